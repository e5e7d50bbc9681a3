"""Alarms of the system itself, and the tags under which the alarms are counted."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from app.plant.definitions import Alarm, Point
from app.plant.system import SYSTEM, system_point

PRIORITIES = (1, 2, 3, 4)

PREFIX = "alarms"
COUNTS: Sequence[str] = (
    "revision",
    "new",
    "sound",
    "total",
    "unack",
    "flood",
    "hidden",
    "shelved",
    "suppressed",
    "oos",
    *(f"unack_{priority}" for priority in PRIORITIES),
    *(f"active_{priority}" for priority in PRIORITIES),
)
"""Points `sys.alarms.…` that every page has: number of the last change, of the newest annunciation, priority that sounds (0 = none), alarms
in the list, those that wait for an acknowledgement, whether there is a flood, what is hidden and by which state, and by priority what waits
and what is in the list."""


def frame_names() -> list[str]:
    """Names of the points that every page has."""
    return [f"{SYSTEM}.{PREFIX}.{key}" for key in COUNTS]


def alarm_points(equipment: Iterable[str]) -> list[Point]:
    """The points of the alarms: the counts, and `sys.alarms.by.<equipment>.p1` … `p4` (the system itself is `sys`)."""
    points = [system_point(f"{PREFIX}.{key}", label=f"{PREFIX}.{key.split('_')[0]}") for key in COUNTS]
    for item in (*equipment, SYSTEM):
        points += [system_point(f"{PREFIX}.by.{item}.p{one}", label=f"{PREFIX}.active") for one in PRIORITIES]
    return points


@dataclass(frozen=True, slots=True)
class SystemAlarm:
    """An alarm that another part of the server tells."""

    priority: int
    on_delay: float = 0.0
    off_delay: float = 0.0
    once: bool = False
    """Something that happened, not something that stands: over as soon as somebody has acknowledged it."""
    alarm_class: str = "system"
    audible: bool = True

    def row(self, key: str) -> Alarm:
        """As an alarm row; its texts are `alarm.system.<key>.label`, `.consequence`, `.cause`, `.response` of the product."""
        prefix = f"alarm.system.{key}."
        return Alarm(
            key=key,
            label=prefix + "label",
            expression="",
            priority=self.priority,
            on_delay=self.on_delay,
            off_delay=self.off_delay,
            audible=self.audible,
            alarm_class=self.alarm_class,
            consequence=prefix + "consequence",
            cause=prefix + "cause",
            response=prefix + "response",
        )


SYSTEM_ALARMS: Mapping[str, SystemAlarm] = {
    "stop_unconfirmed": SystemAlarm(1, once=True, alarm_class="command"),
    "command_unconfirmed": SystemAlarm(3, once=True, alarm_class="command"),
    "set_mixed": SystemAlarm(2, once=True, alarm_class="command"),
    "left_changed": SystemAlarm(2, alarm_class="command"),
    "history_full": SystemAlarm(2),
    "history_quota": SystemAlarm(4),
    "history_lost": SystemAlarm(2, once=True),
    "database_restored": SystemAlarm(2, once=True),
    "database_shortened": SystemAlarm(2, once=True),
    "database_lost": SystemAlarm(1),
    "task_down": SystemAlarm(2, on_delay=1.0, off_delay=2.0),
    "link_down": SystemAlarm(2, on_delay=5.0, off_delay=5.0, alarm_class="comm"),
    "connection_closed": SystemAlarm(3, alarm_class="comm"),
    "program_halted": SystemAlarm(2, off_delay=1.0, alarm_class="comm"),
    "device_restarts": SystemAlarm(2, alarm_class="comm"),
    "events_lost": SystemAlarm(3, once=True, alarm_class="comm"),
    "events_unstored": SystemAlarm(2, on_delay=2.0, off_delay=2.0),
    "audit_waiting": SystemAlarm(2),
    "audit_broken": SystemAlarm(1),
    "account_locked": SystemAlarm(3, once=True),
    "admin_added": SystemAlarm(3, once=True),
    "journal_waiting": SystemAlarm(2),
    "simulation_late": SystemAlarm(4, on_delay=30.0, off_delay=5.0, audible=False),
    "disk_low": SystemAlarm(2),
    "disk_slow": SystemAlarm(2),
    "clock_leapt": SystemAlarm(2),
    "certificate_ends": SystemAlarm(2),
    "service_review": SystemAlarm(4, audible=False),
}
"""Key → alarm. `{task}`, `{link}`, `{file}`, `{loss}`, `{time}`, `{command}`, `{percent}`, `{count}`, `{account}` in the texts are
parameters."""
