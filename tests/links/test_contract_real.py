"""The contract over sockets and terminals of this machine: the same stories, without those that measure time."""

import asyncio

import pytest

from app.errors import NotConnected
from app.links.contract import Block
from app.links.transports import TRANSPORTS
from app.plant.definitions import Link
from app.sim.bus import Bus, LineFaultMode
from app.sim.server import TcpServer
from tests.links.devices import RegisterDevice, until
from tests.links.test_contract import (  # noqa: F401
    bench,
    test_a_refusal_is_told_by_its_code,
    test_a_request_that_no_telegram_can_carry_is_a_link_error,
    test_a_wrong_answer_never_becomes_a_value_and_the_next_one_is_right,
    test_reads_exactly_the_words_asked_for,
    test_writes_one_word_and_several_and_checks_the_echo,
)

pytestmark = pytest.mark.real_time


async def test_a_server_that_goes_away_is_noticed_not_waited_for() -> None:
    device = RegisterDevice({0: 1})
    device.line_fault.mode = LineFaultMode.SILENT
    server = TcpServer(Bus({1: device}))
    await server.start("127.0.0.1", 0)
    transport = TRANSPORTS["tcp"](Link("hall", "tcp", host="127.0.0.1", tcp_port=server.address[1]))
    await transport.connect()
    reading = asyncio.create_task(transport.read(1, Block(0, 1), 3600.0))
    await until(lambda: device.requests)
    await server.close()
    async with asyncio.timeout(60):
        with pytest.raises(NotConnected):
            await reading
        with pytest.raises(NotConnected):
            await transport.connect()
    await transport.close()
