"""The words that the virtual drive shows."""

import pytest

from app.sim.eura_e800.drive import VirtualE800
from tests.sim.eura_e800.stand import (
    FORWARD,
    QUIET,
    REVERSE,
    command,
    drive,
    go,
    image,
)


def test_standstill_shows_temperature_bus_and_identity_only() -> None:
    words = image(go(drive(), 5))
    assert {index for index, word in enumerate(words) if word} == {0x03, 0x04, 0x05, 0x07}
    assert 318 <= words[4] <= 330
    assert words[5] & 0xFF == 0
    assert words[7] == 26


def test_status_has_to_be_masked() -> None:
    word = image(command(drive(), FORWARD))[5]
    assert word & 0xFF == 1
    assert word >> 8


def test_poles_and_start_source_share_a_word() -> None:
    assert image(drive(F804=6))[3] == 0x0604


def test_running_values_belong_together() -> None:
    device = command(drive(), FORWARD, 10)
    words = image(device)
    assert words[0x00] == 5000
    assert 215 <= words[0x01] <= 230
    assert 300 < words[0x02] < 450
    assert words[0x04] < 320
    assert 55 < words[0x06] < 80
    assert 1395 < words[0x17] < 1500
    point = device.motor.point
    assert words[0x18] == round(point.power_in / 100)
    assert point.power_in == pytest.approx(3**0.5 * device.voltage * point.current * point.cos_phi, rel=1e-9)
    assert words[0x17] == round(device.shaft_speed)
    assert point.power_in == pytest.approx(point.power_shaft + point.losses)
    assert words[0x0C] == 1
    assert words[0x15] == 10000


def test_reverse_shows_the_same_positive_numbers() -> None:
    forward, reverse = command(drive(), FORWARD, 10), command(drive(), REVERSE, 10)
    a, b = image(forward), image(reverse)
    assert a[5] & 0xFF == 1
    assert b[5] & 0xFF == 2
    assert a[:5] + a[6:] == b[:5] + b[6:]
    assert forward.shaft_speed == -reverse.shaft_speed


def test_rated_load_draws_rated_current() -> None:
    device = VirtualE800(rated_current=2.5, parameters=QUIET, load=100, quadratic_load=0, disturbance=0)
    command(device, FORWARD, 10)
    assert image(device)[2] == pytest.approx(250, rel=0.03)
    assert image(device)[0x17] == pytest.approx(1395, rel=0.01)
    assert device.parameter("F803") == 2.5


def test_more_than_a_word_is_shown_as_the_largest_word() -> None:
    device = command(VirtualE800(rated_current=640, parameters=QUIET), FORWARD, 6)
    assert image(device)[2] == pytest.approx(53000, rel=0.1)
    assert max(image(device)) <= 0xFFFF


def test_analog_outputs_follow_the_plc_when_chosen() -> None:
    device = drive(F431=7, F432=7)
    device.write(6, 0x2002, [250])
    device.write(6, 0x2003, [1000])
    device.write(6, 0x2007, [1])
    go(device, 0.02)
    assert image(device)[0x15:0x17] == [2500, 10000]
    assert device.outputs[0x2007] == 1
