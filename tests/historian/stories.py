"""What machines may tell, made of a seed: products and runs in any order, with gaps, power cycles and rings that begin again."""

import random
from collections.abc import Iterator
from dataclasses import dataclass

from tests.historian.rings import BEGIN, SECOND, Event, Ring
from tests.historian.sequence_rings import Device


@dataclass(frozen=True, slots=True)
class Portion:
    """What a link hands over at once."""

    events: tuple[Event, ...]
    lost: int = 0


def products(seed: int, rounds: int, begin: int = BEGIN) -> Iterator[Portion]:
    """A line with several products on it at a time; everything that its ring can tell of them, likely or not."""
    source = random.Random(seed)
    ring = Ring(time=begin)
    on_line: list[int] = []
    number = source.choice([0, 40_000, 70_000])
    for _ in range(rounds):
        kind = source.random()
        if kind < 0.25 or not on_line:
            number += 1
            on_line.append(number)
            ring.tell(source.choice([1, 1, 1, 1, 8]), number, source=1, value=100.0, other=source.choice([0.0, 25.5]))
        elif kind < 0.3:
            ring.tell(2, source.choice(on_line), source=1, value=source.uniform(10, 60))
        elif kind < 0.65:
            one = source.choice(on_line)
            ring.tell(
                source.choice([3, 3, 4, 10]),
                one,
                source=source.randrange(1, 5),
                value=source.choice([source.gauss(0, 3), source.gauss(0, 1), float("nan")]),
                after=source.choice([0.0, 0.3, 1.0]),
            )
        elif kind < 0.72:
            rear, front = source.choice(on_line), source.choice([*on_line, 0, number + 5])
            ring.tell(source.choice([20, 21]), rear, second=front, value=4.5, other=6.0)
        elif kind < 0.9:
            one = on_line.pop(source.choice([0, 0, 0, -1]))
            ring.tell(source.choice([5, 5, 5, 5, 6, 11, 15, 16]), one, source=source.choice([0, 2]), value=12.0)
            if source.random() < 0.3:
                late = source.choice([0.5, 59.0, 61.0, 120.0])
                ring.tell(source.choice([3, 5, 6, 11, 12, 7]), one, source=source.choice([0, 3]), value=1.5, after=late)
        elif kind < 0.93:
            ring.tell(source.choice([12, 13, 14, 99]), source.choice([0, number + 3, *on_line]), source=3, value=2.0)
        elif kind < 0.95:
            ring.tell(7, source.choice(on_line), value=140.0, other=source.choice([28.0, 0.0, float("nan")]))
        elif kind < 0.97:
            ring.tell(source.choice([9, 22, 23, 24, 30, 37, 40]), source.choice([0, *on_line]), value=3.0)
        elif kind < 0.98:
            ring.boot += 1
            ring.tell(34, value=ring.boot, after=30.0)
        elif kind < 0.985:  # it lost what it retains
            ring = Ring(time=ring.time + 90 * SECOND, boot=ring.boot + 1)
            ring.tell(source.choice([34, 1, 5]), source.choice([0, 1, *on_line]), value=1.0)
        if source.random() < 0.35:
            yield _portion(ring, source)
    yield Portion(tuple(ring.drain()))


def runs(seed: int, rounds: int, begin: int = BEGIN) -> Iterator[Portion]:
    """Runs of a sequence of three steps, as the block itself tells them, with what a person and a fault do to it."""
    source = random.Random(seed)
    device = Device(time=begin, dt=0.1)
    for _ in range(rounds):
        if source.random() < 0.25:
            device.tell(device.block.force(source.randrange(1, 4), 3, source.choice([1.0, 5.0, 60.0]), device.time))
        device.start()
        device.scan(source.randrange(0, 14))
        if source.random() < 0.35:
            device.scan(source.randrange(1, 9), suspend=True)
        if source.random() < 0.15:
            device.lose(source.randrange(1, 4), 3, 59.5)
            device.scan(source.randrange(0, 3))
            device.give()
            device.scan(source.randrange(0, 3))
        kind = source.random()
        if kind < 0.25:
            device.lose(source.randrange(0, 4), source.choice([0, 3]), 61.5)
        elif kind < 0.32:
            device.power_cycle()
        elif kind < 0.4:
            device.scan(abort_request=True)
        elif kind < 0.43:
            device.scan(source.randrange(1, 9), suspend=True)
            device.put(source.choice([1, 3, 4, 7, 14, 17, 19]), source.randrange(0, 4), 1.5)
        elif kind < 0.45:
            device = Device(time=device.time + 90 * SECOND, dt=0.1, boot=device.boot + 1)
            if source.random() < 0.5:
                device.put(18, value=1)
        if source.random() < 0.9:
            while device.block.running:
                device.scan()
        device.give()
        device.scan(2)
        if source.random() < 0.3 and (release := device.block.forces.release(source.randrange(1, 4), 3)):
            device.tell(release)
        told = device.drain()
        while told:
            cut = source.randrange(1, len(told) + 1)
            part, told = told[:cut], told[cut:]
            if source.random() < 0.06:
                yield Portion(tuple(part[1:]), 1) if len(part) > 1 else Portion((), 1)
            else:
                yield Portion(tuple(part))


def _portion(ring: Ring, source: random.Random) -> Portion:
    told = ring.drain()
    if told and source.random() < 0.08:
        gone = source.randrange(1, len(told) + 1)
        return Portion(tuple(told[gone:]), gone)
    return Portion(tuple(told))


def interrupted(begin: int = BEGIN) -> tuple[Portion, Portion]:
    """A run with a force, a permissive of the next step missing, suspended; and what comes after, which that permissive ends."""
    device = Device(time=begin, dt=0.1)
    device.tell(device.block.force(1, 3, 600.0, device.time))
    device.run()
    device.start()
    device.scan(7)
    device.lose(3, 3, 61.5)
    device.scan(2)
    device.scan(3, suspend=True)
    before = Portion(tuple(device.drain()))
    while device.block.running:
        device.scan()
    device.give()
    device.run()
    return before, Portion(tuple(device.drain()))
