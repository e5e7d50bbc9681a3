"""A command at work: everything that is known of it, changed by what happens to it and by nothing else.

Who sends, follows and ends commands reads the fields and tells what happened; every change of a field is here. Times are monotonic [s].
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace

from app.commands.hold import Lease
from app.commands.interlocks import Prepared
from app.commands.lifecycle import Progress, ProgressState, advance, also_known_as
from app.commands.orders import Order
from app.plant.definitions import Alarm, Condition
from app.registers.plc_map import Answer

NEVER = float("-inf")


@dataclass(slots=True)
class Job:
    """A command at work."""

    order: Order
    prepared: Prepared
    progress: Progress
    before: bool | None
    """The feedback before the write."""
    guarded: tuple[Condition, ...]
    """Interlocks that were met."""
    quiet: tuple[Alarm, ...]
    """Drive faults that were not there."""
    asked: float
    """Of a Stop that follows an unconfirmed Stop, the first one's."""
    words: tuple[int, ...] = ()
    expected: int = 0
    since: float | None = None
    """From when on values count as feedback: accepted, or unknown."""
    writing: int = 0
    """Whether its telegrams are on their way."""
    stopping: int = 0
    """Stop telegrams on their way."""
    last_write: float = NEVER
    last_read: float = NEVER
    sent: float = float("inf")
    """When the last telegram of the command itself went out."""
    other: "Job | None" = None
    """The superseded command whose telegram may still be on its way."""
    lease: Lease | None = None
    ending: float | None = None
    """When a hold-to-run began to stop."""
    moved: bool = False
    echoed: bool = False
    answer: Answer | None = None
    """What the device last said about a code."""
    asking: bool = False
    """Whether its answer is being read."""
    last_ask: float = NEVER
    clears: bool = False
    """A Stop over a hold-to-run by request bits: it clears them, too."""
    last_hold: float = NEVER
    """When request bits were last sent."""
    held: float = float("inf")
    """When they were last echoed; until the first echo, when they were first sent."""

    # ---- it begins

    def supersede(self, old: "Job") -> None:
        """It takes the machine over from `old`, whose telegrams may still be on their way."""
        self.other = old if old.writing else old.other
        if old.prepared.command.stop and self.prepared.command.stop:
            self.asked = old.asked
        self.clears = old.clears or bool(old.prepared.command.hold_bits)

    def lend(self, lease: Lease, now: float) -> None:
        """It lasts as long as the button of `lease` is held."""
        self.lease = lease
        if self.prepared.command.hold_bits:
            self.held = now

    def keeps(self, former: Mapping[str, float]) -> None:
        """It gives points back what they held (`former`) when it is over."""
        self.progress = replace(self.progress, former=former)

    # ---- telegrams

    @contextmanager
    def telegrams(self) -> Iterator[None]:
        """Inside, its telegrams are on their way."""
        self.writing += 1
        try:
            yield
        finally:
            self.writing -= 1

    @contextmanager
    def stop_telegrams(self, now: float) -> Iterator[None]:
        """Inside, telegrams of a stop are on their way, from `now` on."""
        self.stopping += 1
        self.last_write = now
        try:
            yield
        finally:
            self.stopping -= 1

    def goes_out(self, now: float) -> None:
        """A telegram of the command itself goes out."""
        self.sent = now

    def bits_sent(self, now: float) -> None:
        """Request bits of a hold-to-run go out."""
        self.last_hold = now
        if self.ending is None:
            self.sent = min(self.sent, now)

    def bits_echoed(self, now: float) -> None:
        """The device has heard request bits."""
        self.held = now

    def answered(self, answer: Answer) -> None:
        """The device has said something about its code."""
        self.answer = answer
        self.known_as(answer.id)

    def known_as(self, request: int) -> None:
        """The device knows it by this id."""
        self.progress = also_known_as(self.progress, request)

    @contextmanager
    def asked_again(self, now: float) -> Iterator[None]:
        """Inside, what the device says about its code is being read."""
        self.asking = True
        self.last_ask = now
        try:
            yield
        finally:
            self.asking = False

    def read_back(self, now: float) -> None:
        """Its feedback is being read."""
        self.last_read = now

    # ---- what became of it

    def accepted(self, now: float, at: int) -> None:
        """The device has echoed all telegrams (`at` [µs UTC])."""
        self.progress = advance(self.progress, ProgressState.ACCEPTED, at)
        self.since = now
        self.echoed = True

    def outcome_unknown(self, now: float, at: int, reason: str, params: Mapping[str, object]) -> None:
        """Nobody knows whether a telegram arrived; what is read from now on tells. Of a held motion its end tells."""
        self.progress = advance(self.progress, ProgressState.UNKNOWN, at, reason=reason, params=params)
        if self.lease is None:
            self.since = now

    def seen_moving(self, at: int) -> None:
        """A held motion is confirmed, and goes on, or ends when it has stopped."""
        self.moved = True
        self.progress = advance(self.progress, ProgressState.CONFIRMED, at, end=False)

    def let_go(self, now: float) -> None:
        """The button is up: it stops from now on."""
        self.ending = now
        self.since, self.echoed = None, False
        self.other = None

    def stop_echoed(self, now: float, at: int) -> bool:
        """The device has echoed a stop; whether that is news to whoever watches the command."""
        self.echoed = True
        if self.since is None and self.other is None:
            self.since = now
        if self.progress.state is not ProgressState.REQUESTED or self.lease is not None:
            return False
        self.progress = advance(self.progress, ProgressState.ACCEPTED, at)
        return True

    def stop_perhaps_heard(self, now: float) -> None:
        """The echo of a stop is lost, but what is read from here on comes after a telegram that may have arrived."""
        self.since = now

    def stop_anew(self) -> None:
        """A telegram may have moved the machine after the last stop: stop at once, and believe only what is read after that."""
        self.since, self.last_write = None, NEVER

    def other_is_through(self) -> None:
        """Nothing of the superseded command is on its way any more."""
        self.other = None
        if self.prepared.command.stop or self.ending is not None:
            self.stop_anew()

    def end(self, state: ProgressState, at: int, reason: str, params: Mapping[str, object]) -> None:
        """It is over (`at` [µs UTC])."""
        self.progress = advance(self.progress, state, at, end=True, reason=reason, params=params)
