"""The equipment types that a plant names, each read once."""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from app.plant import types
from app.plant.definitions import EquipmentType
from app.plant.derive import order_problem
from app.plant.plant_files.languages import PlantLanguages
from app.plant.problems import Problem
from app.plant.said import said
from app.plant.tables import Enough, Table
from app.plant.type_files.data import TypeData
from app.plant.type_files.names import KEY, NAME_EXPECTED


class TypesUsed:
    """Types below `folder` and those that the folder `plant` brings, and the problems of those that were asked for."""

    def __init__(self, folder: Path, languages: PlantLanguages, plant: Path) -> None:
        self.problems: list[Problem] = []
        self._folder = folder
        self._plant = plant
        self._brought = self._names(types.names(folder))
        self.names = sorted({*types.names(folder), *self._brought})
        self._languages = languages
        self._read: dict[str, TypeData | None] = {}
        self._variants: dict[tuple[str, frozenset[tuple[str, float]]], TypeData | None] = {}

    def get(self, name: str) -> TypeData | None:
        """The type `name`; None when its files have problems."""
        if name not in self._read:
            data, problems = self._of(name, {})
            problems = problems or list(self._taken(name, data.type))
            self.problems += problems
            self._read[name] = None if problems else data
        return self._read[name]

    def variant(self, usual: TypeData, table: Table) -> TypeData | None:
        """The type of a machine that `table` describes, as many of its repeated rows as the options there say; `usual` where they say
        nothing else, or what cannot be (that is told where the options are read)."""
        counted = {option: table.data[option] for option in usual.counted if option in table.data}
        preset = usual.type.presets.get(str(table.data.get("preset", "")), {})
        counted |= {option: preset[option] for option in usual.counted - counted.keys() if option in preset}
        for option, value in counted.items():
            low, high = usual.type.ranges[option]
            if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high or value % 1:
                return usual
        given = {option: float(value) for option, value in counted.items() if value != usual.type.options[option]}
        if not given:
            return usual
        key = usual.type.name, frozenset(given.items())
        if key not in self._variants:
            data, problems = self._of(usual.type.name, given)
            self.problems += problems
            self._variants[key] = None if problems else data
        return self._variants[key]

    def _names(self, taken: Sequence[str]) -> frozenset[str]:
        """The types that the plant brings; what is wrong with their names is noted."""
        found = types.names(self._plant / types.OWN)
        for name in found:
            if not re.fullmatch(KEY, name):
                self.problems.append(Problem(f"{types.OWN}/{name}", "(folder)", name, NAME_EXPECTED))
            elif name in taken:
                self.problems.append(Problem(f"{types.OWN}/{name}", "(folder)", name, said("mistake.own_type")))
        return frozenset(name for name in found if re.fullmatch(KEY, name)) - frozenset(taken)

    def _of(self, name: str, given: Mapping[str, float]) -> tuple[TypeData, list[Problem]]:
        known, spoken = self._languages.known, self._languages.spoken
        try:
            if name in self._brought:
                data, problems = types.read_own_type(name, known, self._plant, spoken=spoken, given=given)
            else:
                data, problems = types.read_type(name, known, self._folder, spoken=spoken, given=given)
        except Enough as enough:
            self.problems += enough.problems
            raise
        circle = "" if problems else order_problem(data.type.points)
        if circle:
            expected = said("mistake.no_circle")
            problems = [Problem(f"{name}/points.toml", "derived", circle, expected)]
        return data, problems

    def _taken(self, name: str, kind: EquipmentType) -> Iterator[Problem]:
        """Kinds of records that another type has named so: one list, one address and one table of texts cannot be of both."""
        for other in self.usable.values():
            for record in sorted(kind.records.keys() & other.records.keys()):
                found, expected = said("mistake.kind_taken", type=other.name), said("mistake.kind_name")
                yield Problem(f"{name}/records.toml", record, found, expected)

    @property
    def doubts(self) -> list[Problem]:
        """What is seldom meant in those that are used, each once."""
        read = (*self._read.values(), *self._variants.values())
        told = [doubt for data in read if data is not None for doubt in data.doubts]
        return list({(doubt.file, doubt.key): doubt for doubt in reversed(told)}.values())[::-1]

    @property
    def asked(self) -> frozenset[str]:
        """Those that were asked for, with problems or without."""
        return frozenset(self._read)

    @property
    def usable(self) -> Mapping[str, EquipmentType]:
        """Those that were asked for and have no problems."""
        return {name: data.type for name, data in self._read.items() if data is not None}
