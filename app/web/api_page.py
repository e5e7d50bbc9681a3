"""The page that describes the interface for other programs: every address, what it asks for, an example for the shell.

All of it is read from the routes themselves (api/description.py) and from the running plant, so it cannot go stale; what is told in English
there is said in the reader's language by the texts `api.told`.
"""

import asyncio
import json
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any
from urllib.parse import quote

import orjson
from fastapi import APIRouter, Request
from fastapi.responses import Response

from app.plant.definitions import Equipment, Plant
from app.web.api.description import ERRORS, SUBJECTS, described
from app.web.guard import allow, permissions
from app.web.pages import plant_of, view_of

router = APIRouter()

EXAMPLES: Mapping[str, Mapping[str, Any]] = {
    "POST /api/v1/alarms/acknowledge": {"occurrences": [17]},
    "POST /api/v1/equipment/{key}/stop": {"id": "stop-0001"},
    "POST /api/v1/equipment/{key}/commands/{command}": {"id": "press-0001", "nonce": "$NONCE"},
    "POST /api/v1/equipment/{key}/setpoints/{setpoint}": {"id": "press-0002", "nonce": "$NONCE", "value": 1.0},
    "POST /api/v1/equipment/{key}/setpoints": {"id": "press-0003", "nonce": "$NONCE", "values": {}},
}
"""Bodies that examples send."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """Something that a request says."""

    name: str
    where: str
    """`path`, `query` or `body`."""
    required: bool
    kind: str
    what: str


@dataclass(frozen=True, slots=True)
class Operation:
    """One method of one address."""

    method: str
    path: str
    anchor: str
    summary: str
    more: str
    permission: str
    parameters: tuple[Parameter, ...]
    errors: tuple[tuple[str, str], ...]
    """Status and what it means."""
    example: str


@router.get("/docs", dependencies=[allow("configure")], include_in_schema=False)
async def docs(request: Request) -> Response:
    """The description for people; programs read `/api/v1/openapi.json`."""
    plant = plant_of(request)
    schema = orjson.loads(await asyncio.to_thread(described))
    asked = permissions(request.app)
    base = str(request.base_url).rstrip("/")
    found = {one.path + one.method: one for one in _operations(schema, asked, plant, base)}
    sections = []
    for subject in SUBJECTS:
        name = subject.__name__.rpartition(".")[2]
        routes = [(route.path, method) for route in subject.router.routes for method in sorted(route.methods or ())]
        sections.append((name, [found[path + method] for path, method in routes if path + method in found]))
    view = view_of(request)

    def told(english: str) -> str:
        key = view.runtime(request).texts.key_of(english, "api.told.")
        return view.text(request, key) if key else english

    return view.page(
        request,
        "pages/api.html",
        title=view.text(request, "api.title"),
        sections=sections,
        base=base,
        up="/tokens",
        told=cache(told),
    )


def _operations(schema: Mapping[str, Any], asked: Mapping[str, str], plant: Plant, base: str) -> Iterator[Operation]:
    for path, methods in schema["paths"].items():
        for method, told in methods.items():
            name = f"{method.upper()} {path}"
            summary, _, more = str(told.get("description", "")).partition("\n\n")
            yield Operation(
                method.upper(),
                path,
                f"{method}-{path.removeprefix('/api/v1/').translate(str.maketrans('/', '-', '{}'))}",
                " ".join(summary.split()),
                " ".join(more.split()),
                asked.get(name, ""),
                (*_parameters(told), *_body(schema, told)),
                tuple((status, ERRORS[int(status)]) for status in sorted(told["responses"]) if int(status) in ERRORS),
                _example(name, told, plant, base),
            )


def _parameters(told: Mapping[str, Any]) -> Iterator[Parameter]:
    for one in told.get("parameters", ()):
        what = one.get("description") or one["schema"].get("description", "")
        yield Parameter(one["name"], one["in"], one.get("required", False), _kind(one["schema"]), what)


def _body(schema: Mapping[str, Any], told: Mapping[str, Any]) -> Iterator[Parameter]:
    content = told.get("requestBody", {}).get("content", {}).get("application/json", {}).get("schema", {})
    model = schema["components"]["schemas"].get(content.get("$ref", "").rpartition("/")[2], {})
    for name, field in model.get("properties", {}).items():
        yield Parameter(name, "body", name in model.get("required", ()), _kind(field), field.get("description", ""))


def _kind(field: Mapping[str, Any]) -> str:
    """The type of a value in a word or two."""
    if "anyOf" in field:
        return " | ".join(kind for one in field["anyOf"] if (kind := _kind(one)) != "null")
    if field.get("type") == "array":
        return f"{_kind(field.get('items', {}))}[]"
    if "additionalProperties" in field and isinstance(field["additionalProperties"], dict):
        return f"{{name: {_kind(field['additionalProperties'])}}}"
    if "enum" in field:
        return " | ".join(str(one) for one in field["enum"])
    return str(field.get("type", "value")) + (f" ({field['format']})" if "format" in field else "")


def _example(name: str, told: Mapping[str, Any], plant: Plant, base: str) -> str:
    """How the shell asks this of the running plant; `$TOKEN` and `$NONCE` are the reader's."""
    method, path = name.split(" ")
    machine = _machine(plant, path)
    places = _places(plant, machine)
    address = base + "/".join(
        quote(places.get(part.strip("{}"), part.strip("{}"))) if part.startswith("{") else part
        for part in path.split("/")
    )
    required = [one["name"] for one in told.get("parameters", ()) if one["in"] == "query" and one.get("required")]
    if required:
        address += "?" + "&".join(f"{one}={quote(places.get(one, one))}" for one in required)
    parts = ["curl", '-H "Authorization: Bearer $TOKEN"']
    if method != "GET":
        parts.append(f"-X {method}")
    if (body := EXAMPLES.get(name)) is not None:
        sent = dict(body)
        if "values" in sent and machine is not None:
            sent["values"] = {key: 1.0 for key in list(machine.type.setpoints)[:2]}
        quoted = json.dumps(sent).replace('"', '\\"')
        parts += ['-H "Content-Type: application/json"', f'-d "{quoted}"']
    return " \\\n  ".join([*parts, shlex.quote(address)])


def _machine(plant: Plant, path: str) -> Equipment | None:
    """One that the example can be about."""
    wanted = "setpoints" if "/setpoints" in path else "commands" if "/commands" in path else ""
    machines = list(plant.equipment.values())
    return next((item for item in machines if not wanted or getattr(item.type, wanted)), next(iter(machines), None))


def _places(plant: Plant, machine: Equipment | None) -> dict[str, str]:
    if machine is None:
        return {}
    kinds = [kind for item in plant.equipment.values() for kind in item.type.records]
    point = next((one.name for one in machine.points.values() if one.history), "")
    found = {
        "key": machine.id,
        "name": point,
        "tags": point,
        "action": "take",
        "command": next(iter(machine.type.commands), ""),
        "setpoint": next(iter(machine.type.setpoints), ""),
        "kind": next(iter(kinds), ""),
        "from": "2026-11-23T06:00:00Z",
        "to": "2026-11-23T07:00:00Z",
    }
    return {name: value for name, value in found.items() if value}
