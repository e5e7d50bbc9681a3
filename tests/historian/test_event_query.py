"""Filters as SQL: what is not asked for does not filter, and values are never part of the text."""

import pytest
from sqlalchemy import create_engine

from app.historian.event_query import counted, filtered


@pytest.mark.parametrize(
    ("equal", "plain", "where", "given"),
    [
        ([], [], "", []),
        ([("code = ?", None)], [], "", []),
        ([("code = ?", 0)], [], "WHERE code = ?", [0]),
        ([("code = ?", 7), ("time < ?", None), ("id = ?", "x")], [], "WHERE code = ? AND id = ?", [7, "x"]),
        ([("code IN (?, ?)", (1, 2)), ("id = ?", 3)], [], "WHERE code IN (?, ?) AND id = ?", [1, 2, 3]),
        ([], ["ended IS NULL"], "WHERE ended IS NULL", []),
        ([("id = ?", "'; DROP TABLE x; --")], ["a = 1"], "WHERE id = ? AND a = 1", ["'; DROP TABLE x; --"]),
    ],
)
def test_only_what_is_asked_for_filters(
    equal: list[tuple[str, object]], plain: list[str], where: str, given: list[object]
) -> None:
    assert filtered(equal, plain) == (where, given)


@pytest.mark.parametrize(("most", "count"), [(100, 40), (40, 40), (39, 39), (1, 1), (0, 0)])
def test_it_counts_up_to_a_limit(most: int, count: int) -> None:
    engine = create_engine("sqlite://")
    with engine.connect() as connection:
        connection.exec_driver_sql("CREATE TABLE x (code INTEGER)")
        connection.exec_driver_sql("INSERT INTO x VALUES (?)", [(n % 2,) for n in range(80)])
        assert counted(connection, "x", *filtered([("code = ?", 1)]), most) == count
    engine.dispose()
