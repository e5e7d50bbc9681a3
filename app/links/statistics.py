"""How a link is doing, counted as it happens and published about once a second as tags `sys.link.<link>.…`.

| name | content |
| --- | --- |
| state | 0 connecting · 1 up · 2 some units silent · 3 down · 4 configuration |
| polls | telegrams answered per second, reads and writes [1/s] |
| scan_time | time between two scans of a fast block, mean [ms] |
| bus_share | time with a telegram on its way, of all time and connections [%] |
| timeouts, exceptions, retries, late_scans | counted since the start |
| last_error | index in `ERROR_KINDS`, 0 = none yet |
| damaged | telegrams with a wrong check sum, and noise, counted since the start |
| late_answers | answers that came when nobody waited for them any more |
| torn | images that the device was changing while they were read, counted since the start |
| connections | open now |
| simulated | 1 when every unit says that it is simulated |

and for each unit `sys.link.<link>.unit<n>.…`: state, answer_time (smoothed [ms]; none while it does not answer), timeouts, exceptions.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from zlib import crc32

from app.clock import Clock
from app.errors import DeviceException, LinkError, NoAnswer
from app.links.contract import Counts
from app.plant.definitions import Link
from app.tags.batch import Batch, Value
from app.tags.database import TagDatabase
from app.tags.quality import COMM_FAILURE, GOOD

SOURCE = "sys"

LINK_KEYS: Sequence[str] = (
    "state",
    "polls",
    "scan_time",
    "bus_share",
    "timeouts",
    "exceptions",
    "retries",
    "late_scans",
    "damaged",
    "late_answers",
    "torn",
    "last_error",
    "connections",
    "simulated",
)
UNIT_KEYS: Sequence[str] = ("state", "answer_time", "timeouts", "exceptions")

ERROR_KINDS: Sequence[str] = (
    "",
    "failed",
    "no_answer",
    "not_connected",
    "bad_answer",
    "exception",
    "overtaken",
    "rejected",
    "hung_up",
)
"""`LinkError.kind` by its code in `last_error`; a text key `link.error.<kind>`."""

SMOOTHING = 0.1
"""Share of the newest in a smoothed answer time."""
FORGETTING = 0.999
"""What is left of the slowest answer with each quicker one."""


class LinkState(IntEnum):
    """Of a link, and of a unit (which is never SOME_SILENT)."""

    CONNECTING = 0
    UP = 1
    SOME_SILENT = 2
    DOWN = 3
    CONFIGURATION = 4


ANSWERS = (LinkState.UP, LinkState.CONFIGURATION)
"""States of a unit that answers."""


def statistic_names(link: Link | str, units: Iterable[int]) -> list[str]:
    """Names of all tags of `link`, for those who create the points."""
    link = link if isinstance(link, str) else link.name
    names = [f"{SOURCE}.link.{link}.{key}" for key in LINK_KEYS]
    for unit in sorted(set(units)):
        names += [f"{SOURCE}.link.{link}.unit{unit}.{key}" for key in UNIT_KEYS]
    return names


@dataclass(slots=True)
class UnitStatistics:
    """One unit."""

    state: LinkState = LinkState.CONNECTING
    answer_time: float = 0.0
    """Smoothed [s]; 0 = never answered."""
    slowest: float = 0.0
    """Of the answers of late: halves in some 700 that are quicker [s]."""
    turnaround: float = 0.0
    """Of the answer time, what is not telegrams and silences on the wire: the device, its adapter, this computer; smoothed [s]."""
    timeouts: int = 0
    exceptions: int = 0
    by_code: dict[int, int] = field(default_factory=dict)
    """Exceptions by code."""

    def answered(self, seconds: float, wire: float | None = None) -> None:
        """An answer took `seconds`, of which `wire` on the line itself (None: not known)."""
        share = SMOOTHING if self.answer_time else 1.0
        self.answer_time += (seconds - self.answer_time) * share
        self.slowest = max(seconds, self.slowest * FORGETTING)
        if wire is not None:
            share = SMOOTHING if self.turnaround else 1.0
            self.turnaround += (max(0.0, seconds - wire) - self.turnaround) * share


@dataclass(slots=True)
class LinkStatistics:
    """One link."""

    state: LinkState = LinkState.CONNECTING
    telegrams: int = 0
    """Answered, refusals included."""
    busy: float = 0.0
    """Time with a telegram on its way, summed over connections [s]."""
    timeouts: int = 0
    exceptions: int = 0
    retries: int = 0
    late_scans: int = 0
    torn: int = 0
    """Answers that the device was changing."""
    wire: Counts = field(default_factory=Counts)
    """Counted by the connections themselves."""
    last_error: str = ""
    """Kind of the last error."""
    last_error_text: str = ""
    """Its sentence, for people."""
    connections: int = 0
    simulated: bool = False
    fast_scans: int = 0
    fast_time: float = 0.0
    """Sum of the times between scans of fast blocks [s]."""
    polls: float = 0.0
    """In the last period [1/s]."""
    scan_time: float = 0.0
    """In the last period [s]."""
    bus_share: float = 0.0
    """In the last period, 0 to 1."""
    units: dict[int, UnitStatistics] = field(default_factory=dict)

    def failed(self, unit: int, error: LinkError) -> None:
        """Count `error` of `unit`."""
        self.last_error, self.last_error_text = error.kind, str(error)
        of_unit = self.units.get(unit)
        if isinstance(error, DeviceException):
            self.exceptions += 1
            if of_unit:
                of_unit.exceptions += 1
                of_unit.by_code[error.code] = of_unit.by_code.get(error.code, 0) + 1
        elif isinstance(error, NoAnswer):
            self.timeouts += 1
            if of_unit:
                of_unit.timeouts += 1

    def fast_scan(self, seconds: float) -> None:
        """A fast block was scanned `seconds` after its last time."""
        self.fast_scans += 1
        self.fast_time += seconds


class StatisticsPublisher:
    """Turns the counters of one link into tags."""

    def __init__(self, link: str, statistics: LinkStatistics, tags: TagDatabase, clock: Clock) -> None:
        self._prefix = f"{SOURCE}.link.{link}."
        self._block = crc32(link.encode())
        self._statistics = statistics
        self._tags = tags
        self._clock = clock
        self._revision = -1
        self._last: dict[str, Value] = {}
        self._since = clock.monotonic()
        self._before = (0, 0.0, 0, 0.0)

    def measure(self) -> None:
        """Close a period: rates since the last call."""
        s, now = self._statistics, self._clock.monotonic()
        elapsed = now - self._since
        if elapsed <= 0:
            return
        telegrams, busy, scans, time = self._before
        s.polls = (s.telegrams - telegrams) / elapsed
        s.bus_share = min(1.0, (s.busy - busy) / elapsed / max(1, s.connections))
        s.scan_time = (s.fast_time - time) / (s.fast_scans - scans) if s.fast_scans > scans else 0.0
        self._before = (s.telegrams, s.busy, s.fast_scans, s.fast_time)
        self._since = now

    def publish(self) -> None:
        """Publish what changed, for the tags that exist."""
        tags = self._tags
        if tags.revision != self._revision:
            self._revision, self._last = tags.revision, {}
        values, last = self._values(), self._last
        changed = {key: value for key, value in values.items() if last.get(key) != value and self._prefix + key in tags}
        last |= changed
        now = self._clock.micros()
        handles = [tags.handle(self._prefix + key) for key in changed]
        qualities = [COMM_FAILURE if value is None else GOOD for value in changed.values()]
        tags.publish(Batch(SOURCE, self._block, now, now, handles, list(changed.values()), qualities=qualities))

    def _values(self) -> dict[str, Value]:
        s = self._statistics
        values: dict[str, Value] = {
            "state": int(s.state),
            "polls": round(s.polls, 1),
            "scan_time": round(s.scan_time * 1000, 1),
            "bus_share": round(s.bus_share * 100, 1),
            "timeouts": s.timeouts,
            "exceptions": s.exceptions,
            "retries": s.retries,
            "late_scans": s.late_scans,
            "damaged": s.wire.damaged,
            "late_answers": s.wire.late,
            "torn": s.torn,
            "last_error": ERROR_KINDS.index(s.last_error) if s.last_error in ERROR_KINDS else 1,
            "connections": s.connections,
            "simulated": int(s.simulated),
        }
        for unit, of_unit in s.units.items():
            values[f"unit{unit}.state"] = int(of_unit.state)
            took = round(of_unit.answer_time * 1000, 1)
            values[f"unit{unit}.answer_time"] = took if of_unit.state in ANSWERS else None
            values[f"unit{unit}.timeouts"] = of_unit.timeouts
            values[f"unit{unit}.exceptions"] = of_unit.exceptions
        return values
