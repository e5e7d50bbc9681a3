"""A register page as a PLC programmer reads it: docs/registers/<type>.md and nothing else, no data and no module of the product."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from struct import pack, unpack

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "registers"
FORMS = {"u16": ">H", "i16": ">h", "u32": ">I", "i32": ">i", "f32": ">f", "u64": ">Q"}
LENGTHS = {"u16": 1, "i16": 1, "u32": 2, "i32": 2, "f32": 2, "u64": 4}


@dataclass(frozen=True)
class Cell:
    """A row of an image, of the settings or of a table."""

    at: int
    """Register, or word of a row."""
    form: str
    name: str
    bit: int | None = None
    scale: float = 1.0
    choices: tuple[int, ...] = ()
    default: float = 0.0
    low: float | None = None
    high: float | None = None
    staged: int = 0

    @property
    def words(self) -> int:
        return LENGTHS[self.form]

    def number(self, words: Sequence[int]) -> float:
        """The number in its words."""
        raw = unpack(FORMS[self.form], pack(f">{len(words)}H", *words))[0]
        return raw >> self.bit & 1 if self.bit is not None else raw

    def encoded(self, number: float) -> tuple[int, ...]:
        """Its words; not for bits."""
        value = number if self.form == "f32" else int(number)
        return unpack(f">{self.words}H", pack(FORMS[self.form], value))


@dataclass(frozen=True)
class Area:
    """Registers between two generations, or a table."""

    address: int
    words: int
    cells: tuple[Cell, ...]
    spare: tuple[int, ...] = ()
    name: str = ""


@dataclass
class Page:
    """What the page of one type says."""

    kind: str
    type_code: int = 0
    header: dict[str, tuple[int, int]] = field(default_factory=dict)
    """First words of the content → first word, number of words."""
    images: list[Area] = field(default_factory=list)
    settings: Area | None = None
    commands: dict[str, tuple[int, tuple[tuple[str, str], ...]]] = field(default_factory=dict)
    """Name → code, arguments with their types; the commit of settings is `commit`."""
    command_at: int = 0
    answers_at: int = 0
    answers_words: int = 0
    reasons: dict[int, str] = field(default_factory=dict)
    hold_at: int = 0
    holds: dict[str, int] = field(default_factory=dict)
    ring_at: int = 0
    rows_at: int = 0
    row_words: int = 0
    events: dict[int, str] = field(default_factory=dict)
    tables: list[Area] = field(default_factory=list)
    training: int = 0

    def code_of(self, event: str) -> int:
        return next(code for code, name in self.events.items() if name == event)

    def covered(self) -> Iterator[tuple[int, int]]:
        """First register and number of registers of everything that has a row."""
        yield 0, 32
        for area in (*self.images, *([self.settings] if self.settings else [])):
            yield area.address, area.words
        if self.settings:
            yield self.settings.cells[0].staged, sum(cell.words for cell in self.settings.cells)
        yield self.command_at, 16
        yield self.answers_at, self.answers_words
        yield self.ring_at, 10


def text_of(kind: str) -> str:
    """The page of `kind` as it stands."""
    return (FOLDER / f"{kind}.md").read_text("utf-8")


def read_page(kind: str, text: str = "") -> Page:
    """The page of `kind`, or what another `text` says in its place."""
    text = text or text_of(kind)
    page = Page(kind)
    for part in text.split("\n## ")[1:]:
        head, _, body = part.partition("\n")
        _section(page, head, body)
    return page


def _section(page: Page, head: str, body: str) -> None:
    if head.startswith("Header"):
        for place, form, content, *_ in rows(body):
            first, _, last = place.partition("–")
            key = content if content.startswith("scan time") else re.split(r"[,;:]", content)[0]
            page.header[key] = int(first), int(last or first) - int(first) + 1
            if found := re.match(r"type (\d+)", content):
                page.type_code = int(found[1])
            assert form
    elif found := re.match(r"Image 0x(\w+)–0x(\w+), (\d+) words", head):
        cells, spare = _cells(rows(body))
        page.images.append(Area(int(found[1], 16), int(found[3]), cells, spare))
    elif found := re.match(r"Settings 0x(\w+)–0x(\w+), (\d+) words", head):
        page.settings = Area(int(found[1], 16), int(found[3]), tuple(_settings(rows(body))))
    elif found := re.match(r"Commands 0x(\w+)", head):
        page.command_at = int(found[1], 16)
        for code, name, arguments, *_ in (row for row in rows(body) if len(row) == 5):
            given = tuple((part.split()[0], part.split()[1]) for part in arguments.split(", ") if name and part)
            page.commands[name.strip("`") or "commit"] = int(code, 0), given
    elif found := re.match(r"Answers 0x(\w+)", head):
        page.answers_at = int(found[1], 16)
        page.answers_words = int(re.search(r"(\d+) words", body)[1])  # type: ignore[index]
        page.reasons = {int(code): name.strip("`") for code, name, *_ in rows(body) if name.startswith("`")}
    elif found := re.match(r"Hold-to-run 0x(\w+)", head):
        page.hold_at = int(found[1], 16)
        page.holds = {name.strip("`"): int(bits, 16) for bits, name, *_ in rows(body)}
    elif head.startswith("Events"):
        page.ring_at = int(re.search(r"Head at 0x(\w+)", body)[1], 16)  # type: ignore[index]
        page.rows_at = int(re.search(r"Rows from 0x(\w+)", body)[1], 16)  # type: ignore[index]
        page.row_words = int(re.search(r"capacity`, (\d+) words each", body)[1])  # type: ignore[index]
        page.events = {int(code): name.strip("`") for code, name, *_ in rows(body) if name.startswith("`")}
    elif found := re.match(r"Table `(\w+)` 0x(\w+)", head):
        size = int(re.search(r"words per row \((\d+)\)", body)[1])  # type: ignore[index]
        cells, spare = _cells(rows(body))
        page.tables.append(Area(int(found[2], 16), size, cells, spare, found[1]))
    elif head.startswith("Training"):
        page.training = int(re.search(r"0x(\w+)", body)[1], 16)  # type: ignore[index]


def rows(body: str) -> Iterator[list[str]]:
    """The cells of every row of the tables in `body`, heads left out."""
    lines = body.splitlines()
    for n, line in enumerate(lines):
        following = lines[n + 1] if n + 1 < len(lines) else ""
        if (
            line.startswith("|")
            and not line.startswith("| -")
            and not line.startswith("|-")
            and not following.startswith(("| -", "|-"))
        ):
            yield [cell.strip().replace("\\|", "|") for cell in re.split(r"(?<!\\)\|", line)[1:-1]]


def _place(text: str) -> int:
    return int(text, 16) if text.startswith("0x") else int(text)


def _cells(found: Iterator[list[str]]) -> tuple[tuple[Cell, ...], tuple[int, ...]]:
    cells, spare = [], []
    for place, form, name, unit, meaning in found:
        if meaning.startswith("spare"):
            first, _, last = place.partition("–")
            spare += range(_place(first), _place(last or first) + 1)
        elif name:
            kind, _, bit = form.partition(" bit ")
            scale = float(unit.split()[0]) if re.match(r"[\d.e-]+ \S", unit) else 1.0
            choices = _choices(meaning)
            cells.append(Cell(_place(place), kind, name.strip("`"), int(bit) if bit else None, scale, choices))
    return tuple(cells), tuple(spare)


def _choices(meaning: str) -> tuple[int, ...]:
    """The values of an enumeration, which are told as `0 stopped, 1 running`; empty when it is none."""
    found = re.search(r"(?:^|: )(\d+ (?!=).*)$", meaning)
    values = re.findall(r"(?:^|, )(\d+) (?!=)", found[1].partition(";")[0]) if found else []
    return tuple(map(int, values)) if len(values) > 1 else ()


def _settings(found: Iterator[list[str]]) -> Iterator[Cell]:
    for place, staged, form, name, _, default, limits, *_ in found:
        low, _, high = limits.partition(" … ")
        yield Cell(
            _place(place), form, name.strip("`"), default=float(default or 0), staged=_place(staged),
            low=_limit(low), high=_limit(high),
        )  # fmt: skip


def _limit(text: str) -> float | None:
    """None: it follows from other settings."""
    return float(text) if re.fullmatch(r"-?[\d.]+", text) else None
