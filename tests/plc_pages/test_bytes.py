"""Every row of docs/registers/ is what a virtual device sends: address, type, bit, unit, meaning, limits, codes."""

import math
import re
from collections.abc import Iterator
from functools import cache
from struct import pack, unpack
from zlib import crc32

import pytest

from app.clock import ManualClock
from app.errors import DeviceException
from app.registers.codec import decode
from app.sim.device import VirtualDevice
from app.sim.plant import SimPlant
from tests.links.conformance.servers import KINDS, data_of, demo
from tests.plc_pages.page import Page, read_page, text_of

ROUNDS, STEPS = 12, 500
"""Looks at every device, and the scans between two of them: a minute of a plant that works."""
DONE, REJECTED = 3, 4
OTHERWISE = ("stall_after",)
"""Settings that the demo plant gives another value: the definition of its sequence says 10 s."""
AT_LIMITS = {"coil_car": 0.99, "conveyor": 0.99, "crane": 0.5, "sequence": 0.99}
"""The part of all limits that the device takes as long as the other settings stay as they are."""
UNKNOWN, OUTSIDE = 1, 21


class Machine:
    """A virtual device and the page that says how to read it."""

    def __init__(self, plant: SimPlant, kind: str) -> None:
        self.page = read_page(kind)
        item = next(item for item in plant.equipment.values() if item.type.name == kind)
        self.device: VirtualDevice = plant.devices[item.id]
        self.plant = plant
        self.data = data_of(kind)
        self.last = 1000

    def read(self, address: int, count: int) -> list[int]:
        return self.device.read(3, address, count)

    def step(self, scans: int = 1) -> None:
        for _ in range(scans):
            for device in self.plant.devices.values():
                device.step()

    def ask(self, code: int, *arguments: int) -> tuple[int, int, int]:
        """State, reason and detail in the newest answer to a command."""
        self.last += 1
        words = [word for argument in (*arguments, 0, 0, 0, 0)[:4] for word in (argument >> 16, argument & 0xFFFF)]
        self.device.write(16, self.page.command_at, [code, 0, 0, *words, 0, 0, 0, 0, self.last])
        self.step()
        row = self.read(self.page.answers_at + 1, 8)
        assert row[0] == self.last
        return row[1], row[2], row[3]


@cache
def snapshots() -> dict[str, list[dict[int, int]]]:
    """Kind → every register that its page names, at several moments of a minute of work."""
    plant = SimPlant(demo(), ManualClock())
    machines = {kind: Machine(plant, kind) for kind in KINDS}
    found: dict[str, list[dict[int, int]]] = {kind: [] for kind in KINDS}
    for _ in range(ROUNDS):
        machines["crane"].step(STEPS)
        for kind, machine in machines.items():
            memory: dict[int, int] = {}
            for first, words in spans(machine):
                for at in range(first, first + words, 100):
                    count = min(100, first + words - at)
                    memory.update(enumerate(machine.read(at, count), at))
            found[kind].append(memory)
    return found


def spans(machine: Machine) -> Iterator[tuple[int, int]]:
    yield from machine.page.covered()
    page = machine.page
    capacity = machine.read(page.ring_at + 1, 1)[0]
    yield page.rows_at, capacity * page.row_words
    if page.hold_at:
        yield page.hold_at, 4
    for table in page.tables:
        yield table.address, 4 + machine.read(table.address + 1, 1)[0] * table.words


def words(memory: dict[int, int], at: int, count: int) -> list[int]:
    return [memory[at + n] for n in range(count)]


@pytest.mark.sweep(8)
@pytest.mark.parametrize("kind", KINDS)
def test_a_row_of_an_image_reads_as_the_product_reads_that_point(kind: str) -> None:
    """By the page's address, type and bit on the device's bytes, and by the product's own decoder: the same number, at every moment."""
    assert wrong_rows(read_page(kind), kind) == set()


def wrong_rows(page: Page, kind: str) -> set[str]:
    """Names of the rows of images and settings that are not what the device sends and the product reads."""
    points = data_of(kind).type.points
    areas = [*page.images, *([page.settings] if page.settings else [])]
    cells = [cell for area in areas for cell in area.cells]
    held = {key for key, point in points.items() if point.register and point.register.address >= 0x0100}
    wrong = {cell.name for cell in cells} ^ {key for key in held if not is_head(page, key)}
    for memory in snapshots()[kind]:
        for cell in cells:
            register = points[cell.name].register if cell.name in points else None
            if register is None or register.words != cell.words or cell.at + cell.words - 1 not in memory:
                wrong.add(cell.name)
                continue
            mine = cell.number(words(memory, cell.at, cell.words)) * cell.scale
            theirs = decode(register, words(memory, register.address, register.words))
            none = theirs is None and (math.isnan(mine) or mine == register.none)
            same = theirs is not None and mine == pytest.approx(theirs, rel=1e-6)
            if not (same or none) or (cell.choices and mine not in cell.choices):
                wrong.add(cell.name)
    return wrong


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("row", "instead", "name"),
    [
        ("| 0x012A | f32 | `line_speed`", "| 0x012C | f32 | `line_speed`", "line_speed"),
        ("| 0x0136 | i32 | `encoder_1`", "| 0x0136 | f32 | `encoder_1`", "encoder_1"),
        ("| 0x010A | u32 | `next_id`", "| 0x010A | u16 | `next_id`", "next_id"),
        ("| 0x0103 | u16 bit 1 | `moving`", "| 0x0103 | u16 bit 2 | `moving`", "moving"),
        (
            "| 0x0202 | 0x0240 | f32 | `automatic_speed`",
            "| 0x0204 | 0x0240 | f32 | `automatic_speed`",
            "automatic_speed",
        ),
        ("State: 0 stopped, 1 automatic, running, 2", "State: 0 stopped, 2", "state"),
        ("| 0x0108 | u16 | `products`", "| 0x0108 | u16 | `product_count`", "product_count"),
    ],
)
def test_a_page_that_says_something_else_is_found(row: str, instead: str, name: str) -> None:
    text = text_of("conveyor")
    assert row in text
    assert name in wrong_rows(read_page("conveyor", text.replace(row, instead)), "conveyor")


def is_head(page: Page, key: str) -> bool:
    """Whether `key` is a word of the head of a table, which the page tells in a sentence."""
    return any(
        key in (f"{table.name}_generation", f"{table.name}_capacity", f"{table.name}_count") for table in page.tables
    )


@pytest.mark.parametrize("kind", KINDS)
def test_images_are_whole_spare_words_are_0_and_numbers_are_numbers(kind: str) -> None:
    page = read_page(kind)
    for memory in snapshots()[kind]:
        for area in (*page.images, *([page.settings] if page.settings else [])):
            assert memory[area.address] == memory[area.address + area.words - 1] and memory[area.address] % 2 == 0
            for at in area.spare:
                assert memory[at] == 0, f"0x{at:04X}"
            for cell in area.cells:
                if cell.form == "f32":
                    value = cell.number(words(memory, cell.at, 2))
                    assert math.isnan(value) or value == 0 or 1e-12 < abs(value) < 1e9, (cell.name, value)


@pytest.mark.parametrize("kind", KINDS)
def test_the_page_says_where_the_settings_end(kind: str) -> None:
    """Behind the values lies a spare word: whose generation stood there had an image that was never whole."""
    page = read_page(kind)
    assert page.settings
    told = re.search(
        r"0x(\w{4}) generation, 0x(\w{4}) count \((\d+)\).*?(?:0x(\w{4})(?:–0x(\w{4}))? spare, 0, and )?0x(\w{4}) the generation again",
        text_of(kind),
    )
    assert told
    first, count, spare, last = (int(told[n], 16) for n in (1, 2, 4, 6))
    for memory in snapshots()[kind]:
        assert memory[first] == memory[last] and memory[count] == int(told[3]) and memory[spare] == 0
    assert (first, last) == (page.settings.address, page.settings.address + page.settings.words - 1)
    assert spare == max(cell.at for cell in page.settings.cells) + 2


@pytest.mark.sweep(8)
@pytest.mark.parametrize("kind", KINDS)
def test_the_minute_says_enough_to_judge(kind: str) -> None:
    """A row that is 0 in every look would also be right one word further: most are not."""
    page, looks = read_page(kind), snapshots()[kind]
    cells = [cell for area in page.images for cell in area.cells if cell.bit is None]
    cells = [
        cell for cell in cells if not cell.name.startswith("recipe_")
    ]  # the demo's sequence takes no values of a run
    seen = [cell.name for cell in cells if any(any(words(memory, cell.at, cell.words)) for memory in looks)]
    assert len(seen) > len(cells) / 3, sorted({cell.name for cell in cells} - set(seen))


@pytest.mark.parametrize("kind", KINDS)
def test_the_header_is_what_its_rows_say(kind: str) -> None:
    page, looks = read_page(kind), snapshots()[kind]
    assert sum(size for _, size in page.header.values()) == 32 and page.header["magic 0x5047"] == (0, 1)

    def long(memory: dict[int, int], content: str) -> int:
        at, size = page.header[content]
        return sum(memory[at + n] << 16 * (size - 1 - n) for n in range(size))

    first, last = looks[0], looks[-1]
    scans = (ROUNDS - 1) * STEPS
    assert (
        long(last, "magic 0x5047") == 0x5047
        and long(last, f"type {page.type_code}") == data_of(kind).type.device.plc.type_code
    )  # type: ignore[union-attr]
    assert (long(last, "map major 1"), long(last, "map minor 6")) == (1, 6)
    assert long(last, "bit 0 simulated") == 3
    assert long(last, "step number") - long(first, "step number") == scans
    assert long(last, "heartbeat out") - long(first, "heartbeat out") & 0xFFFF == scans
    assert long(last, "device time [µs]") - long(first, "device time [µs]") == scans * 10_000
    assert long(last, "check sum of the configuration") == long(first, "check sum of the configuration") != 0
    assert long(last, "boot count") >= 1 and long(last, "time quality") == 0


@pytest.mark.sweep(8)
@pytest.mark.parametrize("kind", KINDS)
def test_what_has_a_row_is_answered_and_what_has_none_is_refused(kind: str) -> None:
    """Every single register below the training registers."""
    plant = SimPlant(demo(), ManualClock())
    machine = Machine(plant, kind)
    machine.step(2)
    there = {at + n for at, count in spans(machine) for n in range(count)}
    for at in range(machine.page.training):
        try:
            machine.read(at, 1)
            answered = True
        except DeviceException as error:
            assert error.code == 2
            answered = False
        # a gap may answer 0 instead: a sequence takes a hold-to-run that nobody asks it for
        assert answered == (at in there) or (answered and machine.read(at, 1) == [0]), f"0x{at:04X}"
    assert machine.read(machine.page.training, 1) == [0x5047]


@pytest.mark.parametrize("kind", KINDS)
def test_rows_of_tables_and_of_the_ring_are_what_the_page_says(kind: str) -> None:
    page, columns = read_page(kind), data_of(kind).columns
    looks = snapshots()[kind]
    used = set()
    for memory in looks:
        for table in page.tables:
            assert memory[table.address] % 2 == 0 and memory[table.address + 3] == table.words
            for slot in range(memory[table.address + 2]):
                begin = table.address + 4 + slot * table.words
                row = words(memory, begin, table.words)
                assert row[2] == row[-1] and row[2] % 2 == 0
                assert all(row[at] == 0 for at in table.spare)
                if not row[0] << 16 | row[1]:
                    continue
                used.add(table.name)
                for cell in table.cells:
                    register = columns[table.name][cell.name].point.register
                    assert register
                    mine = cell.number(row[cell.at : cell.at + cell.words])
                    theirs = decode(register, row[cell.at : cell.at + cell.words])
                    assert theirs is None or mine * cell.scale == pytest.approx(theirs, rel=1e-6), cell.name
                    assert not cell.choices or mine in cell.choices, cell.name
        capacity, size = memory[page.ring_at + 1], memory[page.ring_at + 2]
        assert size == page.row_words
        oldest, newest = (memory[page.ring_at + n] << 16 | memory[page.ring_at + n + 1] for n in (3, 5))
        assert 1 <= newest - oldest + 1 <= capacity
        for sequence in range(oldest, newest + 1):
            row = words(memory, page.rows_at + sequence % capacity * size, size)
            assert row[0] << 16 | row[1] == sequence and row[6] in page.events
    assert used == {table.name for table in page.tables} - {"force", "fall"}


@pytest.mark.sweep(8)
@pytest.mark.parametrize("kind", KINDS)
def test_settings_have_their_defaults_and_their_limits(kind: str) -> None:
    """Each setting at both of its limits is taken, and beyond them refused as the one that it is."""
    machine = Machine(SimPlant(demo(), ManualClock()), kind)
    page, settings = machine.page, machine.page.settings
    assert settings
    cells, code = settings.cells, page.commands["commit"][0]
    machine.step()
    assert machine.read(settings.address + 1, 1) == [len(cells)]
    assert [cell.at for cell in cells] == [settings.address + 2 + 2 * n for n in range(len(cells))]
    start = machine.read(settings.address + 2, 2 * len(cells))

    def commit(staged: list[int]) -> tuple[int, int, int]:
        machine.device.write(16, cells[0].staged, staged)
        machine.step()
        return machine.ask(code, len(staged), crc32(pack(f">{len(staged)}H", *staged)))

    taken, asked = 0, 0
    for n, cell in enumerate(cells):
        for limit, step in ((cell.low, -1), (cell.high, 1)):
            if limit is None:
                continue
            beyond = commit([*start[: 2 * n], *cell.encoded(limit + step), *start[2 * n + 2 :]])
            assert beyond == (REJECTED, OUTSIDE, n + 1), cell.name
            asked += 1
            taken += commit([*start[: 2 * n], *cell.encoded(limit), *start[2 * n + 2 :]])[0] == DONE
    assert commit(start)[0] == DONE
    assert machine.read(settings.address + 2, len(start)) == start
    assert taken / asked > AT_LIMITS[kind], "what does not go with the other settings is refused, but most do"


@pytest.mark.parametrize("kind", KINDS)
def test_defaults_of_the_page_are_those_of_a_device_that_nobody_set(kind: str) -> None:
    memory, settings = snapshots()[kind][0], read_page(kind).settings
    assert settings
    for cell in settings.cells:
        if cell.name in OTHERWISE:
            continue
        value = cell.number(words(memory, cell.at, 2))
        assert value == pytest.approx(cell.default, rel=1e-6), cell.name


@pytest.mark.sweep(8)
@pytest.mark.parametrize("kind", KINDS)
def test_a_device_knows_the_commands_of_its_page_and_no_others(kind: str) -> None:
    machine = Machine(SimPlant(demo(), ManualClock()), kind)
    machine.step()
    known = {code for code, _ in machine.page.commands.values()}
    for code in (*range(1, 300), 0xFFFF):
        state, reason, _ = machine.ask(code)
        assert (reason == UNKNOWN) == (code not in known), code
        assert state != REJECTED or reason in machine.page.reasons, (code, reason)
    row = machine.read(machine.page.answers_at, machine.page.answers_words)
    assert row[0] == row[-1] and unpack(">H", pack(">H", row[1]))[0] == machine.last
