"""Every kind of link that a plant file may name has its transport, and knows whether several connections make sense."""

import inspect

import pytest

from app.links.contract import Transport
from app.links.transports import TRANSPORTS
from app.plant.definitions import Link


@pytest.mark.parametrize("kind", TRANSPORTS)
def test_it_can_be_built_unopened_and_has_the_calls_of_the_contract(kind: str) -> None:
    transport = TRANSPORTS[kind](Link("hall", kind, host="127.0.0.1", port="/dev/null"), lambda *_: None)  # type: ignore[arg-type]
    assert transport.connected is False or kind == "memory"
    for name in ("connect", "read", "write", "close"):
        assert inspect.iscoroutinefunction(getattr(transport, name)), (kind, name)
        wanted = list(inspect.signature(getattr(Transport, name)).parameters)[1:]
        assert list(inspect.signature(getattr(transport, name)).parameters)[: len(wanted)] == wanted


def test_a_serial_line_takes_one_connection() -> None:
    assert [kind for kind, transport in TRANSPORTS.items() if not transport.parallel] == ["rtu"]
