"""First-out: which alarm of a machine's stop came first. Pure.

A group are the trips of one machine together with the alarms that its events raise; it is armed again when none of them stands any more.
Source: reference/alarms.md section 6.
"""

from collections.abc import Iterable

from app.alarms.lifecycle import AlarmState
from app.alarms.watch import Watch

TRIP = "drive"
"""Class whose alarms of one equipment are a first-out group, together with those that its events raise."""
STOP_SPAN = 60_000_000
"""An alarm of an event that is over still belongs to the stop for this long [µs]."""


def place(watch: Watch, members: Iterable[Watch]) -> list[Watch]:
    """Give `watch`, which raises now, its place among the `members` of its machine; those whose order is doubted since.

    Two that came in the same scan are both uncertain, unless events of the device say their order; so is one that only its value raised.
    """
    watch.ordinal, watch.uncertain = 0, False
    if watch.alarm.alarm_class != TRIP and not watch.alarm.event:
        return []
    group = [one for one in members if one is not watch and in_stop(one, watch.first_true)]
    watch.ordinal = max((one.ordinal for one in group), default=0) + 1
    if group and watch.alarm.event and not watch.event:  # raised by its value: when, only the lost event could say
        watch.uncertain = True
    doubted = [one for one in group if one.first_true == watch.first_true and not (one.event and watch.event)]
    for one in doubted:
        one.uncertain = watch.uncertain = True
    return doubted


def in_stop(one: Watch, at: int) -> bool:
    """Whether an alarm is part of the group that stands at `at` [µs UTC]."""
    if not one.ordinal or one.life.state is AlarmState.NORMAL:
        return False
    return one.alarm.alarm_class == TRIP or (
        one.alarm.event > 0 and (one.life.active or at - one.first_true < STOP_SPAN)
    )
