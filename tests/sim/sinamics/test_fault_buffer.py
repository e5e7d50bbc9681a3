"""The fault buffer: situations, places, and what acknowledges them."""

from app.profidrive.words import ENABLES, RUN, Control
from app.sim.sinamics.drive import VirtualSinamics
from app.sim.sinamics.messages import FAULTS
from app.sim.training import REG_MACHINE_FAULT
from tests.sim.sinamics.stand import command, running, step, value


def test_a_held_acknowledge_bit_is_no_edge() -> None:
    drive = running()
    command(drive, RUN | Control.ACKNOWLEDGE)
    drive.write(6, REG_MACHINE_FAULT, [7860])
    step(drive, 0.1)
    drive.write(6, REG_MACHINE_FAULT, [0])
    command(drive, ENABLES | Control.ACKNOWLEDGE)
    assert drive.faults == [7860]
    command(drive, ENABLES)
    command(drive, ENABLES | Control.ACKNOWLEDGE)
    assert drive.faults == []


def test_an_edge_that_fits_into_one_step_is_lost() -> None:
    drive = running()
    drive.write(6, REG_MACHINE_FAULT, [7860])
    step(drive, 0.1)
    drive.write(6, REG_MACHINE_FAULT, [0])
    command(drive, ENABLES | Control.ACKNOWLEDGE)
    drive.write(6, 99, [ENABLES])
    drive.write(6, 99, [ENABLES | Control.ACKNOWLEDGE])
    step(drive, 0.05)
    drive.write(6, REG_MACHINE_FAULT, [7860])
    step(drive, 0.05)
    drive.write(6, REG_MACHINE_FAULT, [0])
    drive.write(6, 99, [ENABLES])
    drive.write(6, 99, [ENABLES | Control.ACKNOWLEDGE])
    step(drive, 0.05)
    assert drive.faults == [7860]


def test_the_buffer_shifts_by_situations_and_only_its_eighth_place_is_overwritten() -> None:
    drive = VirtualSinamics()
    command(drive, ENABLES)
    numbers = list(FAULTS)
    for number in numbers[:10]:
        drive.buffer.enter(number)
    step(drive, 0.05)
    assert drive.buffer.present == [*numbers[:7], numbers[9]]
    assert [value(drive, 40400 + n) for n in range(8)] == drive.buffer.present
    first = list(drive.buffer.present)
    for n in range(9):
        command(drive, ENABLES | Control.ACKNOWLEDGE)
        command(drive, ENABLES)
        drive.buffer.enter(numbers[n])
        step(drive, 0.05)
        assert (first in drive.buffer.situations) is (n < 7)
        assert len(drive.buffer.situations) == 8 and all(len(situation) == 8 for situation in drive.buffer.situations)


def test_a_fault_that_comes_as_another_is_acknowledged_opens_the_next_situation() -> None:
    """It was moved on unseen: the status word said fault, and there was none."""
    drive = running()
    drive.write(6, REG_MACHINE_FAULT, [7860])
    step(drive, 0.1)
    drive.write(6, REG_MACHINE_FAULT, [0])
    command(drive, ENABLES)
    drive.buffer.enter(7452)  # as a trip at the end of a step
    command(drive, ENABLES | Control.ACKNOWLEDGE)
    assert [situation[:2] for situation in drive.buffer.situations[:3]] == [[7452, 0], [7860, 0], [0, 0]]
    assert drive.faults == [7452] and drive.machine.faulted
    assert drive.buffer.messages[0][0].gone == 0 < drive.buffer.messages[1][0].gone
    command(drive, ENABLES)
    command(drive, ENABLES | Control.ACKNOWLEDGE)
    assert drive.faults == [] and not drive.machine.faulted
    assert [situation[:2] for situation in drive.buffer.situations[:3]] == [[0, 0], [7452, 0], [7860, 0]]


def test_an_acknowledgement_with_nothing_to_acknowledge_leaves_what_comes() -> None:
    drive = running()
    drive.buffer.enter(7860)
    command(drive, RUN | Control.ACKNOWLEDGE)
    assert drive.faults == [7860] and drive.machine.faulted
    assert not any(map(any, drive.buffer.situations[1:]))
