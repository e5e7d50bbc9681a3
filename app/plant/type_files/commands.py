"""commands.toml: what may be asked of a machine, what is written then, and by what feedback it is seen to work."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from app.plant import expression
from app.plant.definitions import Argument, Command, Effect, PlcMap, Type, Write
from app.plant.tables import MISSING, Table, is_number
from app.plant.type_files.data import PointData
from app.plant.type_files.names import KEY, NAME_EXPECTED, ROLES
from app.plant.type_files.options import Options
from app.plant.type_files.sentences import Sentences, read_values

LEVELS = ("C0", "C1", "C2", "C3", "C4")
SPECIAL_VALUES = ("argument", "previous")
ARGUMENT_TYPES = (Type.F32, Type.U32, Type.I32)
MOST_ARGUMENTS = 4


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
        return {key: self._command(key, table) for key, table in file.tables()}

    def _command(self, key: str, table: Table) -> Command:
        timeout = self._timeout(table)
        level_when = self._level_when(table)
        arguments = tuple(self._arguments(table))
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
        )
        self._check(table, command)
        table.done()
        return command

    def _refused(self, table: Table) -> Iterator[tuple[int, str]]:
        given = table.table("refused")
        for code in given.data:
            text = given.text(code)
            if not code.isdecimal() or len(code) > 3 or not 1 <= int(code) <= 255:
                given.note(code, text, "a Modbus exception as key: 1 to 255")
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
        elif not is_number(timeout) or not timeout > 0:
            table.note("timeout", timeout, "seconds above 0, or an expression over points")
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
        ordered = bool(command.code or command.hold_bits)
        if command.feedback:
            self.sentences.add(table, "feedback", command.feedback, argument=not ordered)
        if ordered:
            self._check_order(table, command)
        elif not command.writes:
            table.note("writes", MISSING, "a list of { point, value }" + " or a `code`" * (self.map is not None))
        if not ordered and command.hold != bool(command.release):
            expected = "what is written when the button is released, for a hold-to-run only"
            table.note("release", command.release, expected)
        if command.released:
            self.sentences.add(table, "released", command.released)
            if not command.hold:
                table.note("released", command.released, "nothing: only a hold-to-run is released")
        if command.arguments and not command.code:
            table.note("arguments", [argument.name for argument in command.arguments], "a `code` that they go with")
        if command.needs_reason and (command.hold or command.stop):
            table.note("needs_reason", "true", "no reason for what stops or is held: nobody has the time")
        if command.argument and command.argument not in self.points:
            table.note("argument", command.argument, f"a point of {self.owner}")

    def _check_order(self, table: Table, command: Command) -> None:
        """A command that is sent as a code or as request bits."""
        name = "code" if command.code else "hold_bits"
        if self.map is None:
            table.note(name, getattr(command, name), "[plc] in device.toml: only a Pogon PLC takes it")
        if command.code and command.hold_bits:
            table.note("hold_bits", command.hold_bits, "either `code` or `hold_bits`")
        if bool(command.hold_bits) != command.hold:
            expected = "hold = true with `hold_bits`, and only with them on such a machine"
            table.note("hold", str(command.hold).lower(), expected)
        for given in ("writes", "release", "argument"):
            if getattr(command, given):
                instead = "`arguments`" if given == "argument" else "nothing"
                table.note(given, "given", f"{instead} where there is `{name}`: that is what is sent")
        if command.stop and command.arguments:
            table.note("arguments", [argument.name for argument in command.arguments], "none for a Stop")

    def _arguments(self, table: Table) -> Iterator[Argument]:
        seen: set[str] = set()
        for index, row in enumerate(table.rows("arguments")):
            name = row.text("name", pattern=KEY, expected=NAME_EXPECTED)
            if index == MOST_ARGUMENTS:
                row.note("name", name, f"at most {MOST_ARGUMENTS} arguments")
            if name in seen or name in expression.RESERVED:
                row.note("name", name, "a name that no other argument has and that is no word of the grammar")
            seen.add(name)
            yield self._argument(name, row)

    def _argument(self, name: str, row: Table) -> Argument:
        kind = Type(row.text("type", Type.F32.value, choices=[kind.value for kind in ARGUMENT_TYPES]))
        low, high = (self._limit(row, bound) for bound in ("low", "high"))
        decimals = row.whole("decimals", 0, 0, 6)
        if decimals and kind is not Type.F32:
            row.note("decimals", decimals, f"0 for {kind}")
        argument = Argument(
            name, kind, low, high, row.text("unit", ""), decimals, row.text("label", f"argument.{name}")
        )
        row.done()
        return argument

    def _limit(self, row: Table, bound: str) -> str:
        value = row.raw(bound)
        if isinstance(value, str):
            self.sentences.add(row, bound, value)
        elif value is not None and not is_number(value):
            row.note(bound, value, "a number or an expression over points")
        return "" if value is None else str(value)

    def _writes(self, table: Table, key: str, *, steps: bool = False) -> Iterator[Write]:
        """`steps`: whether they may depend on what the device says; a Stop and a release wait for nothing."""
        for row in table.rows(key):
            when, after = (row.text(name, "") if steps else "" for name in ("when", "after"))
            for name, sentence in (("when", when), ("after", after)):
                if sentence:
                    self.sentences.add(row, name, sentence)
            within = float(row.number("within", 2.0, 0.1, 60)) if after else 2.0
            point, value = row.text("point"), row.raw("value")
            if point and not self._is_writable(point):
                row.note("point", point, f"a point of {self.owner} with a writable register")
            option = value.removeprefix("option:") if isinstance(value, str) and value.startswith("option:") else None
            if option is not None and option not in self.options.values:
                row.note("value", value, f"an option of {self.owner}")
            elif option is None and value not in SPECIAL_VALUES and not is_number(value):
                row.note("value", value, "a number, argument, option:<name> or previous")
            row.done()
            yield Write(point, str(value), when, after, within)

    def _is_writable(self, point: str) -> bool:
        register = self.points[point].point.register if point in self.points else None
        return register is not None and register.writable
