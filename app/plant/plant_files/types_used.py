"""The equipment types that a plant names, each read once."""

from collections.abc import Mapping
from pathlib import Path

from app.plant import types
from app.plant.definitions import EquipmentType, Problem
from app.plant.derive import order_problem
from app.plant.plant_files.languages import PlantLanguages
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
            self.problems += problems
            self._read[name] = None if problems else data
        return self._read[name]

    @property
    def usable(self) -> Mapping[str, EquipmentType]:
        """Those that were asked for and have no problems."""
        return {name: data.type for name, data in self._read.items() if data is not None}
