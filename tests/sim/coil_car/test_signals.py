"""What a sequence reads of the car is what a host reads."""

import math

import pytest

from app.sim.coil_car.register_map import (
    REGISTERS,
    SIGNALS,
)
from tests.sim.coil_car.bench import line, run, value


def test_what_a_sequence_reads_is_what_a_host_reads() -> None:
    car, talker = line(coil=True)
    talker.hold(1)
    run(car, 0.3)
    for name in SIGNALS:
        mine, theirs = float(car.signal(name)), value(car, name)
        assert (math.isnan(mine) and math.isnan(theirs)) or mine == pytest.approx(theirs, rel=1e-6), name
    assert value(car, "horizontal_speed") > 0 and value(car, "moving") == 1


def test_no_two_values_share_a_place() -> None:
    taken: dict[tuple[int, int], str] = {}
    for name, place in REGISTERS.items():
        for word in range(1 if place.type == "u16" else 2):
            bits = range(16) if not place.mask else (place.shift,)
            for bit in bits:
                key = (place.address + word, bit)
                assert key not in taken, (name, taken.get(key))
                taken[key] = name
