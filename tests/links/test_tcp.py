"""The TCP transport beside its contract."""

import asyncio
from contextlib import suppress

from app.errors import NotConnected
from app.links.tcp import TcpTransport
from app.plant.definitions import Link
from tests.conftest import find_port


async def test_a_connection_that_is_refused_while_its_task_ends_lets_it_end() -> None:
    transport = TcpTransport(Link("hall", "tcp", host="127.0.0.1", tcp_port=find_port()), None)

    async def connecting() -> None:
        while True:
            with suppress(NotConnected):
                await transport.connect()
            await asyncio.sleep(0)

    for turns in range(120):
        task = asyncio.create_task(connecting())
        for _ in range(turns):
            await asyncio.sleep(0)
        task.cancel()
        done, _ = await asyncio.wait({task}, timeout=1)
        ended = bool(done)
        while not task.done():
            task.cancel()
            await asyncio.wait({task}, timeout=0.05)
        assert ended, f"the task went on after it was cancelled at turn {turns}"
