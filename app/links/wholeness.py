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
        if plc_map.is_whole(words):
            self._since.pop(address, None)
            if address in self._told:
                self._told.discard(address)
                log.info("image whole link=%s unit=%d address=%#06x", *self._where, address)
            return Seen.WHOLE
        if now - self._since.setdefault(address, now) >= LONGEST and address not in self._told:
            self._told.add(address)
            log.warning(
                "image never whole link=%s unit=%d address=%#06x: its generation is %d at the beginning and %d at the end (%#06x), "
                "expected the same even number",
                *self._where,
                address,
                words[0],
                words[-1],
                address + len(words) - 1,
            )
        return Seen.TORN
