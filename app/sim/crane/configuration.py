"""What the crane's PLC is set to, axis by axis, what must hold between it, and where stands and switches are."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from types import MappingProxyType

from app.sim.crane.figures import AXES as FIGURES
from app.sim.plc import Setting

AXES: Sequence[str] = tuple(FIGURES)
FIRST_STAND, STANDS = 1, 4
"""Number of the first stand, and how many there are."""
STAND_NUMBERS: Sequence[int] = range(FIRST_STAND, STANDS + 1)
SHORTEST_RAMP = 0.5
"""Shortest ramp time that an axis takes [s]: below it the load would be thrown."""


STEEPEST_RAMP: Mapping[str, float] = MappingProxyType({"hoist": 150.0, "trolley": 350.0, "bridge": 350.0})
"""Of a ramp that is plausible [mm/s²]."""
STOP_DELAY = 0.3
"""Of a drive and a scan, before an axis brakes at a slow-down switch [s]."""


def _axis(axis: str) -> Sequence[Setting]:
    figures = {name: figure.value for name, figure in FIGURES[axis].items()}
    fastest = 200.0 if axis == "hoist" else 1000.0

    def setting(name: str, default: str | float, low: float, high: float) -> Setting:
        return Setting(f"{axis}_{name}", figures[default] if isinstance(default, str) else default, low, high)

    return (
        setting("max_rpm", figures.get("rated_speed", 1187.0), 100.0, 1800.0),
        setting("resolution", "resolution", 0.001, 10.0),
        setting("max_speed", "max_speed", 1.0, fastest),
        setting("max_position", "max_position", 5000.0, 100000.0),
        setting("end_tolerance", "end_stop_tolerance", 20.0, 2000.0),
        setting("slow_down_time", "slow_down_time", SHORTEST_RAMP, 60.0),
        setting("speed_up_time", "speed_up_time", SHORTEST_RAMP, 60.0),
        *(setting(f"step_{n}", f"step_{n}", 1.0, fastest) for n in (1, 2, 3, 4)),
        setting("fan_run_on", "fan_run_on", 0.0, 600.0),
        setting("brake_timeout", "brake_timeout", 0.5, 20.0),
        setting("preset_hold", "preset_hold", 1.0, 600.0),
    )


SETTINGS: Sequence[Setting] = (
    *(setting for axis in AXES for setting in _axis(axis)),
    Setting("safe_height", 13000.0, 1000.0, 60000.0),
    Setting("automatic_speed", 100.0, 10.0, 100.0),
    Setting("arc_radius", 3000.0, 1000.0, 6000.0),
    Setting("arc_speed", 120.0, 10.0, 200.0),
    Setting("weight_tolerance", 4.0, 0.5, 50.0),
    Setting("overload_limit", 354.0, 10.0, 400.0),
    Setting("sway_shaping", 0.0, 0.0, 2.0),
    Setting("host_timeout", 0.0, 0.0, 60.0),
)
"""In the order of the settings image: of each axis rpm, mm per pulse, mm/s, mm, mm, s, s, mm/s x 4, s, s, s; then mm, %, mm, mm/s, t, t,
0 off 1 ZV 2 ZVD, s."""


@dataclass(frozen=True, slots=True)
class Places:
    """Where switches and stands are [mm], and what the crane may carry [t]; of no source, but for the capacity.

    A stand is where the carrier's lock is: bridge, trolley and hoist there.

    Raises:
        ValueError: switches that are not in order, or a stand that the crane cannot reach.
    """

    hoist_lower_stop_at: float = 300.0
    hoist_lower_slow_at: float = 1000.0
    hoist_upper_slow_at: float = 33000.0
    hoist_upper_stop_at: float = 33800.0
    trolley_lower_stop_at: float = 300.0
    trolley_lower_slow_at: float = 2200.0
    trolley_upper_slow_at: float = 17800.0
    trolley_upper_stop_at: float = 19700.0
    bridge_lower_stop_at: float = 300.0
    bridge_lower_slow_at: float = 2200.0
    bridge_upper_slow_at: float = 57800.0
    bridge_upper_stop_at: float = 59700.0
    stand_1_bridge: float = 8000.0
    stand_1_trolley: float = 7000.0
    stand_1_hoist: float = 8000.0
    stand_2_bridge: float = 14000.0
    stand_2_trolley: float = 7000.0
    stand_2_hoist: float = 8000.0
    stand_3_bridge: float = 22000.0
    stand_3_trolley: float = 9000.0
    stand_3_hoist: float = 9000.0
    stand_4_bridge: float = 28000.0
    stand_4_trolley: float = 12000.0
    stand_4_hoist: float = 8500.0
    capacity: float = 354.0

    def __post_init__(self) -> None:
        for axis in AXES:
            ends = [
                getattr(self, f"{axis}_{end}_at") for end in ("lower_stop", "lower_slow", "upper_slow", "upper_stop")
            ]
            if not all(a < b for a, b in itertools.pairwise(ends)):
                raise ValueError(f"switches of {axis} at {ends}: expected rising positions")
        for n in STAND_NUMBERS:
            for axis in AXES:
                at = getattr(self, f"stand_{n}_{axis}")
                low, high = getattr(self, f"{axis}_lower_slow_at"), getattr(self, f"{axis}_upper_slow_at")
                if not low < at < high:
                    raise ValueError(f"stand_{n}_{axis} = {at:g}: expected more than {low:g}, less than {high:g}")

    def slow_way(self, axis: str) -> float:
        """From a slow-down switch to the stop switch behind it, the shorter one [mm]."""
        ends = [getattr(self, f"{axis}_{end}_at") for end in ("lower_stop", "lower_slow", "upper_slow", "upper_stop")]
        return float(min(ends[1] - ends[0], ends[3] - ends[2]))

    def stand(self, number: int) -> Mapping[str, float]:
        """Position of each axis where the lock of a stand is."""
        return {axis: getattr(self, f"stand_{number}_{axis}") for axis in AXES}


PLACES: Sequence[str] = tuple(field.name for field in fields(Places))
"""In the order of the configuration image."""


def faulty(values: Mapping[str, float], places: Places) -> int:
    """Number (from 1) of a setting that does not go with the others, 0 = none.

    Steps rise up to the greatest speed; an axis comes down from it between its slow-down and its stop switch, on a ramp that is plausible;
    positions are within reach, and the circular lift stays below the safe height.
    """
    return next((NAMES.index(name) + 1 for name, good in _judged(values, places) if not good), 0)


def _judged(values: Mapping[str, float], places: Places) -> Iterator[tuple[str, bool]]:
    """(setting that is to blame, whether it goes with the others)."""
    for axis in AXES:
        fastest = values[f"{axis}_max_speed"]
        steps = [values[f"{axis}_step_{n}"] for n in (1, 2, 3, 4)]
        yield from ((f"{axis}_step_{n}", a < b) for n, (a, b) in enumerate(itertools.pairwise(steps), 1))
        yield f"{axis}_step_4", steps[-1] <= fastest
        for name in ("slow_down_time", "speed_up_time"):
            yield f"{axis}_{name}", fastest <= STEEPEST_RAMP[axis] * values[f"{axis}_{name}"]
        way = fastest * (values[f"{axis}_slow_down_time"] / 2 + STOP_DELAY)
        yield f"{axis}_max_speed", way <= places.slow_way(axis)
        yield f"{axis}_max_position", values[f"{axis}_max_position"] >= getattr(places, f"{axis}_upper_stop_at")
    locks = [places.stand(n) for n in STAND_NUMBERS]
    yield "safe_height", values["safe_height"] <= places.hoist_upper_slow_at
    yield "arc_radius", max(lock["hoist"] for lock in locks) + values["arc_radius"] < values["safe_height"]
    yield "arc_radius", min(lock["trolley"] for lock in locks) - values["arc_radius"] > places.trolley_lower_slow_at
    yield "overload_limit", values["overload_limit"] <= places.capacity


NAMES: Sequence[str] = tuple(setting.name for setting in SETTINGS)
