"""A set of setpoints at a drive: all new values, all former ones, or a mixed state that is named."""

import asyncio
from collections.abc import Callable

import pytest

from app.commands import set_follow_up, sets
from app.commands.lifecycle import Progress, ProgressState
from app.commands.orders import Question
from app.commands.value_set import Stands
from app.errors import BadAnswer, DeviceException, LinkError, NoAnswer, NotConnected, Overtaken, Refused
from app.plant.definitions import Scan
from tests.commands.stand import ANA, EVA, SETTINGS, VIT, Stand, settle

UP = {"f112": 10.0, "frequency_setpoint": 45.0, "f111": 60.0}
"""F111 50 → 60 goes first, then F113 40 → 45; F112 anywhere."""
RAMPS = {"f114": 6.0, "f115": 7.0, "f209": 1.0}
KEYS = list(RAMPS)


def values(stand: Stand, keys: object = RAMPS) -> dict[str, float]:
    return {key: stand.drive()[key] for key in keys}  # type: ignore[attr-defined]


def former(keys: object = RAMPS) -> dict[str, float]:
    return {key: SETTINGS[key] for key in keys}  # type: ignore[attr-defined]


def stands(progress: Progress) -> dict[str, str]:
    return {change.key: str(change.stands) for change in progress.changes}


def is_true(stand: Stand, progress: Progress) -> None:
    """What is told of each value is what the drive holds; what is not known is told as not known."""
    for change in progress.changes:
        held = stand.drive()[change.key]
        told = {Stands.NEW: change.new, Stands.OLD: change.old, Stands.OTHER: change.found}
        assert change.stands is Stands.UNKNOWN or held == told[change.stands], (change, held)
    expected = {ProgressState.CONFIRMED: {Stands.NEW}, ProgressState.FAILED: {Stands.OLD}}.get(progress.state)
    if expected is not None and progress.changes:
        assert {change.stands for change in progress.changes} == expected, progress


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


LOST = [NoAnswer("silence"), BadAnswer("noise"), NotConnected("gone"), DeviceException(5)]
NO = [DeviceException(4), DeviceException(2), DeviceException(3), Overtaken("a stop")]


@pytest.mark.parametrize("at", range(3))
@pytest.mark.parametrize("acted", [True, False], ids=["acted", "lost"])
@pytest.mark.parametrize("error", LOST, ids=str)
async def test_a_write_of_which_nobody_knows_is_looked_up(at: int, acted: bool, error: LinkError) -> None:
    stand = Stand()
    stand.link.spoil = lambda equipment, point, value: error if value == RAMPS[KEYS[at]] else None
    stand.link.acts_although_spoiled = acted
    done = await stand.set_all(EVA, RAMPS)
    is_true(stand, done)
    if acted:
        assert (done.state, values(stand)) == (ProgressState.CONFIRMED, RAMPS)
    else:
        assert (done.state, done.reason, values(stand)) == (ProgressState.FAILED, sets.RESTORED, former())


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


class Clamps:
    """Makes a drive hold another value than it is sent."""

    def __init__(self, stand: Stand, key: str, value: float, *, always: bool = False) -> None:
        take = stand.drives["m1"].take

        def spoiled(point: str, asked: float) -> None:
            take(point, value if point == key and (always or asked != SETTINGS[key]) else asked)

        stand.drives["m1"].take = spoiled  # type: ignore[method-assign]


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


@pytest.mark.parametrize("at", [1, 2])
@pytest.mark.parametrize("failing", range(2))
async def test_what_cannot_be_put_back_is_named_value_by_value(at: int, failing: int) -> None:
    """Step `at` is refused, and so is putting back `failing`."""
    if failing >= at:
        pytest.skip("it was not written")
    stand = Stand()
    refuse = {(KEYS[at], RAMPS[KEYS[at]]), (KEYS[failing], SETTINGS[KEYS[failing]])}
    stand.link.spoil = lambda equipment, point, value: DeviceException(4) if (point, value) in refuse else None
    ended: list[Progress] = []
    stand.gate.subscribe_ends(ended.append)
    done = await stand.set_all(EVA, RAMPS)
    assert (done.state, done.reason) == (ProgressState.UNCONFIRMED, sets.MIXED)
    assert stands(done) == {key: "new" if key == KEYS[failing] else "old" for key in RAMPS}
    assert done.params["values"] == ", ".join(
        f"{key.upper()} = {stand.drive()[key]:g} ({stands(done)[key]})" for key in RAMPS
    )
    is_true(stand, done)
    assert ended == [done]
    (line,) = stand.commands
    assert (line.result, line.reason) == ("unconfirmed", sets.MIXED)


async def test_a_drive_that_clamps_what_is_put_back_holds_another_value_and_that_is_told() -> None:
    stand = Stand()
    Clamps(stand, "f114", 7.5, always=True)
    done = await stand.set_all(EVA, RAMPS)
    assert stands(done) == {"f114": "other", "f115": "old", "f209": "old"}
    assert done.reason == sets.MIXED
    is_true(stand, done)


class Cable:
    """Pulled by the write of one value, before or after the drive has heard it; put back after `length` [s]."""

    def __init__(self, stand: Stand, point: str, value: float, heard: bool) -> None:
        self.stand, self.out = stand, False
        stand.link.acts_although_spoiled = False

        def spoil(equipment: str, asked: str, new: float) -> LinkError | None:
            if self.out:
                return NotConnected("cable")
            if (asked, new) == (point, value):
                if heard:
                    stand.drives["m1"].take(asked, new)
                self.pull()
                return NoAnswer("cable")
            return None

        stand.link.spoil = spoil

    def pull(self) -> None:
        self.out = True
        self.stand.bad = {"m1"}
        self.stand.link.refresh_error = NotConnected("cable")
        self.stand.publish("m1", Scan.FAST, Scan.SLOW, Scan.ONCE)

    def put_back(self) -> None:
        self.out = False
        self.stand.bad, self.stand.link.refresh_error = set(), None
        self.stand.publish("m1", Scan.FAST, Scan.SLOW, Scan.ONCE)


@pytest.mark.parametrize("at", range(3))
@pytest.mark.parametrize("heard", [True, False], ids=["heard", "unheard"])
async def test_a_cable_that_is_out_for_a_moment_leaves_all_former_values_or_all_new_ones(at: int, heard: bool) -> None:
    stand = Stand()
    cable = Cable(stand, KEYS[at], RAMPS[KEYS[at]], heard)
    asked = stand.begin_set(EVA, RAMPS)
    await stand.pass_time(10, lambda: cable.out)
    await stand.pass_time(7)
    cable.put_back()
    done = await stand.finish(asked)
    assert (done.state, done.reason, values(stand)) == (ProgressState.FAILED, sets.RESTORED, former())
    is_true(stand, done)


@pytest.mark.parametrize("at", range(3))
@pytest.mark.parametrize("heard", [True, False], ids=["heard", "unheard"])
async def test_a_cable_that_stays_out_leaves_what_is_not_known_and_it_is_told_when_it_is_back(
    at: int, heard: bool
) -> None:
    stand = Stand()
    ended: list[Progress] = []
    stand.gate.subscribe_ends(ended.append)
    cable = Cable(stand, KEYS[at], RAMPS[KEYS[at]], heard)
    asked = stand.begin_set(EVA, RAMPS)
    done = await stand.finish(asked)
    assert (done.state, done.reason) == (ProgressState.UNCONFIRMED, set_follow_up.UNREAD)
    assert stands(done) == {key: "unknown" if number <= at else "old" for number, key in enumerate(KEYS)}
    sent = len(stand.link.writes)
    await stand.pass_time(30)
    assert len(ended) == 1
    cable.put_back()
    await stand.pass_time(6)
    assert len(stand.link.writes) == sent, "nothing is written when the device is back"
    assert len(ended) == 2 and ended[1].id == done.id
    is_true(stand, ended[1])
    nothing = at == 0 and not heard
    assert ended[1].reason == (
        set_follow_up.FOUND_OLD
        if nothing
        else set_follow_up.FOUND_NEW
        if at == 2 and heard
        else set_follow_up.FOUND_MIXED
    )
    first, second = stand.commands
    assert (first.params["id"], second.params["id"]) == (done.id, done.id)
    assert second.params["by"] == "Eva" and second.person == ""
    await stand.pass_time(30)
    assert len(stand.commands) == 2


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
