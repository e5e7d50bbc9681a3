"""How a refusal is told apart."""

import pytest

from app.errors import Refused


def reason(caught: pytest.ExceptionInfo[Refused]) -> tuple[str, int]:
    return caught.value.reason, caught.value.status
