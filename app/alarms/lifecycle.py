"""The life of one alarm as a table: which event leads from which state to which, and what the journal calls it. Pure.

Three layers are kept apart (reference/alarms.md section 1): the condition (active), the attention (acknowledged, latched) and what keeps
an alarm from being shown (shelved, suppressed by design, out of service; they may overlap). The letter that ISA-18.2 gives the state
is derived from them by `displayed`; every row of `TRANSITIONS` says which letter it must lead to, and a test sweeps them all.

Where the sheet leaves a corner open: a latch outlives shelving, suppression and service (it is never lost by hiding it); a condition
that goes while it is hidden takes an unlatched acknowledgement with it; suppression that ends starts the condition's on-delay again.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum


class AlarmState(StrEnum):
    """Displayed state, by its letter."""

    NORMAL = "A"
    UNACKNOWLEDGED = "B"
    """Active, unacknowledged."""
    ACKNOWLEDGED = "C"
    """Active, acknowledged."""
    RETURNED = "D"
    """The condition is gone, nobody has acknowledged it."""
    LATCHED_UNACKNOWLEDGED = "E"
    LATCHED = "F"
    """Acknowledged, waits for a reset."""
    SHELVED = "G"
    SUPPRESSED = "H"
    OUT_OF_SERVICE = "I"


ANNUNCIATED = frozenset("BCDEF")
"""States that are in the active list."""
UNACKED = frozenset("BDE")
"""States that wait for an acknowledgement; their symbol flashes."""
AUDIBLE = frozenset("BE")
HIDDEN = frozenset("GHI")


class AlarmEvent(StrEnum):
    """What can happen to an alarm."""

    RAISE = "raise"
    """The condition has been true for the on-delay."""
    RETURN = "return"
    """The condition has been false for the off-delay."""
    ACKNOWLEDGE = "acknowledge"
    RESET = "reset"
    SHELVE = "shelve"
    UNSHELVE = "unshelve"
    SUPPRESS = "suppress"
    UNSUPPRESS = "unsuppress"
    TAKE_OUT = "take_out"
    """Out of service."""
    PUT_BACK = "put_back"
    REALARM = "realarm"
    """Acknowledged for longer than its class allows."""
    PRIORITY = "priority"
    QUALITY = "quality"
    """The condition's inputs became unknown, or known again."""
    LIMIT = "limit"
    """Its definition was changed."""
    RESTART = "restart"
    REMOVE = "remove"
    """Its definition is gone."""


class Entry(StrEnum):
    """What the journal calls a transition."""

    RAISED = "RAISED"
    RTN = "RTN"
    ACK = "ACK"
    RESET = "RESET"
    SHELVED = "SHELVED"
    UNSHELVED = "UNSHELVED"
    SUPPRESSED = "SUPPRESSED"
    UNSUPPRESSED = "UNSUPPRESSED"
    OOS_ON = "OOS_ON"
    OOS_OFF = "OOS_OFF"
    REALARM = "REALARM"
    PRIO_CHANGED = "PRIO_CHANGED"
    QUALITY = "QUALITY"
    LIMIT_CHANGED = "LIMIT_CHANGED"
    RESTORED = "RESTORED"
    REMOVED = "REMOVED"


@dataclass(frozen=True, slots=True)
class Life:
    """The layers of one alarm."""

    active: bool = False
    acked: bool = True
    latched: bool = False
    shelved: bool = False
    suppressed: bool = False
    out_of_service: bool = False

    @property
    def hidden(self) -> int:
        """How many reasons keep it from being shown."""
        return self.shelved + self.suppressed + self.out_of_service

    @property
    def state(self) -> AlarmState:
        """The displayed state."""
        return displayed(self)


@dataclass(frozen=True, slots=True)
class Traits:
    """What its class and definition ask of it."""

    latching: bool = False
    ack_required: bool = True
    """False: an alarm that returns needs no acknowledgement."""


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the table."""

    number: str
    """Of reference/alarms.md section 1.2; a letter behind it where the sheet puts several cases into one line."""
    states: str
    event: AlarmEvent
    to: str
    """Letter that it leads to; `=` for the same, `*` where what is still hidden or active decides."""
    change: Mapping[str, bool]
    """Layer → new value."""
    entry: Entry
    when: Mapping[str, bool] | None = None
    """Facts that must hold: a layer, a trait, or `alone` (nothing else hides it)."""
    detail: str = ""
    """Second word of the journal: AUTOACK, LATCHED."""
    annunciates: bool = False
    """Whether it asks for attention anew: sound, flashing, counted in the rates."""


_RISE = {"active": True, "acked": False}
_CALM = {"active": False, "acked": True, "latched": False}
_SHOWN = {"shelved": False, "suppressed": False, "out_of_service": False}

TRANSITIONS: Sequence[Row] = (
    Row("T1", "A", AlarmEvent.RAISE, "B", _RISE, Entry.RAISED, annunciates=True),
    Row("T2", "B", AlarmEvent.ACKNOWLEDGE, "C", {"acked": True}, Entry.ACK),
    Row("T3", "B", AlarmEvent.RETURN, "D", {"active": False, "latched": False}, Entry.RTN, {"latching": False, "ack_required": True}),
    Row("T4", "B", AlarmEvent.RETURN, "A", _CALM, Entry.RTN, {"latching": False, "ack_required": False}, "AUTOACK"),
    Row("T5", "B", AlarmEvent.RETURN, "E", {"active": False, "latched": True}, Entry.RTN, {"latching": True}, "LATCHED"),
    Row("T6", "C", AlarmEvent.RETURN, "A", _CALM, Entry.RTN, {"latching": False}),
    Row("T7", "C", AlarmEvent.RETURN, "F", {"active": False, "latched": True}, Entry.RTN, {"latching": True}, "LATCHED"),
    Row("T8", "D", AlarmEvent.ACKNOWLEDGE, "A", {"acked": True}, Entry.ACK),
    Row("T9", "D", AlarmEvent.RAISE, "B", _RISE, Entry.RAISED, annunciates=True),
    Row("T10", "E", AlarmEvent.ACKNOWLEDGE, "F", {"acked": True}, Entry.ACK),
    Row("T11", "EF", AlarmEvent.RAISE, "B", {**_RISE, "latched": False}, Entry.RAISED, annunciates=True),
    Row("T12", "F", AlarmEvent.RESET, "A", {"latched": False}, Entry.RESET),
    Row("T14", "ABCDEF", AlarmEvent.SHELVE, "G", {"shelved": True}, Entry.SHELVED),
    Row("T14h", "HI", AlarmEvent.SHELVE, "=", {"shelved": True}, Entry.SHELVED, {"shelved": False}),
    Row("T15a", "G", AlarmEvent.UNSHELVE, "B", {"shelved": False, "acked": False}, Entry.UNSHELVED, {"active": True}, annunciates=True),
    Row("T15b", "G", AlarmEvent.UNSHELVE, "A", {"shelved": False, "acked": True}, Entry.UNSHELVED, {"active": False, "latched": False}),
    Row("T15c", "G", AlarmEvent.UNSHELVE, "*", {"shelved": False}, Entry.UNSHELVED, {"active": False, "latched": True}),
    Row("T15h", "HI", AlarmEvent.UNSHELVE, "=", {"shelved": False}, Entry.UNSHELVED, {"shelved": True}),
    Row("T16", "ABCDEFG", AlarmEvent.SUPPRESS, "H", {"suppressed": True}, Entry.SUPPRESSED),
    Row("T16i", "I", AlarmEvent.SUPPRESS, "I", {"suppressed": True}, Entry.SUPPRESSED, {"suppressed": False}),
    # Active or not: the engine starts the on-delay again, and a condition that still holds raises by T1.
    Row("T17a", "H", AlarmEvent.UNSUPPRESS, "A", {**_CALM, "suppressed": False}, Entry.UNSUPPRESSED, {"alone": True, "latched": False}),
    Row("T17b", "H", AlarmEvent.UNSUPPRESS, "*", {"active": False, "suppressed": False},
        Entry.UNSUPPRESSED, {"alone": True, "latched": True}),
    Row("T17h", "HI", AlarmEvent.UNSUPPRESS, "*", {"suppressed": False}, Entry.UNSUPPRESSED, {"alone": False, "suppressed": True}),
    Row("T18", "ABCDEFGH", AlarmEvent.TAKE_OUT, "I", {"out_of_service": True}, Entry.OOS_ON),
    Row("T19h", "I", AlarmEvent.PUT_BACK, "*", {"out_of_service": False}, Entry.OOS_OFF, {"alone": False}),
    Row("T19a", "I", AlarmEvent.PUT_BACK, "B", {"out_of_service": False, "acked": False},
        Entry.OOS_OFF, {"active": True}, annunciates=True),
    Row("T19b", "I", AlarmEvent.PUT_BACK, "A", {"out_of_service": False, "acked": True},
        Entry.OOS_OFF, {"active": False, "latched": False}),
    Row("T19c", "I", AlarmEvent.PUT_BACK, "*", {"out_of_service": False}, Entry.OOS_OFF, {"active": False, "latched": True}),
    Row("T20", "C", AlarmEvent.REALARM, "B", {"acked": False}, Entry.REALARM, annunciates=True),
    Row("T21", "ABCDEFGHI", AlarmEvent.PRIORITY, "=", {}, Entry.PRIO_CHANGED),
    Row("T22", "BCDEFGHI", AlarmEvent.QUALITY, "=", {}, Entry.QUALITY),
    Row("T23", "BCDEFGHI", AlarmEvent.RESTART, "=", {}, Entry.RESTORED),
    Row("L", "ABCDEFGHI", AlarmEvent.LIMIT, "=", {}, Entry.LIMIT_CHANGED),
    Row("R", "BCDEFGHI", AlarmEvent.REMOVE, "A", {**_CALM, **_SHOWN}, Entry.REMOVED),
    # While hidden the condition goes on and is written down, silently.
    Row("S1", "GHI", AlarmEvent.RAISE, "=", {**_RISE, "latched": False}, Entry.RAISED, {"active": False}),
    Row("S2", "GHI", AlarmEvent.RETURN, "=", _CALM, Entry.RTN, {"active": True, "latching": False}),
    Row("S3", "GHI", AlarmEvent.RETURN, "=", {"active": False, "latched": True}, Entry.RTN, {"active": True, "latching": True}, "LATCHED"),
)  # fmt: skip
"""The table of alarms.md section 1.2. The first row that fits holds; where none fits, nothing happens."""

REFUSED: Mapping[tuple[AlarmEvent, str], str] = {
    (AlarmEvent.ACKNOWLEDGE, "A"): "alarm.why.nothing_to_acknowledge",
    (AlarmEvent.ACKNOWLEDGE, "C"): "alarm.why.already_acknowledged",
    (AlarmEvent.ACKNOWLEDGE, "F"): "alarm.why.already_acknowledged",
    **{(AlarmEvent.ACKNOWLEDGE, state): "alarm.why.not_shown" for state in "GHI"},
    **{(AlarmEvent.RESET, state): "alarm.why.not_latched" for state in "AD"},
    **{(AlarmEvent.RESET, state): "alarm.why.still_active" for state in "BC"},
    (AlarmEvent.RESET, "E"): "alarm.why.acknowledge_first",
    **{(AlarmEvent.RESET, state): "alarm.why.not_shown" for state in "GHI"},
}
"""(event, state) → text key, for what a person asks and the table does not give (T13 and the lines around it)."""


@dataclass(frozen=True, slots=True)
class Step:
    """What an event did."""

    before: AlarmState
    after: AlarmState
    life: Life
    entry: Entry | None = None
    """None: nothing happened, and the journal says nothing."""
    detail: str = ""
    annunciates: bool = False
    silent: bool = False
    """The alarm is hidden: written down for analysis, not shown, not counted."""
    refused: str = ""
    """Text key of the reason, for what a person asked."""


def displayed(life: Life) -> AlarmState:
    """The letter of the layers; what hides an alarm goes before what it is, out of service before suppressed before shelved."""
    if life.hidden:
        return (
            AlarmState.OUT_OF_SERVICE
            if life.out_of_service
            else AlarmState.SUPPRESSED
            if life.suppressed
            else AlarmState.SHELVED
        )
    if life.active:
        return AlarmState.ACKNOWLEDGED if life.acked else AlarmState.UNACKNOWLEDGED
    if life.latched:
        return AlarmState.LATCHED if life.acked else AlarmState.LATCHED_UNACKNOWLEDGED
    return AlarmState.NORMAL if life.acked else AlarmState.RETURNED


def step(life: Life, event: AlarmEvent, traits: Traits) -> Step:
    """`life` after `event`; where the table has no row it stays, and what a person asked comes back with the reason."""
    before = displayed(life)
    row = _row(life, before, event, traits)
    if row is None:
        return Step(before, before, life, refused=REFUSED.get((event, before), ""))
    after = replace(life, **row.change)
    return Step(
        before,
        displayed(after),
        after,
        row.entry,
        row.detail,
        row.annunciates and not after.hidden,
        silent=bool(life.hidden and after.hidden),
    )


def _row(life: Life, state: AlarmState, event: AlarmEvent, traits: Traits) -> Row | None:
    for row in _BY_EVENT.get((event, state), ()):
        if all(_fact(life, traits, name) is wanted for name, wanted in (row.when or {}).items()):
            return row
    return None


def _fact(life: Life, traits: Traits, name: str) -> bool:
    if name == "alone":
        return life.hidden == 1
    return bool(getattr(traits if name in ("latching", "ack_required") else life, name))


_BY_EVENT: dict[tuple[AlarmEvent, str], list[Row]] = {}
for _one in TRANSITIONS:
    for _letter in _one.states:
        _BY_EVENT.setdefault((_one.event, _letter), []).append(_one)
