"""What a request of a program names: the running plant, its gate, a machine, a point, a stretch of time; and what else it may say."""

import re
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from datetime import datetime
from typing import TYPE_CHECKING, Annotated, Any

from fastapi import Depends, Request
from pydantic import ValidatorFunctionWrapHandler, WrapValidator
from pydantic_core import PydanticCustomError

from app.clock import to_micros
from app.commands.gate import Gate
from app.errors import Refused
from app.plant.definitions import Equipment, Point
from app.web.errors import Wrong
from app.web.event_list import in_order

if TYPE_CHECKING:
    from app.runtime import Runtime


def runtime_of(request: Request) -> "Runtime":
    """The running plant."""
    runtime: Runtime = request.app.state.runtime
    return runtime


def gate_of(request: Request) -> Gate:
    """The gate.

    Raises:
        Refused: 503 while there is no plant.
    """
    gate = runtime_of(request).gate
    if gate is None:
        raise Refused("error.unavailable", 503)
    return gate


def item_of(request: Request, key: str) -> Equipment:
    """The machine `key`, or 404."""
    plant = runtime_of(request).plant
    if plant is None or key not in plant.equipment:
        raise Wrong("path.key", key, "a machine of the plant", 404)
    return plant.equipment[key]


def point_of(runtime: "Runtime", name: str, field: str = "path.name") -> Point:
    """The point `name`, or 404; `field` is where the request names it."""
    if name not in runtime.points:
        raise Wrong(field, name, "a tag of the plant", 404)
    return runtime.points[name]


def one_of(field: str, name: str, known: Collection[str]) -> str:
    """`name`, which is one of `known`, or 404."""
    if name not in known:
        raise Wrong(field, name, f"one of {', '.join(known)}" if known else "none: there is nothing of this kind", 404)
    return name


def _moment(written: Any, read: ValidatorFunctionWrapHandler) -> datetime:
    """A bare number is none: nobody knows whether 20260309 is a date, or seconds. A + that was not escaped arrives as a space."""
    text = re.sub(r"(?<=\d) (?=\d\d:?\d\d$)", "+", str(written)) if "T" in str(written) else str(written)
    try:
        found: datetime = read(text)
        if found.tzinfo is None or re.fullmatch(r"[-+.\d]*", text):
            raise ValueError(text)
    except ValueError as error:
        raise PydanticCustomError("moment", "a time as ISO 8601 with its offset: 2026-03-09T06:00:00Z") from error
    return found


Moment = Annotated[datetime, WrapValidator(_moment)]
"""A time as a program writes it: of one meaning."""


def range_of(request: Request, begin: datetime, end: datetime) -> tuple[int, int]:
    """From and to [µs UTC], or 422 when nothing can be between them."""
    since, until = open_range(request, begin, end)
    assert since is not None and until is not None
    return since, until


def open_range(request: Request, begin: datetime | None, end: datetime | None) -> tuple[int | None, int | None]:
    """As `range_of`, where one may be left out."""
    found = to_micros(begin) if begin else None, to_micros(end) if end else None
    said = request.query_params
    try:
        in_order(request, found, (said.get("from", ""), said.get("to", "")))
    except Refused as error:
        raise Wrong("query.to", said["to"], f"a time after from, which is {said['from']}", said=error) from error
    return found


def only(request: Request, known: Collection[str]) -> None:
    """Refuse parameters of the address that nobody reads, a misspelt one say, and one that is there twice.

    Raises:
        Wrong: 422, names the first of them.
    """
    given = request.query_params
    for name in given:
        if name not in known:
            raise Wrong(f"query.{name}", given[name], f"one of {', '.join(sorted(known))}" if known else "no parameter")
        if len(said := given.getlist(name)) > 1:
            raise Wrong(f"query.{name}", ", ".join(said), "it once")


async def _declared(request: Request) -> None:
    only(request, _told(request))


declared = Depends(_declared)
"""Of a route: its address has the parameters that it declares, and each once."""


def _told(request: Request) -> dict[str, str]:
    """The parameters of an address, and what is told of each."""
    return {one.alias: one.field_info.description or "" for one in request.scope["route"].dependant.query_params}


@contextmanager
def naming(request: Request, more: dict[str, str] | None = None) -> Iterator[None]:
    """Inside, a refused field is told with what it says and what was expected, which the route tells, or `more`."""
    try:
        yield
    except Refused as error:
        name = str(error.params.get("field", ""))
        told = _told(request) | (more or {})
        if name not in told:
            raise
        raise Wrong(f"query.{name}", request.query_params.get(name, ""), told[name], error.status, error) from error
