"""The answers of a virtual PLC to its last commands, and the commands that still run."""

from collections.abc import Callable, Sequence

from app.registers import plc_map
from app.registers.plc_map import Answer, AnswerState
from app.sim.plc.verdict import Verdict


class Answers:
    """The last 8 answers, retained, newest first: a known id is not executed again."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """As never switched on before."""
        self._answers: list[Answer] = []
        self._running: dict[int, Callable[[], AnswerState]] = {}

    def knows(self, id: int) -> bool:
        """Whether the command `id` was taken and is remembered."""
        return any(answer.id == id for answer in self._answers)

    @property
    def newest(self) -> Answer:
        """The answer to the command that was taken last; there has been one."""
        return self._answers[0]

    def add(self, id: int, verdict: Verdict, time: int) -> None:
        """The command `id` was taken at `time` [µs]."""
        answer = Answer(id, verdict.state, verdict.reason, verdict.detail & 0xFFFF, time)
        self._answers = [answer, *self._answers][: plc_map.ANSWERS_KEPT]
        if verdict.until:
            self._running[id] = verdict.until

    def watch(self, time: int) -> None:
        """Ask what has become of the commands that run."""
        for id, until in list(self._running.items()):
            if (state := until()) is not AnswerState.RUNNING:
                self._end(id, state, time)

    def fail(self, time: int) -> None:
        """The supply goes: what runs has failed."""
        for id in list(self._running):
            self._end(id, AnswerState.FAILED, time)

    @property
    def words(self) -> Sequence[int]:
        """All places, free ones 0."""
        rows = [word for answer in self._answers for word in plc_map.answer_words(answer)]
        return rows + [0] * (plc_map.ANSWERS_KEPT * plc_map.ANSWER_WORDS - len(rows))

    def _end(self, id: int, state: AnswerState, time: int) -> None:
        self._running.pop(id, None)
        self._answers = [
            Answer(id, state, answer.reason, answer.detail, time) if answer.id == id else answer
            for answer in self._answers
        ]
