"""The coil-car line by its registers: movements, hold-to-run, every command and refusal, every fault, restart."""

import pytest

from app.registers import plc_map
from app.sim import training
from app.sim.coil_car.machine import MEASURES, Geometry
from app.sim.coil_car.program import VirtualCoilCar
from app.sim.coil_car.register_map import (
    ACTIONS,
    SETTINGS,
    STAGING,
    CoilCarCommand,
    CoilCarEvent,
    CoilCarReason,
    Mode,
)
from app.sim.plc import EVENT_CAPACITY
from tests.sim.coil_car.bench import DONE, REJECTED, line, run, value
from tests.sim.coil_car.line import act

# ---- the map


def test_images_are_whole_and_measures_and_settings_read_as_they_are() -> None:
    car, _ = line()
    for address, words in ((0x100, 64), (0x180, 64), (0x200, 2 * len(SETTINGS) + 4)):
        assert plc_map.is_whole(car.read(3, address, words))
    assert car.read(3, plc_map.AT_TYPE, 1) == [30]
    assert car.read(3, plc_map.AT_CAPACITIES, 3) == [3, len(SETTINGS), EVENT_CAPACITY]
    for name in MEASURES:
        assert value(car, f"device_{name}") == pytest.approx(getattr(Geometry(), name)), name
    for setting in SETTINGS:
        assert value(car, setting.name) == setting.default


def test_settings_are_taken_as_a_set_and_checked() -> None:
    car, talker = line()
    assert talker.commit({"automatic_horizontal": 250.0}, STAGING).state == DONE
    assert value(car, "automatic_horizontal") == 250
    answer = talker.commit({"automatic_horizontal": 5000.0}, STAGING)
    assert (answer.state, answer.reason, answer.detail) == (REJECTED, 21, 1)
    assert value(car, "automatic_horizontal") == 250
    assert (CoilCarEvent.SETTINGS, 0) in talker.codes()
    _, talker = line(geometry=Geometry(coil_largest=1500.0))
    answer = talker.commit({"order_diameter": 1800.0}, STAGING)
    assert (answer.reason, answer.detail) == (21, 9)


# ---- faults


def test_a_silent_host_ends_automatic() -> None:
    car, talker = line(start="automatic", settings={"host_timeout": 2.0})
    for beat in range(400):
        if beat % 50 == 0:
            car.write(6, plc_map.AT_HOST_HEARTBEAT, [beat + 1])
        car.step()
    assert value(car, "mode") == Mode.AUTOMATIC
    talker.fault(60)
    run(car, 3)
    assert value(car, "mode") == Mode.OFF and value(car, "host_silent") == 1
    assert talker.ask(CoilCarCommand.AUTOMATIC).reason == CoilCarReason.WRONG_STATE
    assert CoilCarEvent.HOST_SILENT in [code for code, _ in talker.codes()]


# ---- restart, presets, repetition


def test_a_power_cycle_keeps_the_world_the_settings_and_the_counters() -> None:
    car, talker = line(start="automatic", coil=True)
    for action in ACTIONS[:5]:
        act(car, action)
    talker.commit({"automatic_horizontal": 333.0}, STAGING)
    talker.ask(CoilCarCommand.TARGET, 2)
    for _ in range(100):
        car.ask(["drive_to_saddle"])
        car.step()
    newest = car.newest
    talker.train(training.REG_POWER, 1)
    run(car, 2)
    assert car.machine.speed_x == 0 and value(car, "mode") == Mode.OFF and car.boots == 2
    assert value(car, "coil_on_car") == 1 and value(car, "target_selected") == 2
    assert value(car, "automatic_horizontal") == 333 and car.newest > newest
    talker.train(training.REG_RESET, 1)
    car.step()
    assert value(car, "coil_on_car") == 0 and value(car, "automatic_horizontal") == 400 and car.boots == 1


@pytest.mark.sweep(8)
def test_the_same_writes_give_the_same_run() -> None:
    def once() -> list[list[int]]:
        car, talker = line(start="automatic", coil=True)
        images = []
        for action in ACTIONS[:6]:
            act(car, action)
            images.append(car.read(3, 0x100, 64))
        talker.fault(31)
        run(car, 3)
        return [*images, car.read(3, 0x100, 64), car.read(3, plc_map.EVENT_ROWS, 112)]

    assert once() == once()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"start": "running"}, "expected stopped"),
        ({"growth": 0.0}, "growth"),
        ({"crane": -1.0}, "crane"),
        ({"settings": {"speed": 1.0}}, "expected one of"),
        ({"settings": {"manual_vertical": 1000.0}}, "takes 5 to 100"),
    ],
)
def test_a_line_that_cannot_be_built_says_why(options: dict[str, object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        VirtualCoilCar(**options)  # type: ignore[arg-type]
