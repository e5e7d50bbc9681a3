"""The virtual positioning axis by telegrams: what its words, registers and parameters tell."""

import pytest

from app.errors import DeviceException
from app.plant import types
from app.plant.plant_files.languages import LANGUAGES
from app.profidrive.parameter_access.formats import Format
from app.profidrive.parameter_access.messages import Address, Request, Values
from app.profidrive.state_machine import State
from app.profidrive.telegrams import TELEGRAMS
from app.sim import training
from app.sim.epos import messages
from app.sim.epos import training as own
from app.sim.epos.axis import OVERTRAVEL
from app.sim.epos.drive import VirtualPositioningAxis
from app.sim.epos.messages import ALARMS, FAULTS
from app.sim.epos.positioner import Task
from app.sim.sinamics.adjustment import State as Adjusted
from app.sim.sinamics.registers import FIRST_NUMBER

PARAMETERS = types.read_type("epos", LANGUAGES)[0].type.drive_parameters
OUT, IN, EXTRA = (number - FIRST_NUMBER for number in (40100, 40110, 40120))


def axis(**given: object) -> VirtualPositioningAxis:
    return VirtualPositioningAxis(behind_mailbox=PARAMETERS, **given)  # type: ignore[arg-type]


def step(it: VirtualPositioningAxis, seconds: float) -> None:
    """Time passes; the control reads the words as a real one does."""
    for _ in range(round(seconds / it.dt)):
        it.read(3, IN, 1)
        it.step()


def send(it: VirtualPositioningAxis, **values: int) -> None:
    """Telegram 111 to the drive."""
    usual = {"POS_STW2": 0x4000, "OVERRIDE": 0x4000, "MDI_VELOCITY": 12_000, "MDI_ACC": 0x4000, "MDI_DEC": 0x4000}
    words = TELEGRAMS[111].out.pack(usual | values)
    it.write(16, OUT, list(words[:10]))
    it.write(16, EXTRA, list(words[10:]))
    step(it, 0.05)


def told(it: VirtualPositioningAxis) -> dict[str, int]:
    return TELEGRAMS[111].into.unpack([*it.read(3, IN, 10), *it.read(3, EXTRA + 2, 2)])


def enabled(**given: object) -> VirtualPositioningAxis:
    it = axis(**given)
    for word in (0x43E, 0x43F):
        send(it, STW1=word)
    assert it.state is State.OPERATION
    return it


def parameter(
    it: VirtualPositioningAxis, number: int, *written: float, drive_object: int = 2, subindex: int = 0
) -> object:
    address = Address(number, subindex)
    values = [Values(PARAMETERS[f"p{number:04d}"].format, written)] if written else None
    (result,) = it.model.serve(Request(1, drive_object, (address,), values))  # type: ignore[arg-type]
    return result


def test_the_words_of_a_move_as_the_profile_has_them() -> None:
    it = enabled()
    send(it, STW1=0x43F, POS_STW1=0x8100, MDI_TARPOS=600_000)
    send(it, STW1=0x47F, POS_STW1=0x8100, MDI_TARPOS=600_000)
    step(it, 0.3)
    words = told(it)
    assert words["ZSW1"] & 1 << 12 and not words["ZSW1"] & 1 << 10, "acknowledged, not there"
    assert words["POS_ZSW1"] >> 15 and words["POS_ZSW2"] & 1 << 4 and words["NIST_B"] > 0
    assert words["ZSW2"] & 1 << 11 and words["MELDW"] & 1 << 13
    step(it, 3)
    words = told(it)
    assert words["ZSW1"] & 1 << 10 and words["ZSW1"] & 1 << 13 and words["XIST_A"] == pytest.approx(600_000, abs=40)
    assert it.read(3, OUT, 10) == list(TELEGRAMS[111].out.pack({"STW1": 0x47F, "POS_STW1": 0x8100, "POS_STW2": 0x4000,
        "OVERRIDE": 0x4000, "MDI_TARPOS": 600_000, "MDI_VELOCITY": 12_000, "MDI_ACC": 0x4000})[:10])  # fmt: skip


def test_jog_speeds_are_the_parameters_and_change_while_it_jogs() -> None:
    it = enabled()
    send(it, STW1=0x63F)
    step(it, 1)
    assert it.axis.speed * 60 / 1000 == pytest.approx(300, abs=5)
    parameter(it, 2586, 3000)
    step(it, 1)
    assert it.axis.speed * 60 / 1000 == pytest.approx(3000, abs=30)
    send(it, STW1=0x43F)
    step(it, 1)
    assert it.positioner.task is Task.NONE and not told(it)["POS_ZSW1"] & 1 << 10


@pytest.mark.sweep(8)
@pytest.mark.parametrize("number", FAULTS)
def test_every_fault_trips_it_stands_in_the_buffer_and_goes_when_it_is_acknowledged(number: int) -> None:
    it = enabled()
    send(it, STW1=0x43F, POS_STW1=0x8100)
    send(it, STW1=0x47F, POS_STW1=0x8100)
    it.write(6, training.REG_MACHINE_FAULT, [number])
    step(it, 3)
    assert it.state is not State.OPERATION and number in it.faults and told(it)["FAULT_CODE"] == number
    assert it.read(3, 40400 - FIRST_NUMBER, 1) == [number]
    send(it, STW1=0x4BE)
    assert number in it.faults, "its cause is there"
    it.write(6, training.REG_MACHINE_FAULT, [0])
    for word in (0x43E, 0x4BE, 0x43E, 0x43F):
        send(it, STW1=word)
    assert not it.faults and it.state is State.OPERATION and it.buffer.situations[1][0] == number


@pytest.mark.parametrize("number", ALARMS)
def test_every_alarm_warns_and_goes_with_its_cause(number: int) -> None:
    it = enabled()
    it.write(6, training.REG_MACHINE_FAULT, [number])
    step(it, 0.1)
    assert it.state is State.OPERATION and told(it)["WARN_CODE"] == number and told(it)["ZSW1"] & 1 << 7
    assert it.read(3, 40408 - FIRST_NUMBER, 2) == [number, number]
    it.write(6, training.REG_MACHINE_FAULT, [0])
    step(it, 0.1)
    assert not told(it)["WARN_CODE"]


def test_a_slide_that_leaves_its_travel_while_the_limits_count_trips_and_jogs_back() -> None:
    it = enabled()
    send(it, STW1=0x63F, POS_STW2=0)
    parameter(it, 2586, 12_000)
    step(it, 3)
    assert it.axis.position == it.axis.travel + OVERTRAVEL and messages.FOLLOWING in it.faults, "at the mechanical stop"
    for word in (0x43E, 0x4BE, 0x43E, 0x43F):
        send(it, STW1=word)
    send(it, STW1=0x63F)
    step(it, 0.5)
    assert not it.axis.speed and not it.faults, "no further"
    parameter(it, 2585, -12_000)
    send(it, STW1=0x43F)
    send(it, STW1=0x53F)
    step(it, 1)
    assert it.axis.speed < 0 and not it.faults


@pytest.mark.parametrize("speed", [12_000, 0])
def test_more_friction_than_torque_stops_the_slide_and_never_drives_it(speed: int) -> None:
    """300 % and more are beyond the motor: before it begins to move, and while it moves."""
    it = enabled()
    send(it, STW1=0x43F, POS_STW1=0x8100, MDI_TARPOS=700_000, MDI_VELOCITY=12_000)
    if speed:
        send(it, STW1=0x47F, POS_STW1=0x8100, MDI_TARPOS=700_000, MDI_VELOCITY=speed)
        step(it, 0.5)
    it.write(16, own.REG_LOAD, [400])
    at = it.axis.position
    send(it, STW1=0x47F, POS_STW1=0x8100, MDI_TARPOS=700_000, MDI_VELOCITY=12_000)
    way = [(step(it, it.dt), it.axis.position)[1] for _ in range(1000)]
    assert min(way) >= at and max(way) - at < 10_000, (at, min(way), max(way))
    assert it.axis.speed == 0 and messages.FOLLOWING in it.faults
    it.write(16, own.REG_LOAD, [0])
    for word in (0x43E, 0x4BE, 0x43E, 0x43F):
        send(it, STW1=word)
    assert it.state is State.OPERATION


def test_a_silent_control_stops_it() -> None:
    it = enabled(start="")
    send(it, STW1=0x43F, POS_STW1=0)
    send(it, STW1=0x47F, POS_STW1=0)
    for _ in range(300):
        it.step()
    assert it.faults == [messages.TIMEOUT] and it.state is State.INHIBITED and not round(it.axis.speed)


def test_it_moves_by_itself_until_a_control_writes_and_stays_where_it_is_without_one() -> None:
    it = axis(start="blocks")
    seen = set()
    for _ in range(1500):
        it.step()
        seen.add(round(it.actual / 10_000))
    assert len(seen) > 40 and not it.faults and not it.alarms
    send(it, STW1=0x43E)
    step(it, 2)
    assert it.state is State.READY_TO_SWITCH_ON and not round(it.axis.speed)
    quiet = axis()
    step(quiet, 5)
    assert quiet.actual == pytest.approx(400_000) and quiet.state is State.INHIBITED


@pytest.mark.parametrize(
    ("trouble", "fault", "ends"),
    [(0, 0, Adjusted.ADJUSTED), (1, 0, Adjusted.NOT_ADJUSTED), (2, 0, Adjusted.ERROR), (3, 0, Adjusted.STARTED),
     (0, messages.ENCODER, Adjusted.ERROR)],
)  # fmt: skip
def test_the_encoder_is_adjusted_over_the_parameters_or_says_why_not(trouble: int, fault: int, ends: Adjusted) -> None:
    it = axis(adjusted=False)
    it.write(6, own.REG_ADJUSTMENT, [trouble])
    it.write(6, training.REG_MACHINE_FAULT, [fault])
    step(it, 0.1)
    assert not told(it)["ZSW1"] & 1 << 11
    parameter(it, 2599, 123_456)
    parameter(it, 2507, 2)
    step(it, 2)
    assert it.parameter("p2507") == ends and it.adjusted is (ends is Adjusted.ADJUSTED)
    if it.adjusted:
        assert told(it)["XIST_A"] == 123_456 and told(it)["ZSW1"] & 1 << 11
        it.write(6, training.REG_POWER, [1])
        step(it, 0.1)
        assert not it.adjusted, "it was not saved"
        parameter(it, 2507, 2)
        step(it, 2)
        parameter(it, 971, 1, drive_object=1)
        step(it, 1)
        it.write(6, training.REG_POWER, [1])
        step(it, 0.1)
        assert it.adjusted and it.actual == 0.0, "p2599 was not saved the first time, the second adjustment was"


def test_a_new_coordinate_moves_nothing() -> None:
    it = enabled()
    send(it, STW1=0x43E)
    step(it, 1)
    where = it.axis.position
    parameter(it, 2599, 700_000)
    parameter(it, 2507, 2)
    step(it, 1.5)
    send(it, STW1=0x43F)
    step(it, 1)
    assert it.axis.position == pytest.approx(where, abs=40) and it.actual == pytest.approx(700_000, abs=40)


def test_what_the_map_lacks_is_refused() -> None:
    it = axis()
    for address, count in ((0x62, 1), (0x7B, 1), (OUT, 24 + 1), (0x13F - 1, 1)):
        with pytest.raises(DeviceException):
            it.read(3, address, count)
    with pytest.raises(DeviceException):
        it.write(6, 0x154, [1])
    assert it.read(3, 0x1F2, 1) == [1]


def test_a_seed_decides_what_the_encoder_counts_and_nothing_else() -> None:
    one, two = axis(seed=3), axis(seed=4)
    assert one.actual == two.actual and one._raw != two._raw


def test_the_register_of_the_firmware_says_its_version() -> None:
    """r0018 / 10000, as in the maker's map; not the limit of what a register holds."""
    it = enabled()
    assert it.read(3, 40301 - FIRST_NUMBER, 1) == [470]
    assert parameter(it, 18, drive_object=1) == Values(Format.UNSIGNED32, (4_700_000,))
