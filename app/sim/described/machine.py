"""The machine of a description: what its points hold, and how they change by what is written, by rules and by themselves. Pure."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import exp, inf
from random import Random

from app.errors import ConfigurationError
from app.plant import expression
from app.plant.definitions import Equipment, Kind, Register, Setpoint
from app.plant.said import not_as
from app.plant.simulation import Movement, Simulation, Term, WriteRow
from app.plant.tables import span
from app.registers.codec import Value
from app.registers.register import REALS
from app.sim.described.image import Image, Place, ends, nearest, overlapping, places
from app.tags.quality import GOOD, NO_DATA

_Number = Callable[[], float | None]


@dataclass(slots=True)
class _Running:
    """A rule at work."""

    when: expression.Expression
    after: _Number
    set: Mapping[str, Term]
    steps: int = 0
    """For so many it has held."""
    done: bool = False


@dataclass(slots=True)
class _Moving:
    """A point that moves."""

    key: str
    movement: Movement
    to: _Number
    lag: _Number
    rate: _Number
    integral: _Number
    low: _Number
    high: _Number
    least: float
    most: float
    """What its registers can say [EU]."""
    noise: float = 0.0
    """What its registers say beside its value at present [EU]."""


class Machine:
    """The points of one machine with registers; `word` gives what an instructor says: the fault, the words of its trainings."""

    def __init__(self, item: Equipment, simulation: Simulation, seed: int, word: Callable[[str], float | None]) -> None:
        self._simulation, self._seed, self._word = simulation, seed, word
        self._setpoints: Mapping[str, Setpoint] = item.type.setpoints
        self._points = item.points
        self._texts = {key for key, point in item.points.items() if point.kind is Kind.TEXT}
        self.registers: Mapping[str, Register] = {
            key: point.register for key, point in item.points.items() if point.register is not None
        }
        self._options = {key: value for key, value in item.options.items() if isinstance(value, float)}
        self._options |= {
            key: self._options.get(point.derived.of, 0.0)
            for key, point in item.points.items()
            if point.derived and point.derived.kind == "option"
        }
        self._others = overlapping(self.registers)
        self._at: dict[Place, list[str]] = {}
        for key, register in self.registers.items():
            for place in places(register):
                self._at.setdefault(place, []).append(key)
        self._rows: dict[str, list[WriteRow]] = {}
        for row in simulation.writes:
            self._rows.setdefault(row.point, []).append(row)
        self.begin()

    def begin(self) -> None:
        """The state to begin with, the random sequence included."""
        self._image = Image()
        self._steps = 0
        self._random = Random(self._seed)
        self._untold: set[str] = set()
        """Points whose registers do not say yet what they hold."""
        for key, term in self._simulation.start.items():
            if key in self.registers:
                self._image.put(self.registers[key], self._start_of(key, term))
        self._values = {key: self._image.value(register) for key, register in self.registers.items()}
        self._rules = [
            _Running(expression.parse(rule.when), self._number(rule.after), rule.set) for rule in self._simulation.rules
        ]
        self._moving = [self._mover(key, one) for key, one in self._simulation.values.items()]
        self._noise = {moving.key: moving for moving in self._moving if moving.movement.noise}

    def check_start(self) -> None:
        """What follows from the options of this machine.

        Raises:
            ConfigurationError: a point would start with what its registers cannot say.
        """
        for key, term in self._simulation.start.items():
            if not isinstance(term, str) or key not in self.registers or key in self._texts:
                continue
            value = self._start_of(key, term)
            low, high = ends(self.registers[key])
            if not isinstance(value, int | float) or not low <= value <= high:
                told = f"{key} = {term} = {'–' if value is None else f'{value:g}'}"
                raise ConfigurationError(not_as(told, span("number", low, high)))

    def words(self) -> Mapping[Place, int]:
        """What its registers say now."""
        for key in self._untold:
            value, noise = self._values[key], self._noise.get(key)
            told = self._with_noise(key, value, noise.noise) if noise and isinstance(value, int | float) else value
            self._image.put(self.registers[key], told)
        self._untold.clear()
        return self._image.words

    def _with_noise(self, key: str, value: float, noise: float) -> float:
        """What is read of a value that is what its type says it can be: noise does not make it doubtful."""
        point, told = self._points[key], value + noise
        low = -inf if point.low is None else min(point.low, value)
        high = inf if point.high is None else max(point.high, value)
        return min(max(told, low), high)

    def refusal(self, wanted: Mapping[Place, int]) -> int:
        """Modbus exception with which a telegram that writes these words is answered; 0 = it is taken."""
        after = Image({**self.words(), **wanted})
        for key in self._touched(wanted):
            value = after.value(self.registers[key])
            if key in self._setpoints and not self._allows(self._setpoints[key], value):
                return 3
            for row in self._rows.get(key, ()):
                if row.refuse and _meant(row, value) and not self._holds(row.when, value):
                    return row.refuse
        return 0

    def take(self, wanted: Mapping[Place, int]) -> None:
        """These words are written."""
        touched = self._touched(wanted)
        self._image.words = {**self.words(), **wanted}
        for key in touched:
            self._values[key] = self._image.value(self.registers[key])
        for key in touched:
            value = self._values[key]
            for row in self._rows.get(key, ()):
                if _meant(row, value) and self._holds(row.when, value):
                    self._set(row.set, value if isinstance(value, int | float) else None)

    def step(self, dt: float) -> None:
        """Advance by `dt` seconds: the rules in their order, then everything that moves, by what was before."""
        for rule in self._rules:
            self._follow(rule, dt)
        for moving, value in [(moving, self._next(moving, dt)) for moving in self._moving]:
            if value is not None:
                self._hold(moving.key, value)
            if moving.movement.noise:
                moving.noise = self._random.gauss(0, moving.movement.noise)
                self._untold.add(moving.key)
        self._steps += 1

    def _follow(self, rule: _Running, dt: float) -> None:
        if rule.when.true(self._look) is not True:
            rule.steps, rule.done = 0, False
            return
        after = rule.after()
        if not rule.done and after is not None and rule.steps >= round(after / dt):
            rule.done = True
            self._set(rule.set, None)
        rule.steps += 1

    def _set(self, wanted: Mapping[str, Term], argument: float | None) -> None:
        found = {key: self._number(term, argument)() for key, term in wanted.items()}
        for key, value in found.items():
            if value is not None:
                self._hold(key, value)

    def _next(self, moving: _Moving, dt: float) -> float | None:
        """What it holds after this step; None = what it holds now."""
        now, movement = self._values[moving.key], moving.movement
        before = float(now) if isinstance(now, int | float) else 0.0
        if movement.every:
            beats = round(movement.every / dt)
            return None if (self._steps + 1) % beats else (before + 1) % movement.modulo
        if movement.integral is not None:
            more, low, high = moving.integral(), moving.low(), moving.high()
            if more is None:
                return None
            least = moving.least if low is None else max(low, moving.least)
            most = moving.most if high is None else min(high, moving.most)
            return min(max(before + more * dt, least), most)
        aim = moving.to()
        if aim is None:
            return None
        if movement.lag is not None:
            lag = moving.lag()
            return aim if lag is None or lag <= 0 else before + (aim - before) * (1 - exp(-dt / lag))
        if movement.rate is not None:
            reach = abs(moving.rate() or 0.0) * dt
            return aim if abs(aim - before) <= reach else before + (reach if aim > before else -reach)
        return aim

    def _hold(self, key: str, value: float) -> None:
        """A point holds `value` from now on, as near as its registers can say it; its parts, or its whole, follow."""
        register = self.registers[key]
        self._values[key] = nearest(register, value)
        if others := self._others[key]:
            self._image.put(register, self._values[key])
            for other in others:
                self._values[other] = self._image.value(self.registers[other])
        else:
            self._untold.add(key)

    def _touched(self, wanted: Mapping[Place, int]) -> list[str]:
        """Points of which a word is among these, in the order of the files."""
        found = {key for place in wanted for key in self._at.get(place, ())}
        return [key for key in self.registers if key in found]

    def _allows(self, setpoint: Setpoint, value: Value) -> bool:
        if not isinstance(value, int | float) or (setpoint.options and value not in setpoint.options):
            return False
        low, high = (self._number(_term(bound))() for bound in (setpoint.low, setpoint.high))
        register = self.registers[setpoint.key]
        slack = 1e-6 * abs(value) + (0.0 if register.type in REALS else abs(register.scale) / 2)
        return (low is None or low - slack <= value) and (high is None or value <= high + slack)

    def _look(self, name: str) -> tuple[Value, int]:
        if name in self._values:
            value: Value = self._values[name]
        else:
            value = self._options[name] if name in self._options else self._word(name)
        return value, NO_DATA if value is None else GOOD

    def _number(self, term: Term | None, argument: float | None = None) -> _Number:
        if term is None:
            return lambda: None
        if isinstance(term, int | float):
            fixed = float(term)
            return lambda: fixed
        parsed = expression.parse(term)

        def number() -> float | None:
            found = parsed.evaluate(self._look, argument=argument)
            return None if found is None else float(found)

        return number

    def _holds(self, when: str, value: Value) -> bool:
        argument = value if isinstance(value, int | float) else None
        return not when or expression.parse(when).true(self._look, argument=argument) is True

    def _mover(self, key: str, one: Movement) -> _Moving:
        to, lag, rate, integral, low, high = map(
            self._number, (one.to, one.lag, one.rate, one.integral, one.low, one.high)
        )
        least, most = ends(self.registers[key])
        return _Moving(key, one, to, lag, rate, integral, low, high, least, most)

    def _start_of(self, key: str, term: Term) -> Value:
        return term if key in self._texts else expression.number(term, dict(self._options))


def _meant(row: WriteRow, value: Value) -> bool:
    """Whether a row of `[[writes]]` is about what was written."""
    return row.value is None or (isinstance(value, int | float) and abs(value - row.value) <= 1e-9)


def _term(bound: str) -> Term:
    """A limit as a setpoint has it: a number or a sentence, both as a text."""
    try:
        return float(bound)
    except ValueError:
        return bound
