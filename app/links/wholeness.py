"""Images whose generations never agree: nothing of them can be published, and somebody has to be told why there is no value."""

import logging
from collections.abc import Sequence

from app.links.services import Seen
from app.registers import plc_map

log = logging.getLogger(__name__)

LONGEST = 5.0
"""So long an image may be found torn by chance [s]: each read is tried again at once."""


class Wholeness:
    """Those of one unit."""

    def __init__(self, link: str, unit: int) -> None:
        self._where = link, unit
        self._since: dict[int, float] = {}
        self._told: set[int] = set()

    def judge(self, address: int, words: Sequence[int], now: float) -> Seen:
        """Whether the image at `address`, read at `now` [s, monotonic], is whole. One that is not for long is told once, and when it is."""
        whole = plc_map.is_whole(words)
        self.note(address, "" if whole else generations(words[0], words[-1]), now)
        return Seen.WHOLE if whole else Seen.TORN

    def note(self, address: int, fault: str, now: float) -> None:
        """What is wrong now with the generations of the image, or of some row of the telegram, at `address`; empty = nothing."""
        if not fault:
            self._since.pop(address, None)
            if address in self._told:
                self._told.discard(address)
                log.info("whole again link=%s unit=%d address=%#06x", *self._where, address)
        elif now - self._since.setdefault(address, now) >= LONGEST and address not in self._told:
            self._told.add(address)
            log.warning("never whole link=%s unit=%d address=%#06x: %s", *self._where, address, fault)


def generations(first: int, last: int, what: str = "its generation") -> str:
    """What is wrong with them."""
    return f"{what} is {first} at the beginning and {last} at the end, expected the same even number"
