"""The page of all parameters behind a drive's mailbox: who sees it, what it shows, how it is read."""

import re
from collections.abc import Iterator
from dataclasses import replace
from html import unescape

import pytest
from fastapi.testclient import TestClient

from app import bundled
from app.plant import types
from app.plant.plant_files.languages import LANGUAGES
from app.settings import Settings
from app.sim.sinamics.mailbox import MailboxFault
from app.sim.sinamics.training import REG_MAILBOX
from app.web.drive_parameters import places
from tests.virtual import house, pass_time
from tests.web.people import Staff

TYPE = types.read_type("sinamics", LANGUAGES)[0].type
PATH = "/equipment/d1/drive-parameters"
PLACES = [(object, one) for one in TYPE.drive_parameters.values() for object in one.objects]


@pytest.fixture(scope="module")
def people(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    settings = Settings(plant=bundled("plants/sinamics"), data=tmp_path_factory.mktemp("drives") / "data")
    with house(settings) as browser:
        staff = Staff(browser)
        staff.enter("ivana", "engineer", "operator")
        pass_time(3)
        yield staff


@pytest.fixture
def client(people: Staff) -> Iterator[TestClient]:
    """Nothing was read yet, and the mailbox is right."""
    people.client.app.state.__dict__.pop("drive_parameters", None)  # type: ignore[attr-defined]
    yield people.client
    people.client.app.state.runtime.sim.devices["d1"].write(6, REG_MAILBOX, [0])  # type: ignore[attr-defined]
    pass_time(3)


def alert(text: str) -> str:
    """What the page says of a reading that failed."""
    found = re.search(r'<p class="row" role="alert">(.*?)</p>', text, re.S)
    return re.sub(r"<[^>]+>", "", found[1]).strip() if found else ""


def drawn(client: TestClient, path: str = PATH, language: str = "en") -> str:
    client.cookies.set("pogon_lang", language)
    answer = client.get(path)
    assert answer.status_code == 200, answer.text[:300]
    return unescape(answer.text)


def rows_of(text: str) -> dict[tuple[str, str], str]:
    found = re.findall(r'<tr data-code="(\w+)" data-object="(\d)">(.*?)</tr>', text, re.S)
    return {(code, object): re.sub(r"<[^>]+>|\s+", " ", row) for code, object, row in found}


def read(client: TestClient, people: Staff, *, seconds: float = 20.0, **form: str) -> str:
    answer = people.post(f"{PATH}/read", form)
    assert answer.status_code in (200, 303), answer.text[:300]
    pass_time(seconds)
    query = "&".join(f"{name}={value}" for name, value in form.items())
    return drawn(client, f"{PATH}?{query}")


@pytest.mark.sweep(8)
@pytest.mark.parametrize("language", LANGUAGES)
def test_it_lists_every_parameter_in_every_language(client: TestClient, language: str) -> None:
    text = drawn(client, PATH, language)
    assert not re.search(
        r"\[(?:[a-z]{2}\]|[a-z_]+(?:\.[a-z0-9_]+)+\])", re.sub(r"<script.*?</script>", "", text, flags=re.S)
    )
    rows = rows_of(text)
    assert set(rows) == {(one.code, str(object)) for object, one in PLACES}
    for _, one in PLACES:
        assert TYPE.texts[language][f"parameter.{one.code}"] in rows[one.code, str(one.objects[0])]


def test_search_and_groups_choose(client: TestClient) -> None:
    assert set(rows_of(drawn(client, f"{PATH}?q=p1120"))) == {("p1120", "2")}
    assert set(rows_of(drawn(client, f"{PATH}?q=945"))) == {("r0945", "1"), ("r0945", "2")}
    ramp = {code for code, one in TYPE.drive_parameters.items() if one.group == "ramp"}
    assert {code for code, _ in rows_of(drawn(client, f"{PATH}?group=ramp"))} == ramp
    assert set(rows_of(drawn(client, f"{PATH}?group=ramp&q=Ramp-UP"))) == {("p1120", "2")}
    page = client.get(PATH).text
    counts = [int(one) for one in re.findall(r'class="cap push num">(\d+)</span>', page)]
    assert counts[0] == sum(counts[1:]) == len(rows_of(drawn(client))), "one number for one thing"
    nothing = drawn(client, f"{PATH}?q=%3Cscript%3E")
    assert not rows_of(nothing) and "No parameter fits" in nothing
    assert client.get("/equipment/nothing/drive-parameters").status_code == 404


@pytest.mark.sweep(8)
def test_all_of_them_are_read_and_shown_with_their_time(client: TestClient, people: Staff) -> None:
    before = rows_of(drawn(client))
    assert all("not read" in row for row in before.values())
    rows = rows_of(read(client, people))
    assert not [key for key, row in rows.items() if "not read" in row]
    assert all(re.search(r"\d\d:\d\d:\d\d", row) for row in rows.values())
    device = client.app.state.runtime.sim.devices["d1"]  # type: ignore[attr-defined]
    assert f"{device.parameter('p1120'):g} s" in rows["p1120", "2"].replace("\u00a0", " ")
    assert "4 700 000" in rows["r0018", "1"].replace("\u202f", " ").replace("\u00a0", " ")
    assert "+56" in rows["r0945", "2"]


@pytest.mark.sweep(8)
def test_a_drive_with_one_object_has_everything_there(client: TestClient, people: Staff) -> None:
    path = PATH.replace("d1", "d2")
    assert people.post(f"{path}/read", {"group": "ramp"}).status_code in (200, 303)
    pass_time(10)
    rows = rows_of(drawn(client, f"{path}?group=ramp"))
    assert {object for _, object in rows} == {"1"} and not [
        row for row in rows.values() if "not read" in row or "0x" in row
    ]
    assert len(rows_of(drawn(client, path))) == len(TYPE.drive_parameters)


@pytest.mark.parametrize(
    ("own", "objects", "there"),
    [
        ((2,), (), [2]),
        ((2,), (1,), [1]),
        ((1, 2), (1,), [1]),
        ((1, 2), (1, 2), [1, 2]),
        ((2,), (1, 3, 4), [3]),
        ((1,), (1, 3), [1]),
    ],
)
def test_places_of_a_parameter(own: tuple[int, ...], objects: tuple[int, ...], there: list[int]) -> None:
    assert places(replace(TYPE.drive_parameters["p1120"], objects=own), objects) == there


@pytest.mark.sweep(8)
def test_while_it_reads_it_says_how_far_it_is_and_can_be_cancelled(client: TestClient, people: Staff) -> None:
    device = client.app.state.runtime.sim.devices["d1"]  # type: ignore[attr-defined]
    device.write(6, REG_MAILBOX, [MailboxFault.LATE])
    pass_time(1)
    text = read(client, people, seconds=6)
    done = re.search(r'<progress max="(\d+)" value="(\d+)"', text)
    assert done and int(done[1]) == len(PLACES) and 0 < int(done[2]) < len(PLACES)
    assert 'hx-trigger="every 500ms"' in text
    text = read(client, people, seconds=1, cancel="1")
    assert "<progress" not in text
    device.write(6, REG_MAILBOX, [0])
    pass_time(3)
    assert "5 s" in rows_of(read(client, people, q="p1120"))["p1120", "2"].replace("\u00a0", " ")


def test_a_page_that_is_open_gets_the_table_alone(client: TestClient, people: Staff) -> None:
    answer = people.post(f"{PATH}/read", {"group": "ramp"}, **{"HX-Request": "true"})
    assert answer.status_code == 200 and answer.text.lstrip().startswith("<div") and 'id="dp"' in answer.text
    pass_time(5)
    answer = client.get(f"{PATH}/rows?group=ramp", headers={"HX-Request": "true"})
    assert answer.status_code == 200 and "not read" not in answer.text and ("p1120", "2") in rows_of(answer.text)


@pytest.mark.sweep(8)
def test_a_drive_that_does_not_answer_is_told(client: TestClient, people: Staff) -> None:
    device = client.app.state.runtime.sim.devices["d1"]  # type: ignore[attr-defined]
    assert "5 s" in rows_of(read(client, people, q="p1121"))["p1121", "2"].replace("\u00a0", " ")
    device.write(6, REG_MAILBOX, [MailboxFault.NEVER])
    pass_time(1)
    text = read(client, people, q="p1121")
    assert alert(text) == "No answer from the device"
    assert "the device does not answer" in rows_of(text)["p1121", "2"]
    device.write(6, REG_MAILBOX, [0])
    pass_time(3)
    text = read(client, people, q="p1121")
    assert not alert(text) and "5 s" in rows_of(text)["p1121", "2"].replace("\u00a0", " ")


def test_only_engineers_get_in_and_only_to_drives_with_a_mailbox(client: TestClient, people: Staff) -> None:
    people.enter("marko", "operator")
    assert client.get(PATH, follow_redirects=False).status_code == 403
    assert people.post(f"{PATH}/read", {}).status_code == 403
    people.enter("ivana2", "engineer", "operator")
    assert client.get(PATH).status_code == 200
