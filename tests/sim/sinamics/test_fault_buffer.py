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
