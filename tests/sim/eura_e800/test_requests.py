"""Which telegrams the virtual drive refuses, and by which exception code."""

import pytest

from app.sim.eura_e800.drive import VirtualE800
from tests.sim.eura_e800.stand import drive, refusal


def test_reading_is_refused_by_code() -> None:
    device = drive()
    for function, address, count, code in (
        (4, 0x1000, 1, 1),
        (1, 0x1000, 1, 1),
        (3, 0x2000, 1, 2),
        (3, 0x0FFF, 1, 2),
        (3, 0x1019, 1, 2),
        (3, 0x1018, 2, 2),
        (3, 0x1000, 26, 3),
        (3, 0x1000, 0, 3),
        (3, 0x010B, 7, 3),
        (3, 0x0116, 6, 2),
        (3, 0x0300, 1, 2),
        (3, 0xE040, 1, 2),
    ):
        assert refusal(lambda f=function, a=address, c=count: device.read(f, a, c)) == code, (function, address, count)


def test_limits_of_the_device_are_settings() -> None:
    device = VirtualE800(block_limit=9, parameter_limit=2, multiple_writes=True)
    assert len(device.read(3, 0x1000, 9)) == 9
    assert refusal(lambda: device.read(3, 0x1000, 10)) == 3
    assert refusal(lambda: device.read(3, 0x010B, 3)) == 3
    device.write(16, 0x010E, [20, 30])
    device.step()
    assert (device.parameter("F114"), device.parameter("F115")) == (2.0, 3.0)


def test_function_16_is_unknown_until_switched_on_and_then_all_or_nothing() -> None:
    assert refusal(lambda: drive().write(16, 0x010E, [20])) == 1
    device = VirtualE800(multiple_writes=True)
    assert refusal(lambda: device.write(16, 0x010E, [20, 0])) == 3
    device.step()
    assert device.parameter("F114") == 5.0


@pytest.mark.parametrize(
    ("address", "word", "code"),
    [
        (0x1000, 1, 2),
        (0x2004, 1, 2),
        (0x2008, 1, 2),
        (0x0300, 1, 2),
        (0x2000, 0, 3),
        (0x2000, 7, 3),
        (0x2000, 12, 3),
        (0x2001, 0, 3),
        (0x2001, 5, 3),
        (0x2002, 1001, 3),
        (0x2003, 1001, 3),
        (0x2005, 2, 3),
        (0x2007, 2, 3),
    ],
)
def test_writing_is_refused_by_code(address: int, word: int, code: int) -> None:
    assert refusal(lambda: drive().write(6, address, [word])) == code


def test_number_of_words_fits_the_function() -> None:
    assert refusal(lambda: drive().write(6, 0x010E, [20, 30])) == 3
    assert refusal(lambda: drive().write(6, 0x010E, [])) == 3
    assert refusal(lambda: drive().write(5, 0x2000, [1])) == 1
