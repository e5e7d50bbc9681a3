"""No command, hold-to-run, action, fault or restart, in any order, makes the car touch something; without the interlock it does."""

from random import Random

import pytest

from app.sim import training
from app.sim.coil_car import training as own
from app.sim.coil_car.machine import FAULTS, CoilCar, Geometry, Hit
from app.sim.coil_car.program import VirtualCoilCar
from app.sim.coil_car.register_map import (
    ACTIONS,
    GEOMETRY,
    MOVEMENTS,
    SETTINGS,
    STAGING,
    Block,
    CoilCarCommand,
    CoilCarEvent,
    CoilCarReason,
    Fault,
    Mode,
)
from tests.sim.coil_car.line import Talker, act

OTHER = Geometry(
    mandrel_position=1200.0,
    mandrel_reach=1700.0,
    mandrel_height=1300.0,
    out_position=3000.0,
    saddle_3_position=4700.0,
    saddle_2_position=6700.0,
    saddle_1_position=8600.0,
    saddle_height=600.0,
    clearance=110.0,
    coil_width=1000.0,
    coil_smallest=550.0,
    coil_largest=2200.0,
    position_tolerance=12.0,
)


def crowd(car: VirtualCoilCar, random: Random) -> None:
    """Somewhere a run could have led to."""
    at = random.choice(("out", "mandrel", "saddle", "loaded", "raised", "transport", "transport", "transport"))
    m = car.geometry
    diameter = float(random.randint(600, 1900))
    given = {"diameter": diameter, "coil": float(random.random() < 0.6)}
    given |= {f"saddle_{n}": float(random.random() < 0.4) for n in (1, 2, 3)}
    if at == "mandrel":
        given |= {"horizontal": m.mandrel_position}
    elif at == "saddle":
        given |= {"horizontal": m.saddle(random.randint(1, 3)), "vertical": float(random.randint(0, 100))}
    elif at == "loaded":
        given |= {
            "horizontal": m.out_position,
            "vertical": float(random.randint(0, 1300)),
            "coil_on_car": 1.0,
            "saddle_3": 0.0,
        }
    elif at == "raised":
        given |= {"horizontal": m.out_position, "vertical": float(random.randint(0, 1300)), "saddle_3": 0.0}
    if at != "transport":
        car.preset(given)
        return
    car.preset({**given, "coil": 1.0, "saddle_3": 0.0, "mode": 1.0})
    for action in ACTIONS[: random.randint(1, 8)]:
        act(car, action)
    car.preset({"mode": float(random.randint(0, 2))})


def commotion(car: VirtualCoilCar, random: Random, seconds: float) -> Hit:
    """Anything that a plant can do to the PLC, at random; the first collision."""
    talker = Talker(car)
    actions: list[str] = []
    bits = 0
    pause = 0
    machine = car.machine
    for scan in range(round(seconds * 100)):
        if pause == 0:
            pause = random.choice((1, 3, 20, 100, 300, 700))
            what = random.random()
            actions, bits = [], 0
            if (what < 0.40 and car.mode is not Mode.AUTOMATIC) or what < 0.1:
                bits = random.choice((1, 2, 4, 8, 16, 32, 1, 2, 4, 8, random.randint(0, 255)))
            elif what < 0.55:
                actions = random.sample(ACTIONS, random.choice((1, 1, 1, 2)))
            elif what < 0.80:
                code = random.choice(
                    [
                        *CoilCarCommand,
                        CoilCarCommand.AUTOMATIC,
                        CoilCarCommand.MANUAL,
                        CoilCarCommand.MANUAL,
                        CoilCarCommand.RESET,
                        99,
                    ]
                )
                talker.ask(code, random.randint(0, 4))
                pause = random.choice((1, 2, 5))
            elif what < 0.86:
                talker.fault(random.choice((0, 0, 0, *FAULTS)))
            elif what < 0.93:
                name = random.choice(
                    ("order_diameter", "automatic_horizontal", "automatic_vertical", "acceleration_horizontal")
                )
                low, high = {s.name: (s.low, s.high) for s in SETTINGS}[name]
                talker.commit({name: random.uniform(low, high)}, STAGING)
            elif what < 0.95:
                talker.train(training.REG_POWER, 1)
            elif what < 0.97:
                talker.train(own.REG_CRANE, random.choice((0, 1, 20)))
                talker.train(own.REG_GROWTH, random.choice((100, 1000, 5000)))
            else:
                pause = 700
        pause -= 1
        if bits and scan % 10 == 0:
            talker.hold(bits)
        if actions:
            car.ask(actions)
        car.step()
        if machine.hit is not Hit.NONE:
            return machine.hit
    return Hit.NONE


@pytest.mark.sweep(8)
@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("geometry", [Geometry(), OTHER], ids=["plain", "other"])
def test_nothing_that_can_be_done_makes_a_collision(geometry: Geometry, seed: int) -> None:
    random = Random(seed)
    car = VirtualCoilCar(geometry, start=random.choice(("stopped", "automatic", "manual")), growth=200.0)
    crowd(car, random)
    assert commotion(car, random, 60.0) is Hit.NONE


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("given", "bits", "kind", "block"),
    [
        ({"horizontal": 1000, "coil": 1}, 4, Hit.COIL_ON_MANDREL, Block.COIL),
        ({"horizontal": 1000, "winding": 1}, 4, Hit.COIL_ON_MANDREL, Block.WINDING),
        ({"horizontal": 1000}, 4, Hit.MANDREL, Block.MANDREL),
        ({"horizontal": 2300, "vertical": 960}, 2, Hit.MANDREL, Block.NOT_LOWERED),
        ({"coil_on_car": 1, "vertical": 300, "mandrel": 0}, 2, Hit.MANDREL, Block.IN_THE_EYE),
        ({"coil_on_car": 1, "vertical": 550, "coil": 1}, 2, Hit.COIL_ON_MANDREL, Block.COIL),
        ({"coil_on_car": 1, "vertical": 550}, 2, Hit.MANDREL, Block.NOT_COLLAPSED),
        ({"coil_on_car": 1, "vertical": 850, "saddle_3": 1}, 1, Hit.COIL_ON_SADDLE, Block.COIL),
        ({"vertical": 800, "saddle_3": 1}, 1, Hit.COIL_ON_SADDLE, Block.COIL),
        ({"coil_on_car": 1, "vertical": 400}, 1, Hit.SADDLE, Block.SADDLE),
        ({"coil_on_car": 1, "vertical": 850, "horizontal": 3500}, 8, Hit.SADDLE, Block.SADDLE),
        ({"horizontal": 3500, "saddle_3": 1, "vertical": 500}, 4, Hit.COIL_ON_SADDLE, Block.COIL),
        ({"coil": 1}, 32, Hit.DROPPED, Block.NOT_SUPPORTED),
        ({"coil_on_car": 1, "vertical": 560, "horizontal": 1000, "mandrel": 0}, 16, Hit.MANDREL, Block.NOT_CENTRED),
    ],
)
def test_what_the_interlock_prevents_happens_without_it(
    given: dict[str, float], bits: int, kind: Hit, block: Block
) -> None:
    for guarded in (True, False):
        car = VirtualCoilCar(start="manual", growth=0.1)
        car.interlocks = guarded
        if "mandrel" in given or "winding" in given:
            car.preset({"automatic_winding": 0})
        car.preset(given)
        talker = Talker(car)
        for scan in range(4000):
            if scan % 10 == 0:
                talker.hold(bits)
            car.step()
            if car.machine.hit is not Hit.NONE:  # the first one stays
                break
        assert car.machine.hit is (Hit.NONE if guarded else kind)
        if guarded:
            movement = bits.bit_length() - 1
            assert car.interlock.block(movement) is block
            assert car.signal(f"interlock_{MOVEMENTS[movement]}") == 1
            assert car.signal("collision_possible") == (block in GEOMETRY)
            told = [(event.source, event.value) for event in talker.events() if event.code == CoilCarEvent.INTERLOCK]
            assert told == [(movement + 1, block)]


@pytest.mark.sweep(8)
def test_without_the_interlock_the_same_commotion_collides() -> None:
    kinds = []
    for seed in range(12):
        random = Random(seed)
        car = VirtualCoilCar(start="manual", growth=200.0)
        crowd(car, random)
        car.interlocks = False
        kinds.append(commotion(car, random, 60.0))
        if sum(kind is not Hit.NONE for kind in kinds) == 4:
            return
    pytest.fail(f"too few collisions: {kinds}")


def test_a_collision_is_seen_held_and_told() -> None:
    car = VirtualCoilCar(start="manual")
    talker = Talker(car)
    car.machine.coil, car.machine.x, car.machine.v = 1300.0, 1000.0, 600.0
    car.step()
    assert car.signal("collision") == 1 and car.signal("collision_kind") == Hit.COIL_ON_MANDREL
    assert (car.mode, car.fault) == (Mode.OFF, Fault.COLLISION)
    assert (CoilCarEvent.COLLISION, Hit.COIL_ON_MANDREL) in talker.codes()
    assert talker.ask(CoilCarCommand.RESET).reason == CoilCarReason.HELD
    talker.train(training.REG_RESET, 1)
    car.step()
    assert car.signal("collision") == 0


def test_an_end_stop_is_a_collision() -> None:
    machine = CoilCar(Geometry())
    machine.x = machine.geometry.travel
    for _ in range(300):
        machine.step(100.0, 0.0, (True, True), 0, 0.01)
    assert machine.hit is Hit.END_STOP
