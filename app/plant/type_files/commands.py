"""commands.toml: what may be asked of a machine, what is written then, and by what feedback it is seen to work."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from app.plant.definitions import Command, Effect, Kind, PlcMap, Type, Write
from app.plant.said import said
from app.plant.tables import MISSING, Table, is_number
from app.plant.type_files.arguments import read_arguments
from app.plant.type_files.data import PointData
from app.plant.type_files.names import ROLES
from app.plant.type_files.options import Options
from app.plant.type_files.sentences import Sentences, names_in, needs_argument, read_values
from app.registers.codec import raw_limits
from app.registers.plc_map import COMMIT_SETTINGS
from app.registers.register import REALS

LEVELS = ("C0", "C1", "C2", "C3", "C4")
SPECIAL_VALUES = ("argument", "previous")
ORDERS = ("code", "hold_bits")
"""What a command of a Pogon PLC is sent as, instead of `writes`."""
LONGEST_WAIT = 3600
"""Seconds after which a command that nothing confirmed has failed, at most: nobody waits longer at a button."""
ROUNDING = 1e-6
"""How far a number may be from a step of its register, in steps: 0.3 is no multiple of 0.1 to a computer."""


@dataclass(frozen=True, slots=True)
class CommandReader:
    """Reads the commands of a type whose points and options are known."""

    owner: str
    points: Mapping[str, PointData]
    options: Options
    sentences: Sentences
    map: PlcMap | None

    def read(self, file: Table) -> dict[str, Command]:
        """Each table of `file` is a command."""
        found = dict[str, Command]()
        for key, table in file.tables():
            found[key] = command = self._command(key, table)
            first = next((other for other in found if found[other].stop), key)
            if command.stop and first != key:
                table.note("stop", "true", said("mistake.one_stop", first=first))
            self._check_once(table, command, found)
        return found

    def _check_once(self, table: Table, command: Command, found: Mapping[str, Command]) -> None:
        """What is sent the same is one command: another Stop would start. With arguments it may be two, who ask for different ones."""
        for name in ORDERS:
            number = getattr(command, name)
            for other in found.values() if number else ():
                same = other is not command and getattr(other, name) == number
                if same and not (command.arguments and other.arguments):
                    table.note(name, number, said("mistake.order_once", other=other.key))
                    break

    def _command(self, key: str, table: Table) -> Command:
        timeout = self._timeout(table)
        level_when = self._level_when(table)
        arguments = tuple(read_arguments(table, self.sentences))
        code, hold_bits = table.whole("code", 0, 1), table.whole("hold_bits", 0, 1)
        command = Command(
            key=key,
            label=table.text("label", f"command.{key}"),
            writes=tuple(self._writes(table, "writes", steps=not table.flag("stop"))),
            feedback=table.text("feedback", *([""] if code else [])),
            timeout=timeout,
            level=table.text("level", "C1", choices=LEVELS),
            level_when=level_when,
            role=table.text("role", "operator", choices=ROLES),
            stop=table.flag("stop"),
            hold=table.flag("hold"),
            release=tuple(self._writes(table, "release")),
            released=table.text("released", ""),
            moves=table.flag("moves", True),
            argument=table.text("argument", ""),
            symbol=table.text("symbol", ""),
            code=code,
            arguments=arguments,
            hold_bits=hold_bits,
            needs_reason=table.flag("needs_reason"),
            refused=dict(self._refused(table)),
            effects=tuple(self._effects(table)),
            aside=table.flag("aside"),
        )
        self._check(table, command)
        table.done()
        return command

    def _refused(self, table: Table) -> Iterator[tuple[int, str]]:
        given = table.table("refused")
        for code in given.data:
            text = given.text(code)
            if not code.isdecimal() or len(code) > 3 or not 1 <= int(code) <= 255:
                given.note(code, text, said("mistake.exception"))
            else:
                yield int(code), f"reason.{text}"
        given.done()

    def _effects(self, table: Table) -> Iterator[Effect]:
        for row in table.rows("effects"):
            when = row.text("when", "")
            if when:
                self.sentences.add(row, "when", when)
            effect = Effect(f"effect.{row.text('text')}", when, read_values(row, self.sentences))
            row.done()
            yield effect

    def _timeout(self, table: Table) -> str:
        timeout = table.raw("timeout", 5)
        if isinstance(timeout, str):
            self.sentences.add(table, "timeout", timeout, argument=True)
        elif not is_number(timeout) or not 0 < timeout <= LONGEST_WAIT:
            table.note("timeout", timeout, said("mistake.seconds", most=LONGEST_WAIT))
        return str(timeout)

    def _level_when(self, table: Table) -> tuple[str, str] | None:
        higher = table.table("level_when")
        if not table.has("level_when"):
            return None
        condition, level = higher.text("condition"), higher.text("level", choices=LEVELS)
        self.sentences.add(higher, "condition", condition)
        higher.done()
        return condition, level

    def _check(self, table: Table, command: Command) -> None:
        """What of the row does not go together."""
        ordered = any(table.has(name) for name in ORDERS)  # also with a number that cannot be
        if command.feedback:
            self.sentences.add(table, "feedback", command.feedback, argument=not ordered)
            self._check_is_read(table, command.feedback)
        if ordered:
            self._check_order(table, command)
        elif not command.writes:
            pair = "{ point, value }"
            writes = (
                said("mistake.writes_or", pair=pair, key="`code`") if self.map else said("mistake.writes", pair=pair)
            )
            table.note("writes", MISSING, writes)
        if not ordered and command.hold != bool(command.release):
            found = said("mistake.given") if command.release else MISSING
            table.note("release", found, said("mistake.release"))
        if command.released:
            self.sentences.add(table, "released", command.released)
            if not command.hold:
                table.note("released", command.released, said("mistake.released"))
        if command.arguments and not command.code:
            table.note(
                "arguments", [argument.name for argument in command.arguments], said("mistake.with_code", key="`code`")
            )
        if command.stop:
            self._check_stop(table, command)
        self._check_argument(table, command)
        if command.aside and (command.hold or command.stop or command.arguments):
            table.note("aside", "true", said("mistake.not_aside"))
        if command.needs_reason and (command.hold or command.stop):
            table.note("needs_reason", "true", said("mistake.no_why"))
        if command.argument and command.argument not in self.points:
            table.note("argument", command.argument, said("mistake.point_of_type", owner=self.owner, near=""))

    def _check_stop(self, table: Table, command: Command) -> None:
        """A Stop is a click of any operator."""
        for key, value in (
            ("hold", command.hold),
            ("argument", command.argument),
            ("role", command.role != "operator"),
        ):
            if value:
                table.note(key, table.raw(key), said("mistake.plain_stop", key=key))

    def _check_argument(self, table: Table, command: Command) -> None:
        """A value that is entered is written, and what is written or compared with is entered."""
        if command.code or command.hold_bits:
            return
        written = [write.value for write in (*command.writes, *command.release)]
        used, previous = (
            "argument" in written,
            "previous" in written,
        )  # what stood before is the argument of its feedback
        if command.argument and not used:
            table.note("argument", command.argument, said("mistake.argument_written"))
        elif not command.argument and (used or (needs_argument(command.feedback) and not previous)):
            table.note("argument", MISSING, said("mistake.argument_point", keys="`writes`, `feedback`"))

    def _check_is_read(self, table: Table, feedback: str) -> None:
        """What is only written never confirms anything."""
        names = names_in(feedback)
        if names is not None and not names:
            table.note("feedback", feedback, said("mistake.over_point"))
        for name in sorted(names or ()):
            register = self.points[name].point.register if name in self.points else None
            if register is not None and not register.readable:
                table.note("feedback", feedback, said("mistake.read_point", point=name))

    def _check_order(self, table: Table, command: Command) -> None:
        """A command that is sent as a code or as request bits."""
        name = "code" if command.code else "hold_bits"
        if self.map is None:
            table.note(name, getattr(command, name), said("mistake.plc_takes", table="[plc]", file="device.toml"))
        if command.code == COMMIT_SETTINGS:
            table.note("code", f"0x{command.code:04X}", said("mistake.code_of_set"))
        if command.code and command.hold_bits:
            table.note("hold_bits", command.hold_bits, said("mistake.either", first="`code`", second="`hold_bits`"))
        if table.has("hold_bits") != command.hold:
            table.note("hold", str(command.hold).lower(), said("mistake.hold_with", key="`hold_bits`"))
        for given in ("writes", "release", "argument"):
            if getattr(command, given):
                instead = "`arguments`" if given == "argument" else said("mistake.nothing")
                table.note(given, said("mistake.given"), said("mistake.sent_instead", what=instead, key=f"`{name}`"))
        if command.stop and command.arguments:
            table.note("arguments", [argument.name for argument in command.arguments], said("mistake.none_for_stop"))

    def _writes(self, table: Table, key: str, *, steps: bool = False) -> Iterator[Write]:
        """`steps`: whether they may depend on what the device says; a Stop and a release wait for nothing."""
        for row in table.rows(key):
            when, after = (row.text(name, "") if steps else "" for name in ("when", "after"))
            for name, sentence in (("when", when), ("after", after)):
                if sentence:
                    self.sentences.add(row, name, sentence)
            within = float(row.number("within", 2.0, 0.1, 60)) if after else 2.0
            point, value = row.text("point"), row.raw("value")
            if point and (not self._is_writable(point) or self.points[point].point.kind is Kind.TEXT):
                row.note("point", point, said("mistake.writable_point", owner=self.owner))
            option = value.removeprefix("option:") if isinstance(value, str) and value.startswith("option:") else None
            if option is not None and option not in self.options.values:
                row.note("value", value, said("mistake.option_of", owner=self.owner))
            elif option is None and value not in SPECIAL_VALUES and not is_number(value):
                row.note(
                    "value", value, said("mistake.written_value", words="argument, option:<name>", last="previous")
                )
            elif is_number(value) and self._is_writable(point):
                self._check_fits(row, point, value)
            row.done()
            yield Write(point, str(value), when, after, within)

    def _check_fits(self, row: Table, point: str, value: float) -> None:
        """What a register does not hold would be written as something else, or not at all."""
        register = self.points[point].point.register
        if register is None or register.type in (*REALS, Type.STRING):
            return
        low, high = raw_limits(register)
        raw = (value - register.offset) / register.scale
        if not low <= raw <= high or abs(raw - round(raw)) > ROUNDING:
            ends = sorted((low * register.scale + register.offset, high * register.scale + register.offset))
            step = f"{abs(register.scale):g}"
            expected = said("mistake.fits_register", point=point, low=f"{ends[0]:g}", high=f"{ends[1]:g}", step=step)
            row.note("value", value, expected)

    def _is_writable(self, point: str) -> bool:
        register = self.points[point].point.register if point in self.points else None
        return register is not None and register.writable
