"""Lessons: text files of steps that watch a machine and tick off what a learner does.

Of a type in its folder, `equipment/<type>/lessons/<name>.toml`, for every plant that has such a machine; of a plant in
`<plant>/lessons/<name>.toml`, then with `type`.

    [lesson]
    type = "eura_e800"                                  in a plant folder only
    title = { hr = "…", en = "Start, trip, reset", de = "…", cs = "…" }
    about = { … }                                       what one learns
    minutes = 10

    [[steps]]                                           in order; each has title and text, may have a hint, and exactly one of:
    title = { … }
    text = { … }
    hint = { … }
    until = "status == 1 and frequency > 5"             a sentence over the points of the machine; `hold = 2`: for so long [s]
    command = "reset"                                   a command of the learner's, confirmed
    alarm = "overcurrent"                               an alarm of the machine; `moment` = active, acknowledged or gone
    cause = "OC"                                        a machine fault of its training.toml, when the learner says so; "none" ends it
    [[steps.choices]]                                   a question: two to six answers, one of them right
    label = { … }
    right = true
    why = { … }                                         said after it was chosen
    [[steps.solution]]                                  how it is done; a test plays the lesson by it
    command = "set_frequency"
    value = 30                                          or `acknowledge = "overcurrent"` in place of a command
"""

import re
from collections.abc import Callable, Collection, Iterator, Mapping
from difflib import get_close_matches
from functools import reduce
from pathlib import Path

from app.errors import ConfigurationError
from app.plant import expression
from app.plant.definitions import EquipmentType
from app.plant.lesson_definition import MOMENTS, NO_FAULT, Choice, Deed, Lesson, LessonStep, Texts
from app.plant.problems import Problem
from app.plant.said import Plain, said
from app.plant.tables import MISSING, NONE, Source, Table, meant_as_toml, perhaps
from app.plant.type_files.sentences import check_choices

FOLDER = "lessons"
NAME = r"[a-z][a-z0-9_]{0,31}"
MOST_LESSONS, MOST_STEPS = 60, 60
"""In one folder; in one lesson."""
LONGEST_HOLD = 600.0
"""[s]"""
MOST_CHOICES = 6
WAYS = ("until", "command", "alarm", "cause", "choices")
"""What a step may be done by."""

ReadLabel = Callable[[Table, str, bool], Texts]
"""(table, key, whether it must be there) → the text in every language that it has; notes what is wrong."""


class LessonFiles:
    """The lessons of a plant folder and of the types that the plant uses; all mistakes of all files."""

    def __init__(self, folder: Path, label: ReadLabel) -> None:
        self.found: dict[str, Lesson] = {}
        self._folder = folder
        self._label = label
        self._sources: list[Source] = []
        self._used: Collection[str] = ()

    @property
    def problems(self) -> list[Problem]:
        """What was wrong."""
        return [problem for source in self._sources for problem in source.problems]

    def read(self, kinds: Mapping[str, EquipmentType], used: Collection[str]) -> None:
        """Read the lessons of these types, then the plant's own. Of types that are `used` and not among them mistakes are told
        elsewhere: what a lesson names of them is not judged."""
        self._used = used
        for kind in kinds.values():
            self._read_folder(kind.folder / FOLDER, f"{kind.name}/{FOLDER}", {kind.name: kind}, kind.folder)
        self._read_folder(self._folder / FOLDER, FOLDER, kinds, self._folder, own=True)

    def _read_folder(
        self, folder: Path, shown: str, kinds: Mapping[str, EquipmentType], inside: Path, *, own: bool = False
    ) -> None:
        paths = meant_as_toml(folder)
        for path in paths[:MOST_LESSONS]:
            source = Source(path, f"{shown}/{path.name}", inside=inside)
            self._sources.append(source)
            if source.problems:
                continue
            root, name = source.table(), path.stem
            if not own and name in self.found:  # another type has one that is called so
                name = f"{next(iter(kinds))}_{name}"
            if not _named(path.name):
                root.note("", Plain(path.name), said("mistake.file_name"))
            elif name in self.found:
                root.note("", Plain(path.stem), said("mistake.lesson_name"))
            lesson = self._lesson(name, root, kinds, own=own)
            if not source.problems:
                self.found[name] = lesson
        if len(paths) > MOST_LESSONS:
            found, most = said("mistake.files", number=len(paths)), said("mistake.lessons_in_folder", most=MOST_LESSONS)
            self._sources[-1].note((), found, most)

    def _lesson(self, name: str, root: Table, kinds: Mapping[str, EquipmentType], *, own: bool) -> Lesson:
        head = root.table("lesson", required=True, expected=said("mistake.lesson_head", table="[lesson]"))
        kind_name = head.text("type", choices=sorted(self._used)) if own else next(iter(kinds))
        kind = kinds.get(kind_name)
        title, about = self._label(head, "title", True), self._label(head, "about", True)
        minutes = head.whole("minutes", 10, low=1, high=240)
        head.done()
        steps = [self._step(row, kind) for row in root.rows("steps")]
        if not steps:
            root.note("steps", NONE, said("mistake.at_least_one", what="[[steps]]"))
        elif len(steps) > MOST_STEPS:
            root.note("steps", said("mistake.steps", number=len(steps)), said("mistake.at_most", most=MOST_STEPS))
        root.done()
        return Lesson(name, kind_name, title, about, minutes, tuple(steps))

    def _step(self, row: Table, kind: EquipmentType | None) -> LessonStep:
        given = [way for way in WAYS if row.has(way)]
        if len(given) != 1:
            found = reduce(lambda one, other: said("mistake.and", first=one, second=other), given) if given else NONE
            row.note("", found, said("mistake.exactly_one", names=", ".join(WAYS)))
        step = LessonStep(
            title=self._label(row, "title", True),
            text=self._label(row, "text", True),
            hint=self._label(row, "hint", False) if row.has("hint") else {},
            until=row.text("until", ""),
            hold=float(row.number("hold", 0.0, 0.0, LONGEST_HOLD)),
            command=row.text("command", "", choices=list(kind.commands) if kind else None),
            alarm=row.text("alarm", "", choices=[alarm.key for alarm in kind.alarms] if kind else None),
            moment=row.text("moment", MOMENTS[0], choices=MOMENTS),
            cause=row.text("cause", "", choices=[NO_FAULT, *kind.training.faults] if kind else None),
            choices=tuple(self._choices(row)),
            solution=tuple(_solution(row, kind)),
        )
        if step.until and kind:
            _check_sentence(row, step.until, kind)
        if row.has("hold") and not row.has("until"):
            row.note("hold", row.data["hold"], said("mistake.only_beside", key="until"))
        if row.has("moment") and not row.has("alarm"):
            row.note("moment", row.data["moment"], said("mistake.only_beside", key="alarm"))
        row.done()
        return step

    def _choices(self, row: Table) -> Iterator[Choice]:
        found = [
            (table, Choice(self._label(table, "label", True), table.flag("right"), self._label(table, "why", True)))
            for table in row.rows("choices")
        ]
        for table, _ in found:
            table.done()
        if row.has("choices"):
            right = sum(choice.right for _, choice in found)
            if not 2 <= len(found) <= MOST_CHOICES:
                row.note(
                    "choices",
                    said("mistake.answers", number=len(found)),
                    said("mistake.answers_between", low=2, high=MOST_CHOICES),
                )
            if right != 1:
                row.note("choices", said("mistake.right_answers", number=right), said("mistake.one_right"))
        yield from (choice for _, choice in found)


def _solution(row: Table, kind: EquipmentType | None) -> Iterator[Deed]:
    for table in row.rows("solution"):
        if table.has("command") == table.has("acknowledge"):
            found = said("mistake.both") if table.has("command") else MISSING
            table.note("", found, said("mistake.either", first="command", second="acknowledge"))
        command = table.text("command", "", choices=list(kind.commands) if kind else None)
        value = table.number("value", None)
        if kind and command and (value is not None) != bool(kind.commands[command].argument):
            expected = said(f"mistake.{'no_value' if value is not None else 'value'}_with", command=command)
            table.note("value", Plain(f"{value:g}") if value is not None else MISSING, expected)
        alarms = [alarm.key for alarm in kind.alarms] if kind else None
        yield Deed(command, value, table.text("acknowledge", "", choices=alarms))
        table.done()


def _check_sentence(row: Table, text: str, kind: EquipmentType) -> None:
    try:
        sentence = expression.parse(text)
    except ConfigurationError as error:
        row.note("until", text, error.args[0])
        return
    for name in sorted(sentence.names - kind.points.keys()):
        near = get_close_matches(name, list(kind.points), n=1)
        row.note("until", name, said("mistake.point_of_type", owner=kind.name, near=perhaps(near[0] if near else "")))
    if sentence.needs_argument:
        row.note("until", expression.ARGUMENT, said("mistake.lesson_argument"))
    check_choices(row, "until", text, kind.points.get)


def _named(file: str) -> bool:
    return re.fullmatch(rf"{NAME}\.toml", file) is not None
