"""What every virtual device is to the bus that carries telegrams to it and to the clock that steps it."""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

from app.errors import DeviceException
from app.sim.training import LineFault

DT = 0.01
"""Step of every virtual device [s]."""
MOST_WAITING = 4096
"""Writes that wait for the next step at most: one that is not stepped for hours, in a plant that is paused, refuses more."""
BUSY = 6
"""Exception of a server that cannot take a request now."""


def check_room(device: str, waiting: int) -> None:
    """Whether a write finds room beside those that wait.

    Raises:
        DeviceException: 06, there are as many as a device keeps.
    """
    if waiting >= MOST_WAITING:
        raise DeviceException(
            BUSY, f"{device}: {waiting} writes wait for its next step, expected fewer than {MOST_WAITING}"
        )


class VirtualDevice(Protocol):
    """A register image with physics and a program behind it. No clock of its own: time is steps x `dt`."""

    type: str
    """Equipment type, e.g. `eura_e800`."""
    dt: float
    """Fixed step [s]."""

    @property
    def line_fault(self) -> LineFault:
        """What the instructor did to the line of this unit; the bus acts on it and counts it down."""
        ...

    def step(self) -> None:
        """Advance by `dt`: writes taken since the last step act first, then the register image is swapped."""
        ...

    def read(self, function: int, address: int, count: int) -> list[int]:
        """`count` words from `address` as of the last step.

        Raises:
            DeviceException: 01 function, 02 address, 03 count.
        """
        ...

    def write(self, function: int, address: int, words: Sequence[int]) -> None:
        """Check `words` now; they act at the next step border.

        Raises:
            DeviceException: 01 function, 02 address, 03 value, 04 cannot be done now, 06 too many wait; nothing of the request acts.
        """
        ...

    def telegram_seen(self) -> None:
        """A valid telegram for this unit was heard; never called for training registers (`training.is_training`)."""
        ...


@runtime_checkable
class Paced(Protocol):
    """A virtual device with a time beside its steps: what waits for a host, and what tells a time, goes by the clock of whoever looks."""

    tempo: float
    """Simulated time per real time, above 0."""

    def stood(self, seconds: float) -> None:
        """So much real time passed without a step."""
        ...


@runtime_checkable
class Permanent(Protocol):
    """A virtual device with a memory that needs no power: it outlives the server, too."""

    @property
    def written(self) -> int:
        """Changes with every write into that memory."""
        ...

    def memory(self) -> dict[str, Any]:
        """What it holds, as JSON holds it; empty = nothing beyond what the plant file says."""
        ...

    def remember(self, memory: Mapping[str, Any]) -> bool:
        """Begin with what `memory` gave in a former run; false where that is not of such a device, which begins as the plant file says."""
        ...
