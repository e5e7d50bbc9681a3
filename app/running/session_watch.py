"""Sessions that end, act or lose rights, as the gate must know it: nobody commands a machine behind whom nobody stands."""

from collections.abc import Callable, Collection

from app.commands.gate import Gate


class SessionWatch:
    """Tells the gate, while there is one."""

    def __init__(self, gate: Callable[[], Gate | None]) -> None:
        self._gate = gate

    def ended(self, sessions: Collection[str]) -> None:
        """These are over."""
        if gate := self._gate():
            for session in sessions:
                gate.session_ended(session)

    def acted(self, sessions: Collection[str]) -> None:
        """In these somebody did something."""
        if gate := self._gate():
            for session in sessions:
                gate.control.session_seen(session)

    def rights_changed(self, sessions: Collection[str]) -> None:
        """The people of these may do other things now."""
        if gate := self._gate():
            gate.rights_changed()
