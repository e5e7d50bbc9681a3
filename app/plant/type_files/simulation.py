"""simulation.toml of a type: the machine behind its registers, as data; without it the type stands on real links only.

    [start]                                 what points hold at the start, 0 where nothing is said: numbers, sentences over options, texts
    energy = "100 * rated_power"

    [[writes]]                              what happens when a point is written
    point = "command"
    value = 1                               only then; else whatever was written, which is `argument`
    when = "local == 0"                     only while that holds
    refuse = 4                              …else the telegram is answered with this Modbus exception
    set = { state = 1, power = "argument / 2" }

    [[rules]]                               what happens by itself, once each time that `when` begins to hold
    when = "state == 1"
    after = 3                               and has held for so long [s]
    set = { state = 2 }

    [values.power]                          how a point moves: to a value, at once or with `lag` [s] or `rate` [unit/s]
    to = "0.8 * rated_power * (state == 2)"
    lag = 2
    noise = 0.02                            standard deviation of what is read
    [values.energy]                         …or as a sum over time [unit/s], between `low` and `high`
    integral = "power / 3600"
    [values.life]                           …or as a heartbeat [s]
    every = 1
    modulo = 256

Sentences are those of the other files, over points with a register (those that are only written, too), options, the words of training.toml,
and `fault`, the code of the machine fault that an instructor caused.
"""

from collections.abc import Mapping

from app.errors import ConfigurationError
from app.plant import expression
from app.plant.definitions import Device, Kind, Point, Setpoint, Training
from app.plant.said import said
from app.plant.simulation import FAULT, Movement, Rule, Simulation, Term, WriteRow
from app.plant.tables import MISSING, Table, is_number, one_of, span
from app.plant.type_files.data import PointData
from app.plant.type_files.options import Options
from app.registers.codec import encode, raw_limits
from app.registers.register import BIT_TABLES, REALS, Register, Type

FILE = "simulation.toml"
LONGEST = 86_400.0
"""Of a time in it [s]."""
SHORTEST = 0.02
"""Of half a heartbeat that anybody could see [s]: two steps of a virtual device."""
REFUSALS = (1, 2, 3, 4, 5, 6)
"""Modbus exceptions of a device itself."""
TRAINING = ((0xE000, 0xE03F), (0xE100, 0xE1C8))
"""Where every virtual device has its training registers (sim/training.py)."""


class SimulationReader:
    """Reads the file of a type whose other files were read."""

    def __init__(self, owner: str, points: Mapping[str, PointData], options: Options, training: Training) -> None:
        self._owner = owner
        self._doubtful = False
        self._points = {key: data.point for key, data in points.items() if data.point.register is not None}
        self._options = options
        self._words = {**training.world, **training.acts, **training.switches}
        alike = {key for key, data in points.items() if data.point.derived and data.point.derived.kind == "option"}
        self._numbers = {key for key, point in self._points.items() if point.kind is not Kind.TEXT}
        self._names = self._numbers | set(options.defaults) | set(self._words) | {FAULT} | alike

    def read(
        self, file: Table, device: Device, setpoints: Mapping[str, Setpoint], *, doubtful: bool = False
    ) -> Simulation:
        """The whole file; what is wrong in it is noted there.

        `doubtful`: points or setpoints have mistakes, and what only follows from these is none of this file.
        """
        self._doubtful = doubtful
        if device.services:
            file.note("", FILE, said("mistake.simulation_services", type=self._owner))
        for key, point in self._points.items():
            register = point.register
            assert register
            if register.table not in BIT_TABLES and any(
                register.address <= last and first < register.address + register.words for first, last in TRAINING
            ):
                file.note("", key, said("mistake.simulation_training", point=key, address=f"0x{register.address:04X}"))
        values = dict(self._values(file))
        writes = tuple(self._write(row, values) for row in file.rows("writes"))
        rules = tuple(self._rule(row, values) for row in file.rows("rules"))
        start = self._start(file.table("start"))
        file.done()
        if not file.source.problems and not doubtful:
            self._check_starts(file, start, values, setpoints)
        return Simulation(start, writes, rules, values)

    def _start(self, table: Table) -> dict[str, Term]:
        start: dict[str, Term] = {}
        for key, value in table.data.items():
            table.raw(key)
            point, word = self._points.get(key), self._words.get(key)
            if point is None and word is None:
                table.note(key, value, one_of(sorted({*self._points, *self._words}), key))
            elif point is None and word is not None:
                start[key] = float(table.whole(key, low=word.low, high=word.high))
            elif point is not None and point.kind is Kind.TEXT:
                if not isinstance(value, str):
                    table.note(key, value, said("mistake.text"))
                else:
                    self._fits(table, key, point, value)
                    start[key] = value
            elif isinstance(value, str):
                self._options.check_expression(table, key, value)
                start[key] = value
            elif not is_number(value):
                table.note(key, value, said("mistake.number_or_options"))
            elif point is not None:
                self._fits(table, key, point, value)
                start[key] = value
        return start

    def _check_starts(
        self, file: Table, start: Mapping[str, Term], values: Mapping[str, Movement], setpoints: Mapping[str, Setpoint]
    ) -> None:
        """What its registers would say at once must be what the type says that they can say."""
        for key, point in self._points.items():
            value = start.get(key, 0.0)
            moves = key in values and key not in start
            if isinstance(value, str) or point.register is None or not point.register.readable or moves:
                continue
            low, high = point.low, point.high
            if key in setpoints:
                low, high = (_fixed(bound) for bound in (setpoints[key].low, setpoints[key].high))
            shown = value if key in start else MISSING
            if _unsaid(point, value):
                file.note(f"start.{key}", shown, one_of([str(one) for one in point.texts]))
            elif (low is not None and value < low) or (high is not None and value > high):
                ends = -float("inf") if low is None else low, float("inf") if high is None else high
                file.note(f"start.{key}", shown, span("number", *ends))
            elif key not in start and not _holds(point.register, 0.0):
                file.note(f"start.{key}", MISSING, _room(point.register))

    def _write(self, row: Table, values: Mapping[str, Movement]) -> WriteRow:
        key = row.text("point", choices=sorted(self._points))
        point = self._points.get(key) if row.data.get("point") == key else None
        if point is not None and not self._is_written(point):
            row.note("point", key, said("mistake.simulation_written", point=key))
        if point is not None and point.kind is Kind.TEXT:
            row.note("point", key, said("mistake.point_is_text", point=key))
        value = row.number("value", None)
        if point is not None and value is not None:
            self._fits(row, "value", point, value)
        when = row.text("when", "")
        if when:
            self._sentence(row, "when", when, argument=True)
        refuse = 0
        if row.has("refuse"):
            refuse = row.whole("refuse", low=REFUSALS[0], high=REFUSALS[-1])
            if not when:
                row.note("refuse", refuse, said("mistake.simulation_refuse"))
        sets = self._sets(row, values, argument=True, optional=bool(refuse))
        row.done()
        return WriteRow(key, None if value is None else float(value), when, refuse, sets)

    def _rule(self, row: Table, values: Mapping[str, Movement]) -> Rule:
        when = row.text("when")
        if when:
            self._sentence(row, "when", when)
        after = self._time(row, "after") or 0.0
        rule = Rule(when, after, self._sets(row, values))
        row.done()
        return rule

    def _sets(
        self, row: Table, values: Mapping[str, Movement], *, argument: bool = False, optional: bool = False
    ) -> dict[str, Term]:
        """`set = { point = number or sentence }`."""
        table = row.table("set", required=not optional, expected=said("mistake.simulation_set"))
        sets: dict[str, Term] = {}
        for key, value in table.data.items():
            table.raw(key)
            point = self._points.get(key)
            if point is None or point.kind is Kind.TEXT:
                table.note(key, value, one_of(sorted(self._numbers), key))
                continue
            moving = values.get(key)
            if moving is not None and moving.to is not None and moving.lag is None and moving.rate is None:
                table.note(key, value, said("mistake.simulation_lost", point=key))
            if isinstance(value, str):
                self._sentence(table, key, value, argument=argument)
                sets[key] = value
            elif is_number(value):
                self._fits(table, key, point, value)
                sets[key] = float(value)
            else:
                table.note(key, value, said("mistake.simulation_term"))
        if row.has("set") and not table.data and isinstance(row.data["set"], dict):
            row.note("set", "{}", said("mistake.simulation_set"))
        return sets

    def _values(self, file: Table) -> Mapping[str, Movement]:
        found: dict[str, Movement] = {}
        taken: dict[tuple[str, int], str] = {}
        for key, table in file.tables("values"):
            point = self._points.get(key)
            if point is None or point.kind is Kind.TEXT:
                table.note("", key, one_of(sorted(self._numbers), key))
                continue
            assert point.register
            if point.register.mask is not None:
                own = ((point.register.table, point.register.address, bit) for bit in _bits(point.register))
            else:
                first, words = point.register.address, point.register.words
                own = ((point.register.table, first + at, bit) for at in range(words) for bit in range(16))
            for table_, address, bit in own:
                other = taken.setdefault((table_, 16 * address + bit), key)
                if other != key and not self._doubtful:
                    table.note("", key, said("mistake.simulation_same_words", other=other))
                    break
            found[key] = self._movement(table, point)
        return found

    def _movement(self, table: Table, point: Point) -> Movement:
        ways = [way for way in ("to", "integral", "every") if table.has(way)]
        if len(ways) != 1:
            table.note("", ", ".join(ways) or MISSING, said("mistake.simulation_way", ways="to, integral, every"))
        assert point.register
        to, integral = self._term(table, "to"), self._term(table, "integral")
        lag, rate = self._time(table, "lag"), self._term(table, "rate")
        low, high = self._term(table, "low"), self._term(table, "high")
        for key, of in (("lag", "to"), ("rate", "to"), ("low", "integral"), ("high", "integral"), ("modulo", "every")):
            if table.has(key) and not table.has(of):
                table.note(key, table.raw(key), said("mistake.simulation_only_with", key=key, other=of))
        if table.has("lag") and table.has("rate"):
            table.note("rate", table.raw("rate"), said("mistake.simulation_lag_or_rate"))
        for key, term in (("lag", lag), ("rate", rate)):
            if isinstance(term, float) and table.has(key) and term <= 0:
                table.note(key, term, said("mistake.above_zero"))
        if isinstance(low, float) and isinstance(high, float) and low >= high:
            table.note("low", low, said("mistake.pair", pair="low, high", order="low < high"))
        if point.register.writable and table.has("to") and not (table.has("lag") or table.has("rate")):
            table.note("to", table.raw("to"), said("mistake.simulation_lost", point=point.key))
        every = float(table.number("every", 0.0, SHORTEST, LONGEST))
        most = _most(point.register)
        modulo = table.whole("modulo", min(most + 1, 65536), 2, min(most + 1, 2**32)) if table.has("every") else 0
        noise = float(table.number("noise", 0.0, 0))
        if noise and (point.kind is not Kind.ANALOG or every):
            table.note("noise", noise, said("mistake.simulation_noise"))
        table.done()
        return Movement(to, lag, rate, integral, low, high, every, modulo, noise)

    def _term(self, table: Table, key: str) -> Term | None:
        """A number or a sentence; None when it is not there."""
        value = table.raw(key)
        if value is None:
            return None
        if isinstance(value, str):
            self._sentence(table, key, value)
            return value
        if not is_number(value):
            table.note(key, value, said("mistake.simulation_term"))
            return 0.0
        return float(value)

    def _time(self, table: Table, key: str) -> Term | None:
        """As `_term`, of a time [s]."""
        term = self._term(table, key)
        if isinstance(term, float) and not 0 <= term <= LONGEST:
            table.note(key, term, span("number", 0, LONGEST))
        return term

    def _sentence(self, table: Table, key: str, text: str, *, argument: bool = False) -> None:
        """Note what is no sentence over what a virtual device has."""
        try:
            parsed = expression.parse(text)
        except ConfigurationError as error:
            table.note(key, text, error.args[0])
            return
        for name in sorted(parsed.names - self._names):
            table.note(key, text, said("mistake.simulation_names", type=self._owner, name=name))
        if parsed.ages:
            table.note(key, text, said("mistake.simulation_age"))
        if parsed.needs_argument and not argument:
            table.note(key, text, said("mistake.no_argument"))

    @staticmethod
    def _fits(table: Table, key: str, point: Point, value: float | str) -> None:
        """Note what the register of `point` cannot hold, or what none of its texts says."""
        assert point.register
        if point.register.type is Type.STRING:
            if not _holds(point.register, value):
                table.note(key, value, said("mistake.letters", most=2 * point.register.words))
        elif not _holds(point.register, value):
            table.note(key, value, _room(point.register))
        elif _unsaid(point, value):
            table.note(key, value, one_of([str(one) for one in point.texts]))

    def _is_written(self, point: Point) -> bool:
        """Whether a telegram can write it: it is written itself, or is a part of a word that is."""
        places = {
            (other.register.table, other.register.address + at)
            for other in self._points.values()
            if other.register and other.register.writable
            for at in range(other.register.words)
        }
        register = point.register
        assert register
        return all((register.table, register.address + at) in places for at in range(register.words))


def _unsaid(point: Point, value: float | str) -> bool:
    """Whether it is a value that none of the texts of a point says."""
    told = point.kind in (Kind.ENUM, Kind.BOOL) and point.register is not None and point.register.readable
    return bool(point.texts) and told and value not in point.texts


def _holds(register: Register, value: float | str) -> bool:
    try:
        encode(register, value)
    except ValueError:
        return False
    return True


def _room(register: Register) -> str:
    """What a register of whole numbers holds, in words."""
    if register.type in REALS:
        return said("mistake.number")
    low, high = sorted(raw * register.scale + register.offset for raw in raw_limits(register))
    none = register.none
    if none is None:
        return span("number", low, high)
    return said("mistake.simulation_none", low=f"{low:g}", high=f"{high:g}", none=f"0x{none:04X}")


def _most(register: Register) -> int:
    """Greatest whole number that its registers say as they are."""
    if register.type in REALS:
        return 65535
    return int(max(1, max(raw * register.scale + register.offset for raw in raw_limits(register))))


def _bits(register: Register) -> list[int]:
    """Bits of its word that a masked register has."""
    return [bit for bit in range(64) if (register.mask or 0) << register.shift >> bit & 1]


def _fixed(text: str) -> float | None:
    """A limit that is a number."""
    try:
        return float(text)
    except ValueError:
        return None
