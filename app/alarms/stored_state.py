"""How an alarm stood, as the database keeps it: written from a watch, put back into one. Pure."""

import json

from app.alarms.conditions import ByEvent, Delay, Reported
from app.alarms.journal import Stored
from app.alarms.shelf import packed, unpacked
from app.alarms.watch import Watch
from app.plant.definitions import Alarm
from app.tags.quality import NO_DATA


def stored(watch: Watch) -> Stored:
    """What is kept of `watch`."""
    life = watch.life
    return Stored(
        alarm=watch.id,
        equipment=watch.equipment,
        key=watch.alarm.key,
        occurrence=watch.occurrence,
        active=life.active,
        acked=life.acked,
        latched=life.latched,
        shelved=life.shelved,
        suppressed=life.suppressed,
        out_of_service=life.out_of_service,
        known=watch.known,
        first_true=watch.first_true,
        annunciated=watch.annunciated,
        returned=watch.returned,
        acked_at=watch.acked_at,
        acked_by=watch.acked_by,
        count=watch.count,
        ordinal=watch.ordinal,
        uncertain=watch.uncertain,
        value=watch.value,
        limit=watch.limit,
        params=json.dumps(watch.params, ensure_ascii=False, sort_keys=True),
        hiding=packed(watch.shelf, watch.service),
    )


def put_back(watch: Watch, one: Stored) -> None:
    """Let `watch` stand as it stood; its delays begin anew, and what an event raised still waits for what ends it."""
    watch.life, watch.occurrence, watch.known = one.life, one.occurrence, one.known
    watch.first_true, watch.annunciated, watch.returned = one.first_true, one.annunciated, one.returned
    watch.acked_at, watch.acked_by, watch.count = one.acked_at, one.acked_by, one.count
    watch.ordinal, watch.uncertain = one.ordinal, one.uncertain
    watch.value, watch.limit = one.value, one.limit
    watch.shelf, watch.service = unpacked(one.hiding)
    watch.params = json.loads(one.params)
    watch.delay.restart(one.active)
    if isinstance(watch.condition, Reported):
        watch.condition.active = one.active
    elif isinstance(watch.condition, ByEvent):
        watch.event = int(str(watch.params.get("event", 0)))
        watch.condition.raised = one.active and watch.event > 0


def orphan(one: Stored) -> Watch:
    """An alarm that stood and whose definition is gone: enough of it to close it in the journal."""
    watch = Watch(
        id=one.alarm,
        index=0,
        equipment=one.equipment,
        area="",
        type="",
        alarm=Alarm(one.key, f"alarm.{one.key}.label", "", 4),
        condition=Reported(),
        delay=Delay(0, 0),
        look=lambda key: (None, NO_DATA),
        age=lambda key: None,
        handles=frozenset(),
    )
    watch.life, watch.occurrence, watch.first_true = one.life, one.occurrence, one.first_true
    return watch
