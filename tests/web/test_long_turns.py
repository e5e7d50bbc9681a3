"""What one turn of the loop does for a hostile request of the interface for programs is bounded, counted in calls of functions."""

from collections.abc import Iterator

import pytest

from app.settings import Settings
from tests.virtual import house
from tests.web.people import Staff
from tests.web.work import Work, counted

MOST = 150_000
"""Calls in one turn. A bare loop does some ten million in a second: 15 ms."""
PIECES = (",", "a,", "m1.frequency,", "m1.f113,", "q=0.1,", ";q=1,", "*,", "hr-HR,", "9", " ")


@pytest.fixture(scope="module")
def staff(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    with house(Settings(data=tmp_path_factory.mktemp("turns") / "data")) as client:
        client.pass_time(1)
        staff = Staff(client)
        staff.enter("ada", "admin", "engineer", "operator")
        client.get("/api/v1/tags")
        yield staff


@pytest.fixture
def work() -> Iterator[Work]:
    with counted() as work:
        yield work


@pytest.mark.sweep(8)
@pytest.mark.parametrize("piece", PIECES)
def test_names_of_tags_cost_no_long_turn(staff: Staff, work: Work, piece: str) -> None:
    for size in (2_000, 8_000, 19_999):
        staff.client.get("/api/v1/tags?names=" + (piece * size)[:size].replace(" ", "+"))
    assert 0 < work.most < MOST


@pytest.mark.sweep(8)
@pytest.mark.parametrize("head", ["Accept-Language", "Cookie", "Authorization"])
@pytest.mark.parametrize("piece", PIECES)
def test_heads_cost_no_long_turn(staff: Staff, work: Work, piece: str, head: str) -> None:
    kept = staff.client.cookies.get("sid")
    value = (piece * 8000)[:8000].strip() or "x"
    if head == "Cookie":
        value = f"sid={kept}; pogon_lang={value}"
    staff.client.get("/api/v1/tags", headers={head: value})
    assert 0 < work.most < MOST
