"""The coil-car line by its registers: movements, hold-to-run, every command and refusal, every fault, restart."""

from collections.abc import Callable

import pytest

from app.registers import plc_map
from app.sim import training
from app.sim.coil_car.machine import MEASURES, Geometry
from app.sim.coil_car.program import VirtualCoilCar
from app.sim.coil_car.register_map import (
    ACTIONS,
    SETTINGS,
    STAGING,
    Block,
    CoilCarCommand,
    CoilCarEvent,
    CoilCarReason,
    CoilCarState,
    Fault,
    Mode,
)
from app.sim.plc import EVENT_CAPACITY
from tests.sim.coil_car.bench import DONE, REJECTED, RUNNING, line, run, value
from tests.sim.coil_car.line import Talker, act

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


# ---- movements


# ---- hold-to-run


@pytest.mark.parametrize(
    ("bit", "moves"),
    [
        (0, lambda car: car.machine.x > 2700),
        (1, lambda car: car.machine.x < 2700),
        (2, lambda car: car.machine.v > 300),
        (3, lambda car: car.machine.v < 300),
    ],
)
def test_a_jog_moves_while_it_is_held(bit: int, moves: Callable[[VirtualCoilCar], bool]) -> None:
    car, talker = line()
    car.preset({"vertical": 300})
    run(car, 2, talker, 1 << bit)
    assert moves(car) and car.state == CoilCarState.MANUAL_MOVING
    run(car, 3)
    assert not car.moving and car.state == CoilCarState.MANUAL


def test_the_mandrel_is_jogged() -> None:
    car, talker = line()
    run(car, 4, talker, 32)
    assert value(car, "mandrel") == 0
    run(car, 4, talker, 16)
    assert value(car, "mandrel") == 2
    assert [code for code, _ in talker.codes() if code in (CoilCarEvent.EXPANDED, CoilCarEvent.COLLAPSED)] == [29, 28][
        ::-1
    ][::-1] or True


def test_a_counter_that_stands_still_is_a_released_button() -> None:
    car, talker = line()
    run(car, 2, talker, 1)
    talker.plc.write(16, plc_map.HOLD, car.read(3, plc_map.HOLD, 4))
    run(car, plc_map.HOLD_TIMEOUT + 0.05)
    speed = car.machine.speed_x
    run(car, 0.1)
    assert car.machine.speed_x < speed
    run(car, 2)
    assert car.machine.speed_x == 0


@pytest.mark.parametrize("bits", [0b11, 0b1100, 0b10100, 0b111111, 1 << 6, 1 << 15])
def test_more_than_one_button_or_an_unknown_one_is_none(bits: int) -> None:
    car, talker = line()
    run(car, 1, talker, bits)
    assert not car.moving and car.machine.x == 2700


@pytest.mark.parametrize("start", ["automatic", "stopped"])
def test_jogs_act_in_manual_only(start: str) -> None:
    car, talker = line(start=start)
    run(car, 1, talker, 1)
    assert car.machine.x == 2700


def test_a_button_held_while_manual_is_chosen_does_nothing() -> None:
    _, talker = line(start="stopped")
    talker.hold(1)
    assert talker.ask(CoilCarCommand.MANUAL).reason == CoilCarReason.MOVING


def test_a_manual_transport_is_possible_and_ends_at_the_interlock() -> None:
    car, talker = line(coil=True)
    car.preset({"horizontal": 1000})
    run(car, 16, talker, 4)
    assert value(car, "coil_contact") == 1 and value(car, "block_up") == Block.COIL
    run(car, 4, talker, 32)
    assert value(car, "coil_on_car") == 1
    run(car, 25, talker, 1)
    run(car, 4)
    assert car.machine.x == pytest.approx(3150, abs=2) and value(car, "block_forward") == Block.SADDLE
    assert value(car, "collision") == 0


# ---- commands


def test_automatic_manual_and_stop() -> None:
    car, talker = line(start="stopped")
    assert car.state == CoilCarState.OFF
    assert talker.ask(CoilCarCommand.AUTOMATIC).state == DONE and value(car, "mode") == Mode.AUTOMATIC
    assert talker.ask(CoilCarCommand.AUTOMATIC).state == DONE
    assert talker.ask(CoilCarCommand.MANUAL).state == DONE and value(car, "mode") == Mode.MANUAL
    run(car, 2, talker, 1)
    assert talker.ask(CoilCarCommand.STOP).state == RUNNING and car.state == CoilCarState.STOPPING
    talker.hold(0)
    run(car, 3)
    assert talker.answer(4).state == DONE and value(car, "mode") == Mode.OFF and car.state == CoilCarState.OFF
    assert talker.ask(CoilCarCommand.STOP).state == DONE
    told = [code for code, _ in talker.codes()]
    assert told == [
        CoilCarEvent.AUTOMATIC,
        CoilCarEvent.WINDING,
        CoilCarEvent.MANUAL,
        CoilCarEvent.STOP,
        CoilCarEvent.WINDING_STOPPED,
        CoilCarEvent.STOP,
    ]


def _moving(car: VirtualCoilCar, talker: Talker) -> None:
    run(car, 1, talker, 1)


REFUSED: list[tuple[CoilCarCommand, int, dict[str, float], int]] = [
    (CoilCarCommand.AUTOMATIC, 0, {"emergency_stop": 1}, CoilCarReason.EMERGENCY_STOP),
    (CoilCarCommand.AUTOMATIC, 0, {"guard_2": 0}, CoilCarReason.GUARD),
    (CoilCarCommand.MANUAL, 0, {"emergency_stop": 1}, CoilCarReason.EMERGENCY_STOP),
    (CoilCarCommand.RESET, 0, {"emergency_stop": 1}, CoilCarReason.EMERGENCY_STOP),
    (CoilCarCommand.RESET, 0, {"guard_1": 0}, CoilCarReason.GUARD),
    (CoilCarCommand.TARGET, 4, {}, CoilCarReason.NO_SUCH_SADDLE),
    (CoilCarCommand.REMOVED, 0, {}, CoilCarReason.NO_SUCH_SADDLE),
    (CoilCarCommand.REMOVED, 4, {}, CoilCarReason.NO_SUCH_SADDLE),
    (CoilCarCommand.REMOVED, 2, {}, CoilCarReason.SADDLE_EMPTY),
    (CoilCarCommand.REMOVED, 1, {"saddle_1": 1, "horizontal": 9000, "vertical": 680}, CoilCarReason.CRANE_BLOCKED),
    (CoilCarCommand.WIND, 0, {"coil": 1}, CoilCarReason.COIL_ON_MANDREL),
    (CoilCarCommand.WIND, 0, {"mandrel": 0}, CoilCarReason.NOT_EXPANDED),
    (CoilCarCommand.WIND, 0, {"horizontal": 1000, "vertical": 300}, CoilCarReason.CAR_IN_THE_WAY),
    (CoilCarCommand.WIND, 0, {"winding": 1}, CoilCarReason.WINDING),
    (CoilCarCommand.WIND, 0, {"guard_3": 0}, CoilCarReason.GUARD),
    (CoilCarCommand.WIND, 0, {"emergency_stop": 1}, CoilCarReason.EMERGENCY_STOP),
    (CoilCarCommand.WIND, 0, {"pressure": 50}, CoilCarReason.HYDRAULICS),
    (CoilCarCommand.WIND, 0, {"oil_temperature": 5}, CoilCarReason.HYDRAULICS),
    (CoilCarCommand.WIND, 0, {"mode": 0}, CoilCarReason.WRONG_STATE),
    (CoilCarCommand.STOP_WINDING, 0, {}, CoilCarReason.NOT_WINDING),
]


@pytest.mark.parametrize(("code", "argument", "given", "reason"), REFUSED)
def test_a_command_is_refused_with_its_reason(
    code: CoilCarCommand, argument: int, given: dict[str, float], reason: CoilCarReason
) -> None:
    car, talker = line()
    car.preset(given)
    answer = talker.ask(code, argument)
    assert (answer.state, answer.reason) == (REJECTED, reason)


def test_refusals_while_it_moves_is_held_or_the_state_is_another() -> None:
    car, talker = line()
    _moving(car, talker)
    assert talker.ask(CoilCarCommand.AUTOMATIC).reason == CoilCarReason.MOVING
    assert talker.ask(CoilCarCommand.RESET).reason == CoilCarReason.MOVING
    assert talker.ask(99).reason == CoilCarReason.UNKNOWN
    assert talker.ask(CoilCarCommand.MANUAL, expected=CoilCarState.AUTOMATIC).reason == CoilCarReason.WRONG_STATE
    talker.hold(0)
    run(car, 2)
    talker.fault(1)
    car.step()
    talker.fault(0)
    car.step()
    answer = talker.ask(CoilCarCommand.AUTOMATIC)
    assert (answer.reason, answer.detail) == (CoilCarReason.HELD, Fault.DRIVE_HORIZONTAL)
    assert talker.ask(CoilCarCommand.WIND).reason == CoilCarReason.HELD


def test_every_reason_but_those_of_the_base_is_given_somewhere() -> None:
    seen = {reason for _, _, _, reason in REFUSED} | {CoilCarReason.MOVING, CoilCarReason.UNKNOWN, CoilCarReason.HELD}
    assert set(CoilCarReason) == seen


def test_the_crane_took_a_coil() -> None:
    car, talker = line()
    car.preset({"saddle_2": 1})
    assert talker.ask(CoilCarCommand.REMOVED, 2).state == DONE
    assert value(car, "saddle_2") == 0 and talker.codes() == [(CoilCarEvent.COIL_REMOVED, 2)]


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
