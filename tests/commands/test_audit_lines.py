"""One line for every command, and few for a burst of refusals."""

import asyncio

import pytest

from app.access.roles import Person
from app.commands.lifecycle import ProgressState
from app.errors import Refused
from tests.commands.stand import ANA, IVO, Stand, person


async def test_a_double_click_acts_once_and_leaves_one_line() -> None:
    stand = Stand()
    nonce = stand.gate.nonces.issue(ANA.session)
    results = await asyncio.gather(
        stand.ask(ANA, "forward", id="click", nonce=nonce), stand.ask(ANA, "forward", id="click", nonce=nonce)
    )
    assert {result.state for result in results} == {ProgressState.ACCEPTED}
    await stand.pass_time(0.2)
    assert (await stand.ask(ANA, "forward", id="click", nonce=nonce)).state is ProgressState.ACCEPTED
    assert stand.link.sent() == [("command", 1.0)]
    assert len(stand.commands) == 1


async def test_a_broken_audit_or_subscriber_does_not_keep_the_gate_from_working() -> None:
    stand = Stand()

    def breaks(*anything: object, **more: object) -> None:
        raise RuntimeError("full")

    stand.gate._state.audit_lines._audit = breaks
    stand.gate.subscribe(breaks)
    stand.gate.subscribe_ends(breaks)
    await stand.ask(ANA, "forward")
    await stand.pass_time(0.2)
    assert stand.state() == "confirmed"


@pytest.mark.parametrize("machine", ["m1", "gone"])
async def test_refused_stops_of_a_second_are_one_line_with_their_number(machine: str) -> None:
    stand = Stand()
    nobody = person("vit", "viewer")

    async def stops(count: int) -> None:
        for _ in range(count):
            with pytest.raises(Refused):
                await stand.gate.ask(nobody, machine, "stop")

    await stops(300)
    assert len(stand.commands) <= 2, "one for each reason"
    await stand.pass_time(1.1)
    assert len(stand.commands) <= 4
    assert sum(line.params.get("reason_count", 1) for line in stand.commands) == 300
    await stops(1)
    await stand.pass_time(2.2)
    await stops(7)
    await stand.gate.close()
    assert sum(line.params.get("reason_count", 1) for line in stand.commands) == 308, "none is left out"
    assert len(stand.commands) <= 8


async def test_refusals_of_a_second_are_one_line_with_their_number() -> None:
    stand = Stand()
    stand.gate._admission.rate.take = lambda _person: True  # type: ignore[method-assign]

    async def refused(command: str, who: Person = ANA) -> None:
        with pytest.raises(Refused):
            await stand.gate.ask(who, "m1", command)

    for number in range(50):
        await refused(f"unknown{number}")
    await refused("forward")  # another reason: a line of its own
    await refused("unknown", IVO)  # another person, too
    told = [line.reason for line in stand.commands]
    assert told == [*["why.no_such_command"] * 6, "why.no_token", "why.no_such_command"]
    await stand.pass_time(1.1)
    assert len(stand.commands) == 9
    assert stand.commands[-1].params["reason_count"] == 44
    await stand.pass_time(3)
    assert len(stand.commands) == 9
    await refused("unknown")
    assert len(stand.commands) == 10


async def test_the_rest_of_a_burst_is_written_when_the_plant_stops() -> None:
    stand = Stand()
    for _ in range(3):
        with pytest.raises(Refused):
            await stand.gate.ask(ANA, "m1", "nothing")
    await stand.gate.close()
    assert [line.params.get("reason_count") for line in stand.commands] == [None, 2]


@pytest.mark.parametrize("pressed", [("a", "a"), ("a", "b", "a"), ("a", "a", "b", "c", "a"), ("a", "b", "b", "a")])
async def test_a_press_that_comes_again_has_one_line_although_it_was_refused(pressed: tuple[str, ...]) -> None:
    stand = Stand()
    for id in pressed:
        with pytest.raises(Refused):
            await stand.gate.ask(ANA, "m1", "nothing", id=id)
    await stand.pass_time(1.1)
    told = [line.params["id"] for line in stand.commands]
    assert len(told) == len(set(told)) and told[0] == "a"
