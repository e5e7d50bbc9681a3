"""Every parameter of a drive by its code, also one of which nothing is known: found, read, compared, written all or none."""

import re
from collections.abc import Iterator
from html import unescape

import pytest
from fastapi.testclient import TestClient

from app.access.audit.search import Filter
from app.plant.plant_files.languages import LANGUAGES
from app.settings import Settings
from app.sim.eura_e800.drive import VirtualE800
from app.sim.eura_e800.parameters import PARAMETERS
from tests.virtual import house, pass_time
from tests.web.people import PASSWORD, Staff

PATH = "/equipment/m2/drive-parameters"
HX = {"HX-Request": "true"}
PLANT = """[plant]
name = "Drives"
timezone = "Europe/Zagreb"
languages = ["hr", "en", "de", "cs"]

[links.hall]
transport = "memory"
writes = true

[equipment.m2]
type = "eura_e800"
link = "hall"
unit = 2
label = "Fan 2"
rated_current = 2.5

[equipment.m3]
type = "eura_e800"
link = "hall"
unit = 3
label = "Fan 3"
rated_current = 2.5
simulation = { F114 = 9.0, F131 = 2054.0, F900 = 3.0 }
"""


@pytest.fixture(scope="module")
def people(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    folder = tmp_path_factory.mktemp("codes")
    (folder / "plant").mkdir()
    (folder / "plant" / "plant.toml").write_text(PLANT, "utf-8")
    settings = Settings(plant=folder / "plant", data=folder / "data")
    with house(settings) as browser:
        staff = Staff(browser)
        staff.ivana = staff.enter("ivana", "engineer", "operator")  # type: ignore[attr-defined]
        pass_time(3)
        yield staff


@pytest.fixture
def client(people: Staff) -> Iterator[TestClient]:
    """Ivana is in control of m2, which stands as it was commissioned; nothing was read."""
    client = people.client
    for name in ("drive_writing", "drive_parameters", "drive_compare"):
        client.app.state.__dict__.pop(name, None)  # type: ignore[attr-defined]
    people.have(people.ivana)  # type: ignore[attr-defined]
    client.cookies.set("pogon_lang", "en")
    people.post("/equipment/m2/token/take", {}, **HX)
    drive(client)._start = ""
    drive(client)._to_initial_state()
    pass_time(2)
    yield client
    people.have(people.ivana)  # type: ignore[attr-defined]
    people.post("/equipment/m2/token/release", {}, **HX)
    pass_time(2)


def drive(client: TestClient) -> VirtualE800:
    found = client.app.state.runtime.sim.devices["m2"]  # type: ignore[attr-defined]
    assert isinstance(found, VirtualE800)
    return found


def words(text: str) -> str:
    return re.sub(r"\s+", " ", unescape(re.sub(r"<[^>]+>", " ", text))).replace("\u00a0", " ").replace("\u202f", " ")


def drawn(client: TestClient, **query: str) -> str:
    answer = client.get(PATH, params=query)
    assert answer.status_code == 200, answer.text[:300]
    return str(answer.text)


def rows_of(text: str) -> dict[str, str]:
    return {code: words(row) for code, row in re.findall(r'<tr data-code="(\w+)"[^>]*>(.*?)</tr>', text, re.S)}


def read(people: Staff, *, seconds: float = 10.0, **form: str) -> dict[str, str]:
    answer = people.post(f"{PATH}/read", form, **HX)
    assert answer.status_code == 200, answer.text[:300]
    pass_time(seconds)
    return rows_of(drawn(people.client, **form))


def post(people: Staff, action: str, **form: object) -> str:
    answer = people.post(f"{PATH}/{action}", form, **HX)
    assert answer.status_code == 200, words(answer.text)[:300]
    return str(answer.text)


def review(people: Staff, **values: str) -> str:
    """Fill the list and have it reviewed."""
    post(people, "list", clear="1")
    for code in values:
        post(people, "list", add=f"0:{code}")
    post(people, "review", key=[f"0:{code}" for code in values], value=list(values.values()))
    pass_time(3)
    return str(people.client.get(f"{PATH}/list").text)


def write(people: Staff, seconds: float = 8, **values: str) -> str:
    review(people, **values)
    nonce = people.client.get("/nonce").json()["nonce"]
    post(people, "write", id=nonce, nonce=nonce, reason="trial", password=PASSWORD)
    pass_time(seconds)
    return str(people.client.get(f"{PATH}/list").text)


def lines(text: str, kind: str = "element") -> dict[str, str]:
    found = re.findall(rf'<li class="rv[^"]*" data-{kind}="0:(\w+)"(.*?)</li>', text, re.S)
    return {key: words(row) for key, row in found}


def held(client: TestClient, *codes: str) -> list[float]:
    return [drive(client).parameter(code) for code in codes]


def test_the_page_shows_what_is_known_without_drive_objects(client: TestClient) -> None:
    text = drawn(client)
    rows = rows_of(text)
    assert set(rows) <= set(PARAMETERS) and {"F113", "F431", "F905"} <= set(rows)
    assert "0.1 … 3 000" in rows["F114"] and "F112 … F111" in rows["F113"] and "not read" in rows["F113"]
    assert ">DO<" not in text


@pytest.mark.sweep(8)
def test_a_number_of_which_nothing_is_known_is_found_read_and_told_as_that(client: TestClient, people: Staff) -> None:
    assert list(rows_of(drawn(client, q="F124"))) == ["F124"]
    assert "Nothing known from the sources" in rows_of(drawn(client, q="f124"))["F124"]
    assert "500" in read(people, q="F124")["F124"], "raw: nobody says that it is 5 Hz"
    assert "02 illegal data address" in read(people, q="F300")["F300"]
    assert rows_of(drawn(client, q="F1000")) == {} == rows_of(drawn(client, q="FB00"))


@pytest.mark.sweep(8)
def test_groups_and_search(client: TestClient) -> None:
    text = drawn(client)
    groups = re.findall(r'group=(f\w)&[^"]*"[^>]*><span>([^<]*)</span>\s*<span class="cap push num">(\d+)<', text)
    assert [key for key, _, _ in groups] == ["f1", "f2", "f4", "f7", "f8", "f9"]
    assert sum(int(count) for _, _, count in groups) == len(rows_of(text))
    assert set(rows_of(drawn(client, group="f9"))) == {"F900", "F901", "F902", "F903", "F904", "F905"}
    assert "F114" in rows_of(drawn(client, q="acceleration")) and "F200" not in rows_of(drawn(client, q="acceleration"))
    every = rows_of(drawn(client, show="every"))
    assert len(every) == 554 and {"F100", "FA70", "F277", "F650"} <= set(every)
    assert len(rows_of(drawn(client, show="every", group="f3"))) == 31


@pytest.mark.sweep(8)
def test_every_number_is_read_with_progress_while_scans_go_on(client: TestClient, people: Staff) -> None:
    runtime = client.app.state.runtime  # type: ignore[attr-defined]
    people.post(f"{PATH}/read", {"show": "every"}, **HX)
    pass_time(2)
    text = words(client.get(f"{PATH}/rows", params={"show": "every"}).text)
    done = re.search(r"Reading: (\d+) of (\d+)", text)
    assert done is not None and 0 < int(done[1]) < int(done[2]) == 554
    ages = []
    for _ in range(40):
        pass_time(0.25)
        ages.append(runtime.tags.age(runtime.tags.handle("m2.frequency")))
    assert max(ages) < 1.0, ages
    pass_time(60)
    rows = rows_of(drawn(client, show="every"))
    for code, parameter in PARAMETERS.items():
        if code in rows:
            assert "exception" not in rows[code] and "not read" not in rows[code], rows[code]
            assert parameter.address
    missing = [code for code, row in rows.items() if "02 illegal data address" in row]
    assert set(missing) == set(rows) - set(PARAMETERS)


def test_what_is_not_at_its_default_is_shown_alone(client: TestClient, people: Staff) -> None:
    assert rows_of(drawn(client, show="changed")) == {}
    changed = read(people, show="changed")
    own = {code for code, one in PARAMETERS.items() if drive(client).parameter(code) != one.default}
    assert {"F901", "F903"} <= set(changed) <= own, "F801 to F805 have no default"
    assert "Differs from the default" in changed["F901"]


@pytest.mark.sweep(8)
def test_a_set_is_reviewed_written_and_read_back(client: TestClient, people: Staff) -> None:
    rows = lines(review(people, F114="7.5", F131="2054", F124="700"))
    assert "5 7.5 s" in rows["F114"] and "0.1 … 3 000 s" in rows["F114"], rows
    assert "500 700" in rows["F124"] and "Nothing is known of this parameter but its number" in rows["F124"]
    assert "Only at standstill" in rows["F124"] and "Only at standstill" not in rows["F114"]
    text = write(people, F114="7.5", F131="2054", F124="700")
    assert {code: "Written and read back" in row for code, row in lines(text, "result").items()} == {
        "F114": True, "F131": True, "F124": True,
    }, words(text)  # fmt: skip
    assert held(client, "F114", "F131", "F124") == [7.5, 2054, 7.0]
    drive(client).power_cycle()
    assert held(client, "F114", "F131", "F124") == [7.5, 2054, 7.0], "in the permanent memory"
    trail = people.wait(people.access.audit.find, Filter(object="m2.drive_parameters"))
    assert [(line.kind, line.result) for line in reversed(trail)][-2:] == [
        ("command.sent", "sent"),
        ("command", "confirmed"),
    ]
    assert trail[0].new == "F114 = 7.5, F131 = 2054, F124 = 700"


@pytest.mark.sweep(8)
def test_a_point_that_is_the_same_value_is_read_again_and_a_doubt_is_told(client: TestClient, people: Staff) -> None:
    pages = ("/equipment/m2", "/equipment/m2/parameters")
    doubt = "Drive: motor current F803 = 3.2 A; plant file: 2.5 A"
    assert not any(doubt in words(client.get(page).text) for page in pages)
    write(people, F803="3.2")
    runtime = client.app.state.runtime  # type: ignore[attr-defined]
    assert runtime.tags.sample("m2.f803").value == 3.2
    assert all(doubt in words(client.get(page).text) for page in pages)
    write(people, F803="2.5")
    assert not any(doubt in words(client.get(page).text) for page in pages)


@pytest.mark.sweep(8)
def test_limits_that_depend_on_each_other_are_kept_in_any_order(client: TestClient, people: Staff) -> None:
    text = write(people, F113="70", F111="80")
    assert held(client, "F111", "F113") == [80.0, 70.0], words(text)
    text = write(people, F111="60")
    assert held(client, "F111", "F113") == [80.0, 70.0]
    assert "do not fit" in words(text) or "alert" in text, words(text)


def test_what_the_drive_refuses_puts_back_what_was_written(client: TestClient, people: Staff) -> None:
    text = write(people, F114="9", F115="9", F124="60000")
    rows = lines(text, "result")
    assert held(client, "F114", "F115", "F124") == [5.0, 5.0, 5.0]
    assert "03 illegal data value" in rows["F124"], words(text)
    assert "former" in words(text)


def test_an_unlocked_memory_is_made_permanent_first(client: TestClient, people: Staff) -> None:
    drive(client).write(6, 0x2001, [4])
    pass_time(1)
    write(people, F114="8")
    drive(client).power_cycle()
    assert held(client, "F114") == [8.0]


@pytest.mark.sweep(8)
def test_nothing_unknown_is_written_while_the_motor_turns(client: TestClient, people: Staff) -> None:
    drive(client).write(6, 0x2000, [1])
    pass_time(3)
    text = write(people, F124="600")
    assert held(client, "F124") == [5.0] and "standstill" in words(text).casefold(), words(text)
    write(people, F114="6")
    assert held(client, "F114") == [6.0], "a ramp may be changed while it runs"


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("code", "typed", "says"),
    [
        ("F114", "7.55", "Too many decimal places"),
        ("F114", "3000.1", "Permitted: 0.1 to 3"),
        ("F203", "7", "Not one of the permitted choices"),
        ("F124", "65536", "Permitted: 0 to 65"),
        ("F124", "1.5", "Too many decimal places"),
        ("F114", "fast", "Not a number"),
        ("F300", "1", "02 illegal data address"),
    ],
)
def test_what_cannot_be_written_is_told_in_the_review(
    client: TestClient, people: Staff, code: str, typed: str, says: str
) -> None:
    text = review(people, **{code: typed})
    assert says in lines(text)[code], lines(text)
    assert 'name="password"' not in text


@pytest.mark.sweep(8)
@pytest.mark.parametrize("key", ["0:F000", "0:FB00", "0:f114", "0:p1120", "1:F11", "999:F114", "0:F114[0]"])
def test_what_is_no_code_is_not_put_into_the_list(client: TestClient, people: Staff, key: str) -> None:
    answer = people.post(f"{PATH}/list", {"add": key}, **HX)
    assert answer.status_code == 422


@pytest.mark.sweep(8)
@pytest.mark.parametrize("language", LANGUAGES)
def test_every_language_says_all_of_it(client: TestClient, language: str) -> None:
    client.cookies.set("pogon_lang", language)
    for show in ("", "changed", "every"):
        assert "parameter.group" not in drawn(client, show=show) and "dpar." not in drawn(client, show=show)


# ---- to the second drive, home and back


def different(client: TestClient, show: str = "") -> set[str]:
    page = client.get(f"{PATH}/compare", params={"show": show}).text
    return set(re.findall(r'data-element="0:(\w+)"', page))


def taken(people: Staff) -> dict[str, str]:
    people.post(f"{PATH}/compare/take", {})
    page = people.client.get(PATH).text
    return dict(re.findall(r'data-element="0:(\w+)".*?name="value" value="([^"]*)"', page, re.S))


def send(people: Staff, text: str) -> None:
    people.client.app.state.__dict__.pop("drive_compare", None)  # type: ignore[attr-defined]
    form = {"text": text, "name": "set.csv", "part": 1, "parts": 1}
    assert people.post(f"{PATH}/compare/file", form, **HX).status_code == 200
    pass_time(5)


@pytest.mark.sweep(8)
def test_the_second_drive_gets_what_the_first_one_has_but_not_its_address(client: TestClient, people: Staff) -> None:
    people.post(f"{PATH}/compare/drive", {"other": "m3"}, **HX)
    pass_time(8)
    assert different(client) == {"F114", "F131", "F900"}
    assert "each drive's own" in words(client.get(f"{PATH}/compare").text)
    values = taken(people)
    assert values == {"F114": "9", "F131": "2054"}
    text = write(people, **values)
    assert held(client, "F114", "F131", "F900") == [9.0, 2054.0, 1.0], words(text)


@pytest.mark.sweep(8)
def test_a_set_goes_home_and_puts_a_changed_drive_right(client: TestClient, people: Staff) -> None:
    read(people)
    read(people, q="F124")
    home = client.get(f"{PATH}/export.csv").text
    assert "F124;;500;;" in home and "F114;;5;s;" in home
    write(people, F114="8", F124="700")
    send(people, home)
    assert different(client) == {"F114", "F124"} and "F905" in different(client, "all")
    assert taken(people) == {"F114": "5", "F124": "500"}
    write(people, F114="5", F124="500")
    assert held(client, "F114", "F124") == [5.0, 5.0]


def test_a_file_with_a_wrong_line_is_not_taken(client: TestClient, people: Staff) -> None:
    send(people, "object;parameter;value\n0;F114;7\n0;F0114;1\n0;F203;7\n")
    said = words(client.get(f"{PATH}/compare").text)
    assert "Line 3: No such parameter: F0114" in said and "Line 4" in said
    assert taken(people) == {}
