"""A drive's parameters go home as a file and come back from one, or from another drive: checked, compared, put into the list."""

import csv
import io
import json
import re
from collections.abc import Iterator
from html import unescape

import pytest
from fastapi.testclient import TestClient

from app import bundled
from app.plant.plant_files.languages import LANGUAGES
from app.settings import Settings
from app.sim.sinamics.mailbox import MailboxFault
from app.sim.sinamics.training import REG_MAILBOX
from tests.virtual import house, pass_time
from tests.web.people import Staff

PATH = "/equipment/d1/drive-parameters"
HX = {"HX-Request": "true"}


@pytest.fixture(scope="module")
def people(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    settings = Settings(plant=bundled("plants/sinamics"), data=tmp_path_factory.mktemp("drives") / "data")
    with house(settings) as browser:
        staff = Staff(browser)
        staff.ivana = staff.enter("ivana", "engineer", "operator")  # type: ignore[attr-defined]
        pass_time(3)
        yield staff


@pytest.fixture
def client(people: Staff) -> TestClient:
    """Ivana compares nothing, and nothing was read."""
    client = people.client
    for kind in ("drive_writing", "drive_compare", "drive_parameters"):
        client.app.state.__dict__.pop(kind, None)  # type: ignore[attr-defined]
    people.have(people.ivana)  # type: ignore[attr-defined]
    client.cookies.set("pogon_lang", "en")
    return client


def words(text: str) -> str:
    return re.sub(r"\s+", " ", unescape(re.sub(r"<[^>]+>", " ", text))).replace("\u00a0", " ").replace("\u202f", " ")


def read(people: Staff, search: str = "") -> None:
    people.post(f"{PATH}/read", {"q": search, "group": "", "show": ""}, **HX)
    pass_time(30)


def send(people: Staff, text: str, name: str = "set.csv", piece: int = 9000) -> str:
    parts = [text[at : at + piece] for at in range(0, len(text), piece)] or [""]
    for number, part in enumerate(parts, 1):
        answer = people.post(
            f"{PATH}/compare/file", {"text": part, "name": name, "part": number, "parts": len(parts)}, **HX
        )
        assert answer.status_code == (200 if number == len(parts) else 204), answer.text
    pass_time(30)
    return words(people.client.get(f"{PATH}/compare?show=all").text)


def elements(client: TestClient, show: str = "") -> dict[str, str]:
    page = client.get(f"{PATH}/compare", params={"show": show}).text
    return dict(re.findall(r'data-element="([^"]+)" data-same="(yes|no)"', page))


def test_nothing_goes_home_before_something_was_read(client: TestClient) -> None:
    assert client.get(f"{PATH}/export.csv").status_code == 409
    assert "Nothing was read" in words(client.get(f"{PATH}/compare").text)


@pytest.mark.sweep(8)
def test_what_was_read_goes_home_as_csv_and_json_and_comes_back_without_a_difference(
    people: Staff, client: TestClient
) -> None:
    read(people, "p11")
    answer = client.get(f"{PATH}/export.csv")
    assert answer.headers["content-disposition"] == 'attachment; filename="d1-parameters.csv"'
    rows = list(csv.DictReader(io.StringIO(answer.text.removeprefix("\ufeff")), delimiter=";"))
    assert {"p1120", "p1121"} <= {row["parameter"] for row in rows} and all(row["read_at"] for row in rows)
    as_json = json.loads(client.get(f"{PATH}/export.json").text)
    assert as_json["type"] == "sinamics" and len(as_json["parameters"]) == len(rows)
    for text in (answer.text, json.dumps(as_json)):
        send(people, text)
        found = elements(client, "all")
        assert len(found) == len(rows) and set(found.values()) == {"yes"}, found
        assert not elements(client)


@pytest.mark.parametrize("kind", ["csv", "json"])
def test_what_was_written_since_it_was_read_goes_home_too(people: Staff, client: TestClient, kind: str) -> None:
    read(people, "p112")
    whole = client.get(f"{PATH}/export.{kind}").text
    (drive,) = client.app.state.drive_writing.values()  # type: ignore[attr-defined]
    pass_time(2)
    now = client.app.state.runtime.clock.micros()  # type: ignore[attr-defined]
    drive.written[2, "p1120"] = now
    again = client.get(f"{PATH}/export.{kind}").text
    assert again.count("p1120") == whole.count("p1120") > 0
    assert again.count("\n") == whole.count("\n") and again != whole, "read anew"


def test_a_file_without_what_was_written_does_not_go_home(people: Staff, client: TestClient) -> None:
    read(people, "p112")
    assert client.get(f"{PATH}/export.csv").status_code == 200
    (drive,) = client.app.state.drive_writing.values()  # type: ignore[attr-defined]
    device = client.app.state.runtime.sim.devices["d1"]  # type: ignore[attr-defined]
    device.write(6, REG_MAILBOX, [MailboxFault.NEVER])
    pass_time(2)
    drive.written[2, "p1120"] = client.app.state.runtime.clock.micros()  # type: ignore[attr-defined]
    answer = client.get(f"{PATH}/export.csv")
    assert answer.status_code == 503 and "No answer from the device" in words(answer.text)
    device.write(6, REG_MAILBOX, [0])
    pass_time(30)
    assert "p1120" in client.get(f"{PATH}/export.csv").text


@pytest.mark.sweep(8)
def test_what_differs_goes_into_the_list_and_is_reviewed_there(people: Staff, client: TestClient) -> None:
    said = send(people, "object;parameter;value\n2;p1120;12,5\n2;p1121;5\n2;r0020;7\n2;p0840;r0722.0\n")
    assert "12.5" in said and "only read" in said
    assert elements(client)["2:p1120"] == "no" and "2:p1121" not in elements(client)
    people.post(f"{PATH}/compare/take", {})
    page = people.client.get(PATH).text
    taken = dict(re.findall(r'data-element="([^"]+)".*?name="value" value="([^"]*)"', page, re.S))
    assert taken["2:p1120"] == "12.5" and "2:p1121" not in taken and "2:r0020" not in taken
    review = people.post(f"{PATH}/review", {"key": list(taken), "value": list(taken.values())}, **HX)
    pass_time(3)
    review = words(client.get(f"{PATH}/list").text)
    assert "12.5" in review and "Ramp" in review


@pytest.mark.sweep(8)
def test_a_file_with_mistakes_names_each_and_nothing_of_it_can_be_taken(people: Staff, client: TestClient) -> None:
    said = send(people, "object;parameter;value\n2;p1120;12.5\n2;p9999;1\n2;p1120;9\n2;p1121;1000001\n")
    for part in ("Line 3", "p9999", "Line 4", "2:p1120", "Line 5", "p1121"):
        assert part in said, part
    people.post(f"{PATH}/compare/take", {})
    assert 'name="value"' not in client.get(PATH).text


@pytest.mark.sweep(8)
def test_a_file_comes_in_pieces_and_one_that_is_missing_is_told(people: Staff, client: TestClient) -> None:
    text = "object;parameter;value\n" + "".join(f"2;p1120;{n}\n" for n in range(3))
    said = send(people, text, piece=10)
    assert "Line 3" in said and "Line 4" in said
    answer = people.post(f"{PATH}/compare/file", {"text": "x", "name": "a", "part": 3, "parts": 4}, **HX)
    assert answer.status_code == 409
    for part, parts in ((0, 1), (2, 1), (1, 9999), ("x", 1)):
        answer = people.post(f"{PATH}/compare/file", {"text": "x", "name": "a", "part": part, "parts": parts}, **HX)
        assert answer.status_code == 413


@pytest.mark.sweep(8)
def test_two_drives_are_read_and_stand_beside_each_other(people: Staff, client: TestClient) -> None:
    assert people.post(f"{PATH}/compare/drive", {"other": "nobody"}, **HX).status_code == 422
    answer = people.post(f"{PATH}/compare/drive", {"other": "d2"}, **HX)
    assert "Reading" in words(answer.text)
    pass_time(120)
    both, different, missing = elements(client, "all"), elements(client), elements(client, "missing")
    assert len(both) > 150 and different and len(different) < len(both)
    assert all(same == "no" for same in different.values()) and set(missing) <= set(different)
    assert not missing, "one has a drive object more, and every setting in its own one"
    assert not {"1:p0971", "1:p0977"} & set(both)
    people.post(f"{PATH}/compare/take", {})
    assert 'name="value"' in client.get(PATH).text


@pytest.mark.sweep(8)
@pytest.mark.parametrize("language", LANGUAGES)
def test_the_page_speaks_every_language(people: Staff, client: TestClient, language: str) -> None:
    send(people, "object;parameter;value\n2;p1120;x\n2;p1121;1000001\n")
    client.cookies.set("pogon_lang", language)
    page = words(client.get(f"{PATH}/compare").text)
    assert "dcmp." not in page and "why." not in page and "{" not in page


def test_an_operator_sees_none_of_it(people: Staff, client: TestClient) -> None:
    people.have(people.enter("ivo", "operator"))
    for path in ("compare", "export.csv", "export.json", "compare/rows"):
        assert client.get(f"{PATH}/{path}", follow_redirects=False).status_code in (303, 403), path
    for path in ("compare/file", "compare/drive", "compare/take"):
        assert people.post(f"{PATH}/{path}", {}).status_code == 403, path


@pytest.mark.sweep(20)
def test_no_form_about_the_parameters_of_a_drive_leads_elsewhere(client: TestClient, people: Staff) -> None:
    """Who has no scripts is sent on by an address."""
    read(people, "p1120")
    send(people, "parameter,value\np1120,7\n")
    faults = "/equipment/d1/fault-buffer"
    for form, page in (
        (f"{PATH}/compare/take", PATH),
        (f"{PATH}/read", PATH),
        (f"{PATH}/list", PATH),
        (f"{faults}/read", faults),
    ):
        for next, leads in (
            ("https://evil.test/", "/"),
            ("//evil.test", "/"),
            (f"{PATH}?q=p1", f"{PATH}?q=p1"),
            ("", page),
        ):
            answer = people.post(form, {"next": next})
            assert (answer.status_code, answer.headers["location"]) == (303, leads), form
        pass_time(30)
