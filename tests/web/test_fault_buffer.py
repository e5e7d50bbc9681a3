"""The page of a drive's fault buffer: who reads it, what it shows of faults and alarms, when it is old, why it could not be read."""

import re
import shutil
from collections.abc import Iterator
from html import unescape
from pathlib import Path
from zoneinfo import ZoneInfo

import pytest
from fastapi.testclient import TestClient

from app import bundled
from app.plant import types
from app.plant.plant_files.languages import LANGUAGES
from app.profidrive.fault_buffer import PLACES
from app.profidrive.parameter_access.formats import Format
from app.profidrive.parameter_access.messages import Address, Values
from app.settings import Settings
from app.sim import training
from app.sim.sinamics.mailbox import MailboxFault
from app.sim.sinamics.messages import ALARMS, BLOCKED, FAULTS
from app.sim.sinamics.training import REG_MAILBOX
from app.web import format as fmt
from tests.virtual import house, pass_time
from tests.web.people import Staff

TYPE = types.read_type("sinamics", LANGUAGES)[0].type
PATH = "/equipment/d1/fault-buffer"
ZONE = ZoneInfo("Europe/Zagreb")
CAUSED = [number for number in FAULTS if number != BLOCKED]
"""Each can be caused as such; a blocked motor takes its time."""


@pytest.fixture(scope="module")
def people(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    settings = Settings(plant=bundled("plants/sinamics"), data=tmp_path_factory.mktemp("drives") / "data")
    with house(settings) as browser:
        staff = Staff(browser)
        staff.enter("vera", "viewer")
        pass_time(3)
        yield staff


@pytest.fixture
def client(people: Staff) -> Iterator[TestClient]:
    """Nothing was read yet; no fault, none acknowledged, and the mailbox is right."""
    people.client.app.state.__dict__.pop("fault_buffers", None)  # type: ignore[attr-defined]
    yield people.client
    cause(people.client, 0, REG_MAILBOX)
    cause(people.client, 0)
    change(people, 3981, 1)
    change(people, 952, 0)


def cause(client: TestClient, value: int, register: int = training.REG_MACHINE_FAULT, *, seconds: float = 2) -> None:
    client.app.state.runtime.sim.devices["d1"].write(6, register, [value])  # type: ignore[attr-defined]
    pass_time(seconds)


def change(people: Staff, number: int, value: int) -> None:
    """Write a parameter of the drive, as a desktop tool would."""
    mailbox = people.client.app.state.runtime.links["drives"].parameters("d1")  # type: ignore[attr-defined]
    people.wait(mailbox.change, 2, [(Address(number), Values(Format.UNSIGNED16, (value,)))])
    pass_time(2)


def fragment(client: TestClient, language: str = "en", path: str = f"{PATH}/rows") -> str:
    client.cookies.set("pogon_lang", language)
    answer = client.get(path)
    assert answer.status_code == 200, answer.text[:300]
    return unescape(answer.text).replace("\u00a0", " ")


def read(client: TestClient, people: Staff, seconds: float = 3) -> str:
    answer = people.post(f"{PATH}/read")
    assert answer.status_code in (200, 303), answer.text[:300]
    pass_time(seconds)
    return fragment(client, path=PATH)


def shown(text: str) -> dict[str, list[list[str]]]:
    """Cells by situation."""
    found = {}
    for key, body in re.findall(r'<tbody data-situation="(\w+)">(.*?)</tbody>', text, re.S):
        rows = re.findall(r'<tr data-code="\w+">(.*?)</tr>', body, re.S)
        plain = [re.sub(r'<span class="fb-n">.*?</span>', "", row) for row in rows]
        cells = [re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", row, re.S) for row in plain]
        found[key] = [[re.sub(r"<[^>]+>|\s+", " ", cell).strip() for cell in row] for row in cells]
    return found


def told(text: str, name: str) -> str:
    found = re.search(rf'<p class="row {name}"[^>]*>(.*?)</p>', text, re.S)
    return re.sub(r"<[^>]+>", "", found[1]).strip() if found else ""


def alert(text: str) -> str:
    return told(text, "fb-say")


def old(text: str) -> str:
    return told(text, "fb-say fb-old")


@pytest.mark.sweep(8)
@pytest.mark.parametrize("language", LANGUAGES)
def test_before_it_was_read_it_says_so_and_empty_it_says_that(client: TestClient, people: Staff, language: str) -> None:
    texts = fragment(client, language, PATH)
    assert "<table" not in texts and 'class="empty"' in texts
    read(client, people)
    empty = fragment(client, language, PATH)
    assert shown(empty) == {"s0": [], "alarms": []} and empty.count('<td colspan="5">') == 2
    for text in (texts, empty):
        plain = re.sub(r"<script.*?</script>", "", text, flags=re.S)
        assert not re.search(r"\[(?:[a-z]{2}\]|[a-z_]+(?:\.[a-z0-9_]+)+\])", plain)
    assert not alert(empty) and not old(empty)


def named(row: list[str], code: str) -> None:
    """A row has the words of its number, a value and the time at which it came."""
    texts, key = TYPE.texts["en"], f"message.{int(code[1:])}"
    assert row[0] == code and texts[f"{key}.name"].partition(" – ")[2] in row[1]
    assert texts[f"{key}.cause"] in row[1] and texts[f"{key}.remedy"] in row[1]
    assert row[2] == "0" and re.fullmatch(r"\d\d/\d\d \d\d:\d\d:\d\d", row[3]) and row[4] == "–"


@pytest.mark.sweep(8)
def test_every_known_fault_and_alarm_is_named_with_cause_and_remedy(client: TestClient, people: Staff) -> None:
    for begin in range(0, len(CAUSED), PLACES):
        numbers = CAUSED[begin : begin + PLACES]
        for number in numbers:
            cause(client, number, seconds=0.1)
        cause(client, 0, seconds=0.1)
        for row, number in zip(shown(read(client, people))["s0"], numbers, strict=True):
            named(row, f"F{number:05d}")
        change(people, 3981, 1)
    for number in ALARMS:
        cause(client, number, seconds=0.1)
        (row,) = [row for row in shown(read(client, people))["alarms"] if row[0] == f"A{number:05d}"]
        named(row, row[0])


@pytest.mark.sweep(8)
def test_acknowledged_faults_move_on_and_keep_their_times(client: TestClient, people: Staff) -> None:
    numbers, came, clock = CAUSED[:9], [], client.app.state.runtime.clock  # type: ignore[attr-defined]
    for number in numbers:
        came.append(clock.micros())
        cause(client, number)
        cause(client, 0)
        change(people, 3981, 1)
    rows = shown(read(client, people))
    assert rows["s0"] == [] and list(rows) == ["s0", "alarms", *(f"s{place}" for place in range(1, 8))]
    for place, number, time in zip(range(1, 8), numbers[::-1], came[::-1], strict=False):
        (row,) = rows[f"s{place}"]
        near = [fmt.date_time(time + d * 1_000_000, ZONE, "en", time) for d in (-1, 0, 1)]
        gone = [fmt.date_time(time + d * 1_000_000, ZONE, "en", time) for d in range(3, 8)]
        assert row[0] == f"F{number:05d}" and row[3] in near and row[4] in gone


@pytest.mark.sweep(8)
def test_it_is_read_again_by_itself_only_when_the_drive_tells_something(client: TestClient, people: Staff) -> None:
    cause(client, 7860)
    assert shown(fragment(client)) == {}  # nobody has asked
    cause(client, 0)
    change(people, 3981, 1)
    at = re.search(r"Read at [\d:]+", read(client, people))
    for _ in range(5):
        pass_time(2)
        assert re.search(r"Read at [\d:]+", fragment(client))[0] == at[0]  # type: ignore[index]
    cause(client, 7452)
    first = fragment(client)
    assert "Reading" in first and "has told a change" in old(first) and shown(first)["s0"] == []
    pass_time(3)
    again = fragment(client)
    assert [row[0] for row in shown(again)["s0"]] == ["F07452"] and not old(again)
    cause(client, MailboxFault.NEVER, REG_MAILBOX)
    cause(client, 30005)
    fragment(client)
    pass_time(20)
    failed = client.app.state.fault_buffers["sinamics", "drives", 1].of(0).task  # type: ignore[attr-defined]
    assert "could not be read again" in old(fragment(client))
    pass_time(5)
    fragment(client)
    assert client.app.state.fault_buffers["sinamics", "drives", 1].of(0).task is failed  # type: ignore[attr-defined]  # once, not for ever


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        (MailboxFault.NEVER, "the device does not answer"),
        (MailboxFault.BUSY, "Parameter mailbox: not permitted in the present state of the drive"),
        (MailboxFault.FOREIGN, "wrong answer"),
        (MailboxFault.WRONG_LENGTH, "wrong answer"),
        (MailboxFault.INTERNAL, "Parameter mailbox: internal error"),
    ],
)
def test_a_failed_reading_tells_why_and_keeps_the_old_one_as_old(
    client: TestClient, people: Staff, fault: MailboxFault, reason: str
) -> None:
    cause(client, 7452)
    before = read(client, people)
    cause(client, fault, REG_MAILBOX)
    after = read(client, people, 25)
    assert alert(after) == reason and "could not be read again" in old(after)
    assert shown(after) == shown(before) and re.findall(r"Read at [\d:]+", after) == re.findall(
        r"Read at [\d:]+", before
    )
    cause(client, 0, REG_MAILBOX)
    assert alert(fragment(client, path=PATH)) and not alert(well := read(client, people)) and not old(well)


@pytest.mark.sweep(8)
def test_a_late_mailbox_is_waited_for_and_a_second_press_adds_nothing(client: TestClient, people: Staff) -> None:
    cause(client, 7452)
    cause(client, MailboxFault.LATE, REG_MAILBOX)
    assert "Reading" in read(client, people, 2)
    task = client.app.state.fault_buffers["sinamics", "drives", 1].of(0).task  # type: ignore[attr-defined]
    assert (
        "Reading" in read(client, people, 2)
        and client.app.state.fault_buffers["sinamics", "drives", 1].of(0).task is task
    )  # type: ignore[attr-defined]
    pass_time(40)
    text = fragment(client)
    assert [row[0] for row in shown(text)["s0"]] == ["F07452"] and not alert(text)


@pytest.mark.sweep(8)
def test_who_may_view_may_read_and_nobody_else(client: TestClient, people: Staff) -> None:
    for role in ("viewer", "operator", "engineer", "admin"):
        people.enter(f"one_{role}", role)
        assert client.get(PATH).status_code == 200 and people.post(f"{PATH}/read").status_code in (200, 303)
        pass_time(3)
    assert client.post(f"{PATH}/read").status_code == 403  # not from a page of ours
    assert client.get("/equipment/nothing/fault-buffer").status_code == 404
    people.enter("vera", "viewer")


@pytest.mark.sweep(8)
def test_a_link_that_may_not_write_is_asked_nothing(tmp_path: Path) -> None:
    plant = tmp_path / "plant"
    shutil.copytree(bundled("plants/sinamics"), plant)
    file = plant / "plant.toml"
    file.write_text(file.read_text().replace("writes = true", "writes = false"))
    with house(Settings(plant=plant, data=tmp_path / "data")) as browser:
        staff = Staff(browser)
        staff.enter("vera", "viewer")
        pass_time(3)
        text = read(browser, staff)
        assert alert(text) == "Commands to this link are switched off in the plant file" and shown(text) == {}
        assert browser.app.state.runtime.links["drives"].parameters("d1").waiting == 0  # type: ignore[attr-defined]


@pytest.mark.sweep(8)
def test_every_drive_object_has_a_buffer_of_its_own_which_is_chosen_by_name(client: TestClient, people: Staff) -> None:
    cause(client, 7452)
    assert "Control Unit" not in fragment(client), "the objects are told with the first reading"
    read(client, people)
    first = fragment(client)
    assert 'aria-current="true">Drive object 2</a>' in first and f'href="{PATH}?object=1">Control Unit</a>' in first
    assert "F07452" in first
    chosen = fragment(client, path=f"{PATH}?object=1")
    assert "Not read yet" in chosen or "F07452" not in chosen
    assert people.post(f"{PATH}/read", {"object": "1"}).status_code in (200, 303)
    pass_time(3)
    of_unit = fragment(client, path=f"{PATH}/rows?object=1")
    assert 'aria-current="true">Control Unit</a>' in of_unit and "F07452" not in of_unit and "No fault" in of_unit
    assert 'name="object" value="1"' in of_unit and f"{PATH}/rows?object=1" in of_unit
    assert "F07452" in fragment(client)


@pytest.mark.sweep(8)
def test_the_buffer_of_a_further_axis_is_read_from_it(client: TestClient, people: Staff) -> None:
    """A drive of two axes behind one Control Unit; the second one has another fault."""
    model = client.app.state.runtime.sim.devices["d1"].model  # type: ignore[attr-defined]
    read_one, values = model._read, model.values

    def second(drive_object: int, address: Address) -> object:
        if drive_object != 3:
            return read_one(drive_object, address)
        model.values = lambda code: [30021.0 if code in ("r0945", "r0947") else 0.0, *[0.0] * 63]
        told = read_one(2, address)
        model.values = values
        return told

    model._read, objects = second, list(model.values("p0101"))
    model._ram["p0101"][:3], model._live = (
        [1, 2, 3],
        (lambda live: lambda code: (3,) if code == "r0102" else live(code))(model._live),
    )
    try:
        read(client, people)
        assert ">Drive object 3</a>" in fragment(client)
        people.post(f"{PATH}/read", {"object": "3"})
        pass_time(3)
        assert "F30021" in fragment(client, path=f"{PATH}/rows?object=3") and "F30021" not in fragment(client)
    finally:
        model._ram["p0101"][:] = objects
        del model._read


@pytest.mark.sweep(8)
@pytest.mark.parametrize("object", ["256", "-1", "x", "1.0", "²"])
def test_what_is_no_drive_object_is_refused(client: TestClient, object: str) -> None:
    assert client.get(f"{PATH}?object={object}").status_code == 422


def test_an_object_that_the_drive_does_not_have_is_told_in_its_own_words(client: TestClient, people: Staff) -> None:
    people.post(f"{PATH}/read", {"object": "7"})
    pass_time(3)
    assert (
        "0x19" in fragment(client, path=f"{PATH}/rows?object=7")
        or "drive object" in fragment(client, path=f"{PATH}/rows?object=7").lower()
    )
