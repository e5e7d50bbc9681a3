"""Parameters that are registers: over every road the same, answered one by one, never beside the truth."""

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager

import pytest

from app.errors import DeviceException, LinkError, NoAnswer, Overtaken, Refused
from app.links.mailbox import Missed, Outcome
from app.links.register_parameters import RegisterParameters
from app.plant.definitions import Device, ParameterMap
from app.profidrive.parameter_access.error_numbers import EXCEPTION
from app.profidrive.parameter_access.formats import Format
from app.profidrive.parameter_access.messages import Address, Failed, Result, Values, Written
from tests.links.devices import Line, RegisterDevice, machine, point, until
from tests.links.plc_devices import KINDS, FaultyBus, plant

LOCK = 0x2001
DEVICE = Device(timeout=0.15, fast=0.05, slow=0.5, services=(ParameterMap(6, (LOCK, 3), (("F100", "F160"),)),))
U16 = Format.UNSIGNED16


class Drive(RegisterDevice):
    """Four registers to scan, parameters 0x0100 to 0x0109 but 0x0104, and the lock; six registers of parameters at most."""

    type = "drive"
    dt = 0.01

    def __init__(self) -> None:
        super().__init__({at: at for at in (*range(4), *(0x100 + n for n in range(10) if n != 4), LOCK)})
        self.scans = 0
        self.refuses: dict[int, int] = {}
        """Register → exception code with which a write is refused."""

    def step(self) -> None:
        """It acts at once."""

    def read(self, function: int, address: int, count: int) -> list[int]:
        self.scans += address < 4
        if address >= 0x100 and count > 6:
            raise DeviceException(3)
        return super().read(function, address, count)

    def write(self, function: int, address: int, words: Sequence[int]) -> None:
        if address in self.refuses:
            raise DeviceException(self.refuses[address])
        super().write(function, address, words)


@asynccontextmanager
async def parameters(
    device: Drive, kind: str = "memory", **how: bool
) -> AsyncIterator[tuple[RegisterParameters, Line, FaultyBus]]:
    fan = machine("d", 1, [point("d", "a", 1), point("d", "command", 3, writable=True)], DEVICE)
    async with plant(device, kind, equipment=[fan], **how) as (line, bus):  # type: ignore[arg-type]
        await until(lambda: line.value("d.a") == 1)
        found = line.link.parameters("d")
        assert isinstance(found, RegisterParameters)
        device.requests.clear()
        yield found, line, bus


def addresses(*numbers: int) -> list[Address]:
    return [Address(number) for number in numbers]


def changes(*pairs: tuple[int, int]) -> list[tuple[Address, Values]]:
    return [(Address(number), Values(U16, (word,))) for number, word in pairs]


def is_write(pdu: bytes, address: int) -> bool:
    return pdu[0] == 6 and int.from_bytes(pdu[1:3], "big") == address


def missed(told: Sequence[Outcome], error: type[LinkError], *, sent: bool) -> bool:
    return all(isinstance(one, Missed) and type(one.error) is error and one.sent is sent for one in told)


@pytest.mark.parametrize("kind", KINDS)
async def test_neighbours_are_read_together_and_what_is_not_there_hides_nothing(kind: str) -> None:
    device = Drive()
    async with parameters(device, kind) as (box, _, _):
        seen: list[tuple[int, int]] = []
        numbers = [0x109, *range(0x100, 0x109), 0x300]
        told = await box.read(0, addresses(*numbers), progress=lambda done, count: seen.append((done, count)))
        absent: dict[int, Result] = {0x104: Failed(EXCEPTION + 2), 0x300: Failed(EXCEPTION + 2)}
        assert told == [absent.get(number, Values(U16, (number,))) for number in numbers]
        asked = [read for read in device.reads if read[0] >= 0x100]
        assert asked[:1] == [(0x100, 6)] and (0x106, 4) in asked and max(count for _, count in asked) == 6
        assert seen[-1] == (11, 11) and [done for done, _ in seen] == sorted(done for done, _ in seen)


@pytest.mark.parametrize("kind", KINDS)
async def test_scans_go_on_beside_a_long_reading(kind: str) -> None:
    device = Drive()
    async with parameters(device, kind) as (box, _, _):
        loop = asyncio.get_running_loop()
        before, began = device.scans, loop.time()
        await box.read(0, addresses(*range(0x200, 0x300, 2)))
        took = loop.time() - began
        assert device.scans - before >= 0.9 * took / DEVICE.fast


@pytest.mark.parametrize("kind", KINDS)
async def test_changes_are_written_in_order_after_the_memory_was_made_permanent(kind: str) -> None:
    device = Drive()
    async with parameters(device, kind) as (box, _, _):
        assert await box.change(0, changes((0x102, 7), (0x101, 8))) == [Written(), Written()]
        assert device.writes == [(LOCK, (3,)), (0x102, (7,)), (0x101, (8,))]
        assert await box.read(0, addresses(0x101)) == [Values(U16, (8,))]


async def test_nothing_is_sent_after_what_was_refused() -> None:
    device = Drive()
    device.refuses = {0x101: 3}
    async with parameters(device) as (box, _, _):
        told = await box.change(0, changes((0x100, 7), (0x101, 8), (0x102, 9)))
        assert told[:2] == [Written(), Failed(EXCEPTION + 3)] and missed(told[2:], LinkError, sent=False)
        assert device.words[0x100] == 7 and device.words[0x102] == 0x102


async def test_no_parameter_is_sent_when_the_memory_cannot_be_made_permanent() -> None:
    device = Drive()
    device.refuses = {LOCK: 4}
    async with parameters(device) as (box, _, _):
        told = await box.change(0, changes((0x100, 7), (0x102, 9)))
        assert missed(told, DeviceException, sent=False), told
        assert device.words[0x100] == 0x100


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("lost", "arrived"), [("request", False), ("answer", True)])
async def test_a_change_without_an_answer_is_never_sent_again(kind: str, lost: str, arrived: bool) -> None:
    device = Drive()
    async with parameters(device, kind) as (box, _, bus):
        bus.fault = lambda pdu: lost if is_write(pdu, 0x101) else ""
        told = await box.change(0, changes((0x100, 7), (0x101, 8), (0x102, 9)))
        assert (
            told[0] == Written() and missed(told[1:2], NoAnswer, sent=True) and missed(told[2:], NoAnswer, sent=False)
        )
        assert device.words[0x101] == (8 if arrived else 0x101)
        assert bus.spoiled == 1
        bus.fault = lambda pdu: ""


async def test_a_change_whose_answer_a_gateway_lost_was_not_refused() -> None:
    device = Drive()
    async with parameters(device) as (box, _, bus):
        bus.fault = lambda pdu: "gateway" if is_write(pdu, 0x101) else ""
        told = await box.change(0, changes((0x100, 7), (0x101, 8), (0x102, 9)))
        assert told[0] == Written() and missed(told[1:2], DeviceException, sent=True)
        assert missed(told[2:], DeviceException, sent=False)
        assert device.words[0x101] == 8, "the drive has it"


async def test_what_a_gateway_could_not_ask_a_drive_was_not_refused_by_it() -> None:
    device = Drive()
    async with parameters(device) as (box, _, bus):
        bus.fault = lambda pdu: "gateway" if pdu[0] == 3 and pdu[1] else ""
        assert missed(await box.read(0, addresses(0x100, 0x101)), DeviceException, sent=False)


async def test_a_read_is_asked_again_once_and_then_the_rest_is_missed() -> None:
    device = Drive()
    async with parameters(device) as (box, _, bus):
        lost = 1

        def fault(pdu: bytes) -> str:
            nonlocal lost
            if pdu[0] == 3 and pdu[1] and lost:
                lost -= 1
                return "answer"
            return ""

        bus.fault = fault
        assert await box.read(0, addresses(0x100)) == [Values(U16, (0x100,))]
        lost = 99
        told = await box.read(0, addresses(0x100, 0x102, 0x108))
        assert missed(told, NoAnswer, sent=False)


async def test_a_stop_ends_a_change() -> None:
    device = Drive()
    async with parameters(device) as (box, line, bus):
        stops: list[asyncio.Task[int]] = []

        def fault(pdu: bytes) -> str:
            if is_write(pdu, 0x102) and not stops:
                stops.append(asyncio.create_task(line.link.write("d", "command", 0, urgent=True)))
            return ""

        bus.fault = fault
        told = await box.change(0, changes(*((0x100 + n % 4, n) for n in range(40))))
        assert told[0] == Written() and missed(told[-1:], Overtaken, sent=False)
        await stops[0]


async def test_without_permission_nothing_is_written_but_everything_read() -> None:
    device = Drive()
    async with parameters(device, writes=False) as (box, _, _):
        with pytest.raises(Refused):
            await box.change(0, changes((0x100, 7)))
        assert await box.read(0, addresses(0x100)) == [Values(U16, (0x100,))]
        assert device.writes == []
