"""A drive with a mailbox, in a process of its own: `mailbox_drive tcp` says its port, `mailbox_drive BAUD` the path of its line."""

import asyncio
import sys

from app.plant.loader import read_plant
from app.sim.bus import Bus
from app.sim.server import serve_pty, serve_tcp
from app.sim.sinamics.drive import VirtualSinamics
from benchmarks.common import ROOT, lines_in, say


async def _serve(road: str) -> None:
    plant, problems = read_plant(ROOT / "plants" / "sinamics")
    assert plant is not None, problems
    drive = VirtualSinamics(behind_mailbox=plant.equipment["d1"].type.drive_parameters, positioning=True)
    bus = Bus({1: drive})

    async def move() -> None:
        loop = asyncio.get_running_loop()
        due = loop.time()
        while True:
            drive.step()
            due += drive.dt
            await asyncio.sleep(max(0.0, due - loop.time()))

    moving = asyncio.create_task(move())
    if road == "tcp":
        say((await serve_tcp(bus, "127.0.0.1", 0)).address[1])
    else:
        say((await serve_pty(bus, int(road))).path)
    async for _ in lines_in():
        break
    moving.cancel()


def main() -> None:
    asyncio.run(_serve(sys.argv[1]))
