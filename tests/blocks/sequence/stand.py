"""A sequence block on the table, scanned every 10 ms."""

from app.blocks.sequence import (
    ABORT,
    ALL,
    Report,
    SequenceBlock,
    SequenceEvent,
    SequenceSettings,
    Signals,
    StepSettings,
)

DT = 0.01


TEN = StepSettings(minimum=0.1, maximum=0.5)


class Bench:
    """A block with its signals, scanned every 10 ms."""

    def __init__(self, *steps: StepSettings, **settings: object) -> None:
        self.block = SequenceBlock(
            SequenceSettings(steps or (TEN, TEN, TEN), **settings),  # type: ignore[arg-type]
            values=lambda step, bit: 100.0 * step + bit,
        )
        self.signals = Signals([ALL] * len(self.block.settings.steps))
        self.now = 0
        self.log: list[tuple[int, Report]] = []
        self.scan()

    def scan(self, count: int = 1) -> list[Report]:
        fresh = []
        for _ in range(count):
            self.now += 10_000
            fresh += self.block.scan(self.signals, DT, self.now)
        self.log += [(self.now, report) for report in fresh]
        return fresh

    def start(self) -> list[Report]:
        return self.press("start")

    def press(self, name: str) -> list[Report]:
        setattr(self.signals, name, True)
        reports = self.scan()
        setattr(self.signals, name, False)
        return reports + self.scan()

    def drop(self, step: int, bit: int) -> None:
        self._set(step, lambda word: word & ~(1 << bit))

    def give(self, step: int, bit: int) -> None:
        self._set(step, lambda word: word | 1 << bit)

    def _set(self, step: int, change) -> None:  # type: ignore[no-untyped-def]
        if step == ABORT:
            self.signals.abort = change(self.signals.abort)
        else:
            words = list(self.signals.permissives)
            words[step - 1] = change(words[step - 1])
            self.signals.permissives = words

    @property
    def events(self) -> list[SequenceEvent]:
        return [report.event for _, report in self.log]
