"""A format holds its limits and nothing beyond."""

from math import isclose

import pytest

from app.errors import TelegramError
from app.profidrive.parameter_access.formats import INTEGERS, LAYOUTS, Format, fits
from app.profidrive.parameter_access.messages import (
    Address,
    Request,
    decode_request,
    encode_request,
)
from tests.profidrive.parameter_access.test_messages import one


@pytest.mark.sweep(8)
@pytest.mark.parametrize("number", range(256))
def test_a_format_holds_its_limits_and_nothing_beyond(number: int) -> None:
    request = bytes((1, 2, 2, 1, 0x10, 1, 0, 1, 0, 0, number, 1)) + b"\xff" * 4
    if number not in LAYOUTS:
        with pytest.raises(TelegramError, match=f"byte 10: format 0x{number:02X}, expected") as caught:
            decode_request(request)
        assert caught.value.refusal == 0x17
        return
    format, code = Format(number), LAYOUTS[Format(number)].code
    if code == "f":
        assert fits(format, 3.4e38) and not any(fits(format, x) for x in (3.5e38, float("inf"), float("nan"), 10**400))
        return
    low, high = INTEGERS[code]
    for value, allowed in ((low - 1, False), (low, True), (high, True), (high + 1, False), (0.5, False)):
        assert fits(format, value) is allowed
        change = Request(1, 2, (Address(1),), (one(format, value),))
        if allowed:
            assert decode_request(encode_request(change)) == change
            assert len(encode_request(change)) % 2 == 0
        else:
            with pytest.raises(TelegramError, match=r"parameter 1\[0\], value 0: "):
                encode_request(change)


def test_floats_keep_32_bits() -> None:
    request = Request(1, 2, (Address(1),), (one(Format.FLOAT32, 0.1),))
    assert isclose(decode_request(encode_request(request)).values[0].values[0], 0.1, rel_tol=1e-7)  # type: ignore[index]
