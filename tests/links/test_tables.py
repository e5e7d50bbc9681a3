"""Every table, width and order over every transport: what the device holds is what the tag says, and what is written arrives."""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import replace

import pytest

from app.errors import BadAnswer, DeviceException, LinkError, Overtaken
from app.links.contract import Block
from app.links.register_link import RegisterLink
from app.links.transports import TRANSPORTS
from app.plant.definitions import Device, Equipment, Link, Point, Scan
from app.registers.codec import encode
from app.registers.register import Order, Type
from app.sim.bus import Bus
from app.sim.server import TcpServer, serve_pty
from app.tags.quality import NOT_CONNECTED, is_good
from tests.links.devices import Line, machine, on_bus, point, running, until
from tests.links.table_device import TableDevice
from tests.virtual import virtual
from tests.wires import serve_line

ALL = Device(timeout=0.4, fast=0.1, slow=0.3, max_write=4, read_functions=(1, 2, 3, 4), write_functions=(5, 6, 15, 16))
VALUES: dict[Type, tuple[float, float]] = {
    Type.U16: (0xFFFE, 1), Type.I16: (-32767, 5), Type.U32: (0xFFFF_FFF0, 70000), Type.I32: (-70000, 70000),
    Type.F32: (-0.1, 1.5e30), Type.U64: (2**64 - 2, 2**40), Type.I64: (-(2**62) - 1, 2**53 + 1), Type.F64: (-0.1, 1e300),
}  # fmt: skip
"""Of each width, what the device holds and what is written to it."""
WORDS = {Type.U16: 1, Type.I16: 1, Type.U64: 4, Type.I64: 4, Type.F64: 4}


def registers() -> Iterator[Point]:
    """Both tables of registers, in every width and order."""
    for table in ("holding", "input"):
        address = 0
        for kind in VALUES:
            for order in Order:
                words = WORDS.get(kind, 2)
                key = f"{table}_{kind}_{order}"
                yield point("m", key, address, type=kind, order=order, words=words, table=table,
                            writable=table == "holding")  # fmt: skip
                address += words


def bits(count: int = 20) -> list[Point]:
    """Coils and discrete inputs at the same addresses."""
    kinds = [("coil", True), ("discrete", False)]
    return [
        point("m", f"{table}_{n}", n, type=Type.BIT, table=table, writable=writable)
        for table, writable in kinds
        for n in range(count)
    ]


def holding(points: list[Point]) -> dict[str, dict[int, int]]:
    """The tables of a device that holds the first value of each register, and every third bit set."""
    tables: dict[str, dict[int, int]] = {}
    for one in points:
        register = one.register
        assert register is not None
        bit = int(register.address % 3 == 0) if register.table == "coil" else int(register.address % 2 == 0)
        words = [bit] if register.type is Type.BIT else encode(register, VALUES[register.type][0])
        tables.setdefault(register.table, {}).update(enumerate(words, register.address))
    return tables


@asynccontextmanager
async def wired(name: str, bus: Bus) -> AsyncIterator[Link]:
    """The link of one transport to what is on the bus."""
    server = TcpServer(bus)
    await server.start("127.0.0.1", 0)
    line = await (serve_line if virtual() else serve_pty)(bus, 115200)
    link = Link(
        "hall", name, host="127.0.0.1", tcp_port=server.address[1], port=line.path, baud=115200, parity="none",
        stop_bits=2, writes=True,
    )  # fmt: skip
    try:
        yield link
    finally:
        await line.close()
        await server.close()


@asynccontextmanager
async def linked(
    name: str, device: TableDevice, points: list[Point], known: Device = ALL, *, bus: Bus | None = None
) -> AsyncIterator[Line]:
    """A running link of one transport to the device, over a `bus` of its own."""
    bus = bus or Bus({1: device})
    machines = [machine("m", 1, points, known)]
    async with wired(name, bus) as link, running(machines, exchange=on_bus(bus), link=link) as found:
        yield found


@pytest.mark.parametrize("name", list(TRANSPORTS))
async def test_every_width_and_order_of_registers_is_read_and_written(name: str) -> None:
    points = list(registers())
    device = TableDevice(holding(points))
    async with linked(name, device, points) as line:
        await until(lambda: all(is_good(line.quality(one.name)) for one in points))
        for one in points:
            assert one.register is not None
            assert line.value(one.name) == VALUES[one.register.type][0], one.name
        for one in points:
            assert one.register is not None
            if not one.register.writable:
                with pytest.raises(LinkError, match="read only"):
                    await line.link.write("m", one.key, 1)
                continue
            value = VALUES[one.register.type][1]
            await line.link.write("m", one.key, value)
            first = one.register.address
            cells = device.tables["holding"]
            assert [cells[at] for at in range(first, first + one.register.words)] == encode(one.register, value)
        await until(
            lambda: all(
                line.value(one.name) == pytest.approx(VALUES[one.register.type][one.register.writable], rel=1e-12)
                for one in points
                if one.register
            )
        )


@pytest.mark.parametrize("function", [5, 15])
@pytest.mark.parametrize("name", list(TRANSPORTS))
async def test_coils_are_read_and_written_and_discrete_inputs_read(name: str, function: int) -> None:
    points = bits()
    device = TableDevice(holding(points), (1, 2, function))
    known = Device(timeout=0.4, fast=0.1, read_functions=(1, 2), write_functions=(function,))
    async with linked(name, device, points, known) as line:
        await until(lambda: all(is_good(line.quality(one.name)) for one in points))
        for n in range(20):
            assert (line.value(f"m.coil_{n}"), line.value(f"m.discrete_{n}")) == (n % 3 == 0, n % 2 == 0)
        assert line.link.words("m.coil_3") == (1,)
        for n in range(20):
            await line.link.write("m", f"coil_{n}", n % 3 != 0)
        assert device.tables["coil"] == {n: int(n % 3 != 0) for n in range(20)}
        assert {request.function for request in device.requests if request.words} == {function}
        await until(lambda: all(line.value(f"m.coil_{n}") == (n % 3 != 0) for n in range(20)))
        with pytest.raises(LinkError, match=r"m\.coil_1: .*takes 0 to 1, not 2"):
            await line.link.write("m", "coil_1", 2)
        with pytest.raises(LinkError, match="read only"):
            await line.link.write("m", "discrete_1", 1)
        reads = {(request.function, request.address, request.count) for request in device.requests if request.count}
        assert {(1, 0, 20), (2, 0, 20)} <= reads and all(one[0] in (1, 2) for one in reads), "no telegram of registers"


class Busy(TableDevice):
    """A device that counts in the low byte of its register, at every telegram that reaches it."""

    def write(self, function: int, address: int, words: Sequence[int]) -> None:
        self.count()
        super().write(function, address, words)

    def read(self, function: int, address: int, count: int) -> list[int]:
        words = super().read(function, address, count)
        self.count()
        return words

    def count(self) -> None:
        cells = self.tables["holding"]
        cells[5] = cells[5] & 0xFF00 | (cells[5] + 1) & 0xFF


@pytest.mark.parametrize("order", [Order.ABCD, Order.BADC])
@pytest.mark.parametrize("name", list(TRANSPORTS))
async def test_bits_of_a_register_that_the_device_changes_meanwhile_are_not_lost(name: str, order: Order) -> None:
    """Read, put together and written back they would be: function 22 leaves them to the device."""
    swapped = order is Order.BADC
    mask, shift = (0x0F, 4) if swapped else (0x0F, 12)  # the highest bits of the register either way
    points = [
        point("m", "mode", 5, type=Type.U16, mask=mask, shift=shift, order=order, writable=True),
        point("m", "blind", 6, type=Type.U16, mask=1, shift=3, readable=False, writable=True),
        point("m", "level", 7, writable=True),
    ]
    device = Busy({"holding": {5: 0x3000, 6: 0xFFF7, 7: 0}})
    known = Device(timeout=0.4, fast=0.1, write_functions=(6, 22))
    async with linked(name, device, points, known) as line:
        await until(lambda: line.value("m.mode") == 3)
        for value in (9, 0, 15):
            before, device.requests = device.tables["holding"][5] & 0xFF, []
            await line.link.write("m", "mode", value)
            told = [request.function for request in device.requests]
            assert told.count(22) == 1 and 6 not in told
            at = told.index(22)
            assert device.tables["holding"][5] >> 12 == value
            assert (device.tables["holding"][5] - before) % 0x100 >= at + 1, "it went on counting, and none was lost"
            await until(lambda value=value: line.value("m.mode") == value)
        await line.link.write("m", "blind", 1)
        assert device.tables["holding"][6] == 0xFFFF, "it needs no look at what is there"
        await line.link.write("m", "level", 4)
        assert device.tables["holding"][7] == 4 and device.requests[-1].function in (3, 6)


@pytest.mark.parametrize("name", list(TRANSPORTS))
async def test_a_coil_written_is_read_again_at_once(name: str) -> None:
    points = [point("m", "run", 5, Scan.ONCE, type=Type.BIT, table="coil", writable=True), point("m", "level", 5)]
    device = TableDevice({"coil": {5: 0}, "holding": {5: 7}})
    async with linked(name, device, points) as line:
        await until(lambda: line.value("m.run") == 0)
        await line.link.write("m", "run", 1, urgent=True)
        await until(lambda: line.value("m.run") == 1)
        device.tables["coil"][5] = 0
        await line.link.refresh("m", ["run"])
        assert line.value("m.run") == 0


@pytest.mark.parametrize("name", list(TRANSPORTS))
async def test_a_device_without_coils_has_all_the_rest(name: str) -> None:
    points = [*bits(), *(point("m", f"v{n}", n) for n in range(5))]
    device = TableDevice({**holding(bits()), "holding": {n: n for n in range(5)}}, (2, 3, 6))
    async with linked(name, device, points) as line:
        await until(lambda: is_good(line.quality("m.v4")) and is_good(line.quality("m.discrete_4")))
        await until(lambda: not is_good(line.quality("m.coil_0")) and line.value("m.coil_0") is None)
        with pytest.raises(DeviceException, match="illegal function"):
            await line.link.write("m", "coil_0", 1)
        assert line.link.up and all(is_good(line.quality(f"m.v{n}")) for n in range(5))


@pytest.mark.parametrize("name", list(TRANSPORTS))
async def test_coils_that_are_not_there_are_found_and_the_rest_lives(name: str) -> None:
    points = [one for one in bits(40) if one.key.startswith("coil")]
    device = TableDevice({"coil": {n: n % 2 for n in range(40) if n not in (7, 21)}})
    async with linked(name, device, points) as line:
        await until(lambda: is_good(line.quality("m.coil_0")) and is_good(line.quality("m.coil_39")))
        await until(lambda: line.quality("m.coil_7") & 0xFF == NOT_CONNECTED & 0xFF, 60)
        for n in range(40):
            assert line.value(f"m.coil_{n}") == (None if n in (7, 21) else n % 2)


async def test_a_device_that_takes_fewer_bits_is_read_with_fewer_and_with_as_many_registers_as_before() -> None:
    points = [one for one in bits(100) if one.key.startswith("coil")]
    points += [point("m", f"v{n}", n) for n in range(30)]
    device = TableDevice({"coil": {n: n % 2 for n in range(100)}, "holding": {n: n for n in range(30)}})
    device.bit_limit = 16
    async with linked("memory", device, points) as line:
        await until(lambda: all(is_good(line.quality(one.name)) for one in points), 60)
        await asyncio.sleep(1)
        device.requests.clear()
        await asyncio.sleep(0.5)
        reads = {(request.function, request.count) for request in device.requests if request.count}
        assert max(count for function, count in reads if function == 1) <= 16
        assert max(count for function, count in reads if function == 3) == 30
        (station,) = line.link.stations.values()
        assert station.learned.limit == 125 and station.learned.bit_limit <= 16


@pytest.mark.parametrize("name", list(TRANSPORTS))
async def test_two_thousand_coils_are_one_telegram(name: str) -> None:
    points = [one for one in bits(2001) if one.key.startswith("coil")]
    device = TableDevice({"coil": {n: n % 7 == 0 for n in range(2001)}})
    async with linked(name, device, points) as line:
        await until(lambda: all(is_good(line.quality(one.name)) for one in points))
        assert [line.value(f"m.coil_{n}") for n in range(2001)] == [n % 7 == 0 for n in range(2001)]
        (station,) = line.link.stations.values()
        assert sorted(block.block.count for block in station.blocks) in ([1, 2000], [1000, 1001])


@pytest.mark.parametrize("name", list(TRANSPORTS))
async def test_most_bits_of_a_telegram_are_those_of_the_protocol(name: str) -> None:
    device = TableDevice({"coil": {n: n % 5 == 0 for n in range(4000)}})
    async with linked(name, device, bits(1)[:1]) as line:
        link: RegisterLink = line.link
        await until(lambda: is_good(line.quality("m.coil_0")))
        assert await link.raw_read(1, 1, 2000, 1) == [n % 5 == 0 for n in range(1, 2001)]
        with pytest.raises(LinkError):
            await link.raw_read(1, 0, 2001, 1)
        assert await link.raw_read(1, 0, 1, 1) == [1]


@pytest.mark.parametrize("count", [1, 8, 9, 1968])
@pytest.mark.parametrize("name", list(TRANSPORTS))
async def test_several_coils_are_written_in_one_telegram_and_no_other_with_them(name: str, count: int) -> None:
    device = TableDevice({"coil": dict.fromkeys(range(2000), 0)})
    bus = Bus({1: device})
    async with wired(name, bus) as link:
        transport = TRANSPORTS[name](link, on_bus(bus))
        await transport.connect()
        await transport.write(1, 7, [1] * count, 5.0, 15)
        assert device.tables["coil"] == {n: int(7 <= n < 7 + count) for n in range(2000)}
        await transport.write(1, 7, [0], 5.0, 5)
        assert await transport.read(1, Block(6, 3, 1), 5.0) == [0, 0, int(count > 1)]
        with pytest.raises(BadAnswer, match="no telegram"):
            await transport.write(1, 0, [1] * 1969, 5.0, 15)
        with pytest.raises(DeviceException):
            await transport.write(1, 1999, [1, 1], 5.0, 15)
        await transport.close()


@pytest.mark.parametrize(
    ("answer", "error"),
    [
        (lambda pdu: bytes((1, 2, 0xFF, 0xFF)), BadAnswer),
        (lambda pdu: bytes((1, 0)), BadAnswer),
        (lambda pdu: bytes((2, 1, 0xFF)), BadAnswer),
        (lambda pdu: bytes((0x81, 2)), DeviceException),
    ],
)
async def test_a_wrong_answer_to_a_read_of_bits_is_no_value(
    answer: Callable[[bytes], bytes], error: type[LinkError]
) -> None:
    async def exchange(unit: int, pdu: bytes) -> bytes:
        return answer(pdu)

    transport = TRANSPORTS["memory"](Link("hall", "memory"), exchange)
    await transport.connect()
    with pytest.raises(error):
        await transport.read(1, Block(0, 5, 1), 1.0)


def shared(first: list[Point], second: list[Point], base: int, known: Device) -> list[Equipment]:
    """Two machines of one type behind unit 1, the second with the registers of its own base."""
    return [machine("m", 1, first, known), replace(machine("n", 1, second, known), base=base)]


async def test_two_machines_behind_one_unit_are_read_by_themselves_and_their_holes_go_with_them() -> None:
    known = replace(ALL, holes=((2, 8),), write_only=((20, 20),))
    both = [[point(name, f"v{n}", base + n) for n in (0, 1, 9)] for name, base in (("m", 0), ("n", 5), ("n", 100))]
    for base, points in ((5, both[1]), (100, both[2])):
        device = TableDevice({"holding": {n: n for n in range(200)}})
        async with running(shared(both[0], points, base, known), exchange=on_bus(Bus({1: device}))) as line:
            await until(lambda line=line: is_good(line.quality("m.v9")) and is_good(line.quality("n.v9")))
            assert [line.value(f"{name}.v{n}") for name in "mn" for n in (0, 1, 9)] == [
                0,
                1,
                9,
                *(base + n for n in (0, 1, 9)),
            ]
            blocks = {(block.block.address, block.block.count) for block in line.link.stations[1].blocks}
        assert blocks == {(0, 2), (9, 1), (base, 2), (base + 9, 1)}


async def test_a_stop_takes_no_write_to_another_machine_of_its_unit_out_of_the_queue() -> None:
    device = TableDevice({"holding": {n: 0 for n in range(200)}})
    points = [
        [point(name, "run", base, writable=True), point(name, "speed", base + 1, writable=True)]
        for name, base in (("m", 0), ("n", 100))
    ]
    async with running(shared(*points, 100, ALL), exchange=on_bus(Bus({1: device}, turnaround=0.02))) as line:
        await until(lambda: is_good(line.quality("m.run")) and is_good(line.quality("n.run")))
        writes = [asyncio.create_task(line.link.write(name, key, 5)) for key in ("run", "speed") for name in "mn"]
        await asyncio.sleep(0)
        await asyncio.gather(line.link.write("m", "run", 0, urgent=True), *writes, return_exceptions=True)
        assert not isinstance(writes[1].exception() or writes[3].exception(), LinkError), "those to n were sent"
        assert isinstance(writes[2].exception(), Overtaken)
        assert (device.tables["holding"][100], device.tables["holding"][101], device.tables["holding"][1]) == (5, 5, 0)
