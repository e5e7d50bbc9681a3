"""The virtual drive as a master and an operator meet it: registers, commands, ramps, parameters, faults."""

import json
from contextlib import suppress
from random import Random

import pytest

from app.errors import ConfigurationError, DeviceException
from app.sim.device import VirtualDevice
from app.sim.eura_e800.drive import VirtualE800
from app.sim.eura_e800.faults import FAULTS, OC
from app.sim.eura_e800.parameters import PARAMETERS
from app.sim.eura_e800.training import LIMITS
from tests.sim.eura_e800.stand import (
    FORWARD,
    RESET,
    REVERSE,
    RUN,
    command,
    drive,
    faulted,
    go,
    image,
    inject,
    put,
)

# ---- registers


def test_it_is_a_virtual_device() -> None:
    device: VirtualDevice = VirtualE800()
    assert (device.type, device.dt) == ("eura_e800", 0.01)


# ---- addressing, functions, limits


# ---- parameters


def test_a_write_acts_at_the_step_border() -> None:
    device = drive()
    put(device, "F114", 9.0)
    assert device.read(3, 0x010E, 1) == [50]
    device.step()
    assert device.read(3, 0x010E, 1) == [90]


@pytest.mark.parametrize(
    "bad",
    [
        {"motor": "C"},
        {"start": "sideways"},
        {"rated_current": 0.0},
        {"rated_current": float("nan")},
        {"parameters": {"F999": 1.0}},
        {"parameters": {"F114": 0.0}},
        {"parameters": {"F203": 7}},
        {"parameters": {"F113": "40"}},
        {"parameters": {"F113": 51.0}},
        {"parameters": {"F112": 50.01}},
        {"load": -1.0},
        {"inertia_ratio": -1.0},
    ],
)
def test_bad_configuration_is_named(bad: dict[str, object]) -> None:
    with pytest.raises(ConfigurationError, match=r"expected|takes"):
        VirtualE800(**bad)  # type: ignore[arg-type]


# ---- commands


def test_start_already_running() -> None:
    device = VirtualE800(start="reverse", parameters={"F113": 40.0, "F905": 0.0})
    words = image(device)
    assert (words[0], words[5] & 0xFF) == (4000, 2)
    assert device.shaft_speed < -1100
    speed = device.shaft_speed
    assert go(device, 1).shaft_speed == pytest.approx(speed, rel=0.01)


# ---- V/f


# ---- faults


def test_it_never_restarts_by_itself() -> None:
    device = faulted()
    inject(device, 0)
    go(device, 1)
    command(device, RESET, 10)
    assert device.status == 0
    assert device.shaft_speed == 0


def test_power_cycle_clears_a_fault_unless_its_cause_stays() -> None:
    device = faulted()
    device.power_cycle()
    assert go(device, 0.05).fault == 0x0D
    inject(device, 0)
    go(device, 0.05)
    device.power_cycle()
    assert go(device, 0.05).status == 0


# ---- communication watchdog


# ---- outputs


# ---- the same again


@pytest.mark.sweep(8)
def test_seed_and_writes_repeat_a_run_bit_for_bit() -> None:
    writes = {
        5: (0x2000, FORWARD),
        300: (0x010D, 3000),
        700: (0xE020, 60),
        900: (0x2000, REVERSE),
        1500: (0xE010, OC),
        1700: (0xE010, 0),
        1750: (0x2000, RESET),
        1760: (0x2000, RUN),
    }

    def run(seed: int) -> str:
        device = VirtualE800(seed=seed)
        trace: list[object] = []
        for step in range(2200):
            if step in writes:
                address, word = writes[step]
                device.write(6, address, [word])
            if step % 7 == 0:
                device.telegram_seen()
            device.step()
            trace.append(
                (device.motor.speed.hex(), device.bus_voltage.hex(), device.heat.heat_sink.hex(), device.status)
            )
            if step % 50 == 0:
                trace.append(image(device))
        return json.dumps(trace)

    assert run(1) == run(1)
    assert run(1) != run(2)


def test_reading_does_not_change_anything() -> None:
    watched, alone = VirtualE800(start="forward"), VirtualE800(start="forward")
    for _ in range(500):
        image(watched)
        watched.read(3, 0x010B, 6)
        watched.step()
        alone.step()
    assert image(watched) == image(alone)
    assert watched.motor.speed == alone.motor.speed


@pytest.mark.sweep(8)
@pytest.mark.parametrize("seed", range(12))
def test_whatever_is_written_the_physics_stays_sound(seed: int) -> None:
    random = Random(seed)
    device = VirtualE800(
        seed=seed,
        rated_current=random.choice([0.1, 0.8, 2.5, 4.5, 30.0]),
        motor=random.choice("AB"),
        start=random.choice(["", "forward", "reverse"]),
    )
    parameters = list(PARAMETERS.values())
    for step in range(2000):
        if random.random() < 0.03:
            parameter = random.choice(parameters)
            low, high = parameter.encode(parameter.low), parameter.encode(parameter.high)
            training = random.choice(sorted(LIMITS))
            address, word = random.choice(
                [
                    (0x2000, random.choice([1, 2, 3, 4, 5, 6, 8, 9, 10, 11])),
                    (parameter.address, random.randint(low, high)),
                    (training, random.randint(*LIMITS[training])),
                    (0xE010, random.choice([0, *FAULTS])),
                ]
            )
            with suppress(DeviceException):
                device.write(6, address, [word])
        device.step()
        if step % 20 == 0:
            point = device.motor.point
            assert all(0 <= word <= 0xFFFF for word in image(device))
            assert point.power_in == pytest.approx(point.power_shaft + point.losses, rel=1e-9, abs=1e-6)
            assert 0 <= device.bus_voltage < 900
            assert abs(device.shaft_speed) < 60 * 650 * 1.2
