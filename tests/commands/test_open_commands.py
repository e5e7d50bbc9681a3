"""A server that is killed under a command tells after its restart, once, that nobody knows what became of it; nothing is sent again."""

import asyncio
import shutil
from pathlib import Path

import pytest

from app.access.audit.line import Record
from app.access.audit.search import Filter
from app.commands.lifecycle import ProgressState
from app.commands.open_commands import SERVER_ENDED, open_commands
from app.errors import LinkError
from app.plant.loader import read_plant
from app.runtime import Runtime
from app.settings import Settings
from tests.commands.test_open_sets import EVA, runtime_of
from tests.demo_plant import DEMO, plant_folder
from tests.virtual import house

ORDERS = [
    ("m2", "forward", None),
    ("m1", "reset", None),
    ("m1", "stop", None),
    ("m1", "frequency_setpoint", "41"),
    ("m1", "f114", "6"),
    ("c1", "stop", None),
    ("c1", "manual_speed", "22"),
    ("cc1", "stop", None),
]

PLANTS = {"m1": ("m1", "m2"), "m2": ("m1", "m2"), "c1": ("c1",), "cc1": ("cc1", "seq1")}
"""What runs beside a machine: its neighbours on the same link."""


async def ask(runtime: Runtime, machine: str, key: str, value: str | None) -> "asyncio.Task[object]":
    gate = runtime.gate
    assert gate is not None
    gate._state.rights = gate._state.checks._rights = gate._state.control._rights = lambda person: person
    gate.control.take(EVA, machine)
    nonce = gate.nonces.issue(EVA.session)
    if value is None:
        return asyncio.create_task(
            gate.ask(EVA, machine, key, nonce=nonce, confirmed=True, proven=True, reason="try", id="the-order")
        )
    return asyncio.create_task(
        gate.set_value(EVA, machine, key, value, nonce=nonce, confirmed=True, proven=True, reason="try", id="the-order")
    )


async def lines(runtime: Runtime) -> list[Record]:
    found = await runtime.access.audit.find(Filter(kind="command"))
    return [line for line in found if line.parameters.get("id") == "the-order"]


def written(runtime: Runtime) -> list[str]:
    """Every telegram that the gate gives to a link from now on."""
    sent: list[str] = []
    for link in runtime.links.values():

        async def refuse(*given: object, **named: object) -> None:
            sent.append(str(given))
            raise LinkError("not in this test")

        link.write = link.order = refuse  # type: ignore[method-assign, assignment]
    return sent


@pytest.mark.sweep(8)
@pytest.mark.parametrize(("machine", "key", "value"), ORDERS)
def test_a_command_that_a_killed_server_left_open_is_told_once_and_not_repeated(
    tmp_path: Path, machine: str, key: str, value: str | None
) -> None:
    left, plant = tmp_path / "left", plant_folder(tmp_path / "plant", *PLANTS[machine])
    with house(Settings(plant=plant, data=tmp_path / "data")) as browser:
        browser.pass_time(5)
        runtime = runtime_of(browser)
        task = browser.run(ask(runtime, machine, key, value))
        for _ in range(400):
            if browser.run(lines(runtime)) or task.done():
                break
            browser.pass_time(0.001)
        (line,) = browser.run(lines(runtime))
        assert line.kind == "command.sent"
        shutil.copytree(tmp_path / "data", left, ignore=shutil.ignore_patterns("server.socket", "*.lock"))
        browser.pass_time(8)
    with house(Settings(plant=plant, data=left)) as browser:
        runtime = runtime_of(browser)
        sent = written(runtime)
        browser.pass_time(6)
        gate = runtime.gate
        assert gate is not None and sent == []
        told = gate.progress(machine)
        assert told is not None
        assert (told.id, told.state, told.reason, told.over) == ("the-order", ProgressState.UNKNOWN, SERVER_ENDED, True)
        assert told.label != key
        assert [one.id for one in gate.history(machine)] == ["the-order"]
        alarm = "stop_unconfirmed" if key == "stop" else "command_unconfirmed"
        assert f"{alarm}" in {one.key for one in runtime.alarms.list.active() if one.equipment == machine}
        end, begin = browser.run(lines(runtime))
        assert (end.kind, end.result, end.reason) == ("command", "unknown", SERVER_ENDED)
        assert (end.object, end.new, end.parameters["by"]) == (begin.object, begin.new, "eva")
    with house(Settings(plant=plant, data=left)) as browser:
        browser.pass_time(5)
        runtime = runtime_of(browser)
        assert runtime.gate is not None
        assert len(browser.run(lines(runtime))) == 2 and runtime.gate.progress(machine) is None, "told once"


def line(
    seq: int, kind: str, id: str, object: str = "m1.stop", params: str = "", result: str = "sent", time: int = 7
) -> Record:
    params = params or f'{{"id": "{id}", "requested": "17"}}'
    return Record(time, kind, 1, "eva", "", "", object, "40", "45", result, "", params, seq)


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("told", "expected"),
    [
        ([], []),
        ([line(1, "command.sent", "a")], ["a"]),
        ([line(2, "command", "a", result="confirmed"), line(1, "command.sent", "a")], []),
        ([line(2, "command", "a", result="unknown"), line(1, "command.sent", "a")], []),
        ([line(2, "command.sent", "a"), line(1, "command", "a", result="confirmed")], []),
        ([line(3, "command.sent", "b"), line(2, "command", "a"), line(1, "command.sent", "a")], ["b"]),
        ([line(3, "command.sent", "b"), line(1, "command.sent", "a")], ["a", "b"]),
        ([line(3, "command.sent", "a"), line(1, "command.sent", "a")], ["a"]),
        ([line(1, "command.sent", "a", "gone.stop")], ["a"]),
        ([line(1, "command.sent", "a", "m1.gone")], ["a"]),
        ([line(1, "command.sent", "a", "m1.f114")], ["a"]),
        ([line(1, "command.sent", "a", "rubbish")], ["a"]),
        ([line(1, "command.sent", "a", "gone.setpoints")], ["a"]),
        ([line(1, "command.sent", "followed", "m1.setpoints")], []),
        ([line(1, "command.sent", "")], []),
        ([line(1, "command.sent", "a", params='{"id": "a", "requested": "yesterday"}')], ["a"]),
        ([line(1, "command.sent", "a", params="[]")], []),
        ([line(1, "command.sent", "a", params="{")], []),
        ([line(2, "command", "b", result="refused"), line(1, "command.sent", "a")], ["a"]),
    ],
)
def test_open_is_what_was_sent_and_has_no_end(told: list[Record], expected: list[str]) -> None:
    plant, _ = read_plant(DEMO)
    assert plant is not None
    found = open_commands(told, plant.equipment, 99, {"followed"})
    assert [one.progress.id for one in found] == expected
    for one in found:
        assert one.progress.over and one.progress.state is ProgressState.UNKNOWN and one.progress.requested in (7, 17)
        assert one.stop is (f"{one.progress.equipment}.{one.progress.command}" == "m1.stop")
        assert (one.old, one.new) == ("40", "45")
