"""The plant, its machines and their tags as they stand, for programs."""

import asyncio
from datetime import datetime
from typing import TYPE_CHECKING, Annotated

from fastapi import APIRouter, Query, Request
from pydantic import BaseModel, Field

from app import __version__
from app.clock import to_datetime
from app.errors import Refused
from app.plant.definitions import Equipment, Point
from app.tags import quality as q
from app.web.api.lookup import declared, item_of, point_of, runtime_of
from app.web.errors import Wrong
from app.web.guard import allow, check_points, may_read
from app.web.language import language_of

if TYPE_CHECKING:
    from app.runtime import Runtime

router = APIRouter(prefix="/api/v1")

MOST_TAGS = 500
AT_ONCE = 50
"""So many tags are read in one turn of the loop."""


class TagOut(BaseModel):
    """One tag as it stands."""

    name: str = Field(examples=["m1.speed"])
    value: float | str | None = Field(description="None when the quality is bad")
    quality: str = Field(description="good, uncertain or bad, with the reason after a colon", examples=["good"])
    origin: list[str] = Field(description="simulated, forced, substituted, local")
    unit: str
    time: datetime | None = Field(description="when the value was true")
    age: float | None = Field(description="seconds since its source last made sure of it")
    label: str
    text: str = Field(description="of an enumeration, in the language asked for", default="")


class EquipmentOut(BaseModel):
    """One machine."""

    id: str
    type: str
    area: str
    link: str
    unit: int
    label: dict[str, str]
    tags: list[str]
    commands: list[str]
    setpoints: list[str]


class PlantOut(BaseModel):
    """The plant."""

    name: dict[str, str]
    timezone: str
    languages: list[str]
    revision: int
    simulated: bool
    version: str
    equipment: list[EquipmentOut]


@router.get("/plant", dependencies=[allow("view"), declared])
async def plant(request: Request) -> PlantOut:
    """The plant and its machines."""
    runtime = runtime_of(request)
    if runtime.plant is None:
        raise Refused("error.unavailable", 503)
    return PlantOut(
        name=dict(runtime.plant.name),
        timezone=runtime.plant.timezone,
        languages=list(runtime.plant.languages),
        revision=runtime.tags.revision,
        simulated=runtime.simulated,
        version=__version__,
        equipment=[_equipment(runtime, item) for item in runtime.plant.equipment.values()],
    )


@router.get("/equipment/{key}", dependencies=[allow("view"), declared])
async def equipment(request: Request, key: str) -> EquipmentOut:
    """One machine."""
    return _equipment(runtime_of(request), item_of(request, key))


@router.get("/tags", dependencies=[allow("view"), declared])
async def tags(
    request: Request,
    names: Annotated[str, Query(description="comma separated; empty: all", max_length=20_000)] = "",
    prefix: Annotated[str, Query(description="only names that begin so: m1.", max_length=200)] = "",
    after: Annotated[str, Query(description="go on after this name", max_length=200)] = "",
    limit: Annotated[int, Query(ge=1, le=MOST_TAGS)] = MOST_TAGS,
) -> list[TagOut]:
    """Tags as they stand, in order of their names."""
    runtime = runtime_of(request)
    if names.count(",") > MOST_TAGS:
        raise Wrong("query.names", names, f"at most {MOST_TAGS} names")
    wanted = [name.strip() for name in names.split(",") if name.strip()]
    check_points(request, wanted)
    known = (name for name in sorted(runtime.points) if name.startswith(prefix) and name > after)
    found = list[TagOut]()
    for number, name in enumerate(wanted or known, 1):
        if number % AT_ONCE == 0:
            await asyncio.sleep(0)
        if wanted or (name in runtime.points and may_read(request, runtime.points[name])):
            found.append(_tag(request, runtime, point_of(runtime, name, "query.names")))
        if len(found) == limit:
            break
    return found


@router.get("/tags/{name}", dependencies=[allow("view"), declared])
async def tag(request: Request, name: str) -> TagOut:
    """One tag as it stands."""
    runtime = runtime_of(request)
    check_points(request, [name])
    return _tag(request, runtime, point_of(runtime, name))


def _equipment(runtime: "Runtime", item: Equipment) -> EquipmentOut:
    return EquipmentOut(
        id=item.id,
        type=item.type.name,
        area=item.area,
        link=item.link,
        unit=item.unit,
        label=dict(item.label),
        tags=[point.name for point in item.points.values() if point.name in runtime.points],
        commands=list(item.type.commands),
        setpoints=list(item.type.setpoints),
    )


def _tag(request: Request, runtime: "Runtime", point: Point) -> TagOut:
    handle = runtime.tags.handle(point.name)
    sample, age, lang = runtime.tags.read(handle), runtime.tags.age(handle), language_of(request)
    item = runtime.plant.equipment.get(point.equipment) if runtime.plant else None

    def text(key: str) -> str:
        return runtime.texts.of_type(lang, item.type, key) if item else runtime.texts.text(lang, key)

    key = point.texts.get(int(sample.value)) if isinstance(sample.value, int | float) else None
    return TagOut(
        name=point.name,
        value=None if q.is_bad(sample.quality) else sample.value,
        quality=q.name(sample.quality),
        origin=origins(sample.quality),
        unit=point.unit,
        time=to_datetime(sample.time) if sample.time else None,
        age=None if age == float("inf") else round(age, 3),
        label=text(point.label),
        text=text(key) if key else "",
    )


def origins(word: int) -> list[str]:
    """Flags of a quality word by name."""
    return [flag.name.lower() for flag in q.origin(word) if flag.name]
