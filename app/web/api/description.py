"""The interface for other programs, `/api/v1`: tags, history, alarms, commands, through the same gate and the same roles.

A program sends `Authorization: Bearer <token>` (made on the page of tokens); a signed-in browser may use it, too, with its session and
`X-CSRF-Token`. Numbers are plain JSON numbers in the unit of the tag, times ISO 8601 UTC with µs. The socket is in docs/api.md.
"""

import asyncio
from collections.abc import Mapping, Sequence
from functools import cache

import orjson
from fastapi import APIRouter, Request
from fastapi.openapi.utils import get_openapi
from fastapi.responses import Response
from pydantic import BaseModel, Field

from app import __version__
from app.web.api import alarms, commands, events, history, plant, records
from app.web.guard import allow

SUBJECTS = (plant, history, alarms, commands, records, events)

router = APIRouter(prefix="/api/v1")
ROUTERS: Sequence[APIRouter] = (*(subject.router for subject in SUBJECTS), router)

ERRORS: Mapping[int, str] = {
    400: "the body cannot be read",
    401: "the token is unknown or over, or nobody is signed in",
    403: "the token or the person may not do this",
    404: "there is no such machine, tag, command or setpoint",
    408: "the body did not arrive in time",
    409: "not possible now, or it has to be confirmed first (`why.confirm`: ask again with `confirmed` true)",
    410: "the nonce is unknown, used or older than 10 s",
    413: "the body is too large",
    415: "the body is no JSON in utf-8",
    422: "a value is missing, out of range or not understood",
    423: "somebody else has the control of this machine",
    429: "too many commands in a short time",
    503: "the device is silent, or the server cannot do it now",
}
"""What an answer other than the good one means."""


class ErrorOut(BaseModel):
    """Why something was not done."""

    error: str = Field(description="key of the reason", examples=["why.confirm"])
    text: str = Field("", description="in the language of the request")
    argument: str = Field("", description="which argument of a command is wrong")
    reference: str = Field("", description="under which the log of the server has an error of ours")
    fields: list[dict[str, str]] = Field(
        [], description="parts of the request that are wrong: field (`query.limit`), value, expected"
    )


@router.get("/openapi.json", dependencies=[allow("configure")], include_in_schema=False)
async def openapi(request: Request) -> Response:
    """The description of this interface."""
    return Response(await asyncio.to_thread(described), media_type="application/json")


@cache
def described() -> bytes:
    """The description as JSON, made once: it takes long."""
    routes = [route for subject in SUBJECTS for route in subject.router.routes]
    schema = get_openapi(title="Pogon", version=__version__, description=__doc__, routes=routes)
    schema["components"]["securitySchemes"] = {"token": {"type": "http", "scheme": "bearer"}}
    schema["security"] = [{"token": []}]
    schema["components"]["schemas"]["ErrorOut"] = ErrorOut.model_json_schema()
    content = {"application/json": {"schema": {"$ref": "#/components/schemas/ErrorOut"}}}
    for path, methods in schema["paths"].items():
        for method, operation in methods.items():
            for status in errors_of(path, method):
                operation["responses"][str(status)] = {"description": ERRORS[status], "content": content}
    return orjson.dumps(schema)


def errors_of(path: str, method: str) -> list[int]:
    """The errors that an operation of the interface may answer with."""
    if method == "get":
        return [401, 403, *([404] if "{" in path or path.endswith(("/tags", "/history")) else []), 422, 503]
    ordering = "/equipment/" in path
    return [400, 401, 403, 408, *([404, 409, 410, 423] if ordering else []), 413, 415, 422, 429, 503]
