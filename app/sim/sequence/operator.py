"""What operators asked of a sequence and its block has not seen yet, and the modes that they chose."""

from dataclasses import dataclass, field

from app.blocks.sequence import Signals


@dataclass(slots=True)
class OperatorRequests:
    """Modes stay; requests (`ask`) reach the block in the next scan, once."""

    single: bool = False
    automatic: bool = False
    suspended: bool = False
    held: bool = False
    """The plant has it stand still (`suspend_when`)."""
    advance: bool = False
    """The plant has it go on in single step (`advance_when`)."""
    _asked: set[str] = field(default_factory=set)
    _taken: set[str] = field(default_factory=set)

    def ask(self, request: str) -> None:
        """Ask for start, abort, acknowledge or advance."""
        self._asked.add(request)

    @property
    def start_asked(self) -> bool:
        """Whether a start waits for the next scan."""
        return "start" in self._asked

    def start_automatically(self) -> None:
        """Ask for a start unless the last scan had one: an edge, not a level."""
        if "start" not in self._taken:
            self.ask("start")

    def signals(self, words: tuple[int, ...]) -> Signals:
        """What the block sees in this scan, with the permissive `words`, abort conditions first."""
        self._taken, self._asked = self._asked, set()
        asked = self._taken
        return Signals(
            words[1:],
            words[0],
            start="start" in asked,
            suspend=self.suspended or self.held,
            abort_request="abort" in asked,
            acknowledge="acknowledge" in asked,
            single=self.single,
            advance="advance" in asked or self.advance,
        )
