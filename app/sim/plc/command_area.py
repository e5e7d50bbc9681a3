"""The way of a command through a virtual PLC: its words, whether it is new, its answer, and the events that it causes."""

from collections.abc import Callable, Sequence

from app.registers import plc_map
from app.registers.plc_map import Request
from app.sim.plc.answers import Answers
from app.sim.plc.verdict import Verdict

NO_WORDS = (0,) * plc_map.COMMAND_WORDS


class CommandArea:
    """Has every command judged once. The answers are retained; what is on its way is not."""

    def __init__(self, judge: Callable[[Request], Verdict]) -> None:
        """`judge` does what a new command asks, or says why not."""
        self._judge = judge
        self._answers = Answers()
        self._executing = 0
        self._causing: dict[int, int] = {}
        self.words: Sequence[int] = NO_WORDS
        """As they were written last."""

    def take(self, words: Sequence[int], time: int) -> None:
        """A command was written; `time` is now [µs]. One whose id is known is not executed again."""
        self.words = words
        request = plc_map.request_of(words)
        if self._answers.knows(request.id):
            return
        self._executing = request.id
        verdict = self._judge(request)
        self._executing = 0
        self._answers.add(request.id, verdict, time)

    def causes(self, codes: Sequence[int]) -> None:
        """Events with these codes in this scan come from the command that is being executed."""
        self._causing |= dict.fromkeys(codes, self._executing)

    def cause_of(self, code: int) -> int:
        """Id of the command that an event with this code comes from, 0 = none."""
        return self._executing or self._causing.get(code, 0)

    def end_scan(self, time: int) -> None:
        """Ask what has become of the commands that run; `time` is now [µs]."""
        self._answers.watch(time)
        self._causing.clear()

    def fail(self, time: int) -> None:
        """The supply goes: what runs has failed."""
        self._answers.fail(time)

    def start_up(self) -> None:
        """The supply is back: nothing was written."""
        self.words = NO_WORDS

    def clear(self) -> None:
        """As never switched on before."""
        self._answers.clear()

    @property
    def answers(self) -> Sequence[int]:
        """The answers area."""
        return self._answers.words
