"""The demo plant: the same link reads the virtual drives in memory, over a socket and over a serial line."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace

import pytest

from app.plant.loader import read_plant
from app.settings import bundled
from app.sim.plant import SimPlant
from app.sim.server import TcpServer
from app.tags.quality import Origin, is_bad, is_good, origin
from tests.links.devices import Line, on_bus, running, until
from tests.virtual import loop_clock
from tests.wires import serve_line


@asynccontextmanager
async def demo(transport: str) -> AsyncIterator[Line]:
    plant, problems = read_plant(bundled("plants/demo"))
    assert plant is not None, problems
    link = next(iter(plant.links.values()))
    equipment = [item for item in plant.equipment.values() if item.link == link.name]
    sim = SimPlant(plant, loop_clock())
    bus = sim.buses[link.name]
    moving = asyncio.create_task(sim.run())
    server = TcpServer(bus)
    await server.start("127.0.0.1", 0)
    serial = await serve_line(bus, 57600)
    link = replace(link, writes=True, believe_simulated=True)
    if transport == "tcp":
        link = replace(link, transport="tcp", host="127.0.0.1", tcp_port=server.address[1])
    elif transport == "rtu":
        link = replace(link, transport="rtu", port=serial.path, baud=57600, parity="none", stop_bits=2)
    try:
        async with running(equipment, exchange=on_bus(bus), link=link) as line:
            yield line
    finally:
        moving.cancel()
        await asyncio.gather(moving, return_exceptions=True)
        await server.close()
        await serial.close()


@pytest.mark.parametrize("transport", ["memory", "tcp", "rtu"])
async def test_every_point_of_the_virtual_drives_is_good_and_simulated(transport: str) -> None:
    async with demo(transport) as line:
        stations = line.link.stations.values()
        names = [p.name for s in stations for block in s.blocks for p in block.points]
        assert len(names) > 60
        assert not [p.name for s in stations for p in s.unreadable]
        await until(lambda: all(line.tags.sample(name).seen for name in names))
        assert [name for name in names if not is_good(line.quality(name))] == []
        assert {origin(line.quality(name)) for name in names} == {Origin.SIMULATED}
        assert {type(line.quality(name)) for name in names} == {int}  # a flag is asked five times as slowly
        assert line.link.simulated
        for station in stations:
            assert {(b.block.address, b.block.count) for b in station.blocks if b.block.address >= 0x1000} == {
                (0x1000, 25)
            }
            assert max(b.block.count for b in station.blocks if b.block.address < 0x1000) <= 6


@pytest.mark.sweep(8)
@pytest.mark.parametrize("transport", ["memory", "tcp", "rtu"])
async def test_the_instructor_pulls_a_cable_and_plugs_it_in_again(transport: str) -> None:
    async with demo(transport) as line:
        await until(lambda: is_good(line.quality("m1.frequency")) and is_good(line.quality("m2.frequency")))
        await until(
            lambda: is_good(line.quality("m1.f432"))
        )  # no answer of two words is owed, as that to the head will be
        await line.link.raw_write(1, 0xE011, [1])
        assert await until(lambda: is_bad(line.quality("m1.frequency"))) < 1.25
        assert is_good(line.quality("m2.frequency"))
        assert await line.link.raw_read(1, 0xE000, 2) == [0x5047, 1]
        await line.link.raw_write(1, 0xE011, [0])
        await until(lambda: is_good(line.quality("m1.frequency")))
