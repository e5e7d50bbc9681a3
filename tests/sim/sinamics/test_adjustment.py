"""Absolute encoder adjustment of the virtual drive: its waiting time, every way in which it fails, what a power cycle leaves of it."""

import pytest

from app.profidrive.parameter_access.formats import Format
from app.profidrive.parameter_access.messages import Address, Failed, Request, Values, Written
from app.profidrive.words import ENABLES, RUN
from app.sim.sinamics.adjustment import (
    COORDINATE,
    DEFAULTS,
    OFFSET,
    SCALE,
    STATE,
    WAITING_TIME,
    Adjustment,
    Encoder,
    State,
)
from app.sim.sinamics.drive import VirtualSinamics
from app.sim.sinamics.messages import ENCODER
from app.sim.training import REG_MACHINE_FAULT, REG_POWER
from tests.sim.sinamics.mailbox_stand import ask, powered, read, values, write
from tests.sim.sinamics.stand import command, step

STILL, MOVING = Encoder(70_000.0, True), Encoder(70_000.0, False)
DT = 0.1


def started(coordinate: float = 12_000.0) -> Adjustment:
    return Adjustment({**DEFAULTS, COORDINATE: coordinate, STATE: State.STARTED})


def after(adjustment: Adjustment, encoder: Encoder, seconds: float) -> State:
    for _ in range(round(seconds / DT)):
        adjustment.step(encoder, DT)
    return State(int(adjustment.values[STATE]))


@pytest.mark.parametrize("coordinate", [12_000.0, -2_147_482_648.0, 2_147_482_647.0, 0.0])
def test_after_the_waiting_time_the_position_is_the_coordinate(coordinate: float) -> None:
    it = started(coordinate)
    assert after(it, STILL, WAITING_TIME - DT) is State.STARTED and it.position(STILL) == 70_000
    assert after(it, STILL, DT) is State.ADJUSTED
    assert it.position(STILL) == coordinate and 0 <= it.values[OFFSET] < 1 << 32


@pytest.mark.parametrize(
    ("encoder", "state"),
    [(STILL._replace(healthy=False), State.ERROR), (STILL._replace(absolute=False), State.NOT_ADJUSTED),
     (MOVING._replace(healthy=False), State.ERROR), (MOVING, State.STARTED)],
)  # fmt: skip
def test_what_keeps_it_from_being_adjusted_says_so_and_moves_no_position(encoder: Encoder, state: State) -> None:
    it = started()
    assert after(it, encoder, 20) is state and it.position(encoder) == 70_000


def test_the_waiting_time_begins_when_the_axis_stands() -> None:
    it = started()
    assert after(it, STILL, 0.5) is State.STARTED
    assert after(it, MOVING, DT) is State.STARTED
    assert after(it, STILL, 0.5) is State.STARTED
    assert after(it, STILL, 0.4) is State.ADJUSTED


def test_what_is_withdrawn_is_not_carried_out() -> None:
    it = started()
    after(it, MOVING, 1)
    it.values[STATE] = State.NOT_ADJUSTED
    assert after(it, STILL, 5) is State.NOT_ADJUSTED and it.position(STILL) == 70_000


def test_another_scale_loses_the_adjustment() -> None:
    it = started()
    assert after(it, STILL, 2) is State.ADJUSTED
    it.values[SCALE] = 36_000
    assert after(it, STILL, DT) is State.NOT_ADJUSTED


def test_a_power_up_does_not_go_on_with_an_adjustment() -> None:
    it = started()
    it.power_up()
    assert after(it, STILL, 5) is State.NOT_ADJUSTED


# ---- in the drive, over its mailbox -------------------------------------------------------------------------


def adjust(drive: VirtualSinamics, coordinate: int = 12_000) -> None:
    assert write(drive, "p2599", coordinate) == Written() and write(drive, "p2507", 2) == Written()


def state(drive: VirtualSinamics) -> float:
    return values(drive, "p2507")[0]


def test_the_bytes_of_the_thesis_adjust_the_drive_and_saving_keeps_it() -> None:
    drive = powered()
    assert state(drive) == 1
    for number, kind, value in ((2599, Format.INTEGER32, 12_000), (2507, Format.INTEGER16, 2)):
        assert ask(drive, Request(5, 2, (Address(number, 0, 1),), (Values(kind, (value,)),))) == (Written(),)
    assert state(drive) == 2
    step(drive, 2)
    assert state(drive) == 3 and values(drive, "r2521", 0, 2) == (12_000, 12_000)
    assert ask(drive, Request(6, 1, (Address(971, 0, 1),), (Values(Format.UNSIGNED16, (1,)),))) == (Written(),)
    assert values(drive, "p0971") == (1,)
    step(drive, 1)
    assert values(drive, "p0971") == (0,)
    drive.write(6, REG_POWER, [1])
    step(drive, 0.1)
    assert state(drive) == 3 and values(drive, "r2521") == (12_000,)


def test_without_a_save_a_power_up_brings_back_the_former_position() -> None:
    drive = powered()
    before = values(drive, "r2521")
    adjust(drive)
    step(drive, 2)
    drive.write(6, REG_POWER, [1])
    step(drive, 0.1)
    assert state(drive) == 1 and values(drive, "r2521") == before != (12_000,)


def test_a_drive_that_runs_is_adjusted_when_it_stands_without_enables() -> None:
    drive = powered()
    command(drive, ENABLES, 0x1000)
    command(drive, RUN)
    step(drive, 3)
    adjust(drive)
    step(drive, 10)
    assert state(drive) == 2
    command(drive, ENABLES)
    step(drive, 15)
    assert state(drive) == 3 and values(drive, "r2521") == (12_000,)


def test_a_faulty_encoder_ends_it_with_an_error() -> None:
    drive = powered()
    drive.write(6, REG_MACHINE_FAULT, [ENCODER])
    step(drive, 0.1)
    adjust(drive)
    step(drive, 0.1)
    assert state(drive) == 0 and drive.faults == [ENCODER]


def test_a_drive_without_the_basic_positioner_does_not_have_its_parameters() -> None:
    drive = powered(positioning=False)
    assert read(drive, "p2507") == Failed(0x00) == write(drive, "p2599", 1)
    assert values(drive, "p1120") == (5,)
