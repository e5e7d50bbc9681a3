"""The gate: who may, what is possible, what happened. Every machine here is fake; test_gate_e800.py has the virtual drive."""

from collections import Counter
from dataclasses import replace
from datetime import UTC, datetime
from itertools import pairwise

import pytest

from app.clock import to_datetime
from app.commands.command_state import machines_of
from app.commands.gate import LOOK, TICK, Question
from app.commands.lifecycle import ProgressState
from app.errors import NoAnswer, Refused
from app.tags.batch import Batch
from app.tags.quality import GOOD
from tests.commands.stand import ANA, EVA, VIT, Stand, person, refusal

COMMANDS = ("forward", "reverse", "stop", "coast", "reset", "set_frequency")
FAULTS = tuple(range(4, 27))


# the life of a command


# who may


@pytest.mark.sweep(8)
@pytest.mark.parametrize("status", [0, 1, 2, *FAULTS])
async def test_every_command_in_every_state_for_every_person(status: int) -> None:
    """The sweep: what must never be written is not, whoever asks; what is refused names a reason that why_not named before."""
    roles = {"viewer": VIT, "operator": ANA, "engineer": person("eng", "engineer"), "admin": person("adm", "admin")}
    for role, who in roles.items():
        for command in COMMANDS:
            stand = Stand()
            stand.set_drive(status=status, frequency=30.0 if status in (1, 2) else 0.0, bus_voltage=310)
            if role in ("operator", "engineer"):
                stand.gate.control.take(who, "m1")
            why = [reason.key for reason in stand.gate.why_not(who, "m1", command)]
            argument = 41.0 if command == "set_frequency" else None
            try:
                await stand.gate.ask(
                    who, "m1", command, argument=argument, nonce=stand.gate.nonces.issue(who.session), confirmed=True
                )
                outcome = "sent"
            except Refused as refused:
                outcome = refused.reason
            if role in ("viewer", "admin"):
                assert outcome == "why.role", (role, command)
            elif role == "engineer" and command != "stop":
                assert outcome == "sent" or outcome in why
            moves = command in ("forward", "reverse")
            allowed = role in ("operator", "engineer") and not (moves and status >= 4)
            assert (outcome == "sent") is allowed, (role, command, status, outcome)
            assert bool(stand.link.writes) is allowed
            assert (not why) is allowed
            assert len(stand.commands) == (0 if allowed else 1)


# late, twice, too often


# what is possible


# confirmation


# values


async def test_a_setpoint_is_parsed_checked_written_and_read_back() -> None:
    stand = Stand()
    progress = await stand.ask(ANA, "set_frequency", argument="41,25", language="hr", expected=40.0)
    assert (progress.state, progress.argument, progress.old) == (ProgressState.ACCEPTED, 41.25, 40.0)
    await stand.pass_time(0.3)
    assert stand.state() == "confirmed"
    line = stand.commands[0]
    assert (line.old, line.new, line.result) == (40.0, 41.25, "confirmed")


async def test_a_parameter_asks_shows_its_warning_and_is_read_back() -> None:
    stand = Stand()
    with pytest.raises(Question) as question:
        await stand.set(EVA, "f905", "2,5", language="cs")
    assert question.value.params["warning"] == "warning.watchdog"
    await stand.set(EVA, "f905", 2.5, confirmed=True)
    await stand.pass_time(0.2)
    assert stand.state() == "confirmed"
    assert any("f905" in points for _, points in stand.link.refreshed)


# stop


async def test_stop_is_repeated_until_it_is_read_back() -> None:
    stand = Stand()
    stand.set_drive(status=1, frequency=40.0)
    stand.drives["m1"].deaf = True
    await stand.ask(ANA, "stop")
    await stand.pass_time(2)
    assert 4 <= len(stand.link.writes) <= 5
    assert all(urgent for *_, urgent in stand.link.writes)
    stand.drives["m1"].deaf = False
    await stand.pass_time(1)
    assert stand.state() == "confirmed"
    count = len(stand.link.writes)
    await stand.pass_time(5)
    assert len(stand.link.writes) == count
    assert stand.alarms == []


async def test_a_stop_that_is_not_read_back_in_ten_seconds_raises_the_alarm_and_ends() -> None:
    stand = Stand()
    stand.set_drive(status=1, frequency=40.0)
    stand.link.spoil = lambda *telegram: NoAnswer("silence")
    assert (await stand.ask(ANA, "stop")).state is ProgressState.REQUESTED
    await stand.pass_time(9.9)
    assert stand.alarms == []
    await stand.pass_time(0.2)
    assert (stand.state(), stand.alarms) == ("unconfirmed", ["m1"])
    count = len(stand.link.writes)
    assert 18 <= count <= 21
    await stand.pass_time(10)
    assert len(stand.link.writes) == count
    assert len(stand.commands) == 1


# what others see


async def test_a_start_over_a_table_of_bad_values_never_writes() -> None:
    """Any one value that a start uses, bad: nothing is written (the capture of the line proves it)."""
    stand = Stand()
    used = stand.gate._state.machines["m1"].commands["forward"].used
    assert {"status", "frequency", "f200", "f203", "frequency_setpoint", "f111", "f112", "f114"} <= set(used)
    for key in used:
        stand = Stand()
        stand.tags.publish(Batch("link.hall", 99, 1, 1, [stand.tags.handle(f"m1.{key}")], [None], GOOD | 2))
        assert (await refusal(stand, ANA, "forward")).reason == "why.bad_value"
        assert stand.link.writes == []


@pytest.mark.parametrize(("number", "most"), [(6, 6), (40, 10)])
def test_each_machine_is_looked_at_every_two_tenths_of_a_second_and_many_never_all_at_once(
    number: int, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand = Stand()
    machines = machines_of(stand.plant)
    stand.gate.take({f"m{n}": replace(machines["m1"]) for n in range(number)}, stand.plant.timezone)
    looked = list[tuple[int, float]]()
    monkeypatch.setattr(
        stand.gate._state.readings,
        "watch",
        lambda machine, *, paused: looked.append((id(machine), stand.clock.monotonic())),
    )
    for _ in range(40):
        stand.clock.advance(TICK)
        stand.gate.tick()
    assert max(Counter(at for _, at in looked).values()) == most
    times = {one: [at for each, at in looked if each == one] for one, _ in looked}
    assert len(times) == number
    for each in times.values():
        assert all(round(b - a, 3) in (LOOK, LOOK + TICK) for a, b in pairwise(each))


async def test_at_midnight_of_the_plant_every_machine_is_told_of_so_that_what_was_yesterday_says_its_day() -> None:
    """In the zone of the plant, where it is an hour later than UTC; before midnight and after it nothing is told by itself."""
    stand, told = Stand(), list[str]()
    assert stand.plant.timezone == "Europe/Zagreb"
    stand.gate.subscribe(told.append)
    stand.clock.advance(
        (datetime(2026, 3, 9, 22, 59, 50, tzinfo=UTC) - to_datetime(stand.clock.micros())).total_seconds()
    )
    for _ in range(8):  # what became stale is told of
        stand.clock.advance(0.5)
        stand.gate.tick()
    for seconds, expected in ((5, []), (2, sorted(stand.plant.equipment)), (2, []), (3600, [])):
        told.clear()
        stand.clock.advance(seconds)
        stand.gate.tick()
        assert sorted(told) == expected, f"{seconds} s later"
