"""What the wire tells beside the words: the slowest answer, an answer that is none, refusals of requests that nobody should send."""

import asyncio

import pytest

from app.errors import BadAnswer, DeviceException
from app.links.conformance.server import Server


async def test_it_keeps_the_slowest_answer_and_the_first_that_is_none() -> None:
    async def exchange(pdu: bytes) -> bytes:
        address = pdu[1] << 8 | pdu[2]
        await asyncio.sleep(0.2 if address == 7 else 0.01)
        return b"\x03\x02\x00\x05" if address < 100 else b"\x03\x04\x00\x05\x00\x06"

    server = Server(exchange)
    assert await server.read(7, 1) == await server.read(8, 1) == [5]
    assert (round(server.slowest, 3), server.slowest_at) == (0.2, 7)
    for address in (100, 101):
        with pytest.raises(BadAnswer):
            await server.read(address, 1)
    assert server.malformed.startswith("0x0064: ")


async def test_exceptions_are_told_by_their_code() -> None:
    async def exchange(pdu: bytes) -> bytes:
        return bytes((pdu[0] | 0x80, 3)) if pdu[0] == 3 and pdu[-1] == 126 else b"\x03\x02\x00\x00"

    server = Server(exchange)
    refused, taken = await server.refusal_of_read(0, 126), await server.refusal_of_read(0, 1)
    assert (refused.code, refused.answered, taken.code, taken.answered) == (3, False, 0, True)

    async def refusing(pdu: bytes) -> bytes:
        return bytes((pdu[0] | 0x80, 2))

    with pytest.raises(DeviceException):
        await Server(refusing).write(0x300, [1, 2])
