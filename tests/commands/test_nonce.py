"""Late, twice, too often."""

import asyncio
from functools import partial

import pytest

from app.clock import ManualClock
from app.commands.nonce import MOST, Nonces, Once, Rate
from app.errors import Refused


def test_a_nonce_is_good_for_one_command_of_its_session_within_ten_seconds() -> None:
    clock = ManualClock()
    nonces = Nonces(clock)
    first, second, old = nonces.issue("a"), nonces.issue("a"), nonces.issue("b")
    nonces.use("a", first)
    for session, nonce in (("a", first), ("b", second), ("a", "made up"), ("a", ""), ("c", "š")):
        with pytest.raises(Refused) as refused:
            nonces.use(session, nonce)
        assert refused.value.status == 410
    clock.advance(10.1)
    with pytest.raises(Refused):
        nonces.use("b", old)


def test_a_command_six_seconds_under_way_is_late_because_its_page_has_newer_nonces() -> None:
    clock = ManualClock()
    nonces = Nonces(clock)
    used = nonces.issue("a")
    for _ in range(6):
        clock.advance(1)
        nonces.issue("a")
    with pytest.raises(Refused):
        nonces.use("a", used)


async def test_the_same_identity_gives_the_first_result_and_does_not_act_again() -> None:
    once: Once[int] = Once(ManualClock())
    calls = 0

    async def work() -> int:
        nonlocal calls
        calls += 1
        await asyncio.sleep(0)
        return calls

    results = await asyncio.gather(*(once.run("x", "ana", work, keep=lambda refusal: True) for _ in range(5)))
    assert results == [1] * 5
    assert await once.run("x", "ana", work, keep=lambda refusal: True) == 1
    with pytest.raises(Refused, match="replayed"):
        await once.run("x", "ivo", work, keep=lambda refusal: True)
    assert calls == 1


async def test_identities_are_forgotten_after_a_day_and_questions_at_once() -> None:
    clock = ManualClock()
    once: Once[int] = Once(clock)

    async def refuse() -> int:
        raise Refused("why.confirm")

    async def work() -> int:
        return 7

    for _ in range(2):
        with pytest.raises(Refused):
            await once.run("x", "ana", refuse, keep=lambda refusal: False)
        await asyncio.sleep(0)
    assert await once.run("x", "ana", work, keep=lambda refusal: False) == 7
    await asyncio.sleep(0)
    clock.advance(86_401)
    with pytest.raises(Refused):
        await once.run("x", "ana", refuse, keep=lambda refusal: False)


async def test_of_very_many_identities_the_newest_are_remembered() -> None:
    once: Once[int] = Once(ManualClock())
    done: list[int] = []

    async def work(number: int) -> int:
        done.append(number)
        return number

    for number in range(MOST + 100):
        await once.run(f"id-{number}", "ana", partial(work, number), keep=lambda refusal: True)
    assert len(once._entries) <= MOST + 1
    assert await once.run(f"id-{MOST}", "ana", partial(work, -1), keep=lambda refusal: True) == MOST
    assert not once.known("id-0") and -1 not in done


async def test_the_work_goes_on_when_the_caller_goes_away() -> None:
    once: Once[int] = Once(ManualClock())
    door, done = asyncio.Event(), []

    async def work() -> int:
        await door.wait()
        done.append(1)
        return 1

    caller = asyncio.create_task(once.run("x", "ana", work, keep=lambda refusal: True))
    await asyncio.sleep(0)
    caller.cancel()
    await asyncio.gather(caller, return_exceptions=True)
    door.set()
    assert await once.run("x", "ana", work, keep=lambda refusal: True) == 1
    assert done == [1]


def test_ten_at_once_then_five_a_second() -> None:
    clock = ManualClock()
    rate = Rate(clock)
    assert [rate.take("ana") for _ in range(12)] == [True] * 10 + [False] * 2
    assert rate.take("ivo")
    clock.advance(1)
    assert sum(rate.take("ana") for _ in range(10)) == 5
