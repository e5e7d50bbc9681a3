"""The equipment types that a plant names, each read once."""

from collections.abc import Iterator, Mapping
from pathlib import Path

from app.plant import types
from app.plant.definitions import EquipmentType
from app.plant.derive import order_problem
from app.plant.plant_files.languages import PlantLanguages
from app.plant.problems import Problem
from app.plant.tables import Plain
from app.plant.type_files.data import TypeData


class TypesUsed:
    """Types below `folder`, and the problems of those that were asked for."""

    def __init__(self, folder: Path, languages: PlantLanguages) -> None:
        self.names = types.names(folder)
        self.problems: list[Problem] = []
        self._folder = folder
        self._languages = languages
        self._read: dict[str, TypeData | None] = {}

    def get(self, name: str) -> TypeData | None:
        """The type `name`; None when its files have problems."""
        if name not in self._read:
            data, problems = types.read_type(name, self._languages.known, self._folder, spoken=self._languages.spoken)
            circle = "" if problems else order_problem(data.type.points)
            if circle:
                expected = "derived points that do not depend on each other"
                problems = [Problem(f"{name}/points.toml", "derived", circle, expected)]
            problems = problems or list(self._taken(name, data.type))
            self.problems += problems
            self._read[name] = None if problems else data
        return self._read[name]

    def _taken(self, name: str, kind: EquipmentType) -> Iterator[Problem]:
        """Kinds of records that another type has named so: one list, one address and one table of texts cannot be of both."""
        for other in self.usable.values():
            for record in sorted(kind.records.keys() & other.records.keys()):
                found = Plain(f"a kind of records of {other.name}, too")
                yield Problem(f"{name}/records.toml", record, found, "a name that no other type of the plant has")

    @property
    def usable(self) -> Mapping[str, EquipmentType]:
        """Those that were asked for and have no problems."""
        return {name: data.type for name, data in self._read.items() if data is not None}
