"""What happens to sessions reaches the gate, while there is one."""

from typing import Any, cast

from app.commands.gate import Gate
from app.running.session_watch import SessionWatch


class FakeGate:
    """Notes what it is told."""

    def __init__(self) -> None:
        self.heard: list[tuple[str, ...]] = []
        self.control = self

    def session_ended(self, session: str) -> None:
        self.heard.append(("ended", session))

    def session_seen(self, session: str) -> None:
        self.heard.append(("seen", session))

    def rights_changed(self) -> None:
        self.heard.append(("rights",))


def tell(watch: SessionWatch) -> None:
    watch.ended(["a", "b"])
    watch.acted(["c"])
    watch.rights_changed(["d", "e"])


def test_each_session_is_told_and_rights_are_looked_at_anew() -> None:
    gate = FakeGate()
    tell(SessionWatch(lambda: cast(Gate, gate)))
    assert gate.heard[:3] == [("ended", "a"), ("ended", "b"), ("seen", "c")]
    assert set(gate.heard[3:]) == {("rights",)}


def test_without_a_gate_nothing_happens_and_a_new_one_is_told_from_then_on() -> None:
    gates: list[Any] = [None]
    watch = SessionWatch(lambda: gates[-1])
    tell(watch)
    gates.append(FakeGate())
    watch.ended(["z"])
    assert gates[-1].heard == [("ended", "z")]
