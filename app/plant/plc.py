"""What the type of a Pogon PLC says beyond values: `[plc]` of device.toml, tables.toml, events.toml.

    [plc]                                               device.toml
    type_code = 10                                      word 3 of the header
    status = "state"                                    point that commands expect to be as the person saw it
    events = true                                       it has an event ring
    images = [{ address = 0x0100, words = 96 }]         generation first and last; `since` as with tables
    settings = { address = 0x0200, words = 34 }         generation, count, values, generation
    staging = 0x0240

    [product]                                           tables.toml
    address = 0x0800
    row = 24                                            words per row
    capacity = "product_slots"                          a number, or an option of the equipment
    scan = "slow"                                       how often it is read: fast (as it stands), or slow
    since = 2                                           minor version of the map that it came with; as it stands, 0
    [product.columns.head]                              as in points.toml, with `offset` in the row instead of `address`
    offset = 4
    type = "f32"
    unit = "mm"

    [events]                                            events.toml: code = key; texts `event.<key>` and `reason.<key>`
    1 = "arrived"
    [reasons]
    1 = "unknown_code"
    [snapshot.product]                                  what the six words of an event say; text `snapshot.<key>`
    word = 0                                            the first of its words
    type = "u32"                                        u16 i16 u32 i32 f32
    none = 0                                            number that means "no value"
    events = ["read"]                                   events that say it (as it stands all); `but`: all others do
    all = "products"                                    under this name an alarm lists all of them since it was acknowledged

The points that they lie on are read in plant/type_files/tables.py.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence

from app.plant.definitions import Device, Image, PlcMap, Register, Scan, TableMap, Type
from app.plant.said import Plain, said
from app.plant.tables import MISSING, Table, one_of
from app.records.event import WORDS
from app.records.snapshot import PARTS, TYPES, Field, Layout, words_of
from app.registers import plc_map
from app.registers.plc_map import MINOR, TABLE_HEAD

KEY = r"[a-z][a-z0-9_]*"
LARGEST_CODE = 0xFFFF
MOST_WORDS = 125
"""Registers of one telegram: no image and no row is cut by one."""
WRITE_SEVERAL = 16
"""Function code that commands and setpoints are sent with."""
AROUND_SETTINGS = 3
"""Words of a settings image around its values: generation, count, generation."""
WORDS_OF_SETPOINT = 2
"""The PLC counts setpoints, not words (links/orders.py)."""
SMALLEST_ROW = 5
"""Id of two words, generation, state, generation."""
MOST_SLOTS = 10_000
NO_STATES = (Type.BIT, Type.F32, Type.F64, Type.STRING)
OF_EVENT = ("event", "limit", "source", "value")
"""Names that the parameters of an alarm have beside those of the snapshot."""
HEAD_POINTS: Mapping[str, int] = {"generation": 0, "capacity": 1, "count": 2}
"""Points of every table by their word in its head."""


def read_plc(head: Table, device: Device) -> PlcMap | None:
    """`[plc]` of device.toml; None when there is none."""
    if not head.has("plc"):
        return None
    table = head.table("plc")
    images = tuple(_image(row) for row in table.rows("images"))
    settings = _image(table.table("settings")) if table.has("settings") else None
    staging = table.whole("staging", low=1) if settings or table.has("staging") else 0
    if settings is None and table.has("staging"):
        table.note("settings", MISSING, said("mistake.staging", form="{ address, words }"))
    plc = PlcMap(
        type_code=table.whole("type_code", low=1),
        images=images,
        settings=settings,
        staging=staging,
        status=table.text("status", "", pattern=KEY, expected=said("mistake.status_point")),
        events=table.flag("events"),
    )
    _check_areas(table, plc, device)
    if device.max_write < 16 or WRITE_SEVERAL not in device.write_functions:
        table.note("", "max_write / write_functions", said("mistake.takes_16"))
    table.done()
    return plc


def _check_areas(table: Table, plc: PlcMap, device: Device) -> None:
    """No two areas share registers, none lies on those that every map has in the same place, and one telegram takes an image whole."""
    areas = _areas(plc)
    for key, image in areas:
        if image.words > device.max_read and key != "staging":
            table.note(key, image.words, said("mistake.image_read", most=device.max_read))
    for index, (key, image) in enumerate(areas):
        _check_free(table, "images" if key == "settings" else key, image, [other for _, other in areas[:index]])
        _check_fixed(table, key, image, plc)


def _areas(plc: PlcMap) -> list[tuple[str, Image]]:
    """What a map says where it lies, by key: images, settings, and the place where a set of them is put before it is committed."""
    areas = [("images", image) for image in plc.images]
    if plc.settings:
        areas.append(("settings", plc.settings))
    if plc.settings and plc.staging:
        areas.append(("staging", Image(plc.staging, max(1, plc.settings.words - AROUND_SETTINGS))))
    return areas


def _check_free(table: Table, key: str, image: Image, others: Iterable[Image]) -> None:
    for other in others:
        if _meet(image, other):
            table.note(key, f"0x{image.address:04X}", said("mistake.image_free", address=f"0x{other.address:04X}"))


def _check_fixed(table: Table, key: str, image: Image, plc: PlcMap) -> None:
    """Nothing lies on what every map has in the same place."""
    fixed = [Image(plc_map.HEADER, plc_map.HEADER_WORDS), Image(plc_map.COMMAND, plc_map.COMMAND_WORDS)]
    fixed += [Image(plc_map.ANSWERS, plc_map.ANSWERS_WORDS), Image(plc_map.HOLD, plc_map.HOLD_WORDS)]
    fixed += [Image(plc_map.EVENTS, plc_map.EVENTS_END - plc_map.EVENTS)] if plc.events else []
    for other in fixed:
        if _meet(image, other):
            first, last = f"0x{other.address:04X}", f"0x{other.address + other.words - 1:04X}"
            table.note(key, f"0x{image.address:04X}", said("mistake.map_free", first=first, last=last))


def check_tables(
    file: Table, plc: PlcMap, tables: Mapping[str, TableMap], ranges: Mapping[str, tuple[float, float]]
) -> None:
    """No table lies on an area of the map or on another table, however many slots a machine gives it."""
    found: list[Image] = [area for _, area in _areas(plc)]
    for key, map in tables.items():
        most = int(ranges[map.capacity][1]) if map.capacity in ranges else int(map.capacity)
        area = Image(map.address, TABLE_HEAD + most * map.row)
        _check_free(file.table(key), "address", area, found)
        _check_fixed(file.table(key), "address", area, plc)
        found.append(area)


def _meet(one: Image, other: Image) -> bool:
    return one.address < other.address + other.words and other.address < one.address + one.words


def _image(table: Table) -> Image:
    image = Image(
        table.whole("address"), table.whole("words", low=3, high=MOST_WORDS), table.whole("since", 0, low=0, high=MINOR)
    )
    if image.address + image.words > 0x10000:
        table.note("words", image.words, said("mistake.image_end"))
    table.done()
    return image


def read_names(file: Table, key: str) -> dict[int, str]:
    """`[events]` or `[reasons]`: code → key of its text."""
    table = file.table(key)
    found: dict[int, str] = {}
    for code in table.data:
        name = table.text(code, pattern=KEY, expected=said("mistake.key"))
        if not re.fullmatch(r"[1-9]\d{0,4}", code) or int(code) > LARGEST_CODE:
            table.note(code, name, said("mistake.code_key", most=LARGEST_CODE))
        elif name in found.values():
            table.note(code, name, said("mistake.code_key_once"))
        else:
            found[int(code)] = name
    return found


def read_snapshot(file: Table, events: Mapping[int, str]) -> Layout:
    """`[snapshot.<name>]`: what the words of an event say."""
    table = file.table("snapshot")
    found: dict[str, Field] = {}
    taken: dict[int, list[str]] = {}
    for name, row in table.tables():
        field = Field(
            word=row.whole("word", low=0, high=WORDS - 1),
            type=row.text("type", choices=TYPES),
            none=row.whole("none", low=-(2**31), high=2**32 - 1) if row.has("none") else None,
            only=_codes(row, "events", events),
            but=_codes(row, "but", events),
            all=row.text("all", "", pattern=KEY, expected=said("mistake.key")),
            bit_of=row.text("bit_of", "", choices=("", *PARTS)),
            bits_of=row.text("bits_of", "", choices=("", *PARTS)),
        )
        row.done()
        if not re.fullmatch(KEY, name) or name in OF_EVENT:
            table.note(name, name, said("mistake.key_none_of", taken=", ".join(OF_EVENT)))
        if field.all and (field.all in table.data or field.all in OF_EVENT):
            row.note("all", field.all, said("mistake.free_name"))
        for word in range(field.word, field.word + words_of(field.type) if field.type in TYPES else 0):
            if word >= WORDS:
                row.note("word", field.word, said("mistake.snapshot_words", words=WORDS, type=field.type))
                continue
            others = [other for other in taken.setdefault(word, []) if _together(found[other], field, events)]
            if others:
                row.note("word", field.word, said("mistake.words_unused", other=others[0]))
                break
            taken[word].append(name)
        found[name] = field
    return found


def _codes(row: Table, key: str, events: Mapping[int, str]) -> frozenset[int]:
    """Codes of the events that stand at `key`."""
    codes = {name: code for code, name in events.items()}
    found = set()
    for index, one in enumerate(row.items(key, [], said("mistake.list_of_events"))):
        if isinstance(one, str) and one in codes:
            found.add(codes[one])
        else:
            row.note(f"{key}.{index}", one, said("mistake.event_of_file", known=one_of(list(codes), one)))
    return frozenset(found)


def _together(one: Field, other: Field, events: Mapping[int, str]) -> bool:
    """Whether some event would say both."""
    return not events or any(one.is_said(code) and other.is_said(code) for code in events)


def read_table(
    key: str, table: Table, options: Mapping[str, object], ranges: Mapping[str, tuple[float, float]]
) -> TableMap:
    """One table; its columns are named, not read."""
    address, row = table.whole("address"), table.whole("row", low=SMALLEST_ROW, high=MOST_WORDS - TABLE_HEAD)
    capacity, most = table.raw("capacity"), 1
    if not isinstance(capacity, str):
        capacity = most = table.whole("capacity", low=1, high=MOST_SLOTS)
    elif isinstance(options.get(capacity), float):
        low, high = ranges[capacity]
        most = int(high)
        if not (low >= 1 and high <= MOST_SLOTS and low.is_integer() and high.is_integer()):
            table.note("capacity", capacity, said("mistake.option_limits", most=MOST_SLOTS))
    else:
        numbers = sorted(name for name, value in options.items() if isinstance(value, float))
        table.note("capacity", capacity, said("mistake.capacity", known=one_of(numbers, capacity)))
    if address + TABLE_HEAD + most * row > 0x10000:
        table.note("address", f"0x{address:04X}", said("mistake.room", most=most, row=row))
    columns = table.table("columns", required=True, expected=said("mistake.columns", table="[<table>.columns.<name>]"))
    scan = Scan(table.text("scan", Scan.FAST.value, choices=[Scan.FAST.value, Scan.SLOW.value]))
    since = table.whole("since", 0, low=0, high=MINOR)
    return TableMap(key, address, row, str(capacity), tuple(columns.data), scan, since)


def capacity_of(table: TableMap, options: Mapping[str, object]) -> int:
    """Slots of `table` on a machine with these options."""
    option = options.get(table.capacity)
    return int(option) if isinstance(option, float) else int(table.capacity)


def check_columns(table: Table, map: TableMap, columns: Mapping[str, Register]) -> None:
    """A row begins with id, generation and state, and ends with its generation; columns lie between."""
    first = columns.get("id")
    if first is None or (first.address, first.words) != (map.address + TABLE_HEAD, 2):
        table.note(
            "columns.id",
            MISSING if first is None else said("mistake.other"),
            said("mistake.first_column", type='"u32"'),
        )
    taken: dict[int, tuple[str, bool]] = {}
    for name, register in columns.items():
        part = register.mask is not None
        for address in range(register.address, register.address + register.words):
            word = address - map.address - TABLE_HEAD
            if word in (2, map.row - 1) or word >= map.row:
                table.note(f"columns.{name}.offset", word, said("mistake.row_words", last=map.row - 1))
                break
            other, split = taken.setdefault(word, (name, part))
            if other != name and not (part and split):
                table.note(f"columns.{name}.offset", word, said("mistake.words_unused", other=other))
                break


def check_points(head: Table, plc: PlcMap, points: Mapping[str, Register | None], events: Sequence[int]) -> None:
    """Points against the images; the state must be one, the ring needs names."""
    table = head.table("plc")
    if plc.status and plc.status not in points:
        table.note("status", plc.status, said("mistake.status_known", known=one_of(sorted(points), plc.status)))
    state = points.get(plc.status)
    if state is not None and (state.words > 1 or state.type in NO_STATES):
        table.note("status", plc.status, said("mistake.status_number"))
    if plc.events and not events:
        table.note("events", Plain("true"), said("mistake.event_keys", table="[events]"))
    images = [*plc.images, *([plc.settings] if plc.settings else [])]
    for key, register in points.items():
        for image in images if register and register.table == "holding" else ():
            assert register
            inside = [
                image.address <= address < image.address + image.words
                for address in range(register.address, register.address + register.words)
            ]
            if any(inside) and not all(inside):
                table.note("images", f"0x{image.address:04X}", said("mistake.image_whole", point=key))


def fixed_words(image: Image, *, settings: bool) -> Sequence[int]:
    """Addresses of `image` that hold no value: its generation, and the count of settings."""
    first = [image.address, image.address + 1] if settings else [image.address]
    return [*first, image.address + image.words - 1]


def inside(image: Image | None, register: Register | None) -> bool:
    """Whether `register` is one of the values of a settings image: behind generation and count, before the last generation."""
    if image is None or register is None or register.table != "holding":
        return False
    return image.address + 2 <= register.address and register.address + register.words < image.address + image.words


def check_setpoint(row: Table, map: PlcMap, register: Register | None) -> None:
    """Each setpoint of the settings takes two words of its own: the PLC counts them so."""
    assert map.settings is not None
    assert register is not None
    place = register.address - map.settings.address - 2
    if register.words != WORDS_OF_SETPOINT or place % WORDS_OF_SETPOINT or register.mask is not None:
        row.note(
            "", Plain(f"0x{register.address:04X}"), said("mistake.two_words", first=f"0x{map.settings.address + 2:04X}")
        )


def cell_key(table: str, slot: int, column: str) -> str:
    """Key of the point in `column` of `slot`, from 1."""
    return f"{table}_{slot}_{column}"


def is_cell(key: str, tables: Mapping[str, TableMap]) -> bool:
    """Whether `key` could be that of a cell of one of `tables`."""
    return any(re.fullmatch(rf"{table}_\d+_\w+", key) for table in tables)


def text_keys(events: Mapping[int, str], reasons: Mapping[int, str], snapshot: Layout) -> Iterator[str]:
    """Texts that the codes and the snapshot need."""
    yield from (f"snapshot.{key}" for key in snapshot)
    yield from (f"event.{key}" for key in events.values())
    yield from (f"reason.{key}" for key in reasons.values())
