"""Parameters through the mailbox: over every road the same, one at a time, answered one by one, and never the answer to somebody else."""

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import replace

import pytest

from app.errors import (
    BadAnswer,
    LinkError,
    MailboxRefused,
    NoAnswer,
    Overtaken,
    Refused,
    TelegramError,
)
from app.links.mailbox import MailboxUnit, Missed, Outcome
from app.links.schedule import PERMIT
from app.plant.definitions import MailboxMap
from app.profidrive.parameter_access.messages import Address, Failed, Result, Values, Written
from app.sim.sinamics.mailbox import MailboxFault
from tests.links.devices import Line, until
from tests.links.mailbox_drive import AT, DEVICE, U16, U32, MailboxDrive, drive
from tests.links.plc_devices import KINDS, FaultyBus, plant

FIVE = [Address(n) for n in range(1, 6)]
GOT_FIVE = [Values(U16, (n,)) for n in range(1, 6)]
CHANGES = [(Address(1), Values(U16, (50,))), (Address(901), Values(U16, (1,))), (Address(2), Values(U16, (60,)))]


@asynccontextmanager
async def mailbox(
    device: MailboxDrive, kind: str = "memory", **how: bool
) -> AsyncIterator[tuple[MailboxUnit, Line, FaultyBus]]:
    async with plant(device, kind, equipment=[drive()], **how) as (line, bus):  # type: ignore[arg-type]
        await until(lambda: line.value("d.a") == 7)
        yield line.link.parameters("d"), line, bus


def is_request(pdu: bytes) -> bool:
    return pdu[0] == 16 and int.from_bytes(pdu[1:3], "big") == AT


def is_look(pdu: bytes) -> bool:
    return pdu[0] == 3 and int.from_bytes(pdu[1:3], "big") == AT


def missed(told: Sequence[Outcome], error: type[LinkError], *, sent: bool) -> bool:
    return all(isinstance(one, Missed) and type(one.error) is error and one.sent is sent for one in told)


@pytest.mark.parametrize("kind", KINDS)
async def test_every_parameter_is_read_and_answered_by_itself(kind: str) -> None:
    device = MailboxDrive()
    async with mailbox(device, kind) as (box, line, _):
        seen: list[tuple[int, int]] = []
        wanted = [Address(945, count=64), Address(1000), *(Address(n, 1) for n in range(1, 101)), Address(5, 63, 2)]
        told = await box.read(2, wanted, [U16], lambda done, count: seen.append((done, count)))
        numbers = tuple(945 + n for n in range(64))
        assert told[0] == Values(U16, numbers) and told[1] == Failed(0) and told[-1] == Failed(3, (64,))
        assert told[2:-1] == [Values(U16, (n + 1,)) for n in range(1, 101)]
        assert [len(request.addresses) for request in device.requests] == [18, 39, 39, 7]
        assert [done for done, _ in seen] == [18, 57, 96, 103] and {count for _, count in seen} == {103}
        assert len({request.reference for request in device.requests}) == 4
        assert line.value("d.a") == 7


@pytest.mark.parametrize("kind", KINDS)
async def test_changes_are_written_in_order_and_answered_one_by_one(kind: str) -> None:
    device = MailboxDrive()
    async with mailbox(device, kind) as (box, _, _):
        assert await box.change(2, CHANGES) == [Written(), Failed(1, (0,)), Written()]
        assert device.values == {(1, 0): 50, (2, 0): 60}
        assert await box.change(2, CHANGES[:1]) == [Written()]
        many = [(Address(3, count=64), Values(U16, tuple(range(64)))), (Address(4, count=64), Values(U32, (9,) * 64))]
        assert await box.change(2, many) == [Written(), Written()]
        assert await box.read(2, [Address(3, count=64), Address(4, 0, 64)], [U16, U16]) == [
            Values(U16, tuple(range(64))),
            Values(U16, (9,) * 64),
        ]


@pytest.mark.parametrize("kind", KINDS)
async def test_scans_go_on_beside_a_long_read_and_a_slow_drive(kind: str) -> None:
    device = MailboxDrive()
    async with mailbox(device, kind) as (box, _, _):
        await asyncio.sleep(2)
        loop, before = asyncio.get_running_loop(), device.scans
        began = loop.time()
        await box.read(2, [Address(n) for n in range(1, 400)])
        took = loop.time() - began
        assert device.scans - before >= 0.9 * took / DEVICE.fast
        device.fault = MailboxFault.LATE
        before, began = device.scans, loop.time()
        slow = asyncio.create_task(box.read(2, FIVE))
        await asyncio.sleep(0.9)
        assert device.scans - before >= 0.9 * 0.9 / DEVICE.fast
        slow.cancel()
        await asyncio.gather(slow, return_exceptions=True)


@pytest.mark.parametrize("kind", KINDS)
async def test_two_users_never_collide(kind: str) -> None:
    device = MailboxDrive()
    async with mailbox(device, kind) as (box, _, _):
        jobs = [box.read(2, [Address(n, i) for n in range(1, 90)]) for i in range(4)]
        jobs += [
            box.change(2, [(Address(n), Values(U16, (1000 + n,))) for n in range(100 + 40 * i, 140 + 40 * i)])
            for i in range(2)
        ]
        results = await asyncio.gather(*jobs)
        for i in range(4):
            assert results[i] == [Values(U16, (n + i,)) for n in range(1, 90)]
        assert results[4] == results[5] == [Written()] * 40
        assert device.values == {(n, 0): 1000 + n for n in range(100, 180)}
        assert box.waiting == 0


async def test_a_drive_that_is_busy_is_asked_again_but_not_for_ever() -> None:
    device = MailboxDrive()
    async with mailbox(device) as (box, _, _):
        device.fault = MailboxFault.BUSY
        asyncio.get_running_loop().call_later(1.0, setattr, device, "fault", 0)
        assert await box.change(2, CHANGES) == [Written(), Failed(1, (0,)), Written()]
        assert len(device.requests) == 1
        device.fault = MailboxFault.BUSY
        told = await box.read(2, FIVE)
        assert missed(told, MailboxRefused, sent=False)
        assert all(
            isinstance(one, Missed) and isinstance(one.error, MailboxRefused) and one.error.number == 2 for one in told
        )
        device.fault = 0
        assert await box.read(2, FIVE[2:]) == GOT_FIVE[2:]


@pytest.mark.parametrize(
    ("fault", "error", "done"),
    [
        (MailboxFault.FOREIGN, BadAnswer, True),
        (MailboxFault.WRONG_LENGTH, BadAnswer, True),
        (MailboxFault.INTERNAL, MailboxRefused, False),
        (MailboxFault.LATE, NoAnswer, False),
        (MailboxFault.NEVER, NoAnswer, False),
    ],
)
async def test_of_a_change_without_its_own_answer_nobody_knows(fault: int, error: type[LinkError], done: bool) -> None:
    device = MailboxDrive()
    async with mailbox(device) as (box, _, _):
        device.fault = fault
        told = await box.change(2, CHANGES)
        assert missed(told, error, sent=True), told
        assert bool(device.values) is done and len(device.requests) <= 1
        assert isinstance((await box.read(2, [Address(1)]))[0], Missed)
        device.fault = 0
        if fault in (MailboxFault.LATE, MailboxFault.NEVER):
            await asyncio.sleep(3)
        assert await box.read(2, FIVE[2:]) == GOT_FIVE[2:]


async def test_an_old_answer_is_never_taken_for_a_new_one() -> None:
    """The answer to a read that was given up comes while the next one waits, whatever its reference."""
    device = MailboxDrive()
    async with mailbox(device) as (box, _, _):
        for n in range(1, 40):
            job = asyncio.create_task(box.read(2, [Address(n)]))
            await asyncio.sleep(0.004 * n)
            cancelled = job.cancel()
            await asyncio.gather(job, return_exceptions=True)
            assert await box.read(2, [Address(n + 100)]) == [Values(U16, (n + 100,))], cancelled


async def test_a_cancelled_read_leaves_the_mailbox_to_others() -> None:
    device = MailboxDrive()
    async with mailbox(device) as (box, _, _):
        long = asyncio.create_task(box.read(2, [Address(n) for n in range(1, 900)]))
        await asyncio.sleep(0.1)
        short = asyncio.create_task(box.read(2, FIVE))
        await asyncio.sleep(0.15)
        assert not long.done() and short.done() and short.result() == GOT_FIVE
        long.cancel()
        await asyncio.gather(long, return_exceptions=True)
        asked = len(device.requests)
        await asyncio.sleep(0.5)
        assert len(device.requests) <= asked + 1 and box.waiting == 0  # the drive does what it has


async def test_an_answer_that_gets_too_long_is_asked_for_in_pieces() -> None:
    device = MailboxDrive()

    def wide(address: Address) -> Result:
        if address.elements > 10:
            return Failed(0x15)
        return Values(U16, tuple(range(address.subindex, address.subindex + address.elements)))

    device._read = wide  # type: ignore[method-assign]
    async with mailbox(device) as (box, _, _):
        told = await box.read(2, [Address(1, count=64), Address(2)], [U16])
        assert told == [Values(U16, tuple(range(64))), Values(U16, (0,))]
        device._read = lambda address: Failed(0x15)  # type: ignore[method-assign]
        assert await box.read(2, [Address(1, count=3), Address(2)], [U16]) == [Failed(0x15)] * 2


async def test_a_stop_ends_a_change_but_not_a_read() -> None:
    device = MailboxDrive()
    async with mailbox(device) as (box, line, _):
        station = line.link.stations[1]
        device.on_request = lambda request: setattr(station, "stops", station.stops + 1)
        many = [(Address(n), Values(U16, (1,))) for n in range(1, 60)]
        told = await box.change(2, many)
        done = len(device.requests[0].addresses)
        assert told[:done] == [Written()] * done and done < 59
        assert missed(told[done:], Overtaken, sent=False)
        assert await box.read(2, [Address(n, 1) for n in range(1, 60)]) == [Values(U16, (n + 1,)) for n in range(1, 60)]


async def test_the_line_fails_in_the_middle() -> None:
    device = MailboxDrive()
    async with mailbox(device) as (box, _, bus):
        many = [(Address(n), Values(U16, (1,))) for n in range(1, 90)]
        device.on_request = lambda request: setattr(bus, "fault", lambda pdu: "request")
        told = await box.change(2, many)
        first = len(device.requests[0].addresses)
        assert missed(told[:first], NoAnswer, sent=True) and missed(told[first:], NoAnswer, sent=False)
        assert missed(await box.read(2, FIVE), NoAnswer, sent=False)  # the unit is known to be silent
        bus.fault = lambda pdu: ""
        device.on_request = lambda request: None
        await asyncio.sleep(3)
        assert await box.read(2, [Address(1)]) == [Values(U16, (1,))]


async def test_nothing_is_sent_without_leave() -> None:
    device = MailboxDrive()
    async with mailbox(device, writes=False) as (box, _, _):
        with pytest.raises(Refused, match=r"command\.writes_off"):
            await box.read(2, FIVE)
        with pytest.raises(Refused, match=r"command\.writes_off"):
            await box.change(2, CHANGES)
    async with mailbox(device) as (box, _, _):
        with pytest.raises(TelegramError, match="70000"):
            await box.change(2, [(Address(1), Values(U16, (70000,)))])
        token = PERMIT.set(lambda: False)
        told = await box.change(2, CHANGES)
        PERMIT.reset(token)
        assert all(isinstance(one, Missed) and not one.sent for one in told)
    assert device.requests == [] and not device.values


async def test_a_reload_goes_on_in_the_same_queue_and_a_machine_without_mailbox_says_so() -> None:
    device = MailboxDrive()
    async with mailbox(device) as (box, line, _):
        job = asyncio.create_task(box.read(2, [Address(n) for n in range(1, 200)]))
        await asyncio.sleep(0.1)
        changed = drive(replace(DEVICE, fast=0.07, services=(MailboxMap(AT, 0, timeout=2.0),)))
        line.link.renew([changed])
        await until(lambda: line.link.parameters("d") is not box)
        assert await line.link.parameters("d").read(2, FIVE) == GOT_FIVE
        assert len(await job) == 199
        line.link.renew([drive(replace(DEVICE, services=()))])
        with pytest.raises(LinkError, match="d has no parameters"):
            line.link.parameters("d")
        with pytest.raises(LinkError, match="no equipment x"):
            line.link.parameters("x")
