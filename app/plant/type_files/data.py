"""What the readers of an equipment type hand on: the type, and what only the loader of a plant needs of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from app.plant.definitions import EquipmentType, Point
from app.plant.problems import Problem
from app.plant.type_files.options import OptionCheck


@dataclass(slots=True)
class PointData:
    """A point of a type as its data stands; bounds may still be expressions over options."""

    point: Point
    bounds: dict[str, str] = field(default_factory=dict)
    """Field of the point (`low`, `high`, `scale_low`, `scale_high`, `dead_band`, `normal.0`, `normal.1`) → expression."""
    part: bool = False
    """It shows bits of the word of another point."""


@dataclass(frozen=True, slots=True)
class TypeData:
    """An equipment type with what only the loader needs."""

    type: EquipmentType
    points: Mapping[str, PointData]
    choices: Mapping[str, Mapping[str, Sequence[str]]]
    """Options that are tables (`simulation`): key → allowed words."""
    parameters: Mapping[str, frozenset[str]]
    """Options that are tables: codes of parameters that may stand in them."""
    numbers: Mapping[str, Mapping[str, tuple[float, float]]] = field(default_factory=dict)
    """Options that are tables: key → least and greatest number."""
    columns: Mapping[str, Mapping[str, PointData]] = field(default_factory=dict)
    """Table → column → the cell of slot 1, its key still that of the column."""
    checks: Sequence[OptionCheck] = ()
    counted: frozenset[str] = frozenset()
    """Options by which rows of the type are repeated: with other values it is another set of points, commands, alarms."""
    whole: frozenset[str] = frozenset()
    """Options that have whole numbers only."""
    follows: Mapping[str, str] = field(default_factory=dict)
    """Options whose default is a sentence over options before them."""
    doubts: Sequence[Problem] = ()
    """What is no mistake in its files and seldom meant."""
