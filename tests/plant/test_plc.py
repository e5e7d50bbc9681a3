"""A Pogon PLC is data: its map, tables, codes, commands and presets; every wrong combination is told."""

import tomllib
from collections.abc import Sequence
from pathlib import Path
from time import process_time

import pytest

from app.plant import changes, types
from app.plant.definitions import Argument, Image, Kind, PlcMap, Scan, TableMap, Type
from app.plant.plant_files.languages import LANGUAGES
from app.plant.texts import read_product
from app.records.snapshot import Field
from tests.plant.line import FILES, PLANT, load, machine, problem, write_type


def test_the_map_of_a_machine_is_read(tmp_path: Path) -> None:
    kind = machine(tmp_path).type
    assert kind.device.plc == PlcMap(10, (Image(0x100, 16),), Image(0x200, 8), 0x240, "state", events=True)
    assert kind.snapshot == {"product": Field(0, "u32", 0, "products"), "second": Field(2, "u32")}
    assert (kind.events, kind.reasons) == (
        {1: "arrived", 20: "jam", 21: "jam_over"},
        {2: "wrong_state", 7: "no_such_product"},
    )
    assert kind.tables == {"product": TableMap("product", 0x800, 16, "slots", ("id", "state", "head", "left", "right"))}


def test_a_drive_has_no_such_map() -> None:
    data, problems = types.read_type("eura_e800", LANGUAGES)
    assert problems == []
    assert data.type.device.plc is None
    assert not (data.type.tables or data.type.events)


def test_every_slot_of_a_table_is_a_row_of_points(tmp_path: Path) -> None:
    item = machine(tmp_path)
    assert item.tables == {"product": 3}
    head = item.points["product_2_head"]
    assert head.register
    assert (head.name, head.id, head.equipment, head.key) == (
        "k1.product_2_head",
        "k1.product_2_head",
        "k1",
        "product_2_head",
    )
    assert (head.table, head.row, head.register.address, head.register.type) == (
        "product",
        1,
        0x800 + 4 + 16 + 4,
        Type.F32,
    )
    assert (head.kind, head.unit, head.decimals, head.low, head.high) == (Kind.ANALOG, "mm", 1, 0, 660)
    assert (head.scan, head.history, head.label) == (Scan.SLOW, False, "point.product.head")
    state, id = item.points["product_3_state"], item.points["product_1_id"]
    assert (state.kind, state.texts[1], state.row) == (Kind.ENUM, "choice.product.state.1", 2)
    assert (id.kind, id.register and id.register.address) == (Kind.STEP, 0x804)
    assert "product_4_head" not in item.points
    for word, name in enumerate(("generation", "capacity", "count")):
        point = item.points[f"product_{name}"]
        assert point.register
        assert (point.register.address, point.kind, point.history, point.table) == (0x800 + word, Kind.STEP, False, "")


def test_a_machine_has_as_many_slots_as_its_option_says(tmp_path: Path) -> None:
    item = machine(tmp_path, "slots = 250\nlength = 1000\n")
    last = item.points["product_250_head"]
    assert (item.tables["product"], last.high) == (250, 1000)
    assert last.register
    assert last.register.address == 0x800 + 4 + 249 * 16 + 4
    _, problems = load(tmp_path, PLANT + "slots = 2.5\n")
    assert [(p.key, p.expected) for p in problems] == [("equipment.k1.slots", "a whole number")]


def test_the_history_of_a_renamed_table_goes_on(tmp_path: Path) -> None:
    tables = FILES["tables.toml"].replace("columns.head]", 'columns.front]\nwas = "head"')
    item = machine(tmp_path, 'was = "old"\n', tables=tables)
    assert item.points["product_2_front"].id == "old.product_2_head"


def test_a_machine_of_250_slots_is_read_quickly(tmp_path: Path) -> None:
    columns = "".join(f'[product.columns.c{n}]\noffset = {4 + 2 * n}\ntype = "f32"\n' for n in range(12))
    tables = FILES["tables.toml"].replace("row = 16", "row = 40").partition("[product.columns.head]")[0] + columns
    before = process_time()
    item = machine(tmp_path, "slots = 250\n", tables=tables)
    assert sum(point.table == "product" for point in item.points.values()) == 250 * 14
    assert process_time() - before < 3.0


def test_a_preset_gives_defaults_that_the_plant_file_may_change(tmp_path: Path) -> None:
    plain, long = machine(tmp_path), machine(tmp_path, 'preset = "long"\nslots = 4\n')
    assert (plain.preset, plain.options["length"], plain.options["slots"]) == ("", 660, 3)
    assert (long.preset, long.options["length"], long.options["slots"]) == ("long", 4000, 4)
    assert long.points["length"].high == 4000


def test_an_unknown_preset_is_told_with_the_choices(tmp_path: Path) -> None:
    _, problems = load(tmp_path, PLANT + 'preset = "modell"\n')
    assert [str(found) for found in problems] == [
        'plant.toml:13: equipment.k1.preset = "modell": expected one of model, long (perhaps model)'
    ]


def test_a_change_of_preset_is_seen_before_it_is_taken(tmp_path: Path) -> None:
    old, _ = load(tmp_path)
    new, _ = load(tmp_path, PLANT + 'preset = "long"\n')
    assert old is not None
    assert new is not None
    (change,) = changes.compare(old, new)
    assert 'preset: "" → "long"' in change.details
    assert "slots: 3.0 → 5.0" in change.details
    assert "points + product_4_id, product_4_state, product_4_head" in "; ".join(change.details)


def test_the_simulation_takes_numbers_within_limits(tmp_path: Path) -> None:
    item = machine(tmp_path, 'simulation = { start = "automatic", arrivals = 4 }\n')
    assert item.options["simulation"] == {"start": "automatic", "arrivals": 4.0}
    _, problems = load(tmp_path, PLANT + "simulation = { arrivals = 61 }\n")
    assert [(found.key, found.expected) for found in problems] == [
        ("equipment.k1.simulation.arrivals", "a number from 0 to 60")
    ]


def test_commands_are_codes_with_arguments(tmp_path: Path) -> None:
    commands = machine(tmp_path).type.commands
    assert (commands["start"].code, commands["start"].feedback) == (1, "state == 1")
    assert (commands["clear"].code, commands["clear"].feedback) == (4, "")
    assert (commands["jog"].hold, commands["jog"].hold_bits) == (True, 1)
    edit = commands["edit"]
    assert edit.needs_reason
    assert list(edit.arguments) == [
        Argument("product", Type.U32, "1", "", "", 0, "argument.product"),
        Argument("head", Type.F32, "0", "length", "mm", 1, "argument.head"),
    ]


def test_an_event_may_raise_an_alarm(tmp_path: Path) -> None:
    jam, late = machine(tmp_path).alarms
    assert (jam.event, jam.event_clear, jam.source, jam.expression) == (20, 21, 2, "")
    assert (late.event, late.event_clear, late.source, late.expression) == (1, 0, None, "count > 4")


def test_a_plant_may_add_alarms_by_event(tmp_path: Path) -> None:
    row = '[[alarms]]\nequipment = "k1"\nkey = "busy"\nevent = {}\npriority = 4\nlabel = "Busy"\n'
    assert machine(tmp_path, row.format('"arrived"')).alarms[-1].event == 1
    _, problems = load(tmp_path, PLANT + row.format(9))
    assert [(found.key, found.value) for found in problems] == [("alarms.0.event", "9")]


def test_all_texts_that_the_data_ask_for_are_known(tmp_path: Path) -> None:
    data, problems = types.read_type("line", LANGUAGES, write_type(tmp_path))
    assert problems == []
    keys = set(types.text_keys(data))
    assert {
        "type", "event.arrived", "event.jam_over", "reason.no_such_product", "argument.head", "point.product.head",
        "choice.product.state.2", "table.count", "command.edit", "alarm.jam.response",
    } <= keys  # fmt: skip


MISTAKES = [
    ("device", "type_code = 10", "type_code = 0", "plc.type_code", "a whole number from 1 to 65535"),
    ("device", 'status = "state"', 'status = "stat"', "plc.status", "perhaps state"),
    ("device", "words = 16 }]", "words = 2 }]", "plc.images.0.words", "from 3 to 125"),
    ("device", "0x0100, words", "0xFFF8, words", "plc.images.0.words", "0xFFFF"),
    ("device", "words = 16 }]", "words = 16, size = 3 }]", "plc.images.0.size", "no such key"),
    ("device", "words = 16 }]", "words = 16 }, { address = 0x10F, words = 9 }]", "plc.images", "does not use"),
    ("device", "words = 16 }]", "words = 5 }]", "plc.images", "length lies in or outside"),
    ("device", "staging = 0x0240", "", "plc.staging", "a whole number"),
    ("device", "max_write = 123", "max_write = 123\nmax_read = 12", "plc.images", "at most 12 words (`max_read`)"),
    ("device", "0x0200, words", "0x0108, words", "plc.images", "the image at 0x0100 does not use"),
    ("device", "staging = 0x0240", "staging = 0x0204", "plc.staging", "the image at 0x0200 does not use"),
    ("device", "staging = 0x0240", "staging = 0x010F", "plc.staging", "the image at 0x0100 does not use"),
    ("device", "staging = 0x0240", "staging = 0x001F", "plc.staging", "other than 0x0000–0x001F"),
    ("device", "staging = 0x0240", "staging = 0x030C", "plc.staging", "other than 0x0300–0x030F"),
    ("device", "staging = 0x0240", "staging = 0x0360", "plc.staging", "other than 0x0320–0x0361"),
    ("device", "staging = 0x0240", "staging = 0x0383", "plc.staging", "other than 0x0380–0x0383"),
    ("device", "staging = 0x0240", "staging = 0x07FF", "plc.staging", "other than 0x0400–0x07FF"),
    ("device", 'status = "state"', 'status = "length"', "plc.status", "one register with a whole number"),
    ("points", "address = 0x0101", "address = 0x0100", "state.address", "other than 0x0100"),
    ("points", "address = 0x0103", "address = 0x010F", "count.address", "other than 0x010F"),
    ("setpoints", "address = 0x0202", "address = 0x0201", "speed.address", "other than 0x0201"),
    ("points", "address = 0x0204", "address = 0x0206", "delay.address", "other than 0x0207"),
    ("setpoints", "address = 0x0202", "address = 0x0203", "speed", "two registers of its own"),
    (
        "setpoints",
        'type = "f32"',
        'type = "u16"',
        "speed",
        "two registers of its own (f32, u32 or i32), each second one from 0x0202",
    ),
    ("tables", "address = 0x0800", "address = 0x07FC", "product.address", "other than 0x0400–0x07FF"),
    ("device", "0x0200, words", "0x1000, words", "product.address", "the image at 0x1000 does not use"),
    ("device", "0x0240", "0x0900", "product.address", "the image at 0x0900 does not use"),
    (
        "tables",
        "shift = 1",
        'shift = 1\nkind = "bool"\n[other]\naddress = 0x0900\nrow = 16\ncapacity = 1\n[other.columns.id]\noffset = 0\n'
        'type = "u32"\n[other.columns.left]\noffset = 6\nmask = 1',
        "other.address",
        "the image at 0x0800 does not use",
    ),
    ("commands", "timeout = 3", "timeout = 3601", "stop.timeout", "seconds above 0, at most 3600"),
    ("commands", 'feedback = "state == 1"', 'feedback = "state == 7"', "start.feedback", "7 it never is"),
    ("alarms", 'expression = "count > 4"', 'expression = "state == 7"', "late.expression", "7 it never is"),
    ("commands", "code = 2", "code = 1", "stop.code", "no other command has: it is that of start"),
    ("commands", "code = 4", "code = 0xF0", "clear.code", "makes staged settings valid"),
    (
        "commands",
        "hold_bits = 1",
        "hold_bits = 1\nfeedback = 'moving == 1'\n[jog2]\nhold = true\nhold_bits = 1",
        "jog2.hold_bits",
        "it is that of jog",
    ),
    ("commands", 'type = "u32", low = 1', 'type = "u32", low = 1, high = 0', "edit.arguments.0.low", "low <= high"),
    ("device", "max_write = 123", "max_write = 15", "plc", "function 16"),
    ("device", "write_functions = [6, 16]", "write_functions = [6]", "plc", "function 16"),
    ("tables", "row = 16", 'row = 16\nscan = "once"', "product.scan", "one of fast, slow"),
    ("tables", "row = 16", "row = 16\nsince = 99", "product.since", "a whole number from 0 to"),
    ("events", '1 = "arrived"', '0 = "arrived"', "events.0", "a code from 1 to 65535"),
    ("events", '1 = "arrived"', '70000 = "arrived"', "events.70000", "a code from 1 to 65535"),
    ("events", '1 = "arrived"', "1 = 5", "events.1", "a key"),
    ("events", '"jam_over"', '"jam"', "events.21", "no other code"),
    ("events", "[reasons]", "[reason]", "reason", "perhaps reasons"),
    ("events", "word = 0", "word = 6", "snapshot.product.word", "from 0 to 5"),
    ("events", "word = 0", "word = 5", "snapshot.product.word", "words within the 6 of a snapshot"),
    ("events", "word = 0", "word = 1", "snapshot.second.word", "words that product does not use"),
    ("events", "none = 0", "no = 0", "snapshot.product.no", "no such key"),
    ("events", 'type = "u32"', 'type = "u64"', "snapshot.product.type", "one of u16, i16, u32, i32, f32"),
    ("events", "none = 0", "none = 0.5", "snapshot.product.none", "a whole number"),
    ("events", 'all = "products"', 'all = "second"', "snapshot.product.all", "a name that nothing else has"),
    ("events", 'all = "products"', 'all = "source"', "snapshot.product.all", "a name that nothing else has"),
    ("events", "[snapshot.second]", "[snapshot.value]", "snapshot.value", "none of event, limit, source, value"),
    ("events", "[snapshot.second]", "[snapshot.Second]", "snapshot.Second", "small letters"),
]


@pytest.mark.sweep(8)
@pytest.mark.parametrize(("file", "old", "new", "key", "expected"), MISTAKES)
def test_a_mistake_is_named(tmp_path: Path, file: str, old: str, new: str, key: str, expected: str) -> None:
    found = problem(tmp_path, file, old, new)
    assert found.key == key
    assert expected in found.expected


def test_request_bits_that_cannot_be_are_told_alone(tmp_path: Path) -> None:
    _, problems = load(tmp_path, commands=FILES["commands.toml"].replace("hold_bits = 1", "hold_bits = 0x10000"))
    assert [found.key for found in problems] == ["jog.hold_bits"]


def test_of_one_code_may_be_two_commands_that_ask_for_arguments(tmp_path: Path) -> None:
    again = '[edit_again]\ncode = 6\nmoves = false\narguments = [{ name = "head", low = 0, high = 1 }]\n'
    plant, problems = load(tmp_path, commands=FILES["commands.toml"] + again)
    assert plant, problems


def test_more_than_four_arguments_do_not_fit(tmp_path: Path) -> None:
    found = problem(tmp_path, "commands", ", decimals = 1 },", " }, { name = 'a' }, { name = 'b' }, { name = 'c' },")
    assert (found.key, found.expected) == ("edit.arguments.4.name", "at most 4 arguments")


@pytest.mark.parametrize(
    ("file", "keys"),
    [
        ("tables", ["(file)"]),
        ("commands", ["start.code", "stop.code", "clear.code", "edit.code", "jog.hold_bits"]),
        ("alarms", ["jam.event", "jam.event_clear", "late.event"]),
    ],
)
def test_a_drive_has_none_of_it(tmp_path: Path, file: str, keys: Sequence[str]) -> None:
    device = FILES["device.toml"]
    start, end = device.index("[plc]"), device.index("[options.slots]")
    changed: dict[str, str | None] = {
        name: None for name in ("tables", "commands", "alarms", "events", "setpoints") if name != file
    }
    changed["device"] = device[:start] + device[end:]
    _, problems = load(tmp_path, PLANT, **changed)
    assert [found.key for found in problems] == keys


def test_a_ring_without_names_is_told(tmp_path: Path) -> None:
    _, problems = load(tmp_path, events=None, alarms=None)
    assert [(found.key, found.value) for found in problems] == [("plc.events", "true")]


def test_an_order_without_code_needs_telegrams(tmp_path: Path) -> None:
    found = problem(tmp_path, "commands", "code = 4", "")
    assert found.key == "clear.feedback"


def test_the_files_of_the_test_are_toml() -> None:
    for name, text in FILES.items():
        assert tomllib.loads(text), name


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("name", types.names())
def test_every_text_that_a_type_asks_for_is_there_in_every_language(name: str, language: str) -> None:
    data, problems = types.read_type(name, LANGUAGES)
    assert problems == []
    product = read_product()[language]
    assert [key for key in types.text_keys(data) if key not in data.type.texts[language] and key not in product] == []
