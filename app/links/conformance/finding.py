"""What became of one rule, and what a rule says when it is not kept."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from app.errors import DeviceException, NoAnswer

WORDS = (
    "no_answer",
    "one_telegram",
    "same_even",
    "risen_by_two",
    "even",
    "once",
    "unchanged",
    "each_scan",
    "high_word_first",
    "not_falling",
)
"""What stands in braces in a finding; the product text `conform.word.<word>` says it."""


class State(StrEnum):
    """What became of a rule."""

    KEPT = "kept"
    BROKEN = "broken"
    SKIPPED = "skipped"
    """Not judged: another rule must be kept first, there is nothing to judge, or it was not allowed to write."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the report. What was seen and expected is in the notation of registers; what that has no sign for is one of `WORDS` in
    braces."""

    rule: str
    """The sentence of the rule is the product text `conform.rule.<rule>`."""
    state: State
    section: str
    """Heading of docs/registers/<type>.md under which the rule stands; empty = before the first one."""
    seen: str = ""
    expected: str = ""
    why: str = ""
    """Of a skipped one: `needs`, `none`, `nothing`, `own_reason`, `not_asked` or `not_writable` (product text `conform.why.<why>`)."""
    needs: str = ""
    """The rule that must be kept first."""


class Broken(Exception):
    """A rule is not kept: what was `seen` instead of what was `expected`."""

    def __init__(self, seen: str, expected: str) -> None:
        super().__init__(f"{seen}, expected {expected}")
        self.seen, self.expected = seen, expected


class Skipped(Exception):
    """A rule cannot be judged, and why (see `Finding.why`)."""

    def __init__(self, why: str, needs: str = "") -> None:
        super().__init__(f"{why} {needs}".rstrip())
        self.why, self.needs = why, needs


def require(true: object, seen: str, expected: str) -> None:
    """Break the rule unless `true`."""
    if not true:
        raise Broken(seen, expected)


def require_none(wrong: Sequence[tuple[str, str]]) -> None:
    """Break the rule if anything is `wrong`: what was seen, what was expected."""
    if wrong:
        raise Broken(several(seen for seen, _ in wrong), several(dict.fromkeys(expected for _, expected in wrong)))


def at(address: int, word: object) -> str:
    """A register and what is in it: `0x0100 = 4`."""
    return f"0x{address:04X} = {word}"


def span(address: int, words: int) -> str:
    """Registers from the first to the last: `0x0100–0x015F`."""
    return f"0x{address:04X}–0x{address + words - 1:04X}" if words > 1 else f"0x{address:04X}"


def several(parts: Iterable[str], most: int = 4) -> str:
    """The first `most` of `parts`, and a sign that there are more."""
    found = list(parts)
    return ", ".join(found[:most]) + (f", … ({len(found)})" if len(found) > most else "")


def refusal(error: Exception) -> str:
    """An error of the wire in the notation of the report."""
    if isinstance(error, DeviceException):
        return f"exception {error.code:02d}"
    return "{no_answer}" if isinstance(error, NoAnswer) else str(error)
