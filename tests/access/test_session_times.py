"""A step of the wall clock neither ends nor prolongs anything that a person has; only over a restart it is what there is."""

import pytest

from app.access.access import Access
from app.access.session_times import IDLE_AFTER, SHIFT, SHIFT_WITH_POWER, WATCHING
from app.clock import ManualClock
from tests.access.conftest import OpenAccess, add, enter, who

STEPS = [-86_400.0 * 400, -3600.0, -1.0, 1.0, 3600.0, 86_400.0 * 400]


@pytest.mark.parametrize("step", STEPS)
async def test_idleness_is_not_reached_nor_put_off(access: Access, clock: ManualClock, step: float) -> None:
    await add(access, "oli", "operator")
    sid = await enter(access, "oli")
    clock.advance(IDLE_AFTER / 2)
    clock.step_wall(step)
    person = await who(access, sid)
    assert person is not None
    assert not person.idle
    assert person.idle_in == pytest.approx(IDLE_AFTER / 2)
    clock.advance(IDLE_AFTER / 2)
    person = await who(access, sid)
    assert person is not None
    assert person.idle


@pytest.mark.sweep(8)
@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize(("role", "shift"), [("viewer", WATCHING), ("operator", SHIFT), ("engineer", SHIFT_WITH_POWER)])
async def test_a_session_ends_with_its_shift(
    access: Access, clock: ManualClock, step: float, role: str, shift: float
) -> None:
    await add(access, "oli", role)
    sid = await enter(access, "oli")
    for _ in range(4):
        clock.advance(shift / 4 - 1)
        clock.step_wall(step)
        person = await who(access, sid)
        assert person is not None
        access.sessions.touch(person)
    await add(access, "eve", "operator")
    await enter(access, "eve")  # cleans up what is over, and nothing else
    assert await who(access, sid) is not None
    assert len(await access.sessions.of()) == 2
    clock.advance(4)
    assert await who(access, sid) is None
    clock.step_wall(-2 * shift)
    assert await who(access, sid) is None  # over is over


@pytest.mark.parametrize("step", STEPS)
async def test_deeds_after_a_step_count(access: Access, clock: ManualClock, step: float) -> None:
    await add(access, "oli", "operator")
    sid = await enter(access, "oli")
    for _ in range(5):
        clock.advance(IDLE_AFTER - 1)
        clock.step_wall(step)
        person = await who(access, sid)
        assert person is not None
        assert not person.idle
        access.sessions.touch(person)


async def restarted(open_access: OpenAccess) -> Access:
    access = open_access()
    await access.start()
    return access


async def test_a_session_lives_on_over_a_restart(open_access: OpenAccess, clock: ManualClock) -> None:
    access = open_access()
    await add(access, "oli", "operator")
    sid = await enter(access, "oli")
    clock.advance(60)
    person = await who(await restarted(open_access), sid)
    assert person is not None
    assert not person.idle
    assert person.idle_in == pytest.approx(IDLE_AFTER - 60)


async def test_a_restart_after_a_step_that_deeds_have_seen(open_access: OpenAccess, clock: ManualClock) -> None:
    access = open_access()
    await add(access, "oli", "operator")
    sid = await enter(access, "oli")
    clock.step_wall(3600 * 24)
    clock.advance(30)
    person = await who(access, sid)
    assert person is not None
    access.sessions.touch(person)
    access.sessions._db.submit(lambda _connection: None).result()
    person = await who(await restarted(open_access), sid)
    assert person is not None
    assert not person.idle


@pytest.mark.parametrize("back", [3600.0, SHIFT * 10])
async def test_a_clock_set_back_while_the_server_was_down_gives_nobody_time(
    open_access: OpenAccess, clock: ManualClock, back: float
) -> None:
    access = open_access()
    await add(access, "oli", "operator")
    sid = await enter(access, "oli")
    clock.step_wall(-back)
    after = await restarted(open_access)
    person = await who(after, sid)
    assert person is not None
    assert person.idle  # nobody knows how long it has been
    clock.advance(SHIFT)
    assert await who(after, sid) is None


@pytest.mark.parametrize("step", STEPS)
async def test_the_brakes_on_guessing_do_not_see_it(access: Access, clock: ManualClock, step: float) -> None:
    for _ in range(8):
        access.throttle.failed("eve")
    before = access.throttle.wait("eve")
    clock.step_wall(step)
    assert access.throttle.wait("eve") == before
