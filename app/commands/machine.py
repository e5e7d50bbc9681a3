"""What the gate keeps of one machine: what is at work on it, and what was."""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

from app import chance
from app.commands.interlocks import Prepared
from app.commands.job import Job
from app.commands.lifecycle import Progress, also_known_as
from app.commands.orders import Order, Task
from app.plant.definitions import Equipment, Link

HISTORY = 50
"""Commands remembered per machine."""


@dataclass(slots=True)
class SetJob:
    """A set of setpoints or parameters at work; its progress is written here alone, `interrupt` is for whoever has to."""

    order: Order
    prepared: Prepared
    plan: Task
    progress: Progress
    touched: list[tuple[str, ...]] = field(default_factory=list)
    """Steps of which a telegram may have reached the device."""
    unsettled: set[str] = field(default_factory=set)
    """Points whose last write may still take effect: what is read of them now proves nothing."""
    stop: str = ""
    """Why no further new value is written (a text key); empty while nothing keeps it from going on."""

    def went(self, progress: Progress) -> None:
        """What has become of it so far."""
        self.progress = progress

    def known_as(self, request: int) -> None:
        """The device knows one of its steps by this id."""
        self.progress = also_known_as(self.progress, request)

    def interrupt(self, why: str) -> None:
        """Write no further new value, and put back what was changed; the first reason counts."""
        self.stop = self.stop or why


@dataclass(slots=True)
class Machine:
    """What the gate keeps of one machine."""

    item: Equipment
    link: Link
    commands: Mapping[str, Prepared]
    setpoints: Mapping[str, Prepared]
    stop: Prepared | None
    stopped: float = float("-inf")
    """When its Stop was asked for last [s, monotonic]."""
    job: Job | None = None
    set: SetJob | None = None
    """Nothing but a Stop is taken beside it."""
    last: Progress | None = None
    history: deque[Progress] = field(default_factory=lambda: deque(maxlen=HISTORY))
    met: dict[str, tuple[bool | None, int]] = field(default_factory=dict)
    """Condition → met, since [µs UTC]."""
    pulses: dict[str, float] = field(default_factory=dict)
    restore: dict[str, float] = field(default_factory=dict)
    """Point → what it held before a hold-to-run wrote it."""
    then: tuple[tuple[str, float], ...] = ()
    """Telegrams that follow when these points hold it again."""
    restoring: bool = False
    left: bool = False
    """Nobody has given these points back what they held: it waits for somebody to ask for it."""
    former: dict[str, float] = field(default_factory=dict)
    """Command or setpoint → what its value was before the last change that was read back [EU]."""
    counter: int = field(default_factory=lambda: chance.randrange(0, 0xFFFF))
    """Of the last request bits: no telegram repeats the one before, not even across a restart of the server."""
    signature: object = None
    looked: float = float("-inf")
    """When its conditions were looked at last [s, monotonic]."""
    used: Sequence[str] = field(init=False)
    """Points read from the device that anything about its commands uses."""
    handles: tuple[int, Mapping[str, int]] = (-1, MappingProxyType({}))
    """Revision of the tags, and the handles of the points in it."""
    dirty: bool = True
    announced_at: float = float("-inf")
    """When anybody was told last that something changed [s, monotonic]."""

    def __post_init__(self) -> None:
        self.used = tuple(dict.fromkeys(key for prepared in self.commands.values() for key in prepared.used))

    def leave(self) -> None:
        """What a hold-to-run has changed stays as it is, until somebody asks for what was there before."""
        self.left = bool(self.restore) and any(one.command.puts_back for one in self.commands.values())
        if not self.left:
            self.restore.clear()

    def put_back(self) -> None:
        """The points hold again what they held before."""
        self.restore.clear()
        self.left = False

    def go_on_from(self, old: "Machine") -> None:
        """Take over what is at work on the machine and what was, when the plant is read anew."""
        self.job, self.set, self.last, self.history = old.job, old.set, old.last, old.history
        self.former = old.former
        self.then, self.left = old.then, old.left
        self.pulses, self.restore, self.restoring, self.counter = old.pulses, old.restore, old.restoring, old.counter
