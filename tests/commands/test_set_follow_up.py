"""What became of a set of setpoints is looked up, and told value by value."""

import pytest

from app.commands import set_follow_up, sets
from app.commands.lifecycle import Progress, ProgressState
from app.errors import BadAnswer, DeviceException, LinkError, NoAnswer, NotConnected
from app.plant.definitions import Scan
from tests.commands.set_rig import KEYS, RAMPS, Clamps, former, is_true, stands, values
from tests.commands.stand import EVA, SETTINGS, Stand

LOST = [NoAnswer("silence"), BadAnswer("noise"), NotConnected("gone"), DeviceException(5)]


@pytest.mark.sweep(8)
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


@pytest.mark.sweep(8)
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
