"""The limits of a setting as the rules of the header and the settings use them."""

from app.links.conformance.header import numeric_limits
from app.links.conformance.server import Server
from app.links.conformance.subject import Subject
from tests.links.conformance.servers import data_of


async def nobody(pdu: bytes) -> bytes:
    raise AssertionError("asked")


def test_limits_are_those_of_a_float32_or_none_when_they_follow_from_others() -> None:
    subject = Subject(Server(nobody), data_of("conveyor"))
    assert numeric_limits(subject, "automatic_speed") == (5.0, 100.0)
    low, _ = numeric_limits(subject, "jam_time") or (0.0, 0.0)
    assert low != 0.1 and abs(low - 0.1) < 1e-8
    assert numeric_limits(subject, "shortest") is None and numeric_limits(subject, "state") is None
