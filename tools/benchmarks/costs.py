"""What one of each costs: a step of a virtual drive, an alarm, a value decoded, a frame encoded."""

import time
from collections.abc import Callable
from pathlib import Path
from struct import Struct
from tempfile import TemporaryDirectory

import orjson

from app.alarms.engine import AlarmEngine
from app.clock import ManualClock
from app.db import Database
from app.links.contract import Block
from app.links.planner import Reading
from app.links.scan_block import ScanBlock
from app.live.frames import Live
from app.plant.definitions import Alarm, Device, Equipment, EquipmentType, Plant, Point, Register, Scan
from app.plant.texts import Texts
from app.registers.codec import decoder, encode
from app.sim.eura_e800.drive import VirtualE800
from app.tags.batch import Batch
from app.tags.database import Tag, TagDatabase
from benchmarks.common import Row

ALARMS = 2000
BLOCK = 125


def _cost(work: Callable[[], object], at_least: float = 0.4) -> float:
    """CPU time of one call [s], the best of three."""
    best = float("inf")
    for _ in range(3):
        calls, began = 0, time.process_time()
        while time.process_time() - began < at_least:
            for _ in range(20):
                work()
            calls += 20
        best = min(best, (time.process_time() - began) / calls)
    return best


def _drive() -> list[Row]:
    drive = VirtualE800(seed=1, start="forward", parameters={"F113": 40.0})
    for _ in range(1000):
        drive.step()
    step = _cost(drive.step)
    share = 30 * step / drive.dt
    return [
        Row(
            "one step of a virtual drive; 30 drives in one process",
            f"{1e6 * step:.0f} µs; {100 * share:.0f} % of a core",
            note=f"{1 / drive.dt:.0f} steps a second each",
        )
    ]


def _alarms() -> list[Row]:
    points = {f"v{n}": Point(f"d.v{n}", f"d.v{n}", "d", f"v{n}", f"v{n}") for n in range(ALARMS)}
    alarms = tuple(
        Alarm(f"high{n}", "alarm.high", f"v{n} > 100 and v0 < 1000", 3, value=f"v{n}") for n in range(ALARMS)
    )
    kind = EquipmentType("bench", Path(), "type", Device(), points, {}, (), (), {}, alarms, {})
    plant = Plant(Path(), {}, "UTC", ("en",), {}, {}, {"d": Equipment("d", kind, "l", 1, {}, "", points, alarms)}, {})
    clock = ManualClock()
    tags = TagDatabase(clock)
    tags.configure(Tag(point.name, point.id, "link.l") for point in points.values())
    with TemporaryDirectory() as folder:
        database = Database(Path(folder) / "pogon.db", "pogon")
        database.migrate()
        engine = AlarmEngine(tags, clock, database, Texts.read(), b"k" * 32)
        engine.configure(plant, Texts.read())
        handles, values = list(range(ALARMS)), [1.0] * ALARMS
        batch = Batch("link.l", 0, clock.micros(), clock.micros(), handles, values)
        tags.publish(batch)
        each = _cost(lambda: engine.evaluation.take(batch)) / ALARMS
        numbers, limit = values, 100.0
        bare = _cost(lambda: [value > limit and numbers[0] < 1000 for value in numbers]) / ALARMS
        database.close()
    return [
        Row(
            "alarm evaluation of 2 000 alarms whose inputs all changed",
            f"{1e3 * each * ALARMS:.2f} ms, {1e6 * each:.2f} µs each",
            bare=f"{1e6 * bare:.2f} µs, the comparisons in a list",
            ratio=each / bare,
            note="two comparisons each, with quality and delays",
        )
    ]


def _values() -> list[Row]:
    registers = [Register(n, scale=0.1) for n in range(BLOCK)]
    words = list(range(1000, 1000 + BLOCK))
    decoders = [(decoder(register), [word]) for register, word in zip(registers, words, strict=True)]
    unpack, packed = Struct(f">{BLOCK}H").unpack, Struct(f">{BLOCK}H").pack(*words)
    bare = _cost(lambda: unpack(packed)) / BLOCK
    single = _cost(lambda: [decode(raw) for decode, raw in decoders]) / BLOCK
    points = tuple(
        Point(f"d.v{n}", f"d.v{n}", "d", f"v{n}", f"v{n}", register=register) for n, register in enumerate(registers)
    )
    block = ScanBlock("link.l", 0, 1, Reading(Block(0, BLOCK), Scan.FAST, points), 0.1)
    block.bind({point.name: n for n, point in enumerate(points)}, 1)
    other = [word + 1 for word in words]
    flip = [words, other]

    def seen() -> None:
        flip.reverse()
        block.seen(list(flip[0]), 0, 0)

    scanned = _cost(seen) / BLOCK
    encoded = _cost(lambda: [encode(register, 100.0) for register in registers]) / BLOCK
    clock = ManualClock()
    tags = TagDatabase(clock)
    tags.configure(Tag(point.name, point.id, "link.l") for point in points)
    tags.publish(Batch("link.l", 0, 1, 1, list(range(BLOCK)), [word / 10 for word in words]))
    live = Live(tags, clock)
    page = live.join("page", [point.name for point in points[:50]]).page
    frame = _cost(page.full_frame)
    frame_bare = _cost(lambda: orjson.dumps([(n, 100.1, 0) for n in range(50)]))
    return [
        Row(
            "decode one register: alone, and in a scanned block where all change",
            f"{1e6 * single:.2f} µs, {1e6 * scanned:.2f} µs",
            bare=f"{1e6 * bare:.3f} µs, struct.unpack of the block",
            ratio=scanned / bare,
        ),
        Row("encode one register for a write", f"{1e6 * encoded:.2f} µs"),
        Row(
            "encode a frame of 50 values, once for all browsers",
            f"{1e6 * frame:.1f} µs",
            bare=f"{1e6 * frame_bare:.1f} µs, orjson alone",
            ratio=frame / frame_bare,
        ),
    ]


async def measure() -> list[Row]:
    return _drive() + _alarms() + _values()
