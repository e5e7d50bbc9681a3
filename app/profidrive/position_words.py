"""The words of telegram 111, basic positioner, bit by bit; what telegram 1 has too stands in `words.py`.

Source: reference/profidrive.md sections 1, 2 and 6. Certainty: M a maker's manual (bits 0 to 7 of POS_STW2 and POS_ZSW2 are printed for
telegram 110), C public code, T a thesis, G unconfirmed.
"""

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import NamedTuple

from app.errors import TelegramError


class WordBit(NamedTuple):
    """One bit of a word."""

    number: int
    name: str
    parameter: str = ""
    """Of an S120, where it goes to or comes from; empty = none, or not known."""
    certainty: str = "G"


Word = tuple[WordBit, ...]
"""The named bits; those that are not there are reserved."""


def _word(*rows: tuple[int, str, str, str]) -> Word:
    return tuple(WordBit(*row) for row in rows)


STW1 = _word(
    (0, "on", "p840", "TC"),
    (1, "no_coast_stop", "p844", "TC"),
    (2, "no_quick_stop", "p848", "TC"),
    (3, "enable_operation", "p852", "TC"),
    (4, "do_not_reject_task", "p2641", "TC"),
    (5, "no_intermediate_stop", "p2640", "TC"),
    (6, "activate_task", "p2631", "TC"),
    (7, "acknowledge", "p2103", "TC"),
    (8, "jog_1", "p2589", "TC"),
    (9, "jog_2", "p2590", "TC"),
    (10, "by_plc", "p854", "TCM"),
    (11, "start_homing", "p2595", "TCM"),
    (13, "external_block_change", "p2633", "TCM"),
)
ZSW1 = _word(
    (0, "ready_to_switch_on", "r899.0", "TC"),
    (1, "ready", "r899.1", "TC"),
    (2, "operation_enabled", "r899.2", "TC"),
    (3, "fault", "r2139.3", "TC"),
    (4, "no_coast_stop", "r899.4", "TC"),
    (5, "no_quick_stop", "r899.5", "TC"),
    (6, "switching_on_inhibited", "r899.6", "TC"),
    (7, "alarm", "r2139.7", "TC"),
    (8, "following_error_within_tolerance", "r2684.8", "TC"),
    (9, "control_requested", "r899.9", "TC"),
    (10, "target_position_reached", "r2684.10", "TC"),
    (11, "home_position_set", "r2684.11", "TC"),
    (12, "task_acknowledged", "r2684.12", "TC"),
    (13, "drive_stopped", "r2199.0", "TC"),
    (14, "accelerates", "r2684.4", "TC"),
    (15, "decelerates", "r2684.5", "TC"),
)
POS_STW1 = _word(
    *((n, f"block_{n}", f"p{2625 + n}", "C") for n in range(6)),
    (8, "absolute", "p2648", "CG"),
    (9, "positive", "p2651", "CG"),
    (10, "negative", "p2652", "CG"),
    (12, "continuous_acceptance", "p2649", "CG"),
    (14, "set_up", "p2653", "CG"),
    (15, "mdi", "p2647", "CG"),
)
POS_STW2 = _word(
    (0, "tracking", "p2655", "M"),
    (1, "set_reference_point", "p2596", "M"),
    (2, "reference_cam", "p2612", "M"),
    (5, "incremental_jog", "p2591", "M"),
    (8, "flying_homing", "p2597", "G"),
    (9, "search_negative", "p2604", "G"),
    (10, "probe_2", "p2510", "CG"),
    (11, "probe_edge_falling", "p2511", "CG"),
    (14, "software_limits", "p2582", "CG"),
    (15, "stop_cams", "p2568", "CG"),
)
POS_ZSW1 = _word(
    *((n, f"block_{n}", f"r2670.{n}", "C") for n in range(6)),
    (8, "stop_cam_minus", "r2684.13", "CG"),
    (9, "stop_cam_plus", "r2684.14", "CG"),
    (10, "jogging", "r2094.0", "CG"),
    (11, "homing", "r2094.1", "CG"),
    (12, "flying_homing", "r2684.1", "G"),
    (13, "traversing_blocks", "r2094.2", "CG"),
    (14, "set_up", "r2094.4", "CG"),
    (15, "mdi", "r2094.3", "CG"),
)
POS_ZSW2 = _word(
    (0, "tracking", "r2683.0", "M"),
    (1, "velocity_limited", "r2683.1", "M"),
    (2, "setpoint_static", "r2683.2", "M"),
    (3, "within_position_window", "r2684.3", "M"),
    (4, "moves_forward", "r2683.4", "M"),
    (5, "moves_backward", "r2683.5", "M"),
    (6, "software_limit_minus", "r2683.6", "M"),
    (7, "software_limit_plus", "r2683.7", "M"),
    (8, "cam_1", "r2683.8", "CG"),
    (9, "cam_2", "r2683.9", "CG"),
    (10, "output_1", "r2683.10", "CG"),
    (11, "output_2", "r2683.11", "CG"),
    (12, "fixed_stop_reached", "r2683.12", "CG"),
    (13, "fixed_stop_torque_reached", "r2683.13", "CG"),
    (14, "travel_to_fixed_stop", "r2683.14", "CG"),
    (15, "traversing_command", "r2684.15", "CG"),
)
STW2 = _word(
    *((n, f"data_set_{n}", f"p{820 + n}", "CM" if n < 2 else "C") for n in range(5)),
    (7, "parking_axis", "p897", "CM"),
    (8, "travel_to_fixed_stop", "p1545", "CM"),
    (11, "motor_changed_over", "p828", "CM"),
    *((n, f"sign_of_life_{n - 12}", "p2045", "CM") for n in range(12, 16)),
)
ZSW2 = _word(
    *((n, f"data_set_{n}", f"r51.{n}", "CM") for n in range(5)),
    (7, "axis_parked", "r896.0", "CM"),
    (8, "fixed_stop", "r1406.8", "CM"),
    (11, "pulses_enabled", "r899.11", "CM"),
    *((n, f"sign_of_life_{n - 12}", "r2065", "CM") for n in range(12, 16)),
)
MELDW = _word(
    (0, "ramp_finished", "r2199.5", "CG"),
    (1, "torque_below_threshold", "r2199.11", "CG"),
    (2, "speed_below_3", "r2199.0", "CG"),
    (3, "speed_below_2", "r2197.1", "CG"),
    (5, "variable_signal", "r3294", "CG"),
    (6, "no_motor_overtemperature", "r2129.14", "CG"),
    (7, "no_power_unit_overload", "r2129.15", "CG"),
    (8, "speed_within_tolerance", "r2199.4", "CG"),
    (11, "controller_enabled", "r899.8", "CG"),
    (12, "drive_ready", "r899.7", "CG"),
    (13, "pulses_enabled", "r899.11", "CG"),
)
WORDS: Mapping[str, Word] = MappingProxyType(
    {
        "STW1": STW1,
        "ZSW1": ZSW1,
        "POS_STW1": POS_STW1,
        "POS_STW2": POS_STW2,
        "POS_ZSW1": POS_ZSW1,
        "POS_ZSW2": POS_ZSW2,
        "STW2": STW2,
        "ZSW2": ZSW2,
        "MELDW": MELDW,
    }
)
"""Name of a field of telegram 111 → its bits. Parameters beyond those of the reference are G, whatever their bit is."""


def word_of(bits: Word, names: Iterable[str]) -> int:
    """The word with the bits `names` on.

    Raises:
        TelegramError: there is no such bit.
    """
    places = {bit.name: bit.number for bit in bits}
    word = 0
    for name in names:
        if name not in places:
            raise TelegramError("bit", repr(name), f"one of {', '.join(places)}")
        word |= 1 << places[name]
    return word


def bits_of(bits: Word, word: int) -> dict[str, bool]:
    """Every named bit of `word`.

    Raises:
        TelegramError: it is no word of 16 bits.
    """
    if not 0 <= word <= 0xFFFF:
        raise TelegramError("word", str(word), "0 to 65535")
    return {bit.name: bool(word >> bit.number & 1) for bit in bits}
