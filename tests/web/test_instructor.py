"""The instructor's page: faults by the training registers, shown when they were read back, and never on a live device."""

import asyncio
import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app import bundled
from app.access.audit.search import Filter
from app.errors import LinkError, NoAnswer, NotConnected, Overtaken
from app.plant.definitions import Training
from app.plant.texts import Texts
from app.sim import training
from app.sim.eura_e800 import training as own
from app.sim.machines import MACHINE_FAULTS
from tests.web.conftest import Start
from tests.web.people import Staff

LANGUAGES = ("hr", "en", "de", "cs")


@pytest.fixture(scope="module")
def people(demo: TestClient) -> Staff:
    return Staff(demo)


@pytest.fixture
def staff(client: TestClient, people: Staff) -> Iterator[Staff]:
    """An engineer at the demo plant; the drives are put right again afterwards."""
    people.enter("ivana", "engineer")
    client.cookies.set("pogon_lang", "en")
    yield people
    for unit in (1, 2):
        people.wait(link_of(client).raw_write, unit, training.REG_RESET, [1])
    people.wait(_pause)  # it acts at the next step, after whatever else is written until then


def link_of(client: TestClient) -> Any:
    return client.app.state.runtime.links["hall"]  # type: ignore[attr-defined]


def register(staff: Staff, unit: int, address: int) -> int:
    words: list[int] = staff.wait(link_of(staff.client).raw_read, unit, address, 1)
    return words[0]


def told(staff: Staff) -> list[Any]:
    """The instructor's lines of the audit, newest first."""
    access = staff.access
    return [line for line in staff.wait(access.audit.find, Filter(), 50) if line.kind.startswith("instructor.")]


def test_a_fault_is_caused_read_back_and_cleared(staff: Staff) -> None:
    answer = staff.post("/instructor/m1/fault", {"code": "13"})
    assert (answer.status_code, answer.headers["location"]) == (303, "/instructor/m1?done=fault")
    assert register(staff, 1, training.REG_MACHINE_FAULT) == 13
    page = staff.client.get("/instructor/m1?done=fault").text
    assert "ESP – external fault" in page and "Read back: Machine fault" in page
    assert "trips at once" in staff.client.get("/instructor/m1/active").text
    assert "ESP – external fault" in staff.client.get("/instructor").text
    assert staff.post("/instructor/m1/fault", {"code": "0"}).status_code == 303
    assert register(staff, 1, training.REG_MACHINE_FAULT) == 0
    assert "No fault injected" in staff.client.get("/instructor/m1/active").text
    last = told(staff)[0]
    assert (last.person, last.object, last.old, last.new, last.result) == (
        "ivana",
        "m1",
        "0xE010 = 13",
        "0xE010 = 0",
        "ok",
    )


@pytest.mark.sweep(8)
@pytest.mark.parametrize("mode", [mode for mode in training.LINE_FAULT_MODES if mode])
def test_every_line_fault_reaches_the_line_and_is_mended(staff: Staff, mode: int) -> None:
    given = {"mode": str(mode), "delay": "700", "argument": "6" if mode == 7 else "0", "count": "0"}
    answer = staff.post("/instructor/m2/line", given)
    assert answer.status_code == 303, told(staff)[0]
    words = staff.wait(link_of(staff.client).raw_read, 2, training.REG_LINE_FAULT, 4)
    assert words == [mode, 700, int(given["argument"]), 0]
    assert "until it is removed" in staff.client.get("/instructor/m2/active").text
    assert staff.post("/instructor/m2/line", {"mode": "0"}).status_code == 303
    assert register(staff, 2, training.REG_LINE_FAULT) == 0


def test_a_line_fault_for_some_requests_runs_down_by_itself(staff: Staff) -> None:
    given = {"mode": "3", "delay": "0", "argument": "0", "count": "3"}
    assert staff.post("/instructor/m1/line", given).status_code == 303
    for _ in range(100):
        if not register(staff, 1, training.REG_LINE_FAULT):
            break
        staff.wait(_pause)
    assert register(staff, 1, training.REG_LINE_FAULT) == 0


async def _pause() -> None:
    await asyncio.sleep(0.1)


def test_the_world_of_a_machine_is_set_and_reset(staff: Staff) -> None:
    before = staff.wait(link_of(staff.client).raw_read, 1, own.REG_LOAD, 5)
    given = {"load": "80", "quadratic": "10", "disturbance": "20", "ambient": "40", "supply": "215"}
    assert staff.post("/instructor/m1/world", given).status_code == 303
    assert staff.wait(link_of(staff.client).raw_read, 1, own.REG_LOAD, 5) == [80, 10, 20, 40, 215]
    page = staff.client.get("/instructor/m1").text
    assert 'name="ambient" type="number" inputmode="numeric" min="0" max="60" value="40"' in page
    assert staff.post("/instructor/m1/reset").status_code == 303
    assert staff.wait(link_of(staff.client).raw_read, 1, own.REG_LOAD, 5) == before


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("path", "data"),
    [
        ("fault", {"code": "3"}),
        ("fault", {"code": "27"}),
        ("fault", {"code": "-1"}),
        ("fault", {"code": "x"}),
        ("line", {"mode": "8"}),
        ("line", {"mode": "2", "delay": "60001"}),
        ("line", {"mode": "7", "argument": "256"}),
        ("world", {"load": "501", "quadratic": "0", "disturbance": "0", "ambient": "20", "supply": "230"}),
        ("world", {"load": "10", "quadratic": "0", "disturbance": "0", "ambient": "20", "supply": "²30"}),
        ("world", {"load": "10"}),
        ("reset", {"all": "1"}),
    ],
)
def test_what_the_device_would_not_take_is_refused_with_words(staff: Staff, path: str, data: dict[str, str]) -> None:
    area = staff.wait(link_of(staff.client).raw_read, 1, training.BASE, 64)
    answer = staff.post(f"/instructor/m1/{path}", data)
    assert answer.status_code == 422
    assert "[instructor" not in answer.text and "class=" in answer.text
    assert staff.wait(link_of(staff.client).raw_read, 1, training.BASE, 64) == area


@pytest.mark.parametrize("sign", ["\x00", "\u202e", "\x1b"])
@pytest.mark.parametrize(
    ("path", "data"),
    [
        ("fault", {"code": "5{sign}1"}),
        ("world", {"load": "1{sign}5", "quadratic": "0", "disturbance": "0", "ambient": "20", "supply": "230"}),
    ],
)
def test_what_was_typed_is_repeated_without_signs_that_nobody_can_read(
    staff: Staff, path: str, data: dict[str, str], sign: str
) -> None:
    answer = staff.post(f"/instructor/m1/{path}", {name: text.format(sign=sign) for name, text in data.items()})
    assert answer.status_code == 422
    assert sign not in answer.text and "not permitted" in answer.text


def test_nothing_is_shown_as_done_that_was_not_read_back(staff: Staff, monkeypatch: pytest.MonkeyPatch) -> None:
    async def lost(unit: int, address: int, words: Any) -> None:
        """A write that nobody acts upon."""

    monkeypatch.setattr("app.running.instruction.READ_BACK", 0.1)
    monkeypatch.setattr(link_of(staff.client), "raw_write", lost)
    answer = staff.post("/instructor/m1/fault", {"code": "4"})
    assert answer.status_code == 409
    assert "Sent, but not read back" in answer.text
    assert "Read back:" not in answer.text
    assert told(staff)[0].result == "refused"


@pytest.mark.sweep(8)
@pytest.mark.parametrize("lang", LANGUAGES)
@pytest.mark.parametrize("error", [Overtaken("unit 1: 0xe010"), NoAnswer("unit 1"), NotConnected("hall")])
def test_what_the_line_says_is_told_in_the_language_of_who_asks_there_and_in_the_audit(
    staff: Staff, monkeypatch: pytest.MonkeyPatch, error: LinkError, lang: str
) -> None:
    async def fails(*_: Any) -> None:
        raise error

    link = link_of(staff.client)
    said = Texts.read().text(lang, f"link.error.{error.kind}")
    staff.client.cookies.set("pogon_lang", lang)
    with monkeypatch.context() as patch:
        patch.setattr(link, "raw_write", fails)
        answer = staff.post("/instructor/m1/fault", {"code": "4"})
    assert answer.status_code == 409 and said in unescape(answer.text) and str(error) not in answer.text
    with monkeypatch.context() as patch:
        patch.setattr(link, "raw_read", fails)
        assert said in unescape(staff.client.get("/instructor/m1").text)
    assert told(staff)[0].parameters["cause"] == f"link.error.{error.kind}"
    staff.enter("boss2", "admin", "engineer")
    staff.client.cookies.set("pogon_lang", lang)
    assert said in unescape(staff.client.get("/audit").text)
    staff.enter("ivana", "engineer")


def test_a_type_that_says_nothing_of_training_spoils_nobodys_page(staff: Staff) -> None:
    """Its line can still be broken."""
    kind = link_of(staff.client).stations[1].equipment[0].type
    said = kind.training
    object.__setattr__(kind, "training", Training())
    try:
        assert staff.client.get("/instructor").status_code == 200
        page = staff.client.get("/instructor/m1")
        assert page.status_code == 200 and "Inject line fault" in page.text
        assert staff.post("/instructor/m1/fault", {"code": "13"}).status_code == 422
        assert staff.post("/instructor/m1/act", {"act": "power"}).status_code == 422
        assert staff.post("/instructor/m1/line", {"mode": "2", "delay": "0"}).status_code == 303
        assert staff.post("/instructor/m1/line", {"mode": "0"}).status_code == 303
    finally:
        object.__setattr__(kind, "training", said)


def test_only_an_engineer_breaks_machines(staff: Staff) -> None:
    for role in ("viewer", "operator", "admin"):
        staff.enter(f"some_{role}", role)
        assert staff.client.get("/instructor").status_code == 403
        assert staff.post("/instructor/m1/fault", {"code": "4"}).status_code == 403
        assert "/instructor" not in staff.client.get("/").text
    staff.have()
    assert staff.client.get("/instructor/m1").status_code == 303
    assert register(staff, 1, training.REG_MACHINE_FAULT) == 0


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("lang", "mean", "counts"), [("en", "10.0\u00a0s", "× 0.1 s"), ("de", "10,0\u00a0s", "× 0,1 s")]
)
def test_what_a_register_counts_in_tenths_is_said_as_the_number(
    staff: Staff, lang: str, mean: str, counts: str
) -> None:
    staff.client.cookies.set("pogon_lang", lang)
    page = staff.client.get("/instructor/c1").text
    assert f">{mean}<" in page and "\u00a0×" not in page
    assert f'<span class="unit">{counts}</span>' in page


@pytest.mark.parametrize("lang", LANGUAGES)
def test_the_page_speaks_every_language(staff: Staff, lang: str) -> None:
    staff.client.cookies.set("pogon_lang", lang)
    for path in ("/instructor", "/instructor/m2"):
        page = staff.client.get(path).text
        assert not re.findall(r"\[(?:instructor|en|hr|de|cs)\b[^\]]*\]", page)
    codes = re.findall(r'name="code" value="(\d+)" required', page)
    assert [int(code) for code in codes] == list(MACHINE_FAULTS["eura_e800"])


def test_a_live_device_is_never_broken_even_where_writes_are_allowed(
    start: Start, tmp_path: Path, free_port: int
) -> None:
    plant = tmp_path / "plant"
    plant.mkdir()
    text = (bundled("plants/demo") / "plant.toml").read_text("utf-8")
    shutil.copytree(bundled("plants/demo"), plant, dirs_exist_ok=True)
    live = f'transport = "tcp"\nhost = "127.0.0.1"\nport = {free_port}\nwrites = true'
    text = re.sub(r'transport = "memory"[^\n]*\nwrites = true[^\n]*', live, text)
    (plant / "plant.toml").write_text(text, "utf-8")
    client = start(plant=plant)
    people = Staff(client)
    people.enter("ivana", "engineer")
    client.cookies.set("pogon_lang", "en")
    sent: list[Any] = []

    async def note(*arguments: Any) -> None:
        sent.append(arguments)

    link_of(client).raw_write = note
    assert "No machine is simulated" in client.get("/instructor").text
    answer = people.post("/instructor/m1/fault", {"code": "4"})
    assert answer.status_code == 409
    assert "m1 is no simulated device" in answer.text
    assert not sent

    async def other_device(unit: int, address: int, count: int, function: int = 3) -> list[int]:
        return [0] * count

    item = link_of(client).stations[1]
    item.marked, item.link = (
        True,
        replace(item.link, believe_simulated=True),
    )  # it was one, and something else has taken its place on the line
    link_of(client).raw_read = other_device
    answer = people.post("/instructor/m1/fault", {"code": "4"})
    assert (answer.status_code, "m1 is no simulated device" in answer.text, sent) == (409, True, [])
    assert told(people)[0].result == "refused"
