"""A line of the audit says who, what, when and where from, on one line and without secrets."""

import sys
from pathlib import Path

import pytest

from app.access.access import Access
from app.access.audit.line import _escaped, printable
from app.access.audit.search import Filter
from app.clock import ManualClock
from tests.access.conftest import boss


async def test_a_line_says_who_when_where_what_from_and_to(access: Access, clock: ManualClock) -> None:
    seq = await access.audit.record("setpoint", boss(), "m1.frequency", 40.0, 45.5, unit="Hz")
    (line,) = await access.audit.find(Filter())
    assert line.seq == seq
    assert (line.person, line.address, line.object, line.old, line.new) == (
        "ana",
        "10.0.0.1",
        "m1.frequency",
        "40.0",
        "45.5",
    )
    assert (line.time, line.result, line.parameters) == (clock.micros(), "ok", {"unit": "Hz"})


@pytest.mark.parametrize(
    "name", ["password", "new_password", "token", "csrf", "secret_key", "sid", "code", "first_code", "code_reason"]
)
async def test_a_secret_is_never_written(access: Access, data: Path, name: str) -> None:
    await access.audit.record("x", boss(), **{name: "top secret value"})
    (line,) = await access.audit.find(Filter())
    assert line.parameters == {}


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("two\r\nlines", "two\\x0d\\x0alines"),
        ("\x1b[31mred", "\\x1b[31mred"),
        ("a\u2028b", "a\\u2028b"),
        ("\u202egnp.exe", "\\u202egnp.exe"),
        ("\x85\x00", "\\x85\\x00"),
        ("čšž <b>", "čšž <b>"),
        ("x" * 600, "x" * 499 + "…"),
    ],
)
async def test_a_line_stays_one_line(access: Access, text: str, shown: str) -> None:
    assert printable(text) == shown
    await access.audit.record("x", boss(), reason=text)
    (line,) = await access.audit.find(Filter())
    assert line.reason == shown
    assert access.audit.check_now().ok


def test_a_text_that_is_taken_as_it_is_has_no_sign_to_be_escaped() -> None:
    for letter in map(chr, range(sys.maxunicode + 1)):
        assert not letter.isprintable() or _escaped(letter) == letter, ascii(letter)
