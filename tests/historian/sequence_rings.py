"""Machines that run a sequence, and the event rings that the block itself makes: `Device` scans it as a real one does."""

import math
from dataclasses import dataclass, field, replace

from app.blocks.sequence import (
    ALL,
    Report,
    SequenceBlock,
    SequenceSettings,
    Signals,
    StepSettings,
)
from app.plant import types
from app.plant.definitions import Equipment
from app.plant.sequence_definition import SequenceDefinition, SequencePermissive, SequenceStep
from app.registers.plc_map import real
from tests.historian.rings import BEGIN, Event, a_ring

SEQUENCE = types.read_type("sequence", ["en"])[0].type
NO_BIT, POWER_UP = 0xFFFF, 18
LANGUAGES = ("hr", "en", "de", "cs")


def labels(word: str) -> dict[str, str]:
    return {lang: f"{word} {lang}" for lang in LANGUAGES}


def definition(name: str = "transport", steps: tuple[str, ...] = ("lower", "lift", "drive")) -> SequenceDefinition:
    pressure = SequencePermissive("pressure_ok", 3, labels("Pressure"), "pressure > 80", "pressure")
    guard = SequencePermissive("guards", 0, labels("Guards"), "guard_1 == 1", forceable=False)
    made = [
        SequenceStep(key, labels(key.title()), 0.5, 5.0, loss_aborts=True, permissives=(pressure,)) for key in steps
    ]
    return SequenceDefinition(name, labels(name), made, (guard,))


def sequences(*ids: str, of: SequenceDefinition | None = None) -> list[Equipment]:
    """Machines that run one."""
    return [
        Equipment(id, SEQUENCE, "hall", 1, {"en": id}, "line", {}, [], sequence=of or definition(), machine="cc1")
        for id in ids
    ]


@dataclass
class Device:
    """A device that runs a sequence: the block, a clock and an event ring."""

    time: int = BEGIN
    boot: int = 1
    sequence: int = 0
    steps: int = 3
    dt: float = 0.01
    events: list[Event] = field(default_factory=list)
    pressure: float = 120.0
    words: list[int] = field(default_factory=list)
    abort: int = ALL

    def __post_init__(self) -> None:
        self.words, self.ring = [ALL] * self.steps, a_ring(self.boot)
        self.block = self._block()
        self.scan()

    def _block(self) -> SequenceBlock:
        settings = SequenceSettings(
            tuple(StepSettings(0.5, 5.0, loss_aborts=True) for _ in range(self.steps)), abort_forceable=ALL
        )
        return SequenceBlock(settings, lambda step, bit: self.pressure if bit == 3 else math.nan)

    def scan(self, times: int = 1, **signals: bool) -> None:
        for _ in range(times):
            self.time += round(self.dt * 1e6)
            inputs = Signals(tuple(self.words), self.abort, **signals)
            for report in self.block.scan(inputs, self.dt, self.time):
                self.tell(report)

    def tell(self, report: Report) -> None:
        bit = report.bit
        raw = real(self.pressure if bit == 3 else math.nan)
        snapshot = (
            bit if bit >= 0 else NO_BIT,
            report.together,
            self.abort,
            self.words[report.step - 1] if report.step else 0,
            raw >> 16,
            raw & 0xFFFF,
        )
        self.put(report.event, report.step, report.value, snapshot)

    def put(
        self, code: int, step: int = 0, value: float = 0.0, snapshot: tuple[int, ...] = (NO_BIT, 0, 0, 0, 0, 0)
    ) -> None:
        self.sequence += 1
        self.ring.newest, self.ring.boots = self.sequence, self.boot
        told = Event(self.sequence, self.time, int(code), step, float(value), snapshot, self.boot, self.time)
        self.events.append(replace(told, ring=self.ring))

    def start(self) -> None:
        self.scan()
        self.scan(acknowledge=True)
        self.scan()
        self.scan(start=True)

    def lose(self, step: int, bit: int = 3, pressure: float = 61.5) -> None:
        if bit == 3:
            self.pressure = pressure
        if step:
            self.words[step - 1] &= ~(1 << bit)
        else:
            self.abort &= ~(1 << bit)

    def give(self) -> None:
        self.words, self.abort, self.pressure = [ALL] * self.steps, ALL, 120.0

    def run(self) -> None:
        """From its start to its end."""
        self.start()
        while self.block.running:
            self.scan()

    def power_cycle(self, off: float = 60.0) -> None:
        kept = self.block.retained()
        self.time += round(off * 1e6)
        self.boot += 1
        self.put(POWER_UP, value=self.boot)
        self.block = self._block()
        for report in self.block.restore(kept, self.time):
            self.tell(report)

    def drain(self) -> list[Event]:
        found, self.events = self.events, []
        return found
