"""Two permissives that fall 20 ms apart are told apart a thousand times out of a thousand, by a host that looks long after both fell."""

from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from contextlib import asynccontextmanager
from random import Random

import pytest
from pymodbus.client import AsyncModbusTcpClient

from app.blocks.sequence import ALL, Cause, SequenceEvent
from app.registers import plc_map
from app.registers.pdu import Request, parse_answer, read_request
from app.registers.plc_map import event_of, time_of
from app.sim.bus import Bus
from app.sim.sequence import training as own
from app.sim.sequence.program import VirtualSequence
from app.sim.sequence.register_map import STATUS, SequenceCommand
from app.sim.server import serve_tcp
from tests.sim.coil_car.line import Talker, teaching

TIMES = 1000
UNIT = 21
Read = Callable[[int, int], Awaitable[Sequence[int]]]


@asynccontextmanager
async def host(road: str, plc: VirtualSequence) -> AsyncIterator[Read]:
    """How a host reads registers of `plc` over `road`."""
    bus = Bus({UNIT: plc})
    if road == "memory":

        async def remembered(address: int, count: int) -> Sequence[int]:
            answer = bus.answer(UNIT, read_request(address, count))
            assert answer.pdu is not None
            return parse_answer(Request(3, address, count), answer.pdu)

        yield remembered
        return
    server = await serve_tcp(bus, "127.0.0.1", 0)
    address, port = server.address
    client = AsyncModbusTcpClient(address, port=port, timeout=2, retries=0)
    assert await client.connect()

    async def read(address: int, count: int) -> Sequence[int]:
        answer = await client.read_holding_registers(address, count=count, device_id=UNIT)
        assert not answer.isError()
        return answer.registers

    try:
        yield read
    finally:
        client.close()
        await server.close()


async def fallen(read: Read, seen: int) -> tuple[list[tuple[int, int, int]], int]:
    """(step, bit, time) of the permissives that the ring says were lost after `seen`, in its order, and its newest sequence."""
    head = await read(plc_map.EVENTS, plc_map.EVENTS_WORDS)
    assert plc_map.is_whole(head)
    newest = head[plc_map.AT_NEWEST] << 16 | head[plc_map.AT_NEWEST + 1]
    capacity = head[1]
    assert newest - seen <= capacity, "the ring has lost none"
    found = []
    at = seen + 1
    while at <= newest:
        row = at % capacity
        rows = min(newest - at + 1, capacity - row, 125 // plc_map.EVENT_WORDS)
        words = await read(plc_map.EVENT_ROWS + row * plc_map.EVENT_WORDS, rows * plc_map.EVENT_WORDS)
        for n in range(rows):
            event = event_of(words[n * plc_map.EVENT_WORDS : (n + 1) * plc_map.EVENT_WORDS])
            assert event.sequence == at + n
            if event.code == SequenceEvent.PERMISSIVE_LOST:
                found.append((event.source, event.snapshot[0], event.time))
        at += rows
    return found, newest


@pytest.mark.sweep(8)
@pytest.mark.parametrize("road", ["memory", "tcp"])
async def test_the_ring_tells_which_of_two_fell_first(road: str) -> None:
    """Suspended, so that neither stops the sequence before the other has fallen; the resume then must blame the first."""
    random = Random(7)
    plc = VirtualSequence(teaching((1.0, 0.0), (1.0, 0.0), loss_aborts=True))
    talker = Talker(plc)
    plc.step()
    orders = set()
    async with host(road, plc) as read:
        _, seen = await fallen(read, 0)
        for _ in range(TIMES):
            for code in (SequenceCommand.ACKNOWLEDGE, SequenceCommand.START, SequenceCommand.SUSPEND):
                talker.ask(code)
            one, other = random.sample(range(16), 2)
            orders.add(one < other)
            talker.train(own.REG_PERMISSIVES + 1, ALL & ~(1 << one))
            plc.step()
            first = plc.time
            plc.step()
            talker.train(own.REG_PERMISSIVES + 1, ALL & ~(1 << one | 1 << other))
            for _ in range(random.randint(1, 30)):
                plc.step()
            talker.ask(SequenceCommand.RESUME)
            told, seen = await fallen(read, seen)
            assert told == [(1, one, first), (1, other, first + 20_000)]
            out = await read(STATUS + 28, 12)
            assert (out[0], out[1], out[2], out[10]) == (Cause.PERMISSIVE_LOST, 1, one, 1)
            assert time_of(out[4:8]) == first
            talker.train(own.REG_PERMISSIVES + 1, ALL)
            plc.step()
    assert orders == {True, False}


@pytest.mark.parametrize("road", ["memory", "tcp"])
async def test_one_of_the_abort_conditions_and_one_of_the_next_step_too(road: str) -> None:
    random = Random(8)
    plc = VirtualSequence(teaching((0.0, 0.0), (0.0, 0.0)))
    talker = Talker(plc)
    plc.step()
    async with host(road, plc) as read:
        _, seen = await fallen(read, 0)
        for _ in range(100):
            talker.ask(SequenceCommand.ACKNOWLEDGE)
            talker.ask(SequenceCommand.START)
            place = random.choice((1, 2))
            bits = random.sample(range(16), 2)
            talker.train(own.REG_PERMISSIVES + place, ALL & ~(1 << bits[0]))
            plc.step()
            plc.step()
            talker.train(own.REG_PERMISSIVES, ALL & ~(1 << bits[1]))
            for _ in range(10):
                plc.step()
            told, seen = await fallen(read, seen)
            assert [(step, bit) for step, bit, _ in told] == [(place, bits[0]), (0, bits[1])]
            assert told[1][2] - told[0][2] == 20_000
            out = await read(STATUS + 28, 4)
            assert tuple(out[:3]) == (Cause.ABORT_CONDITION, 0, bits[1]), "what stopped it, not what fell before"
            for n in range(3):
                talker.train(own.REG_PERMISSIVES + n, ALL)
            plc.step()


def test_two_in_one_scan_are_told_as_such() -> None:
    plc = VirtualSequence(teaching((1.0, 0.0), loss_aborts=True))
    talker = Talker(plc)
    plc.step()
    talker.ask(SequenceCommand.START)
    talker.events()
    talker.train(own.REG_PERMISSIVES + 1, ALL & ~0b1010)
    plc.step()
    lost = [event for event in talker.events() if event.code == SequenceEvent.PERMISSIVE_LOST]
    assert [(event.snapshot[0], event.snapshot[1]) for event in lost] == [(1, 2), (3, 2)]
    assert plc.read(3, STATUS + 30, 1) == [1] and plc.read(3, STATUS + 38, 1) == [2]
