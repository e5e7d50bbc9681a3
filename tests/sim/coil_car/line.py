"""A coil-car line with its transport sequence for tests: both devices, telegrams to them, and what their registers say."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from app.plant.definitions import Command, Device, Equipment, EquipmentType, Link, Plant
from app.plant.sequence_definition import SequenceDefinition, SequencePermissive, SequenceStep, SequenceTest
from app.registers import plc_map
from app.registers.plc_map import Answer, DeviceEvent, Request, real
from app.sim import training
from app.sim.coil_car import register_map as coil_car
from app.sim.coil_car.program import VirtualCoilCar
from app.sim.coil_car.register_map import ACTIONS
from app.sim.plc import EVENT_CAPACITY, VirtualPlc
from app.sim.sequence import register_map as sequence
from app.sim.sequence.program import VirtualSequence


def bit(number: int, key: str, when: str, value: str = "", *, forceable: bool = True) -> SequencePermissive:
    return SequencePermissive(key, number, {}, when, value, forceable)


def step(
    key: str, *permissives: SequencePermissive, action: str = "", minimum: float = 0.5, maximum: float = 60.0
) -> SequenceStep:
    base = (bit(0, "pressure_ok", "pressure > 80", "pressure"), bit(1, "drives_ok", "drives_ok == 1", forceable=False))
    return SequenceStep(key, {}, minimum, maximum, True, (action,) if action else (), (*base, *permissives))


TRANSPORT = SequenceDefinition(
    "coil_transport",
    {},
    (
        step(
            "lower", bit(2, "coil_ready", "coil_ready == 1"), bit(3, "target_free", "target_free == 1"), action="lower"
        ),
        step("drive_in", bit(2, "lowered", "lowered == 1"), action="drive_to_mandrel"),
        step("lift", bit(2, "at_mandrel", "at_mandrel == 1"), action="lift_to_coil"),
        step("collapse", bit(2, "contact", "coil_contact == 1 or coil_on_car == 1"), action="collapse"),
        step("drive_out", bit(2, "coil_on_car", "coil_on_car == 1"), action="drive_out"),
        step("lift_over", bit(2, "at_out", "at_out == 1"), action="lift_over_saddle"),
        step("drive", bit(2, "over_saddle", "over_saddle == 1", "vertical"), action="drive_to_saddle"),
        step("lay", bit(2, "at_target", "at_target == 1"), action="lower_onto_saddle", minimum=6.0),
    ),
    abort=(
        bit(0, "emergency_stop_free", "emergency_stop == 0", forceable=False),
        bit(1, "automatic", "mode == 1", forceable=False),
        bit(2, "guards_closed", "guards_closed == 1", forceable=False),
    ),
    tests=(),
)
"""The original's eight steps."""


def teaching(*times: tuple[float, float], loss_aborts: bool = False, keep_forces: bool = False) -> SequenceDefinition:
    """A sequence without machine, a step per (minimum, maximum); every bit is named, bit 15 may not be forced."""

    def word(number: int) -> Sequence[SequencePermissive]:
        return tuple(bit(n, f"bit_{n}", "", forceable=number > 0 and n != 15) for n in range(16))

    steps = tuple(
        SequenceStep(f"s{n}", {}, low, high, loss_aborts, (), word(n)) for n, (low, high) in enumerate(times, 1)
    )
    return SequenceDefinition("teaching", {}, steps, abort=word(0), keep_forces=keep_forces)


class Talker:
    """Telegrams to one virtual PLC."""

    def __init__(self, plc: VirtualPlc, tick: Callable[[], None] | None = None) -> None:
        self.plc = plc
        self.tick = tick or plc.step
        self.heard = plc.newest
        self._id = 0
        self._counter = 0

    def ask(self, code: int, *arguments: int, owner: int = 0, expected: int = 0) -> Answer:
        """Send a command, let one scan pass, read its answer."""
        self._id += 1
        request = Request(code, owner, expected, arguments, self._id)
        self.plc.write(16, plc_map.COMMAND, plc_map.request_words(request))
        self.tick()
        return self.answer(self._id)

    def answer(self, id: int) -> Answer:
        answers = plc_map.answers_of(self.plc.read(3, plc_map.ANSWERS, plc_map.ANSWERS_WORDS))
        assert answers is not None
        return next(answer for answer in answers if answer.id == id)

    def hold(self, bits: int, argument: float = 0.0) -> None:
        """One keep-alive of hold-to-run."""
        self._counter = self._counter + 1 & 0xFFFF
        self.plc.write(16, plc_map.HOLD, [bits, self._counter, *plc_map.long_words(real(argument))])

    def train(self, address: int, word: int) -> None:
        self.plc.write(6, address, [word])

    def fault(self, code: int) -> None:
        self.train(training.REG_MACHINE_FAULT, code)

    def commit(self, values: Mapping[str, float], staging: int) -> Answer:
        """Stage all settings, with `values` changed, and make them valid."""
        from struct import pack, unpack
        from zlib import crc32

        wanted = {**self.plc.settings, **values}
        packed = pack(f">{len(wanted)}f", *wanted.values())
        words = list(unpack(f">{len(packed) // 2}H", packed))
        self.plc.write(16, staging, words)
        return self.ask(plc_map.COMMIT_SETTINGS, len(words), crc32(packed))

    def events(self) -> list[DeviceEvent]:
        """What the ring got since the last call."""
        newest = self.plc.newest
        assert newest - self.heard <= EVENT_CAPACITY
        found = [self._event(number) for number in range(self.heard + 1, newest + 1)]
        self.heard = newest
        return found

    def _event(self, number: int) -> DeviceEvent:
        row = number % EVENT_CAPACITY * plc_map.EVENT_WORDS
        return plc_map.event_of(self.plc.read(3, plc_map.EVENT_ROWS + row, plc_map.EVENT_WORDS))

    def codes(self) -> list[tuple[int, int]]:
        """(code, source) of what the ring got since the last call."""
        return [(event.code, event.source) for event in self.events()]


class Line:
    """Machine and sequence, coupled."""

    def __init__(self, definition: SequenceDefinition = TRANSPORT, **options: object) -> None:
        given: dict[str, object] = {"start": "automatic", "coil": True, **options}
        self.car = VirtualCoilCar(**given)  # type: ignore[arg-type]
        self.plc = VirtualSequence(definition)
        self.plc.attach(self.car)
        self.machine = Talker(self.car, self.tick)
        self.sequence = Talker(self.plc, self.tick)
        self.tick()

    def tick(self) -> None:
        self.car.step()
        self.plc.step()

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * 100)):
            self.tick()

    def until(self, holds: Callable[[], bool], within: float) -> float:
        """Run until `holds`; how long it took [s].

        Raises:
            AssertionError: it does not hold in time.
        """
        for scan in range(round(within * 100)):
            if holds():
                return scan / 100
            self.tick()
        out = self.plc.block.first_out
        raise AssertionError(f"not within {within} s: {self.plc.block.state.name} step {self.plc.block.step}, {out}")

    def start(self) -> None:
        assert self.sequence.ask(sequence.SequenceCommand.START).state == plc_map.AnswerState.DONE

    def to_step(self, number: int, within: float = 120.0) -> None:
        self.until(lambda: self.plc.block.step == number, within)


def act(car: VirtualCoilCar, action: str, within: float = 60.0) -> float:
    """Ask for one action until it is done; how long it took [s].

    Raises:
        AssertionError: it is blocked, or not done in time.
    """
    for scan in range(round(within * 100)):
        car.ask([action])
        car.step()
        if car.action == ACTIONS.index(action) + 1 and car.action_state == coil_car.ActionState.DONE:
            return scan / 100
    raise AssertionError(
        f"{action} not done within {within} s: {car.action_state!r}, {car.machine.x=}, {car.machine.v=}"
    )


def plant(definition: SequenceDefinition, *tests: SequenceTest, machine: bool = True, **options: object) -> Plant:
    """A plant of a line, or of a sequence without one, with `tests`; types have no more than tests of sequences need."""
    commands = {
        name.lower(): Command(name.lower(), "", (), "", "1", code=int(code))
        for name, code in sequence.SequenceCommand.__members__.items()
    }
    reasons = {int(code): code.name.lower() for code in sequence.SequenceReason}
    types = {
        "sequence": EquipmentType(
            "sequence", Path("sequence"), "", Device(), {}, commands, (), (), {}, (), {}, reasons=reasons
        ),
        "coil_car": EquipmentType("coil_car", Path("coil_car"), "", Device(), {}, {}, (), (), {}, (), {}),
    }
    own = replace(definition, tests=tests)
    equipment = {
        "seq1": Equipment(
            "seq1", types["sequence"], "coil", 21, {}, "", {}, (), sequence=own, machine="cc1" if machine else ""
        )
    }
    if machine:
        equipment["cc1"] = Equipment("cc1", types["coil_car"], "coil", 20, {}, "", {}, (), options=options)
    return Plant(Path("nowhere"), {}, "UTC", ["en"], {}, {"coil": Link("coil", "memory")}, equipment, types)
