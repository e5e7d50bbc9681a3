"""A server that is killed at any telegram of a parameter download tells after its restart what the drive holds, and writes nothing."""

import asyncio
import shutil
from dataclasses import dataclass
from pathlib import Path

import pytest

from app import bundled
from app.access.audit.line import Record
from app.access.audit.search import Filter
from app.access.roles import Person, permissions_of
from app.commands.lifecycle import ProgressState
from app.commands.open_parameters import OBJECT, open_parameters
from app.commands.parameter_change import ParameterChange
from app.commands.set_follow_up import FOUND_MIXED, FOUND_NEW, FOUND_OLD, UNREAD
from app.plant.definitions import Plant
from app.plant.loader import read_plant
from app.runtime import Runtime
from app.settings import Settings
from app.sim.sinamics.drive import VirtualSinamics
from tests.virtual import VirtualClient, house

ROLES = frozenset({"engineer", "operator"})
EVA = Person(7, "eva", "Eva", ROLES, permissions_of(ROLES), "session-eva")
CODES = ("p1120", "p1121", "p1082")
FORMER, WANTED = (5.0, 6.0, 1500.0), (7.5, 8.0, 1400.0)
MAILBOX_AT = 0x0258


def plant_of(folder: Path, values: tuple[float, ...]) -> Path:
    """One drive that stands still; what it holds of `CODES` when it is switched on."""
    shutil.copytree(bundled("plants/sinamics"), folder)
    text = (folder / "plant.toml").read_text("utf-8")
    begin = "simulation = { setpoint = 60, process_words = 2 }"
    assert begin in text
    held = ", ".join(f"{code} = {value}" for code, value in zip(CODES, values, strict=True))
    (folder / "plant.toml").write_text(text.replace(begin, f"simulation = {{ p2040 = 0, {held} }}"), "utf-8")
    return folder


def runtime_of(browser: VirtualClient) -> Runtime:
    runtime: Runtime = browser.app.state.runtime  # type: ignore[attr-defined]
    return runtime


def drive_of(runtime: Runtime) -> VirtualSinamics:
    assert runtime.sim is not None
    found = runtime.sim.devices["d2"]
    assert isinstance(found, VirtualSinamics)
    return found


async def begin_download(runtime: Runtime) -> "asyncio.Task[object]":
    gate = runtime.gate
    assert gate is not None
    gate._state.rights = gate._state.checks._rights = gate._state.control._rights = lambda person: person
    gate.control.take(EVA, "d2")
    known = gate._state.machines["d2"].item.type.drive_parameters
    changes = [ParameterChange(2, known[code], new) for code, new in zip(CODES, WANTED, strict=True)]
    nonce = gate.nonces.issue(EVA.session)
    return asyncio.create_task(
        gate.parameters.change(EVA, "d2", changes, nonce=nonce, confirmed=True, proven=True, reason="trial")
    )


@dataclass(frozen=True)
class Kill:
    """What a killed server leaves."""

    data: Path
    held: tuple[float, ...]
    """By the drive."""


def held(drive: VirtualSinamics) -> tuple[float, ...]:
    return tuple(drive.model.values(code)[0] for code in CODES)


@pytest.fixture(scope="module")
def kills(tmp_path_factory: pytest.TempPathFactory) -> list[Kill]:
    """Killed at each telegram that the mailbox hears while three values are written, and 50 ms after it."""
    folder, found = tmp_path_factory.mktemp("killed"), list[Kill]()

    def kill() -> None:
        left = folder / f"left{len(found)}"
        shutil.copytree(folder / "data", left, ignore=shutil.ignore_patterns("server.socket", "*.lock"))
        found.append(Kill(left, held(drive)))

    with house(Settings(plant=plant_of(folder / "plant", FORMER), data=folder / "data")) as browser:
        browser.pass_time(5)
        runtime = runtime_of(browser)
        drive = drive_of(runtime)
        write = drive.write

        def heard(function: int, address: int, words: list[int]) -> None:
            if address == MAILBOX_AT:
                kill()
                asyncio.get_running_loop().call_later(0.05, kill)
            write(function, address, words)

        drive.write = heard  # type: ignore[method-assign, assignment]
        task = browser.run(begin_download(runtime))
        browser.pass_time(5)
        assert task.done() and held(drive) == WANTED
        kill()
    assert len(found) >= 7
    return found


async def found_in(runtime: Runtime) -> list[Record]:
    return await runtime.access.audit.find(Filter(object=OBJECT, kind="command"))


def alarmed(runtime: Runtime) -> bool:
    return any(one.id == "sys.set_mixed.d2" and one.life.active for one in runtime.alarms.list.active())


@pytest.mark.sweep(8)
def test_at_every_telegram_the_drive_is_read_again_and_what_it_holds_is_told(tmp_path: Path, kills: list[Kill]) -> None:
    followed = set()
    for number, killed in enumerate(kills):
        left = shutil.copytree(killed.data, tmp_path / f"left{number}")
        with house(Settings(plant=plant_of(tmp_path / f"plant{number}", killed.held), data=left)) as browser:
            runtime = runtime_of(browser)
            assert runtime.gate is not None
            before, told = browser.run(found_in(runtime)), runtime.gate.progress("d2")
            if told is None:  # nothing was sent yet, or all was over
                assert killed.held == (WANTED if before else FORMER), number
                continue
            assert (told.reason, told.person) == (UNREAD, "eva") and alarmed(runtime), number
            browser.pass_time(8)
            told = runtime.gate.progress("d2")
            assert told is not None and [change.found for change in told.changes] == list(killed.held), number
            reason = FOUND_NEW if killed.held == WANTED else FOUND_OLD if killed.held == FORMER else FOUND_MIXED
            assert told.reason == reason and alarmed(runtime) is (reason == FOUND_MIXED), number
            assert held(drive_of(runtime)) == killed.held, "nothing was written"
            followed.add(reason)
    assert {FOUND_NEW, FOUND_OLD} <= followed


@pytest.mark.sweep(8)
@pytest.mark.parametrize("values", [(7.5, 6.0, 1500.0), (5.0, 8.0, 1400.0), (3.0, 6.0, 1500.0)])
def test_a_mixed_state_is_an_alarm_that_names_the_values_and_is_told_once(
    tmp_path: Path, kills: list[Kill], values: tuple[float, ...]
) -> None:
    open_ = next(one for one in kills if (one.data / "pogon.db").exists() and one.held == WANTED)
    left, plant = shutil.copytree(open_.data, tmp_path / "left"), plant_of(tmp_path / "plant", values)
    with house(Settings(plant=plant, data=left)) as browser:
        browser.pass_time(8)
        runtime = runtime_of(browser)
        assert runtime.gate is not None
        told = runtime.gate.progress("d2")
        assert told is not None and (told.state, told.reason) == (ProgressState.UNCONFIRMED, FOUND_MIXED)
        assert alarmed(runtime)
        lines = browser.run(found_in(runtime))
        assert [(line.kind, line.reason) for line in lines] == [("command", FOUND_MIXED), ("command.sent", "")]
        assert lines[0].parameters["id"] == lines[1].parameters["id"]
    with house(Settings(plant=plant, data=left)) as browser:
        browser.pass_time(5)
        assert len(browser.run(found_in(runtime_of(browser)))) == 2


@pytest.fixture(scope="module")
def plant() -> Plant:
    found, _ = read_plant(bundled("plants/sinamics"))
    assert found is not None
    return found


def line(
    kind: str, id: str, reason: str = "", object: str = "d2.drive_parameters", change: str = "2:p1120", new: float = 7.5
) -> Record:
    params = f'{{"id": "{id}", "requested": "17", "change_1": "[\\"{change}\\", 5.0, {new}, null, \\"unknown\\"]"}}'
    return Record(0, kind, 1, "eva", "", "", object, "", "", "sent", reason, params, 1)


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ([line("command.sent", "a")], ["a"]),
        ([line("command.sent", "a", change="1:p0757[2]")], ["a"]),
        ([line("command", "a", UNREAD), line("command.sent", "a")], ["a"]),
        ([line("command", "a", FOUND_MIXED), line("command", "a", UNREAD), line("command.sent", "a")], []),
        ([line("command", "a"), line("command.sent", "a")], []),
        ([line("command.sent", "a"), line("command", "a")], []),
        ([line("command.sent", "a", object="gone.drive_parameters")], []),
        ([line("command.sent", "a", object="d2.setpoints")], []),
        ([line("command.sent", "a", change="2:p9999")], []),
        ([line("command.sent", "a", change="F114")], []),
        ([line("command.sent", "")], []),
        ([], []),
    ],
)
def test_open_is_what_has_no_end_and_can_be_made_out(plant: Plant, lines: list[Record], expected: list[str]) -> None:
    found = open_parameters(lines, plant.equipment)
    assert [progress.id for progress, _ in found] == expected
    for progress, changes in found:
        assert [one.new for one in changes] == [7.5] and [change.old for change in progress.changes] == [5.0]


def test_a_drive_whose_parameters_are_registers_is_known_by_the_codes_that_it_has() -> None:
    demo, _ = read_plant(bundled("plants/demo"))
    assert demo is not None
    codes = ("F114", "F999", "p1120")
    lines = [line("command.sent", code, object="m1.drive_parameters", change=f"0:{code}", new=7) for code in codes]
    assert [progress.id for progress, _ in open_parameters(lines, demo.equipment)] == ["F114", "F999"]
