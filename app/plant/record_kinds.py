"""Record kinds of an equipment type: records.toml, and the functions of the type's own records.py that bear a kind's name.

Events stand in records.toml by their keys of events.toml, `"all"` means any.
"""

from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType

from app.plant.said import said
from app.plant.tables import MISSING, REQUIRED, Table, one_of
from app.plant.toml import parse
from app.records.kind import (
    SOURCES,
    Column,
    End,
    Field,
    Filter,
    Hooks,
    Order,
    Parts,
    Pause,
    RecordKind,
    Repeat,
    Rule,
    Shown,
    Type,
    Verb,
    When,
)
from app.records.record import OPEN, UNKNOWN

PYTHON = "records.py"
KEY = r"[a-z][a-z0-9_]*"
HOOKS = ("number", "belongs", "fold", "detail")
SAID = ("value", "source", "time")
"""What every event says beside the words of its snapshot."""
SECONDS = ("elapsed", "value", "unknown")
LISTED = ("begun", "ended", *(one for one in SOURCES if "." not in one))
"""What a column of the list may show beside the fields."""
OR = " or "
"""Between two fields of one column: the second where the first is empty."""
DEFAULT = ("begun", "equipment", "outcome", "duration")
COMMON = ("equipment", "outcome", "duration", "alarms", "person", "reason", "definition", "ended", "missed")
"""Columns that are called the same whatever the kind: `records.<column>`."""
OPEN_CHOICE = ("any", "choice", "alarm")
"""Filters that offer: whatever it is."""
HOW = ("is", "above", "any", "choice", "alarm")
REPEATED = ("time", "value", "seconds")
MOST_REPEATED = 200
ALL = "all"


def read_kinds(
    file: Table, folder: Path, package: str, events: Mapping[int, str], words: Sequence[str]
) -> dict[str, RecordKind]:
    """The kinds that `file` declares, in its order.

    `events`: codes of events.toml; `words`: names of what a snapshot says; `package`: where
    records.py is imported from, empty: from nowhere.
    """
    has_python = package and file.data and (folder / PYTHON).is_file()
    python = import_module(f"{package}.{folder.name}.records") if has_python else None
    codes = {key: code for code, key in events.items()}
    found = {name: _KindReader(name, table, codes, words, _hooks(python, name)).read() for name, table in file.tables()}
    for name, kind in found.items():
        for one in kind.fields.values():
            if one.overlapping and one.overlapping not in found:
                file.note(f"{name}.fields.{one.name}.overlapping", one.overlapping, one_of(list(found)))
    file.done()
    return found


def text_keys(kinds: Mapping[str, RecordKind]) -> Iterator[str]:
    """Every text that these kinds ask for."""
    for kind in kinds.values():
        of = f"record.{kind.name}"
        yield from (f"{of}.{key}" for key in ("title", "none", "choose", "hint", "unseen"))
        yield from (f"{of}.outcome.{one}" for one in kind.outcomes)
        yield from (
            f"{of}.column.{one}" for one in {_first(column) for column in (*kind.columns, *kind.details)} - set(COMMON)
        )
        for one in kind.filters.values():
            yield f"{of}.filter.{one.name}"
            if one.how in OPEN_CHOICE:
                yield f"{of}.any.{one.name}"
        yield from (f"{of}.badge.{one.name}" for one in kind.fields.values() if one.badge)
        repeated = kind.repeat.columns if kind.repeat else ()
        yield from (f"{of}.csv.{header(column.name)}" for column in (*kind.csv, *repeated))
        yield from (f"{of}.{one.name}.{word}" for one in kind.fields.values() for word in one.words)


def _first(column: str) -> str:
    return column.partition(OR)[0]


def former_addresses(folder: Path) -> dict[str, str]:
    """Address before there were records → kind, of all types in `folder`."""
    return {
        table["former"]: kind
        for file in sorted(folder.glob("*/records.toml"))
        for kind, table in parse(file.read_text("utf-8")).items()
        if "former" in table
    }


def header(column: str) -> str:
    """Key of the text of a column: `s{n}_utc` is `s_n_utc`."""
    return column.replace("{n}", "_n").replace("__", "_")


def _hooks(python: ModuleType | None, kind: str) -> Hooks:
    return Hooks(**{name: getattr(python, f"{kind}_{name}", None) for name in HOOKS})


class _KindReader:
    def __init__(self, name: str, table: Table, codes: Mapping[str, int], words: Sequence[str], hooks: Hooks) -> None:
        self.name, self.table, self.codes, self.words, self.hooks = name, table, codes, words, hooks

    def read(self) -> RecordKind:
        table = self.table
        if not codes_named(self.name):
            table.note("", self.name, said("mistake.name"))
        also = table.table("also")
        ends = tuple(self._ends())
        fields = {key: self._field(key, row) for key, row in table.tables("fields")}
        reopen = table.table("reopen")
        csv, absent = table.table("csv"), self._absent(fields)
        lasts = table.text("lasts", "")
        if lasts:
            self._of(table, "lasts", lasts)
        filters = {key: self._filter(key, row, fields) for key, row in table.tables("filters")}
        kind = RecordKind(
            name=self.name,
            begin=self._events(table, "begin", required=True) or frozenset(),
            number=self._word(table, "number"),
            only=self._events(table, "only") if table.has("only") else None,
            implied=self._events(table, "implied"),
            found=self._events(table, "found") or frozenset(),
            also=self._word(also, "word"),
            shared=self._events(also, "events") or frozenset(),
            late=float(table.number("late", 0.0, 0, 86_400)),
            ends=ends,
            oldest=self._events(table, "oldest") or frozenset(),
            restart=self._events(table, "restart") or frozenset(),
            displaced=table.text("displaced", UNKNOWN, pattern=KEY, expected=said("mistake.key")),
            reopen={key: self._events(reopen, key) or frozenset() for key in reopen.data},
            order=self._order(),
            lasts=lasts,
            expired=table.text("expired", UNKNOWN, pattern=KEY, expected=said("mistake.key")),
            forgotten=table.text("forgotten", "", pattern=KEY, expected=said("mistake.key")),
            parts=self._parts(),
            pause=Pause(*pair) if (pair := self._pair("pause")) else None,
            alarms=table.flag("alarms"),
            definition=table.flag("definition"),
            fields=fields,
            key=self._field_name("key", fields),
            value=self._field_name("value", fields),
            columns=tuple(one for one in self._columns("columns", fields, DEFAULT) if one not in absent),
            minor=frozenset(self._columns("minor", fields, ())),
            shown=tuple(self._shown(row) for row in table.rows("shown")),
            absent=absent,
            details=tuple(one for one in self._columns("details", fields, DEFAULT) if one not in absent),
            filters={key: one for key, one in filters.items() if one.of not in absent},
            csv=tuple(column for column in self._csv(csv, fields) if column.of not in absent),
            repeat=self._repeat(csv),
            complete=table.text("complete", ""),
            former=table.text("former", ""),
            title=csv.text("title", self.name),
            file=csv.text("file", self.name),
            hooks=self.hooks,
        )
        for name, tables in (("also", also), ("reopen", reopen), ("csv", csv)):
            if table.has(name):
                tables.done()
        for index, end in enumerate(ends):
            for outcome in end.after - set(kind.outcomes):
                table.note(f"end.{index}.after", outcome, one_of(kind.outcomes, outcome))
        for key, one in kind.filters.items():
            if one.how == "choice" and one.of != kind.key:
                table.note(f"filters.{key}.of", one.of, said("mistake.key_field"))
        for outcome in set(kind.reopen) - set(kind.outcomes):
            table.note(f"reopen.{outcome}", outcome, one_of(kind.outcomes, outcome))
        table.done()
        return kind

    # ---- events and words -------------------------------------------------------------------------------

    def _events(self, table: Table, key: str, *, required: bool = False) -> frozenset[int] | None:
        """Codes of the events that stand at `key`; None for all of them."""
        if table.raw(key) == ALL and not required:
            return None
        found = set()
        for index, one in enumerate(table.items(key, REQUIRED if required else [], said("mistake.list_of_events"))):
            if isinstance(one, str) and one in self.codes:
                found.add(self.codes[one])
            else:
                table.note(f"{key}.{index}", one, said("mistake.event_of_events", known=one_of(list(self.codes), one)))
        if required and not found:
            table.note(key, table.raw(key, MISSING), said("mistake.an_event"))
        return frozenset(found)

    def _when(self, table: Table) -> When:
        value = table.number("value", None) if table.has("value") else None
        return When(
            self._events(table, "events", required=True) or frozenset(),
            table.whole("source") if table.has("source") else None,
            None if value is None else float(value),
        )

    def _word(self, table: Table, key: str) -> str:
        word = table.text(key, "")
        if word and word not in self.words:
            table.note(key, word, said("mistake.word_of_snapshot", known=one_of(self.words, word)))
        return word

    def _of(self, table: Table, key: str, of: str) -> None:
        if of not in SAID and of not in self.words:
            table.note(key, of, one_of([*SAID, *self.words], of))

    def _parts(self) -> Parts | None:
        table = self.table.table("parts")
        if not self.table.has("parts"):
            return None
        named = table.text("named", "", pattern=KEY, expected=said("mistake.enumeration"))
        begin, end = (self._events(table, name, required=True) or frozenset() for name in ("begin", "end"))
        together = table.flag("together")
        table.done()
        return Parts(begin, end, named, together)

    def _pair(self, key: str) -> tuple[frozenset[int], frozenset[int]] | None:
        table = self.table.table(key)
        if not self.table.has(key):
            return None
        found = [self._events(table, name, required=True) or frozenset() for name in ("begin", "end")]
        table.done()
        return found[0], found[1]

    def _order(self) -> Order | None:
        table = self.table.table("order")
        if not self.table.has("order"):
            return None
        found = [self._events(table, name, required=True) or frozenset() for name in ("begun", "ended")]
        table.done()
        return Order(found[0], found[1])

    # ---- ends and fields --------------------------------------------------------------------------------

    def _ends(self) -> list[End]:
        found = []
        for row in self.table.rows("end"):
            end = End(
                row.text("outcome", pattern=KEY, expected=said("mistake.key")),
                self._when(row),
                frozenset(map(str, row.items("after", [OPEN], said("mistake.list_of_outcomes")))),
                row.text("seconds", SECONDS[0], choices=SECONDS),
                row.text("part", ""),
            )
            row.done()
            found.append(end)
        if not found:
            self.table.note("end", MISSING, said("mistake.ends", table="[[end]]"))
        return found

    def _field(self, key: str, table: Table) -> Field:
        kind = Type(table.text("type", Type.NUMBER.value, choices=[one.value for one in Type]))
        if not codes_named(key) or key in SOURCES or key in LISTED:
            table.note("", key, said("mistake.name_none_of", taken=", ".join(LISTED)))
        people = None
        if table.has("events"):
            people = When(self._events(table, "events", required=True) or frozenset())
            if kind is not Type.PERSON:
                table.note("events", table.raw("events"), said("mistake.rules"))
        field = Field(
            name=key,
            type=kind,
            rules=tuple(self._rule(row) for row in table.rows("rules")),
            unit=table.text("unit", ""),
            decimals=table.whole("decimals", 0, 0, 6),
            initial=table.number("initial", None) if table.has("initial") else None,
            overlapping=table.text("overlapping", ""),
            people=people,
            words=tuple(map(str, table.items("words", []))),
            badge=table.text("badge", ""),
        )
        if field.words and kind is not Type.WORD:
            table.note("words", list(field.words), said("mistake.no_words"))
        table.done()
        return field

    def _rule(self, row: Table) -> Rule:
        verb = Verb(row.text("verb", choices=[one.value for one in Verb]) or Verb.SET.value)
        of = row.text("of", "") if verb is Verb.COUNT else row.text("of")
        if of:
            self._of(row, "of", of)
        above = row.number("above", None) if row.has("above") else None
        rule = Rule(verb, self._when(row), of, row.flag("amount"), None if above is None else float(above))
        row.done()
        return rule

    def _absent(self, fields: Mapping[str, Field]) -> frozenset[str]:
        """`[<kind>.absent.<what>]`: fields that a machine has not that has nothing to fill them with."""
        found: set[str] = set()
        for _, table in self.table.tables("absent"):
            for index, one in enumerate(str(one) for one in table.items("fields", ())):
                found.add(one)
                if one not in fields:
                    table.note(f"fields.{index}", one, said("mistake.field_known", known=one_of(list(fields), one)))
            table.done()
        return frozenset(found)

    def _field_name(self, key: str, fields: Mapping[str, Field]) -> str:
        name = self.table.text(key, "")
        if name and name not in fields:
            self.table.note(key, name, said("mistake.field_known", known=one_of(list(fields), name)))
        return name

    # ---- how it is shown --------------------------------------------------------------------------------

    def _columns(self, key: str, fields: Mapping[str, Field], default: Sequence[str]) -> list[str]:
        known = [*LISTED, *fields]
        found = [str(one) for one in self.table.items(key, default)]
        for index, one in enumerate(found):
            for name in one.split(OR):
                if name not in known:
                    self.table.note(f"{key}.{index}", one, one_of(known, name))
        return found

    def _shown(self, row: Table) -> Shown:
        found = Shown(
            self._events(row, "events", required=True) or frozenset(),
            row.text("unit", ""),
            row.whole("decimals", 0, 0, 6),
            row.flag("signed"),
            row.text("source", ""),
        )
        row.done()
        return found

    def _filter(self, key: str, row: Table, fields: Mapping[str, Field]) -> Filter:
        found = Filter(
            key, row.text("of", choices=["number", "seconds", "alarms", *fields]), row.text("how", choices=HOW)
        )
        row.done()
        return found

    def _csv(self, csv: Table, fields: Mapping[str, Field]) -> list[Column]:
        columns, known = csv.table("columns"), [*SOURCES, *fields]
        return [Column(name, columns.text(name, choices=known)) for name in columns.data]

    def _repeat(self, csv: Table) -> Repeat | None:
        table = csv.table("repeat")
        if not csv.has("repeat"):
            return None
        columns = table.table("columns")
        for name in columns.data:
            if "{n}" not in name:
                columns.note(name, name, said("mistake.name_with", part="{n}"))
        found = Repeat(
            tuple(Column(name, columns.text(name, choices=REPEATED)) for name in columns.data),
            self._events(table, "events") or frozenset(),
            self._events(table, "value") or frozenset(),
            table.text("points", ""),
            table.whole("usual", 0, 0, MOST_REPEATED),
            table.whole("most", MOST_REPEATED, 1, MOST_REPEATED),
        )
        table.done()
        return found


def codes_named(key: str) -> bool:
    """Whether a key is one that texts and addresses can have."""
    return key.isascii() and key.replace("_", "").isalnum() and key[:1].isalpha() and key == key.lower()
