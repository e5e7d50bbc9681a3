"""What a sequence uses of the virtual device that it is coupled with."""

from collections.abc import Sequence
from typing import Protocol, runtime_checkable


@runtime_checkable
class Machine(Protocol):
    """What a sequence uses of the device it is coupled with."""

    type: str
    signals: Sequence[str]
    """Names that `signal` knows."""
    actions: Sequence[str]
    """Names that `ask` knows."""

    @property
    def takes_actions(self) -> bool:
        """Whether it does what is asked: it is in automatic."""
        ...

    def signal(self, name: str) -> float:
        """The value of a point now."""
        ...

    def ask(self, actions: Sequence[str]) -> None:
        """Ask for actions in the next scan."""
        ...
