"""A set of setpoints on its way."""

from app.commands.lifecycle import Progress, ProgressState
from app.commands.value_set import Stands
from tests.commands.stand import SETTINGS, Stand

RAMPS = {"f114": 6.0, "f115": 7.0, "f209": 1.0}


KEYS = list(RAMPS)


def values(stand: Stand, keys: object = RAMPS) -> dict[str, float]:
    return {key: stand.drive()[key] for key in keys}  # type: ignore[attr-defined]


def former(keys: object = RAMPS) -> dict[str, float]:
    return {key: SETTINGS[key] for key in keys}  # type: ignore[attr-defined]


def stands(progress: Progress) -> dict[str, str]:
    return {change.key: str(change.stands) for change in progress.changes}


def is_true(stand: Stand, progress: Progress) -> None:
    """What is told of each value is what the drive holds; what is not known is told as not known."""
    for change in progress.changes:
        held = stand.drive()[change.key]
        told = {Stands.NEW: change.new, Stands.OLD: change.old, Stands.OTHER: change.found}
        assert change.stands is Stands.UNKNOWN or held == told[change.stands], (change, held)
    expected = {ProgressState.CONFIRMED: {Stands.NEW}, ProgressState.FAILED: {Stands.OLD}}.get(progress.state)
    if expected is not None and progress.changes:
        assert {change.stands for change in progress.changes} == expected, progress


class Clamps:
    """Makes a drive hold another value than it is sent."""

    def __init__(self, stand: Stand, key: str, value: float, *, always: bool = False) -> None:
        take = stand.drives["m1"].take

        def spoiled(point: str, asked: float) -> None:
            take(point, value if point == key and (always or asked != SETTINGS[key]) else asked)

        stand.drives["m1"].take = spoiled  # type: ignore[method-assign]
