"""How long one waits for an answer: silence is the device's, never our own.

A process that was held up (no processor, a slow disk, a debugger) finds its time-out and the answer that came meanwhile at the same moment,
and the loop of the server hands out the time-out first. What the loop was late is therefore given once more, at most the time-out itself.
"""

import asyncio
from types import TracebackType


def more(due: float, patience: float) -> float:
    """How much longer to wait [s] when the loop comes to what was due at `due` [s] of its clock; 0 where it is in time."""
    return min(max(asyncio.get_running_loop().time() - due, 0.0), patience)


class Patience:
    """`async with Patience(seconds)`: as `asyncio.timeout`, with the time in which the loop was held up given once more.

    Raises:
        TimeoutError: nothing came in that time.
    """

    __slots__ = ("_limit", "_seconds", "_timer")

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._limit = asyncio.timeout(None)

    async def __aenter__(self) -> None:
        await self._limit.__aenter__()
        loop = asyncio.get_running_loop()
        due = loop.time() + self._seconds
        self._timer = loop.call_at(due, lambda: self._limit.reschedule(loop.time() + more(due, self._seconds)))

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._timer.cancel()
        await self._limit.__aexit__(kind, error, trace)
