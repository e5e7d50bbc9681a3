"""A server that is killed in the middle of a set tells after its restart what stands where, and writes nothing."""

import asyncio
import shutil
from pathlib import Path

import pytest

from app import bundled
from app.access.audit.line import Record
from app.access.audit.search import Filter
from app.access.roles import Person, permissions_of
from app.commands.open_sets import open_sets
from app.commands.set_follow_up import FOUND_MIXED, FOUND_NEW, FOUND_OLD, UNREAD
from app.commands.sets import MIXED, RESTORED
from app.plant.loader import read_plant
from app.runtime import Runtime
from app.settings import Settings
from tests.demo_plant import plant_folder
from tests.virtual import VirtualClient, house

ROLES = frozenset({"engineer", "operator"})
EVA = Person(7, "eva", "Eva", ROLES, permissions_of(ROLES), "session-eva")
FORMER, WANTED = (40.0, 0.0), (45.0, 3.0)
"""F113 and F905 of m1."""


def plant_of(folder: Path, f113: float, f905: float) -> Path:
    """The drives of the demo plant; the first one holds these values when it is switched on."""
    plant_folder(folder, "m1", "m2")
    text = (folder / "plant.toml").read_text("utf-8")
    begin = 'simulation = { start = "forward", F113 = 40.0, F905 = 0.0 }'
    assert begin in text
    (folder / "plant.toml").write_text(
        text.replace(begin, f'simulation = {{ start = "forward", F113 = {f113}, F905 = {f905} }}'), "utf-8"
    )
    return folder


def runtime_of(browser: VirtualClient) -> Runtime:
    runtime: Runtime = browser.app.state.runtime  # type: ignore[attr-defined]
    return runtime


async def begin_set(runtime: Runtime) -> "asyncio.Task[object]":
    gate = runtime.gate
    assert gate is not None
    gate._state.rights = gate._state.checks._rights = gate._state.control._rights = lambda person: person
    gate.control.take(EVA, "m1")
    values = {"frequency_setpoint": WANTED[0], "f905": WANTED[1]}
    nonce = gate.nonces.issue(EVA.session)
    return asyncio.create_task(gate.set_values(EVA, "m1", values, nonce=nonce, confirmed=True))


def killed(tmp_path: Path, moment: float) -> Path:
    """What is on the disk of a server that was killed `moment` [s] after a set was asked; the copy of its data."""
    left = tmp_path / "left"
    with house(Settings(plant=plant_of(tmp_path / "before", *FORMER), data=tmp_path / "data")) as browser:
        browser.pass_time(5)
        runtime = runtime_of(browser)
        browser.run(begin_set(runtime))
        browser.pass_time(moment)
        shutil.copytree(tmp_path / "data", left, ignore=shutil.ignore_patterns("server.socket", "*.lock"))
        browser.pass_time(5)
    return left


@pytest.fixture(scope="module")
def killed_at_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The data of a server that was killed in the middle of a set."""
    return killed(tmp_path_factory.mktemp("killed"), 0.01)


async def found(runtime: Runtime) -> list[Record]:
    return await runtime.access.audit.find(Filter(object="m1.setpoints", kind="command"))


def alarmed(runtime: Runtime) -> bool:
    return any(one.id == "sys.set_mixed.m1" and one.life.active for one in runtime.alarms.list.active())


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("values", "reason"),
    [
        (FORMER, FOUND_OLD),
        (WANTED, FOUND_NEW),
        ((45.0, 0.0), FOUND_MIXED),
        ((40.0, 3.0), FOUND_MIXED),
        ((44.0, 3.0), FOUND_MIXED),
    ],
)
def test_a_set_that_a_killed_server_left_open_is_told_by_what_the_device_holds(
    tmp_path: Path, killed_at_once: Path, values: tuple[float, float], reason: str
) -> None:
    left = shutil.copytree(killed_at_once, tmp_path / "left")
    with house(Settings(plant=plant_of(tmp_path / "after", *values), data=left)) as browser:
        runtime = runtime_of(browser)
        gate = runtime.gate
        assert gate is not None
        told = gate.progress("m1")
        assert told is not None and (told.reason, told.person) == (UNREAD, "eva")
        assert alarmed(runtime)
        browser.pass_time(15)
        assert alarmed(runtime) is (reason == FOUND_MIXED)
        told = gate.progress("m1")
        assert told is not None and told.reason == reason
        assert [change.found for change in told.changes] == list(values)
        lines = browser.run(found(runtime))
        assert [(line.kind, line.reason) for line in lines] == [("command", reason), ("command.sent", "")]
        assert lines[0].parameters["id"] == lines[1].parameters["id"]
        sample = runtime.tags.sample
        assert (sample("m1.frequency_setpoint").value, sample("m1.f905").value) == values, "nothing was written"
    with house(Settings(plant=tmp_path / "after", data=left)) as browser:
        browser.pass_time(5)
        assert len(browser.run(found(runtime_of(browser)))) == 2, "told once"


@pytest.mark.sweep(8)
def test_a_set_that_was_over_is_not_open_after_a_restart(tmp_path: Path) -> None:
    left = killed(tmp_path, 8.0)
    with house(Settings(plant=plant_of(tmp_path / "after", *WANTED), data=left)) as browser:
        browser.pass_time(5)
        gate = runtime_of(browser).gate
        assert gate is not None and gate.progress("m1") is None


def line(seq: int, kind: str, id: str, reason: str = "", object: str = "m1.setpoints", change: str = "") -> Record:
    text = change or '[\\"f114\\", 5.0, 6.0, null, \\"unknown\\"]'
    params = f'{{"id": "{id}", "requested": "17", "change_1": "{text}"}}'
    return Record(0, kind, 1, "eva", "", "", object, "", "", "sent", reason, params, seq)


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ([line(1, "command.sent", "a")], ["a"]),
        ([line(2, "command.sent", "a"), line(1, "command", "a")], []),
        ([line(2, "command", "a"), line(1, "command.sent", "a")], []),
        ([line(2, "command", "a", RESTORED), line(1, "command.sent", "a")], []),
        ([line(2, "command", "a", MIXED), line(1, "command.sent", "a")], []),
        ([line(2, "command", "a", UNREAD), line(1, "command.sent", "a")], ["a"]),
        ([line(3, "command", "a", FOUND_MIXED), line(2, "command", "a", UNREAD), line(1, "command.sent", "a")], []),
        ([line(2, "command.sent", "b"), line(1, "command.sent", "a")], ["b", "a"]),
        ([line(1, "command.sent", "a", object="m1.stop")], []),
        ([line(1, "command.sent", "a", object="gone.setpoints")], []),
        ([line(1, "command.sent", "a", change="nothing")], []),
        ([line(1, "command.sent", "a", change='[\\"gone\\", 1, 2, null, \\"\\"]')], []),
        ([line(1, "command.sent", "")], []),
        ([], []),
    ],
)
def test_open_is_what_has_no_end(lines: list[Record], expected: list[str]) -> None:
    plant, _ = read_plant(bundled("plants/demo"))
    assert plant is not None
    assert [progress.id for progress in open_sets(lines, plant.equipment)] == expected
