"""One connection of a link among others, and what the others tell about it: a socket can be open and dead, or accepted and never served."""

import logging
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from app import chance
from app.errors import GATEWAY, BadAnswer, DeviceException, NoAnswer, NotConnected
from app.links.contract import Transport
from app.links.station import Station
from app.links.statistics import LinkState

log = logging.getLogger(__name__)

STEADY = 2.0
"""A connection with answers that lasted so long is opened again at once when it is lost; others wait longer each time [s]."""
FIRST_PAUSE, LAST_PAUSE = 0.1, 0.5
"""Pauses before a lost connection is opened again [s], doubling; the first try is at once."""
LAST_DEAF_PAUSE = 60.0
"""Longest pause before a connection that stays deaf is tried again [s]: some devices accept more connections than they serve."""
DEAF = 2
"""A connection is deaf when a unit left so many requests in a row unanswered on it, and was heard on another one meanwhile."""


class Deaf(NotConnected):
    """A connection on which a unit does not answer that answers on others."""


@dataclass(slots=True)
class Lane:
    """One connection."""

    number: int
    transport: Transport
    answers: int = 0
    missed: dict[int, tuple[int, float]] = field(default_factory=dict)
    """Unit → how many requests it left unanswered since the last answer on this connection, and when the first of them was sent [s]."""


@dataclass(slots=True)
class Reopening:
    """When a connection that was lost is opened again."""

    deaf: bool = False
    """Whether it was lost because it is deaf, and has not been heard since."""
    pause: float = 0.0

    def after(self, lane: Lane, lasted: float) -> float:
        """The pause after one that lasted so long [s]."""
        pause = 0.0 if lane.answers and lasted >= STEADY else self.pause
        self.pause = min(max(2 * pause, FIRST_PAUSE), LAST_DEAF_PAUSE if self.deaf else LAST_PAUSE)
        return pause * chance.uniform(0.9, 1.1)


class Hearing:
    """Which units of a link are heard at all, and on which connections they are not."""

    def __init__(self, link: str) -> None:
        self._link = link
        self._heard_at: dict[int, float] = {}
        """Unit → when it answered last, on whichever connection [s]."""

    def heard(self, lane: Lane, unit: int, now: float) -> None:
        """An answer of the unit has come on this connection."""
        lane.answers += 1
        lane.missed.clear()
        self._heard_at[unit] = now

    def refused(self, lane: Lane, unit: int, error: DeviceException, now: float) -> None:
        """So has a refusal: the unit's own, or that of a gateway which does not reach it."""
        if error.code not in GATEWAY:
            self.heard(lane, unit, now)
        else:
            lane.answers += 1
            lane.missed.clear()

    def missed(self, lane: Lane, unit: int, started: float) -> None:
        """A request of `started` [s] was not answered.

        Raises:
            Deaf: the unit answers on other connections.
        """
        times, since = lane.missed.get(unit, (0, started))
        lane.missed[unit] = times + 1, since
        if times + 1 >= DEAF and self._heard_at.get(unit, 0.0) > since:
            error = self._deaf(lane, unit)
            log.warning("connection opened again link=%s reason=%s", self._link, error)
            raise error

    async def prove(self, lane: Lane, stations: Iterable[Station]) -> None:
        """Ask a unit that others hear, if there is one: in place of a deaf connection another takes no telegrams until it was answered.

        Raises:
            NotConnected: it is lost, or deaf as well.
        """
        station = next((each for each in stations if each.state is LinkState.UP), None)
        if station is None:
            return
        try:
            await lane.transport.read(station.number, replace(station.probe(), again=True), station.timeout)
        except NoAnswer as error:
            raise self._deaf(lane, station.number) from error
        except (DeviceException, BadAnswer):
            pass

    def _deaf(self, lane: Lane, unit: int) -> Deaf:
        return Deaf(f"link {self._link}: unit {unit} answers on others, not on connection {lane.number + 1}")
