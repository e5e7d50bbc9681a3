"""Alarms that other parts of the server report: a task is down, a Stop was not confirmed, events of a machine are lost."""

from collections.abc import Mapping

from app.alarms.conditions import Reported
from app.alarms.definitions import SYSTEM_ALARMS
from app.alarms.evaluation import Evaluation
from app.alarms.index import AlarmIndex
from app.alarms.lifecycle import AlarmState
from app.alarms.states import AlarmStates
from app.alarms.watch import Watch
from app.plant import expression
from app.plant.system import SYSTEM

SUBJECTS = ("link", "task", "file")
"""Parameters that name what a system alarm is about: each value is an alarm of its own."""


class SystemAlarms:
    """Takes what other parts report and makes alarms of it as they come."""

    def __init__(self, index: AlarmIndex, states: AlarmStates, evaluation: Evaluation) -> None:
        self._index = index
        self._states = states
        self._evaluation = evaluation

    def report(
        self,
        key: str,
        equipment: str | None = None,
        active: bool = True,
        params: Mapping[str, object] | None = None,
        *,
        until: str = "",
    ) -> None:
        """Say that an alarm of `SYSTEM_ALARMS`, of a machine or of the server, is there or over. Saying it again changes nothing.

        A parameter named after what it is about (`link`, `task`, `file`) makes an alarm of its own. `until` is a sentence over the
        machine's points that ends it.

        Raises:
            KeyError: no such alarm.
        """
        SYSTEM_ALARMS[key]
        given = dict(params or {})
        about = equipment or next((str(given[name]) for name in SUBJECTS if name in given), "")
        id = _id(key, about)
        watch = self._index.get(id)
        if watch is None:
            if not active:
                return
            watch = self._index.of_system(id, key, equipment or "")
            self._evaluation.enrol(watch)
        condition = watch.condition
        assert isinstance(condition, Reported)
        if condition.active is active and (not active or dict(watch.params) == given) and watch.delay.active is active:
            return
        condition.active = active
        if active:
            if dict(watch.params) != given and watch.life.active:
                self._states.changed(watch)
            watch.params = given
            if until and equipment in self._index.equipment:
                self._index.listen(watch, until)
        self._evaluation.evaluate([watch])

    def stop_unconfirmed(self, equipment: str) -> None:
        """A Stop was not read back in time. The alarm is over when the machine's Stop is seen to have worked."""
        item = self._index.equipment.get(equipment)
        stop = next((command for command in item.type.commands.values() if command.stop), None) if item else None
        until = stop.feedback if stop and not expression.parse(stop.feedback or "1").needs_argument else ""
        self.report("stop_unconfirmed", equipment, True, until=until)

    def is_raised(self, key: str, about: str = "") -> bool:
        """Whether the alarm `key` about a machine or another thing is not normal."""
        watch = self._index.get(_id(key, about))
        return watch is not None and watch.life.state is not AlarmState.NORMAL

    def seen(self, watch: Watch) -> None:
        """Somebody acknowledged `watch`: what only happened, and no sentence ends, is over by that."""
        if watch.once and isinstance(watch.condition, Reported) and watch.condition.until is None:
            watch.condition.active = False
            self._evaluation.evaluate([watch])


def _id(key: str, about: str) -> str:
    return ".".join(part for part in (SYSTEM, key, about) if part)
