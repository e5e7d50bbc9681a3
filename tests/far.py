"""Machines that another process would simulate: on a wire of their own, behind a server of their own."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from app.plant.definitions import Plant
from app.plant.loader import read_plant
from app.sim.plant import SimPlant
from app.sim.server import TcpServer, serve_pty
from tests.virtual import loop_clock, virtual
from tests.wires import serve_line

BAUD = 115200
LINK = "[links.far]\nwrites = true\nsimulated = true\n"
FAR = {
    "tcp": 'transport = "tcp"\nhost = "127.0.0.1"\nport = {port}\n',
    "rtu": 'transport = "rtu"\nport = "{path}"\nbaud = 115200\nparity = "none"\nstop_bits = 2\n',
}


@asynccontextmanager
async def far(folder: Path, transport: str, head: str, equipment: str) -> AsyncIterator[tuple[str, SimPlant]]:
    """The link `far` to `equipment`, machines of that link in a plant file with `head`, and the plant that simulates them.

    `transport` tcp or rtu: a wire of the loop in virtual time, else a socket and a pseudo-terminal of this machine.
    """
    sim = SimPlant(_plant(folder, f'{head}[links.far]\ntransport = "memory"\n{equipment}'), loop_clock())
    bus = sim.buses["far"]
    moving, server = asyncio.create_task(sim.run()), TcpServer(bus)
    line = await (serve_line if virtual() else serve_pty)(bus, BAUD)
    await server.start("127.0.0.1", 0)
    try:
        yield LINK + FAR[transport].format(port=server.address[1], path=line.path), sim
    finally:
        moving.cancel()
        await asyncio.gather(moving, return_exceptions=True)
        await server.close()
        await line.close()


def _plant(folder: Path, text: str) -> Plant:
    folder.mkdir(parents=True)
    (folder / "plant.toml").write_text(text, "utf-8")
    plant, problems = read_plant(folder)
    assert plant is not None, problems
    return plant
