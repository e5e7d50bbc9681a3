"""The figures of the crane, each with its source; what no source gives is marked as assumed.

Source: reference/theses-facts.md section 2 (thesis 002, nameplates and configuration).
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple


class Figure(NamedTuple):
    """One number."""

    value: float
    unit: str
    source: str
    """`thesis`, `computed` from figures of the thesis, or `assumed`: in no source, to be replaced by the plant's own."""
    note: str = ""


def _thesis(value: float, unit: str, note: str = "") -> Figure:
    return Figure(value, unit, "thesis", note)


def _computed(value: float, unit: str, note: str) -> Figure:
    return Figure(value, unit, "computed", note)


def _assumed(value: float, unit: str, note: str) -> Figure:
    return Figure(value, unit, "assumed", note)


HOIST: Mapping[str, Figure] = MappingProxyType(
    {
        "motors": _thesis(2, ""),
        "rated_power": _thesis(448, "kW"),
        "rated_speed": _thesis(1193, "rpm"),
        "rated_torque": _computed(3586, "Nm", "448 kW at 1193 rpm; the nameplate prints 4177 Nm: conflict"),
        "gear": _thesis(76.6, ""),
        "capacity": _thesis(354, "t"),
        "max_speed": _thesis(132.08, "mm/s"),
        "speed_up_time": _thesis(3, "s"),
        "slow_down_time": _thesis(3, "s"),
        "resolution": _thesis(0.0838895743, "mm/pulse", "ENC_K; printed as pulses per mm: conflict"),
        "max_position": _thesis(34080, "mm"),
        "end_stop_tolerance": _thesis(500, "mm"),
        "step_1": _thesis(20.32, "mm/s"),
        "step_2": _thesis(50.8, "mm/s"),
        "step_3": _thesis(101.6, "mm/s"),
        "step_4": _thesis(132.08, "mm/s"),
        "brake_timeout": _thesis(4, "s"),
        "preset_hold": _thesis(30, "s"),
        "fan_run_on": _assumed(60, "s", "not in the text"),
        "drive_lag": _assumed(0.1, "s", "from set-point to speed"),
        "brake_release": _assumed(0.6, "s", "command to feedback"),
        "brake_close": _assumed(0.2, "s", "command to closed"),
        "brake_deceleration": _assumed(400, "mm/s²", "closed brake on the moving axis"),
        "fall": _assumed(190, "mm/s²", "full load, no torque, open brake: 3586 Nm on 20 kgm² of each motor"),
        "over_speed": _assumed(1.15, "", "of the greatest speed, where the safety brakes fall in"),
        "rope_length_at_top": _assumed(3000, "mm", "rope between trolley and hook in the highest position"),
        "rope_strain": _assumed(0.0018, "", "at full load; safety factor 8, 1770 N/mm², 105 kN/mm²"),
        "rope_damping": _assumed(0.02, "", "part of critical"),
    }
)
TROLLEY: Mapping[str, Figure] = MappingProxyType(
    {
        "motors": _thesis(1, ""),
        "rated_power": _thesis(74, "kW"),
        "rated_speed": _thesis(1187, "rpm"),
        "rated_torque": _thesis(601, "Nm"),
        "gear": _thesis(56.75, ""),
        "max_speed": _thesis(660.4, "mm/s"),
        "speed_up_time": _thesis(6, "s"),
        "slow_down_time": _thesis(4, "s"),
        "resolution": _assumed(0.3122, "mm/pulse", "as many pulses per turn as the hoist's, 6066"),
        "max_position": _assumed(20000, "mm", "not in the text"),
        "end_stop_tolerance": _assumed(500, "mm", "as the hoist's"),
        "step_1": _thesis(81.28, "mm/s"),
        "step_2": _thesis(208.28, "mm/s"),
        "step_3": _thesis(416.56, "mm/s", "printed as 75 %, 63.1 % by the speeds: conflict"),
        "step_4": _thesis(660.4, "mm/s"),
        "brake_timeout": _thesis(4, "s"),
        "preset_hold": _thesis(30, "s"),
        "fan_run_on": _assumed(60, "s", "not in the text"),
        "drive_lag": _assumed(0.1, "s", "from set-point to speed"),
        "brake_release": _assumed(0.2, "s", "command to feedback"),
        "brake_close": _assumed(0.1, "s", "command to closed"),
        "brake_deceleration": _assumed(800, "mm/s²", "closed brake on the moving axis"),
    }
)
BRIDGE: Mapping[str, Figure] = MappingProxyType(
    {
        name: _assumed(figure.value, figure.unit, "the text has no figures of the bridge; as the trolley's")
        for name, figure in TROLLEY.items()
        if not name.startswith("rated") and name not in ("motors", "gear")
    }
    | {"max_position": _assumed(60000, "mm", "not in the text")}
)
AXES: Mapping[str, Mapping[str, Figure]] = MappingProxyType({"hoist": HOIST, "trolley": TROLLEY, "bridge": BRIDGE})
