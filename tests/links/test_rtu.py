"""The serial line: its time, its silences, its late answers, and what happens when it goes away."""

import asyncio

import pytest

from app.errors import BadAnswer, DeviceException, LinkError, NoAnswer, NotConnected
from app.links.contract import Block, LateAnswerDue
from app.links.rtu import RtuTransport
from app.plant.definitions import Device, Scan
from app.registers.rtu import build_frame, read_time, silence
from app.sim.bus import Bus, LineFaultMode
from app.tags.quality import is_good
from tests.links.devices import RegisterDevice, machine, point, row, running, until
from tests.links.serial_slaves import bad_slave, opened, paced, rtu
from tests.wires import serve_line

EVERYWHERE = tuple(range(1, 125))
"""Cuts of a block of single words."""


def block(address: int, count: int) -> Block:
    return Block(address, count, cuts=EVERYWHERE[: count - 1])


# ---- time -------------------------------------------------------------------------------------------------


async def best_rate(transport: RtuTransport, count: int, polls: int, enough: float) -> float:
    """Polls per second of the best of some tries, until one is `enough`: other programs share this computer."""
    best = 0.0
    for _ in range(12):
        began = asyncio.get_running_loop().time()
        for _ in range(polls):
            await transport.read(1, Block(0, count), 0.5)
        best = max(best, polls / (asyncio.get_running_loop().time() - began))
        if best >= enough:
            break
    return best


async def test_a_line_of_9600_baud_carries_95_percent_of_what_arithmetic_allows() -> None:
    async with (
        paced(Bus({1: RegisterDevice({n: n for n in range(25)})}), 9600) as line,
        opened(rtu(line.path, 9600)) as t,
    ):
        limit = 1 / read_time(9600, 25)
        assert round(limit, 1) == 12.5
        assert 0.95 * limit <= await best_rate(t, 25, 12, 0.95 * limit) <= limit * 1.001


async def test_a_faster_line_is_as_fast_as_its_milliseconds_allow() -> None:
    async with (
        paced(Bus({1: RegisterDevice({n: n for n in range(25)})}), 38400) as line,
        opened(rtu(line.path, 38400)) as t,
    ):
        limit = 1 / read_time(38400, 25)
        assert 0.85 * limit <= await best_rate(t, 25, 25, 0.85 * limit) <= limit * 1.001


@pytest.mark.parametrize("baud", [9600, 115200])
async def test_the_line_is_silent_before_every_telegram(baud: int) -> None:
    async with bad_slave() as slave, opened(rtu(slave.path, baud)) as t:
        for _ in range(20):
            await t.read(1, Block(0, 3), 0.5)
        assert len(slave.gaps) >= 19
        assert min(slave.gaps) >= silence(baud) * 0.98


async def test_time_on_the_wire_is_not_taken_from_the_patience_of_the_device() -> None:
    async with (
        paced(Bus({1: RegisterDevice({n: n for n in range(25)})}), 1200) as line,
        opened(rtu(line.path, 1200)) as t,
    ):
        assert len(await t.read(1, Block(0, 25), 0.05)) == 25, "642 ms on the wire, 50 ms for the device"
        began = asyncio.get_running_loop().time()
        with pytest.raises(NoAnswer):
            await t.read(9, Block(0, 25), 0.05)
        assert 0.6 < asyncio.get_running_loop().time() - began < 0.85


# ---- answers that come late --------------------------------------------------------------------------------


@pytest.mark.sweep(8)
@pytest.mark.slow
@pytest.mark.parametrize(
    ("in_order", "wanted"),
    [
        pytest.param(False, 10_000, id="in any order"),
        pytest.param(True, 3000, id="one after another"),
    ],
)
async def test_thousands_of_telegrams_to_a_slave_that_answers_seconds_late_without_one_wrong_value(
    in_order: bool, wanted: int
) -> None:
    right, failed, owed = 0, 0, 0
    async with bad_slave(seed=7) as slave, opened(rtu(slave.path)) as t:
        slave.late, slave.deaf, slave.damaged, slave.in_order = 0.03, 0.001, 0.001, in_order
        slave.latest = 0.4 if in_order else 4.0
        sizes = (60, 25, 25, 25, 10, 3)
        while slave.number < wanted:
            unit = slave.random.randint(1, 8)
            before = slave.number
            try:
                if slave.random.random() < 0.1:
                    await t.write(unit, 0x2000, [slave.random.choice((1, 3, 3, 3))], 0.01)
                    assert slave.number > before, "confirmed without having been heard"
                    right += 1
                    continue
                asked = block(100 * unit, slave.random.choice(sizes))
                words = await t.read(unit, asked, 0.01)
            except LateAnswerDue:
                owed += 1
                await asyncio.sleep(0.002)
                continue
            except LinkError:
                failed += 1
                continue
            numbers = {slave.number_of(word, asked.address + at) for at, word in enumerate(words)}
            assert before < min(numbers) <= max(numbers) <= slave.number, "an answer to an earlier request"
            assert words == [
                slave.word(asked.address + at, n)
                for at, n in enumerate(slave.number_of(word, asked.address + at) for at, word in enumerate(words))
            ]
            right += 1
        assert slave.lates > wanted * 0.02 and t.counts.late > slave.lates * 0.5
        assert right > 0.6 * wanted, (right, failed, owed)


async def test_a_read_goes_on_in_another_shape_while_its_answer_may_still_come() -> None:
    async with bad_slave() as slave, opened(rtu(slave.path)) as t:
        slave.dumb = 1.0
        with pytest.raises(NoAnswer):
            await t.read(1, block(0, 25), 0.02)
        slave.dumb = 0.0
        before = slave.number
        words = await t.read(1, block(0, 25), 0.1)
        assert slave.number - before == 2, "two telegrams of other lengths"
        assert len(words) == 25
        assert len(await t.read(2, block(0, 25), 0.1)) == 25
        assert slave.number - before == 3, "another unit owes nothing"


async def test_a_value_of_two_words_is_never_put_together_from_two_telegrams() -> None:
    async with bad_slave() as slave, opened(rtu(slave.path)) as t:
        slave.dumb = 1.0
        with pytest.raises(NoAnswer):
            await t.read(1, Block(0, 4, cuts=(2,)), 0.02)
        slave.dumb = 0.0
        words = await t.read(1, Block(0, 4, cuts=(2,)), 0.1)
        assert slave.number_of(words[0], 0) == slave.number_of(words[1], 1)
        assert slave.number_of(words[2], 2) == slave.number_of(words[3], 3)
        slave.dumb = 1.0
        with pytest.raises(NoAnswer):
            await t.read(1, Block(0, 2), 0.02)
        slave.dumb = 0.0
        sent = slave.number
        with pytest.raises(LateAnswerDue) as waits:
            await t.read(1, Block(8, 2), 0.1)
        assert 9 < waits.value.wait <= 10 and slave.number == sent, "nothing is sent"


async def test_one_register_is_asked_for_together_with_neighbours_that_are_known_to_answer() -> None:
    async with bad_slave() as slave, opened(rtu(slave.path)) as t:
        await t.read(1, Block(100, 10), 0.1)
        slave.dumb = 1.0
        with pytest.raises(NoAnswer):
            await t.read(1, Block(109, 1), 0.02)
        slave.dumb = 0.0
        assert await t.read(1, Block(109, 1), 0.1) == [slave.word(109)]


async def test_a_repeated_write_is_confirmed_only_by_its_own_echo() -> None:
    async with bad_slave() as slave, opened(rtu(slave.path)) as t:
        slave.late, slave.latest = 1.0, 0.0
        slave.random.uniform = lambda low, high: 0.15  # type: ignore[method-assign, assignment]
        with pytest.raises(NoAnswer):
            await t.write(1, 0x2000, [3], 0.05)
        slave.late, slave.deaf = 0.0, 1.0
        with pytest.raises(NoAnswer):
            await t.write(1, 0x2000, [3], 0.3)
        assert t.counts.late == 1, "the echo of the first came and is not that of the second"
        slave.deaf = 0.0
        with pytest.raises(NoAnswer):
            await t.write(1, 0x2000, [3], 0.05)  # one echo for two requests: whose is it?
        assert [request.words for _, request in slave.writes] == [(3,), (3,)]


async def test_a_lasting_refusal_is_not_believed_while_an_earlier_request_may_have_been_refused() -> None:
    device = RegisterDevice({n: n for n in range(50)})
    async with paced(Bus({1: device}), 115200) as line, opened(rtu(line.path)) as t:
        with pytest.raises(DeviceException):
            await t.read(1, Block(100, 2), 0.1)
        device.line_fault.mode, device.line_fault.count = LineFaultMode.SILENT, 1
        with pytest.raises(NoAnswer):
            await t.read(1, Block(0, 5), 0.05)
        with pytest.raises(BadAnswer, match="refused this request or an earlier one"):
            await t.read(1, Block(100, 2), 0.1)


# ---- what else a wire does ----------------------------------------------------------------------------------


async def test_a_damaged_answer_is_told_at_once_and_counted() -> None:
    async with bad_slave() as slave, opened(rtu(slave.path)) as t:
        slave.damaged = 1.0
        began = asyncio.get_running_loop().time()
        with pytest.raises(BadAnswer, match="check sum"):
            await t.read(1, Block(0, 10), 2.0)
        assert asyncio.get_running_loop().time() - began < 0.3
        assert t.counts.damaged == 1


async def test_clicks_of_the_driver_before_an_answer_do_not_matter() -> None:
    async with bad_slave() as slave, opened(rtu(slave.path)) as t:
        plain = slave.say
        slave.say = lambda data: plain(b"\x00" + data)  # type: ignore[method-assign]
        for _ in range(5):
            assert len(await t.read(1, Block(0, 10), 0.2)) == 10


async def test_an_answer_in_pieces_is_one_answer() -> None:
    async with bad_slave() as slave, opened(rtu(slave.path)) as t:
        plain, loop = slave.say, asyncio.get_running_loop()

        def in_pieces(data: bytes) -> None:
            plain(data[:4])
            loop.call_later(0.01, plain, data[4:9])
            loop.call_later(0.02, plain, data[9:])

        slave.say = in_pieces  # type: ignore[method-assign]
        assert len(await t.read(1, Block(0, 10), 0.1)) == 10


async def test_an_adapter_that_hears_itself_does_not_confirm_its_own_writes() -> None:
    async with bad_slave() as slave, opened(rtu(slave.path)) as t:
        slave.echo = True
        for address in (0x1000, 0x0200, 0x0000):
            assert await t.read(1, Block(address, 4), 0.2) == [slave.word(address + at) for at in range(4)]
        await t.write(1, 0x2000, [1], 0.2)
        slave.dumb = 1.0
        with pytest.raises(NoAnswer):
            await t.write(1, 0x2000, [2], 0.1)


async def test_a_line_that_is_never_silent_is_told() -> None:
    async with bad_slave() as slave, opened(rtu(slave.path)) as t:

        async def talk() -> None:
            while True:
                slave.say(b"\x55\x55")
                await asyncio.sleep(0.001)

        talking = asyncio.create_task(talk())
        await asyncio.sleep(0.02)
        with pytest.raises(NoAnswer, match="never silent"):
            await t.read(1, Block(0, 1), 0.1)
        talking.cancel()
        await asyncio.gather(talking, return_exceptions=True)


async def test_nobody_is_commanded_by_broadcast() -> None:
    async with bad_slave() as slave, opened(rtu(slave.path)) as t:
        with pytest.raises(BadAnswer, match="broadcast"):
            await t.write(0, 0x2000, [1], 0.1)
        assert slave.number == 0


async def test_a_stranger_talking_between_two_telegrams_is_not_heard() -> None:
    async with bad_slave() as slave, opened(rtu(slave.path)) as t:
        slave.say(build_frame(1, bytes((3, 2, 0xDE, 0xAD))))
        await asyncio.sleep(0.01)
        assert await t.read(1, Block(0, 1), 0.2) == [slave.word(0)]


async def test_a_cable_that_is_pulled_fails_the_request_on_its_way_at_once() -> None:
    loop, device = asyncio.get_running_loop(), RegisterDevice({0: 1})
    device.line_fault.mode = LineFaultMode.SILENT
    line = await serve_line(Bus({1: device}), 115200)
    async with opened(rtu(line.path)) as t:
        reading = asyncio.create_task(t.read(1, Block(0, 1), 10.0))
        await asyncio.sleep(0.05)
        began = loop.time()
        await line.close()
        with pytest.raises(NotConnected, match="gone"):
            await reading
        assert loop.time() == began
        assert not t.connected


# ---- several units, writes ----------------------------------------------------------------------------------


async def test_a_dead_unit_on_the_line_does_not_slow_the_others() -> None:
    device = Device(timeout=0.1, fast=0.01)
    bus = Bus({1: RegisterDevice({n: n for n in range(25)}), 2: RegisterDevice({n: n for n in range(25)})})

    async def scans(line: str, units: tuple[int, ...]) -> int:
        machines = [row(f"m{unit}", unit, 25, device) for unit in units]
        async with running(machines, link=rtu(line, 38400)) as hall:
            await until(lambda: is_good(hall.quality("m1.v0")))
            await asyncio.sleep(0.5)
            dead = hall.link.stations[9] if 9 in units else None
            if dead is not None:
                await until(lambda: hall.link.statistics.units[9].state == 3)
            before = hall.link.statistics.fast_scans
            await asyncio.sleep(3.0)
            return hall.link.statistics.fast_scans - before

    async with paced(bus, 38400) as line:
        alone = await scans(line.path, (1,))
        beside = await scans(line.path, (1, 9))
    assert alone > 100
    assert beside > 0.9 * alone


async def test_a_write_waits_for_the_telegram_on_the_wire_and_no_longer() -> None:
    devices = {n: RegisterDevice({n: n for n in range(60)}) for n in (1, 2, 3)}
    heard = devices[1].requests
    for device in devices.values():
        device.requests = heard
    async with paced(Bus(devices), 19200) as line:
        machines = [
            machine(
                f"m{n}",
                n,
                [point(f"m{n}", f"v{at}", at, Scan.FAST, writable=True) for at in range(60)],
                Device(fast=0.01),
            )
            for n in (1, 2, 3)
        ]
        async with running(machines, link=rtu(line.path, 19200)) as hall:
            await until(lambda: all(is_good(hall.quality(f"m{n}.v0")) for n in (1, 2, 3)))
            await asyncio.sleep(0.3)
            for n in range(30):
                await asyncio.sleep(0.017)
                before = len(heard)
                await hall.link.write("m1", "v5", n)
                first = next(at for at, request in enumerate(heard[before:]) if request.words)
                assert first <= 1, "the line is full: one poll may be on the wire already"
            assert len(heard) > 60
