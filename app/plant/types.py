"""Equipment types: the folders of app/equipment and `equipment/` of a plant, read once; each kind of file has its reader in
plant/type_files.

`device.toml` limits of the device, options of an instance (a `default` may be a sentence over those above it), presets and checks of
them (what one `expected` is a text, or one for each language); `points.toml` values; `setpoints.toml` parameters (each is a point too);
`checks.toml` what must hold between them (`[key]` with `expression`); `ratings.toml` what a device says of itself against the options;
`commands.toml`; `interlocks.toml` with `[permissives.…]` and `[interlocks.…]`; `alarms.toml`; `training.toml` (plant/training.py);
`simulation.toml`, the machine behind its registers (type_files/simulation.py); `texts.<lang>.toml`;
of a Pogon PLC also `tables.toml` and `events.toml` (plant/plc.py), `records.toml` (plant/record_kinds.py); of a drive
`parameters.toml`, behind a mailbox (plant/drive_parameters.py) or as registers (plant/register_parameters.py).

Of a type whose equipment runs a sequence, and of a machine that one may use, device.toml says:

    sequence = true                                     takes `definition` and `machine`; `BY_DEFINITION` are options it gives
    [actions]
    names = ["lower", "lift"]                           what the steps of its own sequence may ask of the machine
    [actions.orders.run]                                what any sequence may have it do (actions.py)
    commands = [{ command = "set_frequency", value = "frequency" }, { command = "forward" }]
    [presets_of_simulation]
    pressure = [0, 250]                                 what a test of a sequence may set on the simulated machine: least, greatest

A point may be bits of another one that is a whole word above it: `part_of = "status_word"` with `shift` and `mask`. A telegram of a command
may depend on what the device says: `when` it is written at all, `after` what, and how long that is waited for (`within`).

A type whose device.toml says `kin = "sinamics"` has the drive parameters, texts and style sheets of that type, too; its
own win.

Rows that a machine has as many of as an option says are written once (plant/type_files/repeats.py).

A missing file but device.toml and points.toml means: there are none of these. Names of text keys follow the keys: `point.speed`,
`command.stop`, `alarm.overcurrent.label`, `argument.head`, of all cells of a column `point.product.head`; what stands under `label` in the
data wins.
"""

import contextlib
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from types import MappingProxyType

from app import bundled
from app.errors import ConfigurationError
from app.plant import drive_parameters, plc, record_kinds, register_parameters
from app.plant.definitions import EquipmentType
from app.plant.problems import Problem
from app.plant.said import said
from app.plant.services import read_services
from app.plant.tables import MISSING, Source, Table, meant_as_toml, one_of
from app.plant.texts import FALLBACK, read_product
from app.plant.training import read_training
from app.plant.training import text_keys as training_keys
from app.plant.type_files.alarms import read_alarms
from app.plant.type_files.commands import CommandReader
from app.plant.type_files.conditions import check_commands, read_checks, read_guards, read_ratings
from app.plant.type_files.data import TypeData
from app.plant.type_files.device import read_actions, read_device, read_picture, read_simulation_presets, read_tile
from app.plant.type_files.doubts import doubt_type
from app.plant.type_files.interventions import check_interventions
from app.plant.type_files.options import read_checks as read_option_checks
from app.plant.type_files.options import read_options
from app.plant.type_files.orders import read_orders
from app.plant.type_files.points import Points
from app.plant.type_files.registers import check_generations, check_registers, check_telegrams
from app.plant.type_files.repeats import Repeats, read_repeats, written_out
from app.plant.type_files.sentences import Sentences
from app.plant.type_files.setpoints import read_setpoints
from app.plant.type_files.simulation import FILE as SIMULATION
from app.plant.type_files.simulation import SimulationReader
from app.plant.type_files.tables import read_tables
from app.plant.type_files.texts import check_texts, flatten
from app.plant.type_files.today import read_today
from app.plant.type_files.today import text_keys as today_keys
from app.profidrive.parameter_access.parameter import DriveParameter

EQUIPMENT = Path(__file__).resolve().parent.parent / "equipment"
OWN = "equipment"
"""Folder of a plant with the types that it brings itself."""
PACKAGE = "app.equipment"
"""Where the Python of a type is imported from."""
SYMBOL = r"[ei]-[a-z0-9-]+"


def names(folder: Path = EQUIPMENT) -> list[str]:
    """Equipment types that exist, or are begun: without device.toml, or with one of another name, a type is wrong and not unknown. None in
    a folder that cannot be, whatever Python has against it."""
    with contextlib.suppress(ValueError):
        return sorted({path.parent.name for path in folder.glob("*/*") if path.suffix.lower() == ".toml"})
    return []


def read_type(
    name: str,
    languages: Sequence[str],
    folder: Path = EQUIPMENT,
    *,
    spoken: Sequence[str] | None = None,
    given: Mapping[str, float] | None = None,
) -> tuple[TypeData, list[Problem]]:
    """Read the folder of type `name`; the data is only of use when there are no problems.

    Of `languages` its texts are read where it has them; of those `spoken` (else of all) it must have them. Its repeated rows are as many
    as the options `given` say, else as the defaults of its options do.
    """
    return _read_files(_Files(folder / name, name, given or {}), languages, languages if spoken is None else spoken)


def read_own_type(
    name: str, languages: Sequence[str], plant: Path, *, spoken: Sequence[str], given: Mapping[str, float]
) -> tuple[TypeData, list[Problem]]:
    """As `read_type`, of `equipment/<name>` in the folder `plant`, which is data alone: its links lead nowhere else, and no Python of it
    is run. A text that none of its languages has is a problem, too; one that a language lacks is shown with its mark."""
    data, problems = _read_files(_Files(plant / OWN / name, name, given, own=True), languages, ())
    if not problems:
        known = {key for texts in (*data.type.texts.values(), read_product()[FALLBACK]) for key in texts}
        asked = (key for key in sorted(set(text_keys(data)) - known) if f"{key}.other" not in known)
        file = f"{OWN}/{name}/texts.{spoken[0]}.toml"
        problems = [Problem(file, key, MISSING, said("mistake.a_text")) for key in asked]
        problems += _unfilled(data.type)
    return data, problems


def _unfilled(kind: EquipmentType) -> Iterator[Problem]:
    """Texts that name a number which nobody gives: an operator would read `{speed}`."""
    needs = (need for action in kind.orders.values() for need in action.needs)
    guards = (*kind.permissives, *kind.interlocks, *needs)
    effects = [effect for command in kind.commands.values() for effect in command.effects]
    given = {one.missing: one.values for one in guards} | {one.text: one.values for one in effects}
    for language, texts in kind.texts.items():
        for key, values in given.items():
            text = texts.get(key, "")
            for name in re.findall(r"\{(\w+)\}", text):
                if name not in values and name != "name":
                    expected = said("mistake.filled", name=name, known=", ".join(values) or said("mistake.none"))
                    yield Problem(f"{OWN}/{kind.name}/texts.{language}.toml", key, f'"{text}"', expected)


def _read_files(files: "_Files", languages: Sequence[str], spoken: Sequence[str]) -> tuple[TypeData, list[Problem]]:
    data = _read(files, languages, spoken)
    if not any(source.problems for source in files.sources):
        doubt_type(data, {source.path.name: source.table() for source in files.sources}, own=files.own)
    data = replace(data, doubts=tuple(doubt for source in files.sources for doubt in source.doubts))
    # what the others miss of a file that could not be read is no mistake of theirs
    told = [source for source in files.sources if source.unread] or files.sources
    return data, [*_strange(files), *(problem for source in told for problem in source.problems)]


def _strange(files: "_Files") -> Iterator[Problem]:
    """Files that nobody reads: what is written in `alarm.toml` would never come."""
    known = {source.path.name for source in files.sources}
    for path in meant_as_toml(files.folder):
        if path.name not in known and not re.fullmatch(r"texts\.[a-z]{2,3}\.toml", path.name):
            yield Problem(f"{files.shown}/{path.name}", "(file)", path.name, one_of(sorted(known), path.name))


class _Files:
    """The files of one type that were opened, and so the mistakes in them."""

    def __init__(
        self, folder: Path, name: str, given: Mapping[str, float] = MappingProxyType({}), *, own: bool = False
    ) -> None:
        self.folder = folder
        self.name = name
        self.shown = f"{OWN}/{name}" if own else name
        """How the folder is named where a mistake in it is told."""
        self.own = own
        """It lies in a plant folder, `equipment/<name>`."""
        self.sources: list[Source] = []
        self.repeats = Repeats({}, {})
        """Known once device.toml was opened."""
        self.given = given

    def open(self, name: str, *, optional: bool = True) -> Table:
        """The file `name` as a table; only one that is not `optional` must be there."""
        shown, inside = f"{self.shown}/{name}", self.folder.parent.parent if self.own else None
        source = Source(self.folder / name, shown, optional=optional, inside=inside)
        self.sources.append(source)
        if name == "device.toml" and "repeats" in source.data:
            try:
                self.repeats = read_repeats(source.data, self.given)
            except ConfigurationError as error:
                source.note(("repeats",), said("mistake.given"), error.args[0])
        if self.repeats:
            # of texts all that any machine may need: they are looked up by the name of the type, too
            numbers = self.repeats.most if name.startswith("texts.") else self.repeats.numbers
            written = written_out(source.data, numbers)
            source.data, source.written = written.data, written.names
            for path, value, expected in written.mistakes:
                source.note(path, value, expected)
        return source.table()


@cache
def _symbols() -> frozenset[str]:
    """What a machine may be drawn as."""
    return frozenset(re.findall(rf'<symbol id="({SYMBOL})"', (bundled("static") / "symbols.svg").read_text("utf-8")))


@dataclass(frozen=True, slots=True)
class _Kin:
    """What a type takes from another one."""

    name: str
    parameters: Mapping[str, DriveParameter]
    texts: Mapping[str, Mapping[str, str]]


def _kin(head: Table, files: _Files, languages: Sequence[str]) -> _Kin:
    """Of the type that `kin` in device.toml names: its mistakes are told where it is read itself."""
    name = head.text("kin", "")
    if not name:
        return _Kin("", {}, {language: {} for language in languages})
    parent = EQUIPMENT if files.own else files.folder.parent
    folder = parent / name
    if name == files.name or name not in names(parent):
        known = ", ".join(one for one in names(parent) if one != files.name)
        head.note("kin", name, said("mistake.another_type", known=known))
        return _Kin("", {}, {language: {} for language in languages})
    other = _Files(folder, name)
    texts = {language: dict(flatten(other.open(f"texts.{language}.toml").data)) for language in languages}
    return _Kin(name, drive_parameters.read_parameters(other.open("parameters.toml")), texts)


def _texts(file: Table) -> dict[str, str]:
    check_texts(file)
    return dict(flatten(file.data))


def _read(files: _Files, languages: Sequence[str], spoken: Sequence[str]) -> TypeData:
    name = files.name
    head = files.open("device.toml", optional=False)
    head.raw("repeats")
    device = read_device(head.table("device"))
    label, area = head.text("label", "type"), head.text("area", "")
    symbol = head.text("symbol", "e-machine", pattern=SYMBOL, expected=said("mistake.symbol"))
    if re.fullmatch(SYMBOL, symbol) and symbol not in _symbols():
        head.note("symbol", symbol, one_of(sorted(_symbols()), symbol))
    sequence = head.flag("sequence")
    options = read_options(head, name, sequence=sequence)
    actions, simulation_presets = read_actions(head, sequence=sequence), read_simulation_presets(head)
    option_checks = tuple(read_option_checks(head, options, usual=not files.given))
    device = replace(device, services=read_services(head, device))
    tile = head.items("tile", ()) if head.has("tile") else ()
    kin = _kin(head, files, languages)
    picture = head.table("picture") if head.has("picture") else None
    head.done()
    file = files.open("events.toml")
    events, reasons = plc.read_names(file, "events"), plc.read_names(file, "reasons")
    snapshot = plc.read_snapshot(file, events)
    file.done()
    package = "" if files.own else PACKAGE
    kinds = record_kinds.read_kinds(files.open("records.toml"), files.folder, package, events, list(snapshot))
    sentences = Sentences()
    points = Points(name, options, sentences)
    points_file = files.open("points.toml", optional=False)
    points.read(points_file)
    table_file = files.open("tables.toml")
    tables, columns = read_tables(table_file, options, points, has_map=device.plc is not None)
    for counting in {map.capacity for map in tables.values()} & set(options.ranges):
        options.check_whole(head, counting, said("mistake.capacity_whole"))
    for option in sorted(options.whole):
        options.check_whole(head, option, said("mistake.option_whole"))
    setpoints_file = files.open("setpoints.toml")
    setpoints = dict(read_setpoints(setpoints_file, points, sentences, device.plc))
    commands = CommandReader(name, points.found, options, sentences, device.plc).read(files.open("commands.toml"))
    orders = read_orders(head.table("actions").table("orders"), commands, sentences)
    check_interventions(table_file, tables, points=points.found, commands=commands, records=kinds)
    guards = files.open("interlocks.toml")
    permissives, interlocks = read_guards(guards, sentences)
    checks = read_checks(files.open("checks.toml"), sentences, setpoints)
    ratings = read_ratings(files.open("ratings.toml"), sentences)
    ring = events if device.plc and device.plc.events else {}
    alarms = list(read_alarms(files.open("alarms.toml"), ring, sentences))
    check_commands(guards, "permissives", permissives, commands, name)
    check_commands(guards, "interlocks", interlocks, commands, name)
    training = read_training(files.open("training.toml"), tuple(points.found))
    simulated = os.path.lexists(files.folder / SIMULATION)
    described = files.open(SIMULATION, optional=not simulated)
    today = read_today(files.open("today.toml"), {key: data.point for key, data in points.found.items()}, kinds)
    known = files.open("parameters.toml")
    if device.parameters:
        found = {key: data.point for key, data in points.found.items()}
        parameters_known = register_parameters.read_known(known, setpoints, found, device.parameters.individual)
    else:
        parameters_known = {**kin.parameters, **drive_parameters.read_parameters(known)}
    texts = {
        language: {
            **kin.texts[language],
            **_texts(files.open(f"texts.{language}.toml", optional=language not in spoken)),
        }
        for language in languages
    }
    registers_of = {key: data.point.register for key, data in points.found.items()}
    sentences.check({key: data.point for key, data in points.found.items()}, name)
    check_registers(points.found.values(), files.sources)
    check_telegrams(points.found.values(), device, files.sources)
    simulation = None
    if simulated and described.data:
        doubtful = bool(points_file.source.problems or setpoints_file.source.problems)
        reader = SimulationReader(name, points.found, options, training)
        simulation = reader.read(described, device, setpoints, doubtful=doubtful)
    if device.plc:
        plc.check_points(head, device.plc, registers_of, tuple(events))
        if not table_file.source.problems:  # a place or a number of rows that is wrong would tell what follows from it
            plc.check_tables(table_file, device.plc, tables, options.ranges)
        if not head.source.problems:  # of an image that is wrong it would tell what follows from it
            check_generations(points.found.values(), device.plc, files.sources)
    kind = EquipmentType(
        name=name,
        folder=files.folder,
        label=label,
        device=device,
        points={key: data.point for key, data in points.found.items()},
        commands=commands,
        permissives=permissives,
        interlocks=interlocks,
        setpoints=setpoints,
        alarms=alarms,
        texts=texts,
        options=options.values,
        ranges=options.ranges,
        area=area,
        tables=tables,
        presets=options.presets,
        events=events,
        reasons=reasons,
        snapshot=snapshot,
        checks=checks,
        ratings=ratings,
        sequence=sequence,
        actions=actions,
        orders=orders,
        simulation_presets=simulation_presets,
        records=kinds,
        training=training,
        simulation=simulation,
        kin=kin.name,
        drive_parameters=parameters_known,
        symbol=symbol,
        today=today,
        tile=read_tile(head, tile, points.found),
        picture=read_picture(picture, tile) if picture is not None else None,
    )
    codes = frozenset(setpoint.code for setpoint in setpoints.values() if setpoint.code)
    parameters = {key: codes if takes else frozenset() for key, takes in options.parameters.items()}
    counted, whole = files.repeats.options, frozenset(options.whole)
    return TypeData(
        kind,
        points.found,
        options.choices,
        parameters,
        options.numbers,
        columns,
        option_checks,
        counted,
        whole,
        options.follows,
    )


def text_keys(data: TypeData) -> Iterator[str]:
    """Every text that the data of a type ask for; each stands in the type's own texts or in the product's."""
    kind = data.type
    yield kind.label
    cells = [cell for columns in data.columns.values() for cell in columns.values()]
    for point in (item.point for item in (*data.points.values(), *cells)):
        yield point.label
        yield from point.texts.values()
    for setpoint in kind.setpoints.values():
        yield from setpoint.options.values()
        yield from [setpoint.warning] if setpoint.warning else []
    for command in kind.commands.values():
        yield command.label
        yield from (effect.text for effect in command.effects)
        yield from command.refused.values()
        yield from (argument.label for argument in command.arguments)
    for action in kind.orders.values():
        yield from [action.label] if action.label else []
        yield from (argument.label for argument in action.arguments)
    needs = (need for action in kind.orders.values() for need in action.needs)
    for condition in (*kind.permissives, *kind.interlocks, *kind.checks, *needs):
        yield condition.label
        yield from [condition.missing] if condition.missing else []
    yield from (rating.missing for rating in kind.ratings)
    for alarm in kind.alarms:
        yield from (alarm.label, alarm.consequence, alarm.cause, alarm.response)
    yield from training_keys(kind.training)
    yield from drive_parameters.text_keys(kind.drive_parameters)
    if kind.device.parameters:
        yield from register_parameters.text_keys(kind.device.parameters)
    yield from plc.text_keys(kind.events, kind.reasons, kind.snapshot)
    yield from record_kinds.text_keys(kind.records)
    yield from today_keys(kind.today)
