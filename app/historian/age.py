"""By which time the history ages: that of the machine's clock, unless it leapt.

A clock that comes up years ahead (an empty battery, a wrong time server) would have all history cut as too old within a minute, and
setting it right brings nothing back. So a leap is believed once the recorder has run a day since; until then the history ages by the
time that passes.
"""

from dataclasses import dataclass

from sqlalchemy import Connection

from app.historian.store import DAY, MARK, SET

PART = 0.1
"""Of the age that is kept: a leap of less costs no more of the history than that, and is believed at once, as after a week's rest."""
BELIEVED, LEAPT = "believed", "leapt"
"""Names of the marks."""


@dataclass(frozen=True, slots=True)
class Age:
    """What is known of the clock."""

    time: int
    """By which the history ages [µs UTC]."""
    leapt: int = 0
    """For how long the recorder has run since a leap that is not believed yet [µs]."""

    def after(self, passed: int, now: int, keep: float) -> "Age":
        """When `passed` [µs] went by and the clock says `now` [µs UTC]; `keep` is the age that is kept [days]."""
        expected, leapt = self.time + passed, self.leapt + passed
        if now - expected <= keep * PART * DAY or leapt >= DAY:
            return Age(now)
        return Age(expected, max(1, leapt))


def read(connection: Connection) -> Age | None:
    """What was noted last, by whichever run; None: nothing was."""
    time = MARK(connection, name=BELIEVED).scalar()
    return None if time is None else Age(time, MARK(connection, name=LEAPT).scalar() or 0)


def note(connection: Connection, age: Age) -> None:
    """Keep it over a restart."""
    SET(connection, name=BELIEVED, t=age.time)
    SET(connection, name=LEAPT, t=age.leapt)
