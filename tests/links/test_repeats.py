"""A repeater says answers twice; what is said twice answers nothing else."""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from app.errors import NoAnswer
from app.links.contract import Block
from app.registers.pdu import build_answer, parse_request
from app.registers.rtu import build_frame, character_time, parse_frame, read_time, request_length
from app.sim.bus import Bus
from tests.links.devices import RegisterDevice
from tests.links.serial_slaves import opened, rtu
from tests.wires import SerialLine, serve_line


class Repeater:
    """A slave at `baud` behind something that says every answer twice, the second time `after` the end of the first [s]."""

    def __init__(self, baud: int, after: float, *, paced: bool, turnaround: float = 0.004) -> None:
        self.line = SerialLine()
        self.path, self.after, self.turnaround = self.line.path, after, turnaround
        self.character = character_time(baud) if paced else 0.0
        self.dumb: set[int] = set()
        """Addresses that nobody answers for."""
        self._heard = bytearray()
        asyncio.get_running_loop().add_reader(self.line.fileno(), self._readable)

    def close(self) -> None:
        asyncio.get_running_loop().remove_reader(self.line.fileno())
        self.line.close()

    def _readable(self) -> None:
        self._heard += self.line.ours.recv(4096)
        while (length := request_length(self._heard)) is not None and len(self._heard) >= length:
            unit, pdu = parse_frame(bytes(self._heard[:length])) or (0, b"")
            del self._heard[:length]
            request = parse_request(pdu)
            if (request.write_address if request.words else request.address) in self.dumb:
                continue
            words = [
                5000 if at == 111 else 100 + at % 3 for at in range(request.address, request.address + request.count)
            ]
            answer = build_frame(unit, build_answer(request, words))
            end = self.turnaround + (length + len(answer)) * self.character
            for due in (end, end + self.after + len(answer) * self.character):
                asyncio.get_running_loop().call_later(due, self._say, answer)

    def _say(self, answer: bytes) -> None:
        with contextlib.suppress(OSError):
            self.line.ours.send(answer)


@asynccontextmanager
async def repeater(baud: int, after: float, *, paced: bool = True) -> AsyncIterator[Repeater]:
    slave = Repeater(baud, after, paced=paced)
    try:
        yield slave
    finally:
        slave.close()


@pytest.mark.parametrize("function", [3, 4])
@pytest.mark.parametrize("baud", [1200, 9600, 19200, 38400])
@pytest.mark.parametrize("after", [0.0, 0.0005, 0.002, 0.0045, 0.006, 0.01, 0.015])
async def test_an_answer_that_is_said_twice_is_not_the_answer_to_the_next_request(
    after: float, baud: int, function: int
) -> None:
    async with repeater(baud, after) as slave, opened(rtu(slave.path, baud)) as t:
        for at, count in ((0, 4), (20, 9), (40, 2)):  # as a link begins
            await t.read(1, Block(at, count, function), 0.2)
        for at in (111, 112, 113, 114, 111, 117, 112, 111, 111, 120, 121, 124):
            assert await t.read(1, Block(at, 1, function), 0.2) == [5000 if at == 111 else 100 + at % 3], at
        assert t.counts.late == 0


@pytest.mark.parametrize(
    ("baud", "after"),
    [(baud, after) for baud in (1200, 9600) for after in (0.0, 0.0045, 0.01)] + [(38400, 0.0), (38400, 0.002)],
)
async def test_an_answer_that_is_said_twice_does_not_stand_in_for_one_that_is_not_there(
    after: float, baud: int
) -> None:
    async with repeater(baud, after) as slave, opened(rtu(slave.path, baud)) as t:
        await t.read(1, Block(113, 1), 0.2)
        await t.read(1, Block(111, 1), 0.2)
        slave.dumb = {112}
        for _ in range(5):
            assert await t.read(1, Block(111, 1), 0.2) == [5000]
            with pytest.raises(NoAnswer):
                await t.read(1, Block(112, 1), 0.2)
            await asyncio.sleep(12)  # until nothing is owed
        slave.dumb = set()
        assert await t.read(1, Block(111, 1), 0.2) == [5000]
        assert await t.read(1, Block(112, 1), 0.2) == [101]


@pytest.mark.parametrize("times", [2, 3, 5])
@pytest.mark.parametrize(
    ("baud", "after"),
    [(baud, after) for baud in (1200, 9600) for after in (0.0, 0.0045, 0.01)] + [(38400, 0.0), (38400, 0.002)],
)
async def test_the_answer_to_a_write_said_twice_does_not_confirm_the_next_one_like_it(
    after: float, baud: int, times: int
) -> None:
    async with repeater(baud, after) as slave, opened(rtu(slave.path, baud)) as t:
        for at, count in ((0, 4), (20, 9), (40, 2)):  # as a link begins
            await t.read(1, Block(at, count), 0.2)
        for _ in range(times):
            await t.write(1, 0x2000, [3], 0.2)
        slave.dumb = {0x2000}
        for _ in range(3):
            with pytest.raises(NoAnswer):
                await t.write(1, 0x2000, [3], 0.2)
        slave.dumb = set()
        await asyncio.sleep(12)  # until nothing is owed
        for _ in range(times):
            await t.write(1, 0x2000, [3], 0.2)
            await t.write(1, 0x2000, [5], 0.2)


@pytest.mark.parametrize("baud", [9600, 38400])
@pytest.mark.parametrize("after", [0.0, 0.0005, 0.001])
async def test_where_nothing_takes_time_an_answer_that_is_said_twice_is_over_before_the_next_request(
    after: float, baud: int
) -> None:
    async with repeater(baud, after, paced=False) as slave, opened(rtu(slave.path, baud)) as t:
        for at in (111, 112, 113, 114, 111, 117, 112, 111, 111, 120, 121, 124):
            assert await t.read(1, Block(at, 1), 0.2) == [5000 if at == 111 else 100 + at % 3], at


@pytest.mark.parametrize("paced", [True, False])
@pytest.mark.parametrize("baud", [9600, 115200])
async def test_the_same_values_again_are_good_at_once(baud: int, paced: bool) -> None:
    line = await serve_line(Bus({1: RegisterDevice(dict.fromkeys(range(200), 7))}), baud, paced=paced)
    async with opened(rtu(line.path, baud)) as t:
        began = asyncio.get_running_loop().time()
        for at in range(100):
            assert await t.read(1, Block(at, 2), 0.5) == [7, 7]
        assert asyncio.get_running_loop().time() - began < 100 * (read_time(baud, 2) + 0.005)
        assert t.counts.late == t.counts.damaged == 0
    await line.close()
