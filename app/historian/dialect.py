"""What the history's statements need of the database at hand (SQLite), gathered here: all others are SQLAlchemy Core, the same for any.

Which of two rows wins, which road through the tables is taken, functions that not every database has, how full it is. Another database
needs these few anew, and `app/db.py`, which keeps the files.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from operator import itemgetter
from typing import Any

from sqlalchemy import (
    CTE,
    BigInteger,
    ColumnElement,
    Connection,
    CursorResult,
    FromClause,
    Insert,
    Join,
    Table,
    Update,
    and_,
    func,
    insert,
    literal_column,
    update,
)
from sqlalchemy.dialects import sqlite
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.base import ReadOnlyColumnCollection
from sqlalchemy.sql.elements import ClauseElement
from sqlalchemy.sql.functions import FunctionElement

EVERYTHING = 2**62
"""A limit that limits nothing."""


class Statement:
    """A statement of Core that is run often: its SQL is made once, so that it costs no more than text."""

    def __init__(self, element: ClauseElement, *columns: str) -> None:
        """`columns` are those that it inserts or sets, in the order of `rows`; its other values are its `bindparam`s."""
        self.element = element
        self.columns = columns
        self._made: tuple[str, Callable[[Mapping[str, Any]], Any], Mapping[str, Any]] | None = None
        self._in_order = False

    def __call__(self, connection: Connection, /, **given: Any) -> CursorResult[*tuple[Any, ...]]:
        """Run it with these values."""
        sql, pick, fixed = self._made or self._make(connection)
        return connection.exec_driver_sql(sql, pick({**fixed, **given} if fixed else given))

    def rows(self, connection: Connection, rows: Sequence[tuple[Any, ...]]) -> None:
        """Run it once for each of `rows`, which are of `columns`."""
        sql, pick, _ = self._made or self._make(connection)
        if self._in_order:
            connection.exec_driver_sql(sql, list(rows))
        else:
            connection.exec_driver_sql(sql, [pick(dict(zip(self.columns, row, strict=True))) for row in rows])

    def sql(self, connection: Connection) -> str:
        """What the database is told."""
        return (self._made or self._make(connection))[0]

    def _make(self, connection: Connection) -> tuple[str, Callable[[Mapping[str, Any]], Any], Mapping[str, Any]]:
        made: Any = self.element.compile(
            dialect=connection.dialect,
            column_keys=list(self.columns) or None,
        )
        order = tuple(made.positiontup)
        fixed = {name: value for name, value in made.params.items() if value is not None}
        self._in_order = order == self.columns
        self._made = str(made), _picker(order), fixed
        return self._made


def _picker(order: tuple[str, ...]) -> Callable[[Mapping[str, Any]], Any]:
    """What takes the values of these names out of a mapping, as a tuple."""
    if len(order) > 1:
        return itemgetter(*order)
    return lambda given: tuple(given[name] for name in order)


# ---- which of two rows wins -------------------------------------------------------------------------------


def replacing(table: Table) -> Insert:
    """Insert into `table`; what is there already under the same key goes."""
    return insert(table).prefix_with("OR REPLACE")


def adding(table: Table) -> Insert:
    """Insert into `table`; what is there already under the same key stays."""
    return insert(table).prefix_with("OR IGNORE")


def updating(
    table: Table, keys: Collection[str], to: Callable[[ReadOnlyColumnCollection[str, Any]], dict[str, Any]]
) -> Insert:
    """Insert into `table`; what is there already under the same `keys` is set `to` what is made of the new row."""
    new = sqlite.insert(table)
    return new.on_conflict_do_update(index_elements=list(keys), set_=to(new.excluded))


def moving(table: Table) -> Update:
    """Update `table`; what is in the way under a key goes."""
    return update(table).prefix_with("OR REPLACE")


# ---- the road through the tables --------------------------------------------------------------------------


class InOrder(Join):
    """A join in which rows of the left side are read first, whatever the planner thinks of it."""

    inherit_cache = True


def in_order(left: FromClause, right: FromClause, *on: ColumnElement[bool]) -> InOrder:
    """Of each row of `left` those of `right`."""
    return InOrder(left, right, and_(*on))


@compiles(InOrder)
def _join(element: InOrder, compiler: Any, **kw: Any) -> str:
    return str(compiler.visit_join(element, **kw))


@compiles(InOrder, "sqlite")
def _cross_join(element: InOrder, compiler: Any, asfrom: bool = False, from_linter: Any = None, **kw: Any) -> str:
    left = element.left._compiler_dispatch(compiler, asfrom=True, from_linter=from_linter, **kw)
    right = element.right._compiler_dispatch(compiler, asfrom=True, from_linter=from_linter, **kw)
    on = element.onclause
    assert on is not None
    return f"{left} CROSS JOIN {right} ON {on._compiler_dispatch(compiler, from_linter=from_linter, **kw)}"


class unindexed(FunctionElement[Any]):
    """A column of which no index is used: few rows are found otherwise, and then sorted."""

    inherit_cache = True


@compiles(unindexed)
def _plain(element: Any, compiler: Any, **kw: Any) -> str:
    return str(compiler.process(element.clauses, **kw))


@compiles(unindexed, "sqlite")
def _plus(element: Any, compiler: Any, **kw: Any) -> str:
    return f"+{compiler.process(element.clauses, **kw)}"


def materialized(part: CTE) -> CTE:
    """A part that is made once, and not again for each time that it is named."""
    return part.prefix_with("MATERIALIZED")


# ---- functions --------------------------------------------------------------------------------------------


class least(FunctionElement[int]):
    """The least of several values."""

    type = BigInteger()
    inherit_cache = True
    name = "least"


class greatest(FunctionElement[int]):
    """The greatest of several values."""

    type = BigInteger()
    inherit_cache = True
    name = "greatest"


@compiles(least)
@compiles(greatest)
def _function(element: Any, compiler: Any, **kw: Any) -> str:
    return f"{element.name}({compiler.process(element.clauses, **kw)})"


@compiles(least, "sqlite")
def _min(element: Any, compiler: Any, **kw: Any) -> str:
    return f"min({compiler.process(element.clauses, **kw)})"


@compiles(greatest, "sqlite")
def _max(element: Any, compiler: Any, **kw: Any) -> str:
    return f"max({compiler.process(element.clauses, **kw)})"


def holds(column: ColumnElement[Any], part: str | ColumnElement[str]) -> ColumnElement[bool]:
    """Whether `part` is in a text, letter for letter."""
    return func.instr(column, part, type_=BigInteger) > 0


def folded(column: ColumnElement[Any]) -> ColumnElement[str]:
    """A text without upper and lower case; `know_folding` comes before."""
    return func.casefold(column)


def know_folding(connection: Connection) -> None:
    """Let statements of this connection use `folded`: of SQLite itself only ASCII has no case."""
    driver = connection.connection.driver_connection
    assert driver is not None
    driver.create_function("casefold", 1, str.casefold, deterministic=True)


def json_field(column: ColumnElement[Any], name: str) -> ColumnElement[Any]:
    """A field of an object in a column of JSON; an empty text has none."""
    return func.json_extract(func.nullif(column, ""), f"$.{name}")


def is_said(column: ColumnElement[Any]) -> ColumnElement[bool]:
    """Whether a column, number or text, is not empty and not 0."""
    said: ColumnElement[Any] = func.coalesce(column, literal_column("''"))
    return and_(said != literal_column("''"), said != literal_column("0"))


def used(connection: Connection) -> int:
    """Bytes in use, without free pages."""
    pages, free, page = (
        int(connection.exec_driver_sql(f"PRAGMA {name}").scalar_one())
        for name in ("page_count", "freelist_count", "page_size")
    )
    return (pages - free) * page
