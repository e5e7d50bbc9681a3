"""By which time the history ages: that of the machine's clock, unless it leapt.

A clock that comes up years ahead (an empty battery, a wrong time server) would have all history cut as too old within a minute, and
setting it right brings nothing back. So a leap is believed once the recorder has run a day since; until then the history ages by the
time that passes. One that comes up years behind is believed at once, as is its return to where it was, within a day of the recorder's.
"""

from dataclasses import dataclass

from sqlalchemy import Connection

from app.historian.store import DAY, MARK, SET

PART = 0.1
"""Of the age that is kept: a leap of less costs no more of the history than that, and is believed at once, as after a week's rest."""
BELIEVED, LEAPT, BEFORE, SINCE = "believed", "leapt", "before", "since"
"""Names of the marks."""


@dataclass(frozen=True, slots=True)
class Age:
    """What is known of the clock."""

    time: int
    """By which the history ages [µs UTC]."""
    leapt: int = 0
    """For how long the recorder has run since a leap that is not believed yet [µs]."""

    before: int = 0
    """Where the clock would be now had it not been set back within the last day that the recorder ran [µs UTC]; 0: it was not."""
    since: int = 0
    """For how long it has run since then [µs]."""

    def after(self, passed: int, now: int, keep: float) -> "Age":
        """When `passed` [µs] went by and the clock says `now` [µs UTC]; `keep` is the age that is kept [days]."""
        expected, leapt, room = self.time + passed, self.leapt + passed, keep * PART * DAY
        since = self.since + passed
        before, since = (self.before + passed, since) if self.before and since < DAY else (0, 0)
        if now - max(expected, before) > room and leapt < DAY:
            return Age(expected, max(1, leapt), before, since)
        if before and before - now > room:
            return Age(now, 0, before, since)
        return Age(now, 0, expected) if expected - now > room else Age(now)


def read(connection: Connection) -> Age | None:
    """What was noted last, by whichever run; None: nothing was."""
    time = MARK(connection, name=BELIEVED).scalar()
    if time is None:
        return None
    return Age(time, *(MARK(connection, name=name).scalar() or 0 for name in (LEAPT, BEFORE, SINCE)))


def note(connection: Connection, age: Age) -> None:
    """Keep it over a restart."""
    for name, time in ((BELIEVED, age.time), (LEAPT, age.leapt), (BEFORE, age.before), (SINCE, age.since)):
        SET(connection, name=name, t=time)
