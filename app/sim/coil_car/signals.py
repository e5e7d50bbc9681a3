"""Every value of the coil car's map by name, as a sequence reads it and the images show it."""

from collections.abc import Callable, Mapping
from math import nan
from struct import pack
from types import MappingProxyType

from app.sim.coil_car.interlock import InterlockedCar
from app.sim.coil_car.machine import LOWERED, MEASURES, RISE, CoilCar, Geometry, Hit
from app.sim.coil_car.register_map import (
    BITS,
    CONFIGURATION_WORDS,
    COUNTS,
    GEOMETRY,
    MOVEMENTS,
    REALS,
    SADDLES,
    SETTINGS,
    STATUS_WORDS,
    WORDS,
    Block,
    Fault,
    Mode,
)


def name_signals(car: InterlockedCar) -> Mapping[str, Callable[[], float]]:
    """What a point's value is, by name."""
    c, m = car.geometry, car.machine
    getters: dict[str, Callable[[], float]] = {
        "automatic": lambda: car.mode is Mode.AUTOMATIC,
        "moving": lambda: car.moving,
        "winding": lambda: m.winding,
        "coil_on_mandrel": lambda: m.coil > 0,
        "coil_on_car": lambda: m.load > 0,
        "coil_ready": lambda: m.finished,
        "at_mandrel": lambda: car.is_at(c.mandrel_position),
        "at_saddle": lambda: any(car.is_at(c.saddle(n)) for n in (1, 2, 3)),
        "zone_mandrel": lambda: m.x < c.free_from,
        "zone_free": lambda: c.free_from <= m.x <= c.saddles_from,
        "zone_saddles": lambda: m.x > c.saddles_from,
        "target_free": car.can_lay,
        "host_silent": lambda: car.host_silent,
        **{f"limit_{name}": _limit(m, n) for n, name in enumerate(("left", "right", "up", "down"), 1)},
        "drive_horizontal": lambda: m.drive_ready(1),
        "drive_vertical": lambda: m.drive_ready(2),
        "pump": lambda: m.pump,
        **{f"guard_{n}": _guard(m, n) for n in (1, 2, 3)},
        "emergency_stop": lambda: m.emergency_stop,
        "held": lambda: car.fault is not Fault.NONE,
        "collision": lambda: m.hit is not Hit.NONE,
        "collision_possible": lambda: car.held_back in GEOMETRY,
        "coil_contact": lambda: m.contact,
        "lowered": lambda: m.v <= LOWERED,
        "at_target": lambda: car.is_at(c.saddle(car.target)),
        "at_out": lambda: car.is_at(c.out_position),
        "over_saddle": lambda: m.v >= c.saddle_height + c.clearance - RISE,
        "coil_laid": lambda: m.saddles[car.target - 1] > 0 and not m.load and m.v < c.saddle_height,
        "pressure_ok": lambda: m.pressure >= car.values["least_pressure"],
        "oil_ok": lambda: m.oil >= car.values["least_oil_temperature"],
        "drives_ok": lambda: m.drive_ready(1) and m.drive_ready(2),
        "guards_closed": lambda: m.guard(1) and m.guard(2) and m.guard(3),
        "limits_plausible": lambda: all(car.interlock.plausible(n) for n in (1, 2, 3, 4)),
        "state": lambda: car.state,
        "mode": lambda: car.mode,
        "mandrel": lambda: m.mandrel,
        "target_saddle": lambda: car.target,
        "target_selected": lambda: car.target_selected,
        "action": lambda: car.action,
        "action_state": lambda: car.action_state,
        "fault": lambda: car.fault,
        "collision_kind": lambda: m.hit,
        "horizontal": lambda: m.x,
        "vertical": lambda: m.v,
        "horizontal_speed": lambda: m.speed_x,
        "vertical_speed": lambda: m.speed_v,
        "horizontal_target": lambda: car.horizontal.target,
        "vertical_target": lambda: car.vertical.target,
        "coil_diameter": lambda: m.coil,
        "car_diameter": lambda: m.load,
        "pressure": lambda: m.pressure,
        "oil_temperature": lambda: m.oil,
        "mandrel_expansion": lambda: 100 * m.expansion,
        "horizontal_stop": lambda: car.horizontal.ramp.stop_distance(),
        "vertical_stop": lambda: car.vertical.ramp.stop_distance(),
        "contact_height": lambda: c.contact(m.coil) if m.coil else nan,
        "coils_done": lambda: car.coils_done,
        "coils_wound": lambda: car.coils_wound,
    }
    for n in (1, 2, 3):
        getters[f"saddle_{n}"], getters[f"saddle_{n}_diameter"] = _saddle(m, n)
    for n, name in enumerate(MOVEMENTS):
        getters[f"interlock_{name}"], getters[f"block_{name}"] = _block(car, n)
    for setting in SETTINGS:
        getters[setting.name] = _setting(car, setting.name)
    return MappingProxyType(getters)


def status(signals: Mapping[str, Callable[[], float]]) -> bytes:
    """The status image."""
    image = bytearray(2 * (STATUS_WORDS - 2))

    def put(word: int, packed: bytes) -> None:
        at = 2 * (word - 1)
        image[at : at + len(packed)] = packed

    for word, names in BITS.items():
        put(word, pack(">H", sum(1 << bit for bit, name in enumerate(names) if signals[name]())))
    for name, word in WORDS.items():
        put(word, pack(">H", int(signals[name]())))
    for name, word in REALS.items():
        put(word, pack(">f", signals[name]()))
    for name, word in COUNTS.items():
        put(word, pack(">I", int(signals[name]())))
    return bytes(image)


def configuration(geometry: Geometry) -> bytes:
    """The configuration image."""
    measures = [getattr(geometry, name) for name in MEASURES]
    packed = pack(f">H{len(measures)}f", SADDLES, *measures)
    return packed.ljust(2 * (CONFIGURATION_WORDS - 2), b"\0")


def _block(car: InterlockedCar, movement: int) -> tuple[Callable[[], float], Callable[[], float]]:
    return lambda: car.interlock.block(movement) is not Block.FREE, lambda: car.interlock.block(movement)


def _setting(car: InterlockedCar, name: str) -> Callable[[], float]:
    return lambda: car.values[name]


def _limit(machine: CoilCar, number: int) -> Callable[[], float]:
    return lambda: machine.limit(number)


def _guard(machine: CoilCar, number: int) -> Callable[[], float]:
    return lambda: machine.guard(number)


def _saddle(machine: CoilCar, number: int) -> tuple[Callable[[], float], Callable[[], float]]:
    return lambda: machine.saddles[number - 1] > 0, lambda: machine.saddles[number - 1]
