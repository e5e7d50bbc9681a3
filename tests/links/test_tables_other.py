"""The telegrams of bits against a server that is not ours: pymodbus' own, and its client against ours."""

import pytest
from pymodbus.client import AsyncModbusTcpClient
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from app.links.contract import Block
from app.links.tcp import TcpTransport
from app.plant.definitions import Link
from app.sim.bus import Bus
from app.sim.server import serve_tcp
from tests.links.table_device import TableDevice

pytestmark = pytest.mark.real_time


async def test_a_client_that_is_not_ours_reads_and_writes_bits_of_a_served_device() -> None:
    bits = {n: int(n % 3 == 0) for n in range(2100)}
    device = TableDevice({"coil": bits, "discrete": {n: int(n % 5 == 0) for n in range(2100)}})
    served = await serve_tcp(Bus({1: device}), "127.0.0.1", 0)
    client = AsyncModbusTcpClient("127.0.0.1", port=served.address[1], timeout=30)
    await client.connect()
    for count in (1, 7, 8, 9, 2000):
        coils = await client.read_coils(1, count=count, device_id=1)
        assert [int(bit) for bit in coils.bits[:count]] == [bits[1 + n] for n in range(count)]
        inputs = await client.read_discrete_inputs(2, count=count, device_id=1)
        assert [int(bit) for bit in inputs.bits[:count]] == [int((2 + n) % 5 == 0) for n in range(count)]
    for value in (True, False):
        assert not (await client.write_coil(4, value, device_id=1)).isError() and device.tables["coil"][4] == value
    for count in (1, 8, 9, 1968):
        device.tables["coil"] = dict(bits)
        assert not (await client.write_coils(10, [True] * count, device_id=1)).isError()
        assert device.tables["coil"] == bits | {10 + n: 1 for n in range(count)}
    assert (await client.read_coils(2099, count=2, device_id=1)).exception_code == 2
    client.close()
    await served.close()


async def test_bits_of_a_server_that_is_not_ours_are_read_and_written(free_port: int) -> None:
    bits, words = DataType.BITS, DataType.REGISTERS
    tables = (
        [SimData(0, count=40, values=False, datatype=bits)],
        [SimData(0, count=40, values=True, datatype=bits)],
        [SimData(0, count=40, values=7, datatype=words)],
        [SimData(0, count=40, values=9, datatype=words)],
    )
    server = ModbusTcpServer(context=SimDevice(1, simdata=tables), address=("127.0.0.1", free_port))
    await server.serve_forever(background=True)
    transport = TcpTransport(Link("hall", "tcp", host="127.0.0.1", tcp_port=free_port))
    await transport.connect()
    for function, value in ((1, 0), (2, 1), (3, 7), (4, 9)):
        assert await transport.read(1, Block(0, 17, function), 30) == [value] * 17
    await transport.write(1, 3, [1], 30, 5)
    await transport.write(1, 5, [1, 0, 1, 1, 1, 1, 1, 1, 1], 30, 15)
    assert await transport.read(1, Block(0, 17, 1), 30) == [int(bit) for bit in "00010101111111000"]
    await transport.write(1, 8, [0xFF0F, 0x0030], 30, 22)
    assert await transport.read(1, Block(7, 3, 3), 30) == [7, 0x37, 7]
    await transport.write(1, 3, [0], 30, 5)
    assert await transport.read(1, Block(3, 1, 1), 30) == [0]
    await transport.close()
    await server.shutdown()
