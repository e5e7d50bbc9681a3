"""A set of setpoints at a drive: all new values, all former ones, or a mixed state that is named."""

import asyncio
from collections.abc import Callable

import pytest

from app.commands import sets
from app.commands.lifecycle import Progress, ProgressState
from app.commands.orders import Question
from app.errors import DeviceException, LinkError, NoAnswer, Overtaken, Refused
from tests.commands.set_rig import KEYS, RAMPS, Clamps, former, is_true, stands, values
from tests.commands.stand import ANA, EVA, SETTINGS, VIT, Stand, settle

UP = {"f112": 10.0, "frequency_setpoint": 45.0, "f111": 60.0}
"""F111 50 → 60 goes first, then F113 40 → 45; F112 anywhere."""


async def test_a_set_is_written_in_order_read_back_and_confirmed() -> None:
    stand = Stand()
    done = await stand.set_all(EVA, RAMPS)
    assert (done.state, values(stand)) == (ProgressState.CONFIRMED, RAMPS)
    assert stand.link.sent() == list(RAMPS.items())
    assert stands(done) == dict.fromkeys(RAMPS, "new")
    read = [points for _, points in stand.link.refreshed]
    assert ("f114",) in read and ("f114", "f115", "f209") in read
    assert stand.gate.progress("m1") is done and stand.gate.history("m1")[0] is done


async def test_there_is_one_line_before_the_first_telegram_and_one_with_every_value() -> None:
    stand = Stand()
    await stand.set_all(EVA, RAMPS, reason="new fan")
    assert stand.sent == [("m1.setpoints", 0)]
    (line,) = stand.commands
    assert (line.object, line.old, line.new) == (
        "m1.setpoints",
        "F114 = 5, F115 = 5, F209 = 0",
        "F114 = 6, F115 = 7, F209 = 1",
    )
    assert (line.result, line.params["why"]) == ("confirmed", "new fan")
    assert line.params["change_2"] == '["f115", 5.0, 7.0, 7.0, "new"]'


@pytest.mark.parametrize(
    ("wanted", "order"),
    [
        (UP, ["f111", "f112", "frequency_setpoint"]),
        ({"f111": 20.0, "f112": 0.1, "frequency_setpoint": 10.0}, ["f112", "frequency_setpoint", "f111"]),
        ({"f112": 55.0, "frequency_setpoint": 56.0, "f111": 60.0}, ["f111", "frequency_setpoint", "f112"]),
    ],
)
async def test_limits_hold_with_all_values_and_after_every_step(wanted: dict[str, float], order: list[str]) -> None:
    stand = Stand()
    done = await stand.set_all(EVA, wanted)
    assert (done.state, values(stand, wanted)) == (ProgressState.CONFIRMED, wanted)
    sent = [point for point, _ in stand.link.sent()]
    assert sorted(sent) == sorted(order)
    held = dict(SETTINGS)
    for point, value in stand.link.sent():
        held[point] = value
        assert held["f112"] <= held["frequency_setpoint"] <= held["f111"], sent


REFUSED = [
    ({"f114": 6.0, "f115": 99999.0}, "why.out_of_limits", 422),
    ({"f114": 6.0, "f106": 1.0}, "why.no_option", 422),
    ({"f114": 6.0, "f115": 6.25}, "why.decimals", 422),
    ({"f114": 6.0, "f115": "x"}, "why.not_a_number", 422),
    ({"f114": 6.0, "f115": float("nan")}, "why.out_of_limits", 422),
    ({"f111": 30.0, "f114": 6.0}, "why.out_of_limits", 422),
    ({"f111": 60.0, "f112": 70.0}, "why.out_of_limits", 422),
    ({"f114": 6.0, "nothing": 1.0}, "why.no_such_command", 404),
    ({}, "why.no_such_command", 404),
    ({"command": 1.0}, "why.no_such_command", 404),
]


@pytest.mark.parametrize(("wanted", "why", "status"), REFUSED)
async def test_one_wrong_value_refuses_all_and_nothing_is_sent(
    wanted: dict[str, float | str], why: str, status: int
) -> None:
    stand = Stand()
    with pytest.raises(Refused) as refused:
        await stand.set_all(EVA, wanted)
    assert (refused.value.reason, refused.value.status) == (why, status)
    assert (stand.link.writes, stand.sent) == ([], [])
    assert [line.result for line in stand.commands] == ["refused"]


async def test_a_value_that_can_mean_two_things_is_asked_back() -> None:
    stand = Stand()
    with pytest.raises(Question) as asked:
        await stand.set_all(EVA, {"f114": "1.000", "f115": 6.0}, language="hr")
    assert asked.value.reason == "why.ambiguous" and asked.value.params["argument"] == "f114"
    assert stand.link.writes == []


async def test_a_value_that_others_changed_meanwhile_refuses_all() -> None:
    stand = Stand()
    with pytest.raises(Refused) as refused:
        await stand.set_all(EVA, RAMPS, seen={"f115": 4.0})
    assert refused.value.reason == "why.changed" and stand.link.writes == []


async def test_who_lacks_a_right_the_token_or_the_standstill_writes_nothing() -> None:
    for who, why in ((ANA, "why.role"), (VIT, "why.role")):
        stand = Stand()
        stand.gate.control.take(ANA, "m1")
        with pytest.raises(Refused) as refused:
            await stand.set_all(who, RAMPS)
        assert refused.value.reason == why
    stand = Stand()
    stand.gate.control.take(ANA, "m1")
    with pytest.raises(Refused) as refused:
        await stand.set_all(EVA, RAMPS)
    assert refused.value.reason == "why.held"
    stand = Stand()
    stand.set_drive(status=1, frequency=40.0)
    with pytest.raises(Refused) as refused:
        await stand.set_all(EVA, {"f114": 6.0, "f106": 0.0})
    assert refused.value.reason == "why.condition"
    assert (await stand.set_all(EVA, {"f114": 6.0})).state is ProgressState.CONFIRMED  # ramps may be set while it runs


async def test_what_asks_back_does_so_once_for_the_whole_set() -> None:
    stand = Stand()
    with pytest.raises(Question) as asked:
        await stand.set_all(EVA, RAMPS, confirmed=False)
    assert (asked.value.reason, asked.value.params["level"]) == ("why.confirm", "C2")
    assert stand.link.writes == []


async def test_a_dry_run_judges_and_sends_nothing() -> None:
    stand = Stand(dry_run=True)
    done = await stand.set_all(EVA, RAMPS)
    assert (done.state, stand.link.writes, stand.sent) == (ProgressState.DRY_RUN, [], [])
    assert done.telegrams == tuple(RAMPS.items())


async def test_what_can_be_written_nowhere_is_not_sent() -> None:
    stand = Stand()
    stand.room = False
    with pytest.raises(Refused) as refused:
        await stand.set_all(EVA, RAMPS)
    assert (refused.value.reason, stand.link.writes) == ("why.no_audit", [])


async def test_nothing_but_a_stop_is_taken_beside_a_set_and_it_ends_the_set() -> None:
    stand = Stand()
    stand.link.door.clear()
    asked = stand.begin_set(EVA, RAMPS)
    await stand.pass_time(0.2)
    for attempt in (stand.set(EVA, "f116", 5.0, confirmed=True), stand.ask(EVA, "forward", confirmed=True)):
        with pytest.raises(Refused) as refused:
            await attempt
        assert refused.value.reason == "why.busy"
    with pytest.raises(Refused) as refused:
        await stand.gate.hold.arm(EVA, "m1", "jog_forward", nonce=stand.gate.nonces.issue(EVA.session), confirmed=True)
    assert refused.value.reason == "why.busy"
    stop = await stand.gate.ask(EVA, "m1", "stop")
    assert stop.state is ProgressState.ACCEPTED
    stand.link.door.set()
    done = await stand.finish(asked)
    assert (done.state, done.reason) == (ProgressState.FAILED, sets.RESTORED)
    assert done.params["cause"] in ("why.set_stopped", "why.right_ended")
    assert values(stand) == former()
    is_true(stand, done)
    await stand.pass_time(3)
    assert [line.result for line in stand.commands if line.object == "m1.stop"] == ["confirmed"]
    assert (await stand.set_all(EVA, RAMPS)).state is ProgressState.CONFIRMED


async def test_two_sets_of_one_machine_are_not_mixed() -> None:
    stand = Stand()
    stand.link.door.clear()
    first = stand.begin_set(EVA, RAMPS)
    await settle()
    with pytest.raises(Refused) as refused:
        await stand.set_all(EVA, {"f114": 9.0})
    assert refused.value.reason == "why.busy"
    stand.link.door.set()
    assert (await stand.finish(first)).state is ProgressState.CONFIRMED


async def test_the_same_press_twice_is_one_set() -> None:
    stand = Stand()
    one, two = (stand.begin_set(EVA, RAMPS, id="press-0001") for _ in range(2))
    assert await stand.finish(one) is await stand.finish(two)
    assert len(stand.link.writes) == 3


NO = [DeviceException(4), DeviceException(2), DeviceException(3), Overtaken("a stop")]


@pytest.mark.parametrize("at", range(3))
@pytest.mark.parametrize("error", NO, ids=str)
async def test_a_refused_value_puts_all_former_ones_back(at: int, error: LinkError) -> None:
    stand = Stand()
    stand.link.spoil = lambda equipment, point, value: error if value == RAMPS[KEYS[at]] else None
    done = await stand.set_all(EVA, RAMPS)
    assert (done.state, done.reason, values(stand)) == (ProgressState.FAILED, sets.RESTORED, former())
    is_true(stand, done)
    written = KEYS[:at]
    assert stand.link.sent() == [
        *((key, RAMPS[key]) for key in KEYS[: at + 1]), *((key, SETTINGS[key]) for key in reversed(written)),
    ]  # fmt: skip
    (line,) = stand.commands
    assert line.result == "failed"


@pytest.mark.parametrize("at", range(3))
async def test_a_value_that_reads_back_otherwise_puts_all_former_ones_back(at: int) -> None:
    stand = Stand()
    Clamps(stand, KEYS[at], 3.0)
    done = await stand.set_all(EVA, RAMPS)
    assert (done.state, done.reason, done.params["cause"]) == (ProgressState.FAILED, sets.RESTORED, "why.set_differs")
    assert values(stand) == former()
    is_true(stand, done)


async def test_a_later_value_that_changes_an_earlier_one_is_seen() -> None:
    stand = Stand()
    drive, take = stand.drive(), stand.drives["m1"].take

    def clamped(point: str, value: float) -> None:
        take(point, value)
        if point == "f209" and value == 1.0:
            drive["f114"] = 1.5

    stand.drives["m1"].take = clamped  # type: ignore[method-assign]
    done = await stand.set_all(EVA, RAMPS)
    assert (done.state, values(stand)) == (ProgressState.FAILED, former())
    is_true(stand, done)


async def halfway(stand: Stand, wanted: dict[str, float]) -> "asyncio.Task[Progress]":
    """A set whose first value is written and not read back yet, until `read_on`."""

    def spoil(equipment: str, point: str, value: float) -> None:
        if value == next(iter(wanted.values())):
            stand.link.refresh_error = NoAnswer("not yet")

    stand.link.spoil = spoil
    asked = stand.begin_set(EVA, wanted)
    await stand.pass_time(2, lambda: stand.link.refresh_error)
    assert stand.drive()["f114"] == 6.0
    return asked


def read_on(stand: Stand) -> None:
    stand.link.spoil = lambda equipment, point, value: None
    stand.link.refresh_error = None


async def lose_right(stand: Stand) -> None:
    stand.people[EVA.session] = None


async def lose_token(stand: Stand) -> None:
    stand.gate.control.release(EVA, "m1")


async def start_it(stand: Stand) -> None:
    stand.set_drive(status=1, frequency=40.0)


@pytest.mark.parametrize(
    ("lose", "cause"), [(lose_right, "why.signed_out"), (lose_token, "why.no_token"), (start_it, "why.condition")]
)
async def test_what_a_set_needs_it_needs_until_its_end(lose: Callable[[Stand], object], cause: str) -> None:
    stand = Stand()
    asked = await halfway(stand, {"f114": 6.0, "f106": 0.0})
    await lose(stand)  # type: ignore[misc]
    read_on(stand)
    done = await stand.finish(asked)
    assert (done.state, done.params["cause"]) == (ProgressState.FAILED, cause)
    assert values(stand, ("f114", "f106")) == former(("f114", "f106"))
    is_true(stand, done)


async def test_a_server_that_stops_puts_back_what_it_can() -> None:
    stand = Stand()
    asked = await halfway(stand, RAMPS)
    closing = asyncio.create_task(stand.gate.close())
    await settle()
    read_on(stand)
    done = await stand.finish(asked)
    await closing
    assert (done.state, done.params["cause"]) == (ProgressState.FAILED, "why.shutdown")
    assert values(stand) == former()


async def test_plant_files_read_anew_in_the_middle_put_the_former_values_back() -> None:
    stand = Stand()
    asked = await halfway(stand, RAMPS)
    stand.gate.configure(stand.plant)
    read_on(stand)
    done = await stand.finish(asked)
    assert (done.state, done.params["cause"]) == (ProgressState.FAILED, "why.reloaded")
    assert values(stand) == former()
    stand.gate.control.take(EVA, "m1")
    assert (await stand.set_all(EVA, RAMPS)).state is ProgressState.CONFIRMED


async def test_a_person_who_goes_away_does_not_stop_it() -> None:
    stand = Stand()
    asked = await halfway(stand, RAMPS)
    asked.cancel()
    read_on(stand)
    await stand.pass_time(10, lambda: stand.gate.progress("m1") and stand.gate.progress("m1").over)  # type: ignore[union-attr]
    assert values(stand) == RAMPS and stand.state() == "confirmed"
