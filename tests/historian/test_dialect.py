"""Statements of Core, made into SQL once: same values, same rows, and nothing of SQLite alone outside one file."""

from collections.abc import Iterator
from typing import Any, cast

import pytest
from sqlalchemy import (
    Column,
    Connection,
    Integer,
    MetaData,
    String,
    Table,
    bindparam,
    create_engine,
    insert,
    select,
    update,
)
from sqlalchemy.dialects import postgresql

from app.historian import (
    aggregate,
    event_gaps,
    events,
    hours,
    minutes,
    query,
    record_query,
    records,
    renames,
    sealed,
    store,
)
from app.historian.dialect import Statement, adding, greatest, is_said, json_field, moving, replacing, updating

thing = Table(
    "thing", MetaData(), Column("id", Integer, primary_key=True), Column("name", String), Column("n", Integer)
)
MODULES = (aggregate, event_gaps, events, hours, minutes, query, record_query, records, renames, sealed, store)


@pytest.fixture
def connection() -> Iterator[Connection]:
    engine = create_engine("sqlite://")
    with engine.connect() as connection:
        thing.create(connection)
        connection.execute(insert(thing), [{"id": 1, "name": "a", "n": 1}, {"id": 2, "name": "b", "n": 2}])
        yield connection
    engine.dispose()


def rows(connection: Connection) -> list[tuple[object, ...]]:
    return [tuple(row) for row in connection.execute(select(thing).order_by(thing.c.id))]


def test_a_value_is_never_part_of_the_text(connection: Connection) -> None:
    find = Statement(select(thing.c.id).where(thing.c.name == bindparam("name")))
    assert find(connection, name="b").scalars().all() == [2]
    assert find(connection, name="' OR 1 = 1 --").scalars().all() == []


def test_a_value_that_is_missing_is_a_mistake(connection: Connection) -> None:
    find = Statement(select(thing.c.id).where(thing.c.name == bindparam("name"), thing.c.n == bindparam("n")))
    with pytest.raises(KeyError, match="'n'"):
        find(connection, name="b")


@pytest.mark.parametrize("columns", [("id", "name", "n"), ("n", "id", "name")])
def test_rows_come_in_the_order_that_was_named(connection: Connection, columns: tuple[str, ...]) -> None:
    row = {"id": 3, "name": "c", "n": 30}
    Statement(insert(thing), *columns).rows(connection, [tuple(row[name] for name in columns)])
    assert rows(connection)[-1] == (3, "c", 30)


def test_an_update_takes_its_condition_with_each_row(connection: Connection) -> None:
    change = Statement(update(thing).where(thing.c.id == bindparam("of")), "name", "n", "of")
    change.rows(connection, [("x", 10, 1), ("y", 20, 2)])
    assert rows(connection) == [(1, "x", 10), (2, "y", 20)]


def test_which_of_two_rows_wins_is_said(connection: Connection) -> None:
    Statement(adding(thing), "id", "name", "n")(connection, id=1, name="new", n=9)
    assert rows(connection)[0] == (1, "a", 1)
    Statement(replacing(thing), "id", "name", "n")(connection, id=1, name="new", n=9)
    assert rows(connection)[0] == (1, "new", 9)
    most = updating(thing, ["id"], lambda new: {"n": greatest(thing.c.n, new.n)})
    for n, held in ((5, 9), (11, 11)):
        Statement(most, "id", "name", "n")(connection, id=1, name="not taken", n=n)
        assert rows(connection)[0] == (1, "new", held)
    Statement(moving(thing).where(thing.c.id == bindparam("before")), "id")(connection, before=1, id=2)
    assert rows(connection) == [(2, "new", 11)]


@pytest.mark.parametrize(
    ("text", "said"),
    [("", False), ('{"a": 0}', False), ('{"a": ""}', False), ('{"a": 2.5}', True), ('{"b": 1}', False)],
)
def test_a_field_that_says_nothing_is_not_said(connection: Connection, text: str, said: bool) -> None:
    connection.execute(update(thing).where(thing.c.id == 1).values(name=text))
    found = connection.execute(select(is_said(json_field(thing.c.name, "a"))).where(thing.c.id == 1))
    assert bool(found.scalar_one()) is said


def test_every_statement_can_be_said_to_another_database() -> None:
    """What cannot, and what only SQLite understands, is made in dialect.py."""
    of_modules = [one for module in MODULES for value in vars(module).values() for one in _statements(value)]
    assert len(of_modules) > 70
    to_another: Any = cast(Any, postgresql).dialect()
    for one in of_modules:
        element: Any = one.element
        if getattr(element, "_post_values_clause", None) is not None:  # of `updating`, which is for SQLite
            continue
        sql = str(element.compile(dialect=to_another, column_keys=list(one.columns) or None))
        assert "?" not in sql and "CROSS JOIN" not in sql, sql


def _statements(value: object) -> Iterator[Statement]:
    if isinstance(value, Statement):
        yield value
    elif isinstance(value, dict | list):
        for one in value.values() if isinstance(value, dict) else value:
            yield from _statements(one)
