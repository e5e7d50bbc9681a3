"""What a request of a program names: the running plant, its gate, a machine, a point, a stretch of time."""

from datetime import datetime
from typing import TYPE_CHECKING

from fastapi import HTTPException, Request

from app.clock import to_micros
from app.commands.gate import Gate
from app.errors import Refused
from app.plant.definitions import Equipment, Point

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
        raise HTTPException(404)
    return plant.equipment[key]


def point_of(runtime: "Runtime", name: str) -> Point:
    """The point `name`, or 404."""
    if name not in runtime.points:
        raise HTTPException(404)
    return runtime.points[name]


def range_of(begin: datetime, end: datetime) -> tuple[int, int]:
    """From and to [µs UTC], or 422 when they have no zone or no length."""
    if begin.tzinfo is None or end.tzinfo is None or end <= begin:
        raise HTTPException(422)
    return to_micros(begin), to_micros(end)
