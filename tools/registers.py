"""docs/registers/<type>.md for every equipment type that is a Pogon PLC, from its data and from app/registers/plc_map.py.

The same data give the same file, byte for byte; `--check` writes nothing and fails when a file is stale. Remarks come from comments in the
data: the block above a table of device.toml or commands.toml, and what stands behind an address, an offset or a code.
"""

import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from app.plant import types  # noqa: E402
from app.plant.definitions import EquipmentType, Image, PlcMap, Point, TableMap  # noqa: E402
from app.plant.type_files.data import TypeData  # noqa: E402
from app.registers import plc_map as words  # noqa: E402

FOLDER = ROOT / "docs" / "registers"
LANGUAGE = "en"
TAKES: Mapping[str, int] = {"u32": 2, "i32": 2, "f32": 2, "u64": 4}
"""Words of a number; all others have one."""

FLAGS = ((words.SIMULATED, "simulated"), (words.WRITABLE, "writable"), (words.LOCAL, "local"))
HEADER: Sequence[tuple[int, str, str]] = (
    (words.AT_MAGIC, "u16", f"magic 0x{words.MAGIC:04X}; another one: nothing of the machine is believed"),
    (words.AT_MAJOR, "u16", f"map major {words.MAJOR}; another one: all values bad (configuration), writes refused"),
    (words.AT_MINOR, "u16", f"map minor {words.MINOR}; a newer one is fine"),
    (words.AT_TYPE, "u16", "type {type_code}"),
    (words.AT_CRC, "u32", "check sum of the configuration; another one than before is told"),
    (words.AT_FLAGS, "u16", ", ".join(f"bit {flag.bit_length() - 1} {told}" for flag, told in FLAGS)),
    (words.AT_BOOTS, "u16", "boot count"),
    (words.AT_HEARTBEAT, "u16", "heartbeat out, +1 per scan"),
    (words.AT_HOST_HEARTBEAT, "u16", "heartbeat in: the host writes it (06)"),
    (words.AT_HOST_TIMEOUT, "u16", "time-out of the heartbeat in [ms], 0 = not watched"),
    (words.AT_TIME, "u64", "device time [µs]"),
    (words.AT_TIME_QUALITY, "u16", "time quality: 0 free, 1 set, 2 synchronised"),
    (words.AT_SCAN, "u16", "scan time, last [µs]; 65535 when it took longer"),
    (words.AT_SCAN_MAX, "u16", "scan time, longest [µs]; 65535 when it took longer"),
    (words.AT_OVERRUNS, "u16", "scans that were too long"),
    (words.AT_STEP, "u64", "step number: scans since the device was first switched on"),
    (words.AT_CAPACITIES, "9 × u16", "capacities of the type"),
)

RULES = """\
Addresses are 0-based holding registers. Functions 03, 06, 16 (23 optional). Bytes big-endian, high word first; bits from 0. NaN and 0x8000
mean "no value". What has no row here answers exception 02; a gap between two rows may answer 0 instead. `pogon conform` tells which of
these rules a server breaks.

An image begins with a generation (word 0) and ends with the same one; a table row carries it behind its id (word 2) and at its end. Even,
and equal at both places, or it was being changed and is read again. The device swaps an image between two scans. A telegram never cuts an
image or a row."""

COMMAND = """\
One write (16) of {words} words; nothing less is taken.

| word | content |
|---|---|
| 0 | code |
| 1 | owner: who asks, for the device's own records |
| 2 | expected state ({status}); rejected with reason 2 when it is another; 0 = any |
| 3–4, 5–6, 7–8, 9–10 | arguments 1–4, 32 bits each; f32, u32 or i32 |
| 11–14 | 0 |
| 15 | request id, 1–65535 |

The same id gives the same answer and is not executed again. After a lost echo the host reads the answers before it asks anew."""

ANSWERS = """\
{words} words: generation, the last {kept} answers of {each} words with the newest first, generation.

| word of an answer | content |
|---|---|
| 0 | request id, 0 = none |
| 1 | state: 1 accepted, 2 running, 3 done, 4 rejected, 5 failed, 6 expired |
| 2 | reason |
| 3 | detail |
| 4–7 | device time u64 [µs] |"""

HOLD = """\
{words} words in one write: request bits, counter, argument f32 (high word first). The counter rises with every write; unchanged for
{timeout:.0f} ms means released, whatever the bits say."""

EVENTS = """\
Head at 0x{head:04X}, {head_words} words: generation, capacity, words per row, oldest sequence u32, newest sequence u32, acknowledged
sequence u32 (word {acknowledged}–{acknowledged_end}, written by the host), generation. Rows from 0x{rows:04X}: the event with `sequence`
stands in row `sequence % capacity`, {row_words} words each.

| word of a row | content |
|---|---|
| 0–1 | sequence u32, rises by one; a gap is a loss and is told |
| 2–5 | device time u64 [µs] |
| 6 | code |
| 7 | source |
| 8–9 | value f32 |
{snapshot}
| {request} | id of the command that caused the event (word 15 of the command); 0 = none. Rows of map 1.0 end before it |"""

TRAINING = """\
A virtual device also has training registers from 0x{training:04X} (table in app/sim/training.py): faults, resets, power cycles. A real
device must answer exception 02 there: that is how the host knows that it is real."""


def main(arguments: Sequence[str]) -> int:
    stale = [path for path, text in pages().items() if not path.is_file() or path.read_text("utf-8") != text]
    if "--check" in arguments:
        for path in stale:
            print(f"{path.relative_to(ROOT)} is stale: make registers")
        return bool(stale)
    FOLDER.mkdir(parents=True, exist_ok=True)
    for path in stale:
        path.write_text(pages()[path], "utf-8")
        print(path.relative_to(ROOT))
    return 0


def pages() -> dict[Path, str]:
    """File → its text, for every type that is a Pogon PLC."""
    found: dict[Path, str] = {}
    for name in types.names():
        data = _read(name, {})
        if data.type.device.plc:
            most = {option: data.type.ranges[option][1] for option in data.counted}
            found[FOLDER / f"{name}.md"] = page(data)
            if most:
                found[FOLDER / f"{name}_more.md"] = more(data, _read(name, most))
    return found


def _read(name: str, given: Mapping[str, float]) -> TypeData:
    data, problems = types.read_type(name, [LANGUAGE], given=given)
    if problems:
        raise SystemExit("\n".join(map(str, problems)))
    return data


def page(data: TypeData) -> str:
    """The whole map of one type, as many rows of each kind as its options say where a plant file says nothing."""
    kind = data.type
    assert kind.device.plc
    parts = [
        f"# Register map: {_text(kind, kind.label)}",
        f"Made by `make registers` from `app/equipment/{kind.name}/` and `app/registers/plc_map.py`: do not edit. Type `{kind.name}`.",
        RULES,
        *_header(kind, kind.device.plc),
        *(part for image in kind.device.plc.images for part in _image(kind, image)),
        *_settings(kind, kind.device.plc),
        *_commands(kind, kind.device.plc),
        *_events(kind),
        *(part for table in kind.tables.values() for part in _table(data, table)),
        "## Training",
        TRAINING.format(training=kind.device.training),
    ]
    return "\n\n".join(parts) + "\n"


def more(data: TypeData, most: TypeData) -> str:
    """What a machine that has `most` of everything serves beside the map of `data`."""
    usual, kind = data.type, most.type
    assert usual.device.plc and kind.device.plc
    ranges = {option: usual.ranges[option] for option in sorted(data.counted)}
    numbers = ", ".join(f"`{option}` {low:g} to {high:g}" for option, (low, high) in ranges.items())
    known = [image.address for image in usual.device.plc.images]
    held = [(key, one) for key, one in kind.commands.items() if one.hold_bits and key not in usual.commands]
    rows = [(f"0x{command.hold_bits:04X}", f"`{key}`", _text(kind, command.label)) for key, command in held]
    parts = [
        f"# Register map: {_text(kind, kind.label)}, more of everything",
        f"Made by `make registers` like [{kind.name}.md]({kind.name}.md), the map of the usual machine: do not edit.",
        f"The plant file says what there is: {numbers}. A machine with fewer than the usual one serves the usual map with 0 or NaN "
        "in the places of what it lacks. One with more serves the following beside it, each image of which it needs a part as a whole, "
        "with 0 or NaN in the places that it does not use.",
        *(part for image in kind.device.plc.images if image.address not in known for part in _image(kind, image)),
        "## Hold-to-run",
        _grid(("bits", "name", "meaning"), rows),
        "## Tables",
        *(
            f"`{key}` is at 0x{table.address:04X} where the usual map has no room for it, with at most {table.capacity} rows."
            for key, table in kind.tables.items()
            if key in usual.tables and table.address != usual.tables[key].address
        ),
        *(part for key, table in kind.tables.items() if key not in usual.tables for part in _table(most, table)),
    ]
    return "\n\n".join(parts) + "\n"


def _header(kind: EquipmentType, plc: PlcMap) -> Iterator[str]:
    yield f"## Header, 0–{words.HEADER_WORDS - 1}"
    rows = [
        (f"{at}" if form == "u16" else f"{at}–{at + int(_words(form)) - 1}", form, text.format(type_code=plc.type_code))
        for at, form, text in HEADER
    ]
    yield _grid(("word", "type", "content"), rows)
    yield from _block(kind, "device.toml", "plc")


def _image(kind: EquipmentType, image: Image) -> Iterator[str]:
    end = image.address + image.words - 1
    yield f"## Image 0x{image.address:04X}–0x{end:04X}, {image.words} words"
    yield _layout(kind, _inside(kind.points.values(), image.address, end), image.address, image.words)


def _settings(kind: EquipmentType, plc: PlcMap) -> Iterator[str]:
    if plc.settings is None:
        return
    image, first = plc.settings, plc.settings.address + 2
    end = image.address + image.words - 1
    yield f"## Settings 0x{image.address:04X}–0x{end:04X}, {image.words} words"
    points = _inside(kind.points.values(), image.address, end)
    last = max(point.register.address + point.register.words for point in points if point.register)
    count = last - first
    behind = f"{_span(last, end - 1)} spare, 0, and " if last < end else ""
    yield (
        f"0x{image.address:04X} generation, 0x{image.address + 1:04X} count ({len(points)}), from 0x{first:04X} the values in effect, "
        f"{behind}0x{end:04X} the generation again. To change one, "
        f"write all {count} words at 0x{plc.staging:04X}, then send command 0x{words.COMMIT_SETTINGS:04X} with argument 1 = {count} and "
        "argument 2 = CRC-32 (zlib) of these words as big-endian bytes. The device takes all or none."
    )
    rows = []
    for point in points:
        setpoint, register = kind.setpoints[point.key], point.register
        assert register
        default = "" if setpoint.default is None else f"{setpoint.default:g}"
        limits = f"{_cell(setpoint.low)} … {_cell(setpoint.high)}"
        at, staged = register.address, register.address - first + plc.staging
        row = (f"0x{at:04X}", f"0x{staged:04X}", register.type.value, f"`{point.key}`", point.unit, default, limits)
        choices = f": {_choices(kind, setpoint.options)}" if setpoint.options else ""
        rows.append((*row, setpoint.role, _text(kind, point.label) + choices))
    yield _grid(("register", "staged at", "type", "name", "unit", "default", "limits", "role", "meaning"), rows)


def _span(first: int, last: int) -> str:
    return f"0x{first:04X}" if first == last else f"0x{first:04X}–0x{last:04X}"


def _commands(kind: EquipmentType, plc: PlcMap) -> Iterator[str]:
    last = words.COMMAND + words.COMMAND_WORDS - 1
    yield f"## Commands 0x{words.COMMAND:04X}–0x{last:04X}"
    status = f"`{plc.status}`" if plc.status else "not used"
    yield COMMAND.format(words=words.COMMAND_WORDS, status=status)
    rows: list[Sequence[str]] = []
    for key, command in kind.commands.items():
        if command.code:
            arguments = ", ".join(
                f"{argument.name} {argument.type}" + f" [{argument.unit}]" * bool(argument.unit)
                for argument in command.arguments
            )
            remark = " ".join(_block(kind, "commands.toml", key))
            rows.append((str(command.code), f"`{key}`", arguments, command.role, remark or _text(kind, command.label)))
    commit = ("number of words u32, CRC-32 u32", "engineer", "makes the staged settings valid")
    if plc.settings:
        rows.append((f"0x{words.COMMIT_SETTINGS:04X}", "", *commit))
    yield _grid(("code", "name", "arguments", "role here", "meaning"), rows)
    yield f"## Answers 0x{words.ANSWERS:04X}–0x{words.ANSWERS + words.ANSWERS_WORDS - 1:04X}"
    yield ANSWERS.format(words=words.ANSWERS_WORDS, kept=words.ANSWERS_KEPT, each=words.ANSWER_WORDS)
    notes = _notes(kind, "events.toml", "reasons")
    yield _grid(
        ("reason", "name", "meaning"),
        [
            (str(code), f"`{name}`", _with(_text(kind, f"reason.{name}"), notes.get(str(code), "")))
            for code, name in kind.reasons.items()
        ],
    )
    held = [(key, command) for key, command in kind.commands.items() if command.hold_bits]
    if held:
        yield f"## Hold-to-run 0x{words.HOLD:04X}–0x{words.HOLD + words.HOLD_WORDS - 1:04X}"
        yield HOLD.format(words=words.HOLD_WORDS, timeout=1000 * words.HOLD_TIMEOUT)
        rows = [(f"0x{command.hold_bits:04X}", f"`{key}`", _text(kind, command.label)) for key, command in held]
        yield _grid(("bits", "name", "meaning"), rows)
        yield from _block(kind, "commands.toml", held[0][0])


def _events(kind: EquipmentType) -> Iterator[str]:
    if not kind.events:
        return
    yield f"## Events 0x{words.EVENTS:04X}"
    at = words.AT_ACKNOWLEDGED
    notes = _notes(kind, "events.toml", "events")
    yield EVENTS.format(
        head=words.EVENTS,
        head_words=words.EVENTS_WORDS,
        rows=words.EVENT_ROWS,
        row_words=words.EVENT_WORDS,
        acknowledged=at,
        acknowledged_end=at + 1,
        snapshot="\n".join(_snapshot(kind)),
        request=words.AT_REQUEST,
    )
    yield _grid(
        ("code", "name", "meaning", "source, value"),
        [
            (str(code), f"`{name}`", _text(kind, f"event.{name}"), notes.get(str(code), ""))
            for code, name in kind.events.items()
        ],
    )


def _snapshot(kind: EquipmentType) -> Iterator[str]:
    """The words of a row behind the value, by the layout of the type."""
    at = words.AT_REQUEST - words.SNAPSHOT_WORDS
    free = set(range(words.SNAPSHOT_WORDS))
    for name, field in sorted(kind.snapshot.items(), key=lambda one: one[1].word):
        free -= set(range(field.word, field.word + field.words))
        first, last = at + field.word, at + field.word + field.words - 1
        note = _note(kind, "events.toml", f"snapshot.{name}", "word")
        none = "" if field.none is None else f"; {field.none} = none"
        place = f"{first}–{last}" if last > first else f"{first}"
        note = ", ".join(part for part in (note, _codes("of", field.only), _codes("not of", field.but)) if part)
        yield f"| {place} | snapshot: `{name}` {field.type}: {_with(_text(kind, f'snapshot.{name}'), note)}{none} |"
    if free:
        yield f"| {', '.join(str(at + word) for word in sorted(free))} | snapshot: 0 |"


def _codes(word: str, codes: Iterable[int]) -> str:
    found = ", ".join(str(code) for code in sorted(codes))
    return f"{word} event {found}" if found else ""


def _table(data: TypeData, table: TableMap) -> Iterator[str]:
    kind = data.type
    yield f"## Table `{table.key}` 0x{table.address:04X}"
    first = table.address + words.TABLE_HEAD
    fit, more = (125 - words.TABLE_HEAD) // table.row, 125 // table.row
    yield (
        f"Words 0–3: generation of its structure (changes when a slot is taken or freed), capacity (`{table.capacity}`), rows to read "
        f"(the highest used slot), words per row ({table.row}). Rows from 0x{first:04X}: slot n, from 1, at 0x{first:04X} + (n − 1) × "
        f"{table.row}. The first telegram takes the head and {fit} rows, each further one {more} rows. An empty slot has the id 0."
    )
    yield from _block(kind, "tables.toml", table.key)
    points = [cell.point for cell in data.columns[table.key].values()]
    rows = _layout(kind, points, first, table.row, f"tables.toml:{table.key}.columns.")
    yield rows.replace("| 2 | u16 | | | spare |", "| 2 | u16 | | | generation of the row |")


def _layout(
    kind: EquipmentType, points: Sequence[Point], address: int, length: int, place: str = "points.toml:"
) -> str:
    """Every word of an image or of a row: values, bits, spare words, generations."""
    file, _, prefix = place.partition(":")
    row = bool(prefix)
    starts: dict[int, list[Point]] = {}
    for point in points:
        assert point.register
        starts.setdefault(point.register.address - address, []).append(point)
    rows: list[tuple[str, ...]] = []
    at = 0
    while at < length:
        here = sorted(starts.get(at, ()), key=lambda point: point.register.shift if point.register else 0)
        place_of = f"{at}" if row else f"0x{address + at:04X}"
        if not here:
            if at in (0, length - 1) or (row and at == 2):
                rows.append((place_of, "u16", "", "", "generation" + " of the row" * row))
                at += 1
                continue
            begin = at
            while at < length - 1 and at not in starts and not (row and at == 2):
                at += 1
            ends = f"{begin}–{at - 1}" if row else f"0x{address + begin:04X}–0x{address + at - 1:04X}"
            rows.append((place_of if at - begin == 1 else ends, "", "", "", "spare, 0"))
            continue
        for point in here:
            register = point.register
            assert register
            bits = "" if register.mask is None else f" bit {register.shift}"
            note = _note(kind, file, f"{prefix}{point.key}")
            meaning = _with(
                _text(kind, point.label), "; ".join(part for part in (_choices(kind, point.texts), note) if part)
            )
            unit = f"{register.scale:g} {point.unit}" if register.scale != 1 and point.unit else point.unit
            rows.append((place_of, register.type.value + bits, f"`{point.key}`", unit, meaning))
        at += max(point.register.words for point in here if point.register)
    return _grid(("word" if row else "register", "type", "name", "unit", "meaning"), rows)


def _inside(points: Iterable[Point], first: int, last: int) -> list[Point]:
    found = [(point.register.address, point.register.shift, point) for point in points if point.register]
    return [point for address, _, point in sorted(found, key=lambda one: one[:2]) if first <= address <= last]


def _choices(kind: EquipmentType, texts: Mapping[int, str]) -> str:
    return ", ".join(f"{value} {_text(kind, key).lower()}" for value, key in texts.items())


def _text(kind: EquipmentType, key: str) -> str:
    return kind.texts[LANGUAGE].get(key, key)


def _with(text: str, note: str) -> str:
    return f"{text}: {note}" if note else text


def _words(form: str) -> int:
    return 9 if form.startswith("9") else TAKES.get(form, 1)


def _cell(text: str) -> str:
    return text if re.fullmatch(r"-?[\d.]+", text) else f"`{text}`"


def _grid(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def _lines(kind: EquipmentType, file: str) -> list[str]:
    return _read_lines(kind.folder / file)


@cache
def _read_lines(path: Path) -> list[str]:
    return path.read_text("utf-8").splitlines() if path.is_file() else []


def _block(kind: EquipmentType, file: str, table: str) -> list[str]:
    """The comment lines right above `[table]`, as one paragraph; none when there are none."""
    block: list[str] = []
    for line in _lines(kind, file):
        if line.startswith("# "):
            block.append(line[2:])
        elif _names(line, table):
            return [" ".join(block)] if block else []
        else:
            block = []
    return []


def _note(kind: EquipmentType, file: str, table: str, *keys: str) -> str:
    """What stands behind `address = ` or `offset = ` of `[table]`, or behind another key."""
    wanted = "|".join(keys or ("address", "offset"))
    here = False
    for line in _lines(kind, file):
        if line.startswith("["):
            here = _names(line, table)
        elif here and (found := re.match(rf"(?:{wanted}) = (?:\w+|\{{.*\}})\s+# (.+)", line)):
            return found[1]
    return ""


def _names(line: str, table: str) -> bool:
    """Whether `line` is the head of `table`, also of one that stands for many (plant/type_files/repeats.py)."""
    return (heads := _heads(line)) is not None and heads.fullmatch(table) is not None


@cache
def _heads(line: str) -> re.Pattern[str] | None:
    """What the names of all tables look like that have this head."""
    name = line[1:-1].replace('"', "") if line.startswith("[") else ""
    return re.compile(r"\d+".join(map(re.escape, re.split(r"\{[^}]*\}", name)))) if name else None


def _notes(kind: EquipmentType, file: str, table: str) -> dict[str, str]:
    """Code → what stands behind it in `[table]`."""
    found: dict[str, str] = {}
    here = False
    for line in _lines(kind, file):
        if line.startswith("["):
            here = line == f"[{table}]"
        elif here and (entry := re.match(r'(\d+) = "\w+"\s+# (.+)', line)):
            found[entry[1]] = entry[2]
    return found


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
