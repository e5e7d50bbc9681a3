"""The bits of standard telegram 1 stand where the profile has them."""

import pytest

from app.profidrive.words import CONTROL_BITS, ENABLES, RUN, STATUS_BITS, Bit, Control, Status


@pytest.mark.parametrize(
    ("word", "number", "bit", "parameter"),
    [
        *(("stw1", n, name, p) for n, name, p in (
            (0, "on", "p840"), (1, "no_coast_stop", "p844"), (2, "no_quick_stop", "p848"), (3, "enable_operation", "p852"),
            (4, "enable_ramp", "p1140"), (5, "continue_ramp", "p1141"), (6, "enable_setpoint", "p1142"),
            (7, "acknowledge", "p2103"), (10, "by_plc", "p854"), (11, "invert", "p1113"),
            (13, "motor_potentiometer_up", "p1035"), (14, "motor_potentiometer_down", "p1036"),
        )),
        *(("zsw1", n, name, p) for n, name, p in (
            (0, "ready_to_switch_on", "r899.0"), (1, "ready", "r899.1"), (2, "operation_enabled", "r899.2"),
            (3, "fault", "r2139.3"), (4, "no_coast_stop", "r899.4"), (5, "no_quick_stop", "r899.5"),
            (6, "switching_on_inhibited", "r899.6"), (7, "alarm", "r2139.7"), (8, "speed_within_tolerance", "r2197.7"),
            (9, "control_requested", "r899.9"), (10, "comparison_reached", "r2199.1"), (11, "limit_not_reached", "r1407.7"),
            (12, "brake_open", "r899.12"), (13, "no_motor_overtemperature", "r2135.14"), (14, "forward", "r2197.3"),
            (15, "no_power_unit_overload", "r2135.15"),
        )),
    ],
)  # fmt: skip
def test_bit_has_its_place_its_text_and_its_parameter(word: str, number: int, bit: str, parameter: str) -> None:
    row = (CONTROL_BITS if word == "stw1" else STATUS_BITS)[number]
    assert (row.number, row.key, row.parameter) == (number, f"{word}.{bit}", parameter)


def test_handy_words_are_those_of_the_profile() -> None:
    assert (ENABLES, RUN, RUN | Control.INVERT, ENABLES | Control.ACKNOWLEDGE) == (0x047E, 0x047F, 0x0C7F, 0x04FE)


@pytest.mark.parametrize(("bits", "names"), [(CONTROL_BITS, Control), (STATUS_BITS, Status)])
def test_every_bit_of_a_word_is_there_once(bits: tuple[Bit, ...], names: type[Control] | type[Status]) -> None:
    assert [bit.number for bit in bits] == list(range(16)) and len({bit.key for bit in bits}) == 16
    assert sum(names) == 0xFFFF
    assert sum(1 << bit.number for bit in CONTROL_BITS if bit.good) == RUN
