"""What becomes of a command that was sent: the device's own answers, the feedback that is read back, a Stop until the machine stands."""

from collections.abc import Mapping

from app.commands import interlocks
from app.commands.checks import holds
from app.commands.command_state import CommandState
from app.commands.delivery import refusal_of
from app.commands.job import Job
from app.commands.lifecycle import Facts, ProgressState, judge
from app.commands.machine import Machine
from app.commands.motion import HeldMotion
from app.commands.sending import STOP_LIMIT, STOP_REPEAT, Sending
from app.registers.plc_map import HOLD_TIMEOUT, AnswerState
from app.tags.quality import is_good

READ_AGAIN = 0.5
"""Between two reads of a feedback that no fast scan brings: a device may take a while to act [s]."""
ASK_AGAIN = 0.2
"""Between two reads of what a device says about a code [s]."""


class Following:
    """Commands that wait for their confirmation."""

    def __init__(self, state: CommandState, sending: Sending, motion: HeldMotion) -> None:
        self._state = state
        self._sending = sending
        self._motion = motion

    def follow(self, machine: Machine, job: Job, now: float) -> None:
        """One look at a job at `now` [s]."""
        if job.other is not None and not job.other.writing:
            job.other_is_through()
        if job.lease is not None and job.ending is None and job.lease.last - job.held > HOLD_TIMEOUT:
            self._state.hold.end(
                job.lease, "write"
            )  # the button is held, but nothing gets through: the device has let go by itself
        if job.ending is not None:
            self._motion.follow_ending(machine, job, now, job.ending)
        elif job.prepared.command.stop:
            self._follow_stop(machine, job, now)
        elif job.progress.state in (ProgressState.ACCEPTED, ProgressState.UNKNOWN) and job.since is not None:
            self._follow_answer(machine, job, now)
            if not job.progress.over:
                self._follow_feedback(machine, job, now, job.since)

    def _follow_answer(self, machine: Machine, job: Job, now: float) -> None:
        """What the device says about a code that it has taken."""
        answer = job.answer
        if answer is None:
            return
        refusal = refusal_of(machine.item.type, answer)
        if refusal is not None:
            self._state.end(machine, job, *refusal)
        elif answer.state is AnswerState.DONE and job.prepared.feedback is None:
            self._state.end(machine, job, ProgressState.CONFIRMED)
        elif answer.state is not AnswerState.DONE and not job.asking and now - job.last_ask >= ASK_AGAIN:
            self._state.spawn(self._state.delivery.ask(machine, job), f"answer {machine.item.id}")

    def _follow_feedback(self, machine: Machine, job: Job, now: float, since: float) -> None:
        fresh = self._state.readings.read_since(machine, job.prepared.watched, since)
        feedback = self._state.readings.feedback(machine, job.prepared, job.progress.argument) if fresh else None
        fault = self._fault(machine, job) if fresh and not feedback else ""
        verdict = judge(Facts(job.progress.state, now - since, job.progress.limit, feedback, job.before, bool(fault)))
        if verdict is None:
            if not feedback and now - job.last_read >= READ_AGAIN:
                self._sending.read_back(machine, job)
            return
        if job.lease is not None:
            self._motion.judge(machine, job, verdict)
        elif verdict is ProgressState.CONFIRMED:
            self._state.end(machine, job, verdict)
        elif verdict is ProgressState.FAILED:
            self._state.end(machine, job, verdict, "why.fault_appeared", {"label": fault})
        elif verdict is ProgressState.UNKNOWN:
            key = "why.unknown_as_asked" if feedback else job.progress.reason
            self._state.end(machine, job, verdict, key, job.progress.params)
        else:
            self._state.end(machine, job, verdict, *self._not_confirmed(machine, job))
            self._sending.look_again(machine)

    def _not_confirmed(self, machine: Machine, job: Job) -> tuple[str, Mapping[str, object]]:
        """Why the time is up: what the device holds instead of what was written, or just that."""
        point = job.prepared.point
        seconds: dict[str, object] = {"seconds": round(job.progress.limit, 1)}
        if point is None or job.progress.argument is None:
            return "why.not_confirmed", seconds
        value, word = self._state.readings.look(machine)(point.key)
        if not is_good(word) or not isinstance(value, int | float):
            return "why.not_confirmed", seconds
        return "why.value_differs", {**seconds, "value": value, "unit": point.unit, "asked": job.progress.argument}

    def _follow_stop(self, machine: Machine, job: Job, now: float) -> None:
        waited = now - job.asked
        if (
            job.other is None
            and job.since is not None
            and self._state.readings.stands(machine, job.prepared, job.since)
        ):
            self._state.end(machine, job, ProgressState.CONFIRMED)
            if machine.restore:
                self._state.spawn(self._motion.restore(machine), f"restore {machine.item.id}")
            return
        limit = job.progress.limit if job.echoed else STOP_LIMIT
        if waited >= limit:
            self._state.end(
                machine, job, ProgressState.UNCONFIRMED, "why.stop_not_confirmed", {"seconds": round(limit, 1)}
            )
            self._motion.leave(machine)
            self._sending.look_again(machine)
            self._state.alarm_stop(machine.item.id)
        elif waited < STOP_LIMIT and not job.stopping and now - job.last_write >= STOP_REPEAT:
            if job.other is None and job.since is None and job.last_write > float("-inf"):
                job.stop_perhaps_heard(now)
            self._state.spawn(
                self._sending.write_stop(machine, job, job.progress.telegrams, job.prepared), f"stop {machine.item.id}"
            )

    def _fault(self, machine: Machine, job: Job) -> str:
        """Label of an interlock that was lost or of a drive fault that came since the command was written; empty = none."""
        look = self._state.readings.look(machine)
        for alarm in job.quiet:
            if holds(alarm.expression, look):
                return alarm.label
        for condition in job.guarded:
            if interlocks.met(condition, look) is False:
                return condition.label
        return ""
