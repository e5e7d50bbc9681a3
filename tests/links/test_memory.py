"""The memory transport: what the device answers in time, and silence like that of a wire."""

import asyncio

import pytest

from app.errors import BadAnswer, ConfigurationError, NoAnswer, NotConnected
from app.links.contract import Block, Exchange
from app.links.memory import MemoryTransport
from app.plant.definitions import Link

LINK = Link("hall", "memory")


async def opened(exchange: Exchange) -> MemoryTransport:
    transport = MemoryTransport(LINK, exchange)
    await transport.connect()
    return transport


async def echo(unit: int, pdu: bytes) -> bytes | None:
    return pdu


async def silence(unit: int, pdu: bytes) -> bytes | None:
    return None


async def test_a_telegram_is_the_one_of_the_wire() -> None:
    seen: list[tuple[int, bytes]] = []

    async def exchange(unit: int, pdu: bytes) -> bytes | None:
        seen.append((unit, pdu))
        return bytes((3, 4, 0, 7, 0, 8)) if pdu[0] == 3 else pdu

    transport = await opened(exchange)
    assert await transport.read(5, Block(0x1000, 2), 0.1) == [7, 8]
    await transport.write(5, 0x20, [3], 0.1)
    assert seen == [(5, bytes((3, 0x10, 0, 0, 2))), (5, bytes((6, 0, 0x20, 0, 3)))]


@pytest.mark.parametrize(("write", "verb"), [(False, "read 0x1000"), (True, "write 0x0020")])
async def test_silence_lasts_as_long_as_one_waits(write: bool, verb: str) -> None:
    transport, began = await opened(silence), asyncio.get_running_loop().time()
    with pytest.raises(NoAnswer, match=f"unit 1: no answer to {verb} in 0.25 s"):
        await (transport.write(1, 0x20, [3], 0.25) if write else transport.read(1, Block(0x1000, 2), 0.25))
    assert asyncio.get_running_loop().time() - began == pytest.approx(0.25, abs=0.1)


async def test_nothing_is_sent_when_it_is_closed_or_makes_no_telegram() -> None:
    transport = MemoryTransport(LINK, echo)
    for _ in range(2):
        assert not transport.connected
        with pytest.raises(NotConnected):
            await transport.read(1, Block(0, 1), 0.1)
        await transport.connect()
        with pytest.raises(BadAnswer):
            await transport.read(1, Block(0, 126), 0.1)
        await transport.close()


def test_without_a_simulated_line_there_is_none() -> None:
    with pytest.raises(ConfigurationError, match="link hall: transport memory needs a simulated line"):
        MemoryTransport(LINK)
