"""What the drive refuses, and by which exception code."""

from collections.abc import Callable

import pytest

from app.sim.sinamics import registers
from app.sim.sinamics.drive import VirtualSinamics
from tests.sim.sinamics.stand import at, code_of, running, step


@pytest.mark.parametrize("words", [2, 10])
def test_what_the_map_does_not_list_answers_2_whether_read_or_written(words: int) -> None:
    drive = VirtualSinamics(process_words=words)
    known = (
        {at(n) for n in registers.REGISTERS}
        | {at(40100 + n) for n in range(words)}
        | {at(40110 + n) for n in range(words)}
        | {at(n) for n in range(40601, 40723)}
    )
    for address in range(0x0300):
        if address in known:
            drive.read(3, address, 1)
        else:
            assert code_of(lambda a=address: drive.read(3, a, 1)) == 2  # type: ignore[misc]
            assert code_of(lambda a=address: drive.write(6, a, [0])) == 2  # type: ignore[misc]
    assert code_of(lambda: drive.read(3, at(40349), 2)) == 2, "a range with one that is not there"


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("deed", "code"),
    [
        (lambda d: d.read(4, 99, 1), 1),
        (lambda d: d.write(5, 99, [1]), 1),
        (lambda d: d.read(3, 99, 0), 3),
        (lambda d: d.read(3, 99, 126), 3),
        (lambda d: d.write(16, 99, []), 3),
        (lambda d: d.write(6, 99, [1, 2]), 3),
        (lambda d: d.write(6, 99, [0x10000]), 3),
        (lambda d: d.write(6, 109, [0]), 4),
        (lambda d: d.write(16, 108, [0, 0]), 4),
    ],
)
def test_bad_requests_are_refused_by_code_and_nothing_of_them_acts(
    deed: Callable[[VirtualSinamics], object], code: int
) -> None:
    drive = running()
    before = [drive.read(3, at(n), 1)[0] for n in (40100, 40101, 40322)]
    assert code_of(lambda: deed(drive)) == code
    step(drive, 0.1)
    assert [drive.read(3, at(n), 1)[0] for n in (40100, 40101, 40322)] == before
