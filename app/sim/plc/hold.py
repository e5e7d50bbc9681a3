"""The hold-to-run of a virtual PLC: request bits count until the counter stood still for 500 ms."""

from collections.abc import Sequence

from app.registers import plc_map


class HoldRequest:
    """The last request, and how long ago its counter changed."""

    def __init__(self) -> None:
        self.start_up()

    def start_up(self) -> None:
        """Nobody holds a button."""
        self.words: tuple[int, ...] = (0,) * plc_map.HOLD_WORDS
        self._counter, self._age = -1, 1.0

    def take(self, words: Sequence[int]) -> None:
        """A request arrived."""
        if words[1] != self._counter:
            self._age, self._counter = 0.0, words[1]
        self.words = tuple(words)

    def step(self, dt: float) -> None:
        """`dt` [s] pass."""
        self._age += dt

    @property
    def bits(self) -> int:
        """Request bits that count now."""
        return self.words[0] if self._age <= plc_map.HOLD_TIMEOUT + 1e-9 else 0

    @property
    def argument(self) -> float:
        """The number that came with them."""
        return plc_map.real_of(self.words[2] << 16 | self.words[3])
