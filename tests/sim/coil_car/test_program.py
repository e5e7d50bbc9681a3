"""The coil-car line by its registers: movements, hold-to-run, every command and refusal, every fault, restart."""

import math
from collections.abc import Callable
from itertools import pairwise

import pytest

from app.registers import plc_map
from app.registers.plc_map import AnswerState
from app.sim import training
from app.sim.coil_car import register_map as coil_car
from app.sim.coil_car.actions import ARRIVED
from app.sim.coil_car.machine import FAULTS, MEASURES, Geometry
from app.sim.coil_car.program import VirtualCoilCar
from app.sim.coil_car.register_map import (
    ACTIONS,
    PRESETS,
    REGISTERS,
    SETTINGS,
    SIGNALS,
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
from tests.sim.coil_car.line import Talker, act

DONE, REJECTED, RUNNING = AnswerState.DONE, AnswerState.REJECTED, AnswerState.RUNNING


def line(**options: object) -> tuple[VirtualCoilCar, Talker]:
    given: dict[str, object] = {"start": "manual", **options}
    car = VirtualCoilCar(**given)  # type: ignore[arg-type]
    car.step()
    return car, Talker(car)


def run(car: VirtualCoilCar, seconds: float, talker: Talker | None = None, bits: int = 0) -> None:
    for scan in range(round(seconds * 100)):
        if talker and bits and scan % 10 == 0:
            talker.hold(bits)
        car.step()


def value(car: VirtualCoilCar, name: str) -> float:
    """A point as a host reads it."""
    place = REGISTERS[name]
    words = car.read(3, place.address, 1 if place.type == "u16" else 2)
    if place.type == "u16":
        return words[0] >> place.shift & place.mask if place.mask else words[0]
    raw = words[0] << 16 | words[1]
    return plc_map.real_of(raw) if place.type == "f32" else raw


# ---- the map


def test_what_a_sequence_reads_is_what_a_host_reads() -> None:
    car, talker = line(coil=True)
    talker.hold(1)
    run(car, 0.3)
    for name in SIGNALS:
        mine, theirs = float(car.signal(name)), value(car, name)
        assert (math.isnan(mine) and math.isnan(theirs)) or mine == pytest.approx(theirs, rel=1e-6), name
    assert value(car, "horizontal_speed") > 0 and value(car, "moving") == 1


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


def test_no_two_values_share_a_place() -> None:
    taken: dict[tuple[int, int], str] = {}
    for name, place in REGISTERS.items():
        for word in range(1 if place.type == "u16" else 2):
            bits = range(16) if not place.mask else (place.shift,)
            for bit in bits:
                key = (place.address + word, bit)
                assert key not in taken, (name, taken.get(key))
                taken[key] = name


# ---- movements


def test_the_transport_by_actions_lays_the_coil_on_the_farthest_saddle() -> None:
    car, talker = line(start="automatic", coil=True)
    talker.events()
    for action in ACTIONS[:8]:
        act(car, action)
    assert [value(car, f"saddle_{n}") for n in (1, 2, 3)] == [1, 0, 0]
    assert value(car, "coils_done") == 1 and value(car, "coil_on_car") == 0
    assert value(car, "horizontal") == pytest.approx(9000, abs=1) and value(car, "vertical") == pytest.approx(
        550, abs=1
    )
    told = [code for code, _ in talker.codes() if code not in (CoilCarEvent.ACTION_BEGUN, CoilCarEvent.ACTION_DONE)]
    assert told == [
        CoilCarEvent.COLLAPSED,
        CoilCarEvent.COIL_ON_CAR,
        CoilCarEvent.EXPANDED,
        CoilCarEvent.WINDING,
        CoilCarEvent.COIL_LAID,
    ]


def test_an_axis_follows_an_s_ramp_and_ends_at_its_target() -> None:
    car, _ = line(start="automatic", settings={"jerk_horizontal": 300.0})
    speeds = [0.0]
    while car.action_state != coil_car.ActionState.DONE:
        car.ask(["drive_to_mandrel"])
        car.step()
        speeds.append(-car.machine.speed_x)
    changes = [(after - before) / 0.01 for before, after in pairwise(speeds)]
    jerks = [(after - before) / 0.01 for before, after in pairwise(changes)]
    assert max(speeds) == pytest.approx(400, abs=0.1) and min(speeds) >= -0.01
    assert max(map(abs, changes)) <= 200 + 1e-6 and max(map(abs, jerks)) <= 300 + 1e-3
    assert car.machine.x == pytest.approx(1000, abs=ARRIVED)


def test_a_withdrawn_action_stops_on_the_ramp() -> None:
    car, _ = line(start="automatic")
    for _ in range(300):
        car.ask(["drive_to_mandrel"])
        car.step()
    speed = car.machine.speed_x
    car.step()
    assert speed < -300 and abs(car.machine.speed_x - speed) < 5
    run(car, 4)
    assert car.machine.speed_x == 0 and value(car, "action") == 0 and not car.moving


def test_actions_are_taken_in_automatic_only() -> None:
    for start in ("manual", "stopped"):
        car, _ = line(start=start, coil=True)
        assert not car.takes_actions
        for _ in range(100):
            car.ask(["drive_to_mandrel"])
            car.step()
        assert car.machine.x == 2700 and value(car, "action") == 0


def test_there_is_nothing_to_lift_to_without_a_coil() -> None:
    car, _ = line(start="automatic", settings={"automatic_winding": 0.0})
    car.preset({"horizontal": 1000})
    for _ in range(100):
        car.ask(["lift_to_coil"])
        car.step()
    assert car.machine.v == 0 and value(car, "action_state") == coil_car.ActionState.BLOCKED


def test_one_movement_at_a_time() -> None:
    car, _ = line(start="automatic")
    for _ in range(200):
        car.ask(["drive_to_mandrel"])
        car.step()
    for _ in range(30):
        car.ask(["lift_over_saddle"])
        car.step()
        assert car.machine.speed_v == 0
    assert value(car, "action_state") == coil_car.ActionState.BLOCKED
    assert value(car, "block_up") == Block.OTHER_MOVEMENT


def test_the_recoiler_winds_the_next_coil_by_itself_in_automatic() -> None:
    car, talker = line(start="automatic")
    run(car, 40)
    assert value(car, "coil_ready") == 1 and value(car, "coil_diameter") == pytest.approx(1300, abs=0.5)
    assert value(car, "coils_wound") == 1
    assert [code for code, _ in talker.codes()] == [CoilCarEvent.WINDING, CoilCarEvent.COIL_READY]
    car, _ = line(start="automatic", settings={"automatic_winding": 0.0})
    run(car, 5)
    assert value(car, "coil_on_mandrel") == 0


def test_the_crane_takes_a_coil_but_not_from_above_the_car() -> None:
    car, talker = line(start="automatic", coil=True)
    car.preset({"saddle_1": 1, "saddle_2": 1, "horizontal": 9000, "vertical": 690, "crane": 2})
    run(car, 3)
    assert [value(car, f"saddle_{n}") for n in (1, 2)] == [1, 0]
    assert (CoilCarEvent.COIL_REMOVED, 2) in talker.codes()


def test_the_target_is_the_farthest_saddle_that_can_be_reached() -> None:
    car, talker = line(coil=True)
    for given, target, free in (
        ({"saddle_1": 1.0}, 2, 1),
        ({"saddle_2": 1.0}, 3, 1),
        ({"saddle_3": 1.0}, 1, 0),
    ):
        car.preset(given)
        car.step()
        assert (value(car, "target_saddle"), value(car, "target_free")) == (target, free)
    assert talker.ask(CoilCarCommand.TARGET, 2).state == DONE
    assert (value(car, "target_saddle"), value(car, "target_selected"), value(car, "target_free")) == (2, 2, 0)


def test_the_target_stays_while_the_car_stands_at_it_and_is_the_next_one_once_it_leaves() -> None:
    car, _ = line(start="automatic", coil=True)
    for action in ACTIONS:
        act(car, action)
    act(car, "lower")
    laid = {name: value(car, name) for name in ("target_saddle", "at_target", "coil_laid", "lowered", "saddle_1")}
    assert laid == {"target_saddle": 1, "at_target": 1, "coil_laid": 1, "lowered": 1, "saddle_1": 1}
    assert value(car, "target_free") == 1, "for the next coil there is a saddle"
    act(car, "drive_to_mandrel")
    assert (value(car, "target_saddle"), value(car, "at_target"), value(car, "coil_laid")) == (2, 0, 0)


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


def test_winding_on_command_stops_and_goes_on() -> None:
    car, talker = line()
    assert talker.ask(CoilCarCommand.WIND).state == DONE
    run(car, 5)
    assert talker.ask(CoilCarCommand.STOP_WINDING).state == DONE
    diameter = value(car, "coil_diameter")
    assert 600 < diameter < 1300 and value(car, "coil_ready") == 0
    run(car, 2)
    assert value(car, "coil_diameter") == diameter
    talker.ask(CoilCarCommand.WIND)
    run(car, 40)
    assert value(car, "coil_ready") == 1
    told = [code for code, _ in talker.codes()]
    assert told == [CoilCarEvent.WINDING, CoilCarEvent.WINDING_STOPPED, CoilCarEvent.WINDING, CoilCarEvent.COIL_READY]


def test_automatic_goes_on_with_a_coil_that_was_not_finished_unless_told_to_stop() -> None:
    car, talker = line(start="automatic")
    run(car, 2)
    talker.ask(CoilCarCommand.STOP_WINDING)
    run(car, 2)
    assert value(car, "winding") == 0
    talker.ask(CoilCarCommand.STOP)
    run(car, 1)
    talker.ask(CoilCarCommand.AUTOMATIC)
    run(car, 1)
    assert value(car, "winding") == 1 and value(car, "coil_diameter") > 640
    talker.ask(CoilCarCommand.STOP)
    assert value(car, "winding") == 0


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


@pytest.mark.parametrize(
    ("code", "event", "fault"),
    [
        (1, (CoilCarEvent.DRIVE_TRIPPED, 1), Fault.DRIVE_HORIZONTAL),
        (2, (CoilCarEvent.DRIVE_TRIPPED, 2), Fault.DRIVE_VERTICAL),
        (41, (CoilCarEvent.GUARD_OPENED, 1), Fault.GUARD),
        (42, (CoilCarEvent.GUARD_OPENED, 2), Fault.GUARD),
        (43, (CoilCarEvent.GUARD_OPENED, 3), Fault.GUARD),
        (50, (CoilCarEvent.EMERGENCY_STOP, 0), Fault.EMERGENCY_STOP),
    ],
)
def test_a_fault_brakes_at_once_and_holds_until_a_reset(code: int, event: tuple[int, int], fault: Fault) -> None:
    car, talker = line(start="automatic")
    for _ in range(300):
        car.ask(["drive_to_mandrel"])
        car.step()
    talker.events()
    talker.fault(code)
    for _ in range(60):
        car.ask(["drive_to_mandrel"])
        car.step()
    assert car.machine.speed_x == 0 and (car.mode, car.fault) == (Mode.OFF, fault)
    assert event in talker.codes()
    talker.fault(0)
    run(car, 0.1)
    x = car.machine.x
    for _ in range(50):
        car.ask(["drive_to_mandrel"])
        car.step()
    assert car.machine.x == x and value(car, "held") == 1
    assert talker.ask(CoilCarCommand.RESET).state == DONE and talker.ask(CoilCarCommand.AUTOMATIC).state == DONE
    act(car, "drive_to_mandrel")


@pytest.mark.parametrize(
    ("code", "low", "back", "block"),
    [
        (31, CoilCarEvent.PRESSURE_LOW, CoilCarEvent.PRESSURE_BACK, Block.PRESSURE),
        (32, CoilCarEvent.PRESSURE_LOW, CoilCarEvent.PRESSURE_BACK, Block.PRESSURE),
        (33, CoilCarEvent.OIL_COLD, CoilCarEvent.OIL_WARM, Block.OIL),
    ],
)
def test_hydraulics_block_table_and_mandrel_and_come_back(
    code: int, low: CoilCarEvent, back: CoilCarEvent, block: Block
) -> None:
    car, talker = line(start="automatic", coil=True)
    talker.fault(code)
    run(car, 10)
    assert low in [each for each, _ in talker.codes()]
    for name in ("up", "down", "expand", "collapse"):
        assert value(car, f"block_{name}") == block and value(car, f"interlock_{name}") == 1
    assert value(car, "block_back") == Block.FREE and value(car, "mode") == Mode.AUTOMATIC
    assert value(car, "pump") == (code != 32)
    for _ in range(100):
        car.ask(["lift_over_saddle"])
        car.step()
    assert car.machine.v == 0 and value(car, "action_state") == coil_car.ActionState.BLOCKED
    talker.fault(0)
    run(car, 10)
    assert back in [each for each, _ in talker.codes()]
    act(car, "lift_over_saddle")


def test_the_table_stays_where_it_is_when_the_pressure_goes() -> None:
    car, talker = line(start="automatic")
    for _ in range(400):
        car.ask(["lift_over_saddle"])
        car.step()
    talker.fault(32)
    run(car, 3)
    height = car.machine.v
    run(car, 10)
    assert height > 100 and car.machine.v == height


@pytest.mark.parametrize(
    ("number", "movement", "bits"), [(1, "back", 2), (2, "forward", 1), (3, "up", 4), (4, "down", 8)]
)
def test_a_limit_switch_stuck_on_blocks_its_direction_only(number: int, movement: str, bits: int) -> None:
    car, talker = line()
    car.preset({"vertical": 300})
    talker.fault(10 + number)
    run(car, 1, talker, bits)
    assert (car.machine.x, car.machine.v) == (2700, 300)
    assert value(car, f"block_{movement}") == Block.LIMIT and value(car, "limits_plausible") == 0
    assert (CoilCarEvent.LIMIT_IMPLAUSIBLE, number) in talker.codes()
    other = bits * 2 if bits in (1, 4) else bits // 2
    run(car, 1, talker, other)
    assert (car.machine.x, car.machine.v) != (2700, 300)


@pytest.mark.parametrize(("number", "bits"), [(1, 2), (2, 1), (3, 4), (4, 8)])
def test_a_limit_switch_stuck_off_is_noticed_and_the_position_stops_the_axis(number: int, bits: int) -> None:
    car, talker = line(settings={"manual_horizontal": 200.0, "manual_vertical": 100.0})
    car.preset({"vertical": 100 if number == 4 else 0, "horizontal": 9000 if number == 2 else 2700})
    talker.fault(20 + number)
    run(car, 30, talker, bits)
    assert value(car, "collision") == 0 and -0.01 <= car.machine.x <= 10000.01 and -0.01 <= car.machine.v <= 1400.01
    assert (CoilCarEvent.LIMIT_IMPLAUSIBLE, number) in talker.codes()


def test_a_stuck_mandrel_is_noticed() -> None:
    car, talker = line()
    talker.fault(51)
    run(car, 7, talker, 32)
    assert (car.mode, car.fault) == (Mode.OFF, Fault.MANDREL)
    assert CoilCarEvent.MANDREL_STUCK in [code for code, _ in talker.codes()]


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


def test_every_fault_of_the_instructor_is_in_a_test() -> None:
    assert set(FAULTS) == {1, 2, 11, 12, 13, 14, 21, 22, 23, 24, 31, 32, 33, 41, 42, 43, 50, 51, 60}


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


def test_presets_put_the_line_into_a_state_or_say_why_not() -> None:
    car, _ = line()
    car.preset({"horizontal": 1000, "coil": 1, "diameter": 1500, "saddle_3": 1})
    assert value(car, "coil_diameter") == 1500 and value(car, "saddle_3_diameter") == 1500
    for values, said in (
        ({"height": 1.0}, "expected one of"),
        ({"saddle_1": 2.0}, "0 to 1"),
        ({"vertical": 900.0}, "touches the coil on mandrel"),
    ):
        with pytest.raises(ValueError, match=said):
            car.preset(values)
    assert car.machine.v == 0 and value(car, "collision") == 0


def test_every_preset_is_taken() -> None:
    for name, (low, high) in PRESETS.items():
        for wanted in (low, high):
            car, _ = line()
            if name == "vertical" or name == "horizontal":
                wanted = min(wanted, 3000.0) if name == "horizontal" else min(wanted, 900.0)
            if name == "mandrel" or name == "coil_on_car":
                car.preset({"automatic_winding": 0})
            car.preset({name: wanted})
            car.step()
            assert value(car, "collision") == 0, name


def test_held_pressure_stays_until_it_is_given_back() -> None:
    car, _ = line()
    car.preset({"pressure": 20})
    run(car, 5)
    assert value(car, "pressure") == 20 and value(car, "pressure_ok") == 0
    car.preset({"pressure": -1})
    run(car, 10)
    assert value(car, "pressure_ok") == 1


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


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("mandrel_position", -1.0),
        ("mandrel_reach", 900.0),
        ("out_position", 2000.0),
        ("saddle_3_position", 3000.0),
        ("saddle_2_position", 5000.0),
        ("travel", 8000.0),
        ("clearance", 20.0),
        ("lift", 700.0),
        ("coil_largest", 2400.0),
        ("position_tolerance", 40.0),
        ("saddle_height", 100.0),
        ("eye_diameter", 400.0),
    ],
)
def test_measures_that_contradict_each_other_are_told(name: str, wrong: float) -> None:
    with pytest.raises(ValueError, match="expected"):
        Geometry(**{name: wrong})
