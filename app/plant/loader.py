"""A plant folder → (definitions, problems). All mistakes at once, each with file, line, key, value and what was expected; never raises."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from app.plant import types
from app.plant.definitions import Plant, Texts
from app.plant.lessons import LessonFiles
from app.plant.plant_files.alarm_classes import read_alarm_classes
from app.plant.plant_files.alarms import read_plant_alarm
from app.plant.plant_files.couplings import couple
from app.plant.plant_files.flow import read_flow
from app.plant.plant_files.languages import PlantLanguages, languages, read_timezone
from app.plant.plant_files.links import read_links
from app.plant.plant_files.machines import MOST_MACHINES, MOST_POINTS, Machines
from app.plant.plant_files.names import check_id
from app.plant.plant_files.screens import read_screens
from app.plant.plant_files.shifts import USUAL, read_shifts
from app.plant.plant_files.types_used import TypesUsed
from app.plant.problems import MoreProblems, Problem
from app.plant.said import said
from app.plant.sequence_recipe import texts_of
from app.plant.sequences import SequenceFiles
from app.plant.tables import MOST_PROBLEMS, NONE, STOP_AT, Enough, Source, Table

PLANT_FILE = "plant.toml"
TRANSPORTS = ("memory", "tcp", "rtu")


def read_plant(
    folder: Path,
    *,
    type_folder: Path = types.EQUIPMENT,
    transports: Sequence[str] = TRANSPORTS,
    drafts: Mapping[str, str] = MappingProxyType({}),
) -> tuple[Plant | None, list[Problem]]:
    """Read `folder`/plant.toml with the equipment types (the product's, and its own in `equipment/`) and the sequences (plant/sequences.py)
    it names.

    The plant is None exactly when there are problems. A text that lacks a language is no problem: it is shown with its language mark.
    `drafts`: sequence → the text that is read in place of its file.
    """
    try:
        reader = _PlantReader(Path(folder), type_folder, transports, drafts)
        try:
            plant = reader.read()
        except Enough:
            plant = None
    except (OSError, RecursionError) as error:
        return None, [Problem(PLANT_FILE, "(file)", str(folder), said("mistake.plant_folder", why=error))]
    problems = reader.problems
    return (None if problems else plant), shortened(problems)


def shortened(problems: list[Problem]) -> list[Problem]:
    """The first `MOST_PROBLEMS`, and a line that says how many more there are."""
    if len(problems) <= MOST_PROBLEMS:
        return problems
    return [*problems[:MOST_PROBLEMS], MoreProblems(len(problems) - MOST_PROBLEMS, stopped=len(problems) >= STOP_AT)]


class _PlantReader:
    def __init__(self, folder: Path, type_folder: Path, transports: Sequence[str], drafts: Mapping[str, str]) -> None:
        self._folder = folder
        self._transports = transports
        self._source = Source(folder / PLANT_FILE, PLANT_FILE, inside=folder)
        known = languages()
        self._languages = PlantLanguages(known, known)
        self._types = TypesUsed(type_folder, self._languages, folder)
        self._sequences = SequenceFiles(
            folder, lambda table, key: self._languages.label(table, key, required=True), drafts
        )
        self._lessons = LessonFiles(folder, lambda table, key, must: self._languages.label(table, key, required=must))
        self._machines = Machines(self._types, self._sequences, self._languages)

    @property
    def problems(self) -> list[Problem]:
        return [*self._source.problems, *self._sequences.problems, *self._types.problems, *self._lessons.problems]

    def read(self) -> Plant | None:
        if self._source.problems:
            return None
        root = self._source.table()
        name, timezone, shifts = self._head(root)
        areas = {key: self._area(key, table) for key, table in root.tables("areas")}
        links = read_links(root, self._transports, self._languages)
        if not links:
            root.note("links", NONE, said("mistake.at_least_one", what="[links.<name>]"))
        machines = self._machines
        for key, table in root.tables("equipment"):
            machines.read(key, table, links, areas)
            if machines.too_many:
                found = said("mistake.too_many_machines", machines=MOST_MACHINES, points=MOST_POINTS)
                root.note("equipment", found, said("mistake.no_more_in_plant"))
                return None
        if not root.data.get("equipment"):
            root.note("equipment", NONE, said("mistake.at_least_one", what="[equipment.<id>]"))
        couple(machines, self._sequences, links, root.data.get("equipment", {}))
        texts: dict[str, dict[str, str]] = {}
        for row in root.rows("alarms"):
            read_plant_alarm(row, machines, self._languages, texts)
        for key, label in texts_of(machines.found):
            for language, text in label.items():
                texts.setdefault(language, {})[key] = text
        classes = read_alarm_classes(
            root, {alarm.alarm_class for item in machines.found.values() for alarm in item.alarms}
        )
        flow = read_flow(root.table("picture"), machines)
        self._lessons.read(self._types.usable, self._types.asked)
        root.done()
        for item in machines.found.values():
            if item.area not in areas:
                areas[item.area] = self._area_of_type(item.area, item.type.texts)
        named = tuple(self._languages.named)
        kinds, lessons = self._types.usable, self._lessons.found
        all = machines.found
        screens, wrong = read_screens(self._folder, all, self._languages)
        doubts = (*self._source.doubts, *self._types.doubts, *wrong)
        return Plant(
            self._folder,
            name,
            timezone,
            named,
            areas,
            links,
            all,
            kinds,
            texts,
            flow,
            lessons,
            shifts,
            classes,
            screens,
            doubts,
        )

    def _head(self, root: Table) -> tuple[dict[str, str], str, tuple[int, ...]]:
        """`[plant]`: name, time zone and shifts; its languages are known from then on."""
        head = root.table("plant", required=True, expected=said("mistake.plant_head", table="[plant]"))
        if not root.has("plant"):
            return {}, "UTC", USUAL
        self._languages.read(head)
        name, timezone = self._languages.label(head, "name", required=True), read_timezone(head)
        shifts = read_shifts(head)
        head.done()
        return name, timezone, shifts

    def _area(self, key: str, table: Table) -> Texts:
        check_id(key, table)
        label = self._languages.label(table, "label", default=key)
        table.done()
        return label

    def _area_of_type(self, area: str, texts: Mapping[str, Texts]) -> Texts:
        """What a type calls its area, where the plant file names none."""
        own = {language: words["area"] for language, words in texts.items() if "area" in words}
        return own or dict.fromkeys(self._languages.named, area)
