"""What a person reads when a request was not carried out: the page in their language, a line for htmx, JSON for programs."""

import json
import logging
from collections.abc import Mapping, Sequence
from functools import partial

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, PlainTextResponse, Response
from starlette.exceptions import HTTPException

from app.access.audit.line import printable
from app.errors import Refused, StorageError
from app.web import format as fmt
from app.web.language import language_of
from app.web.view import View

log = logging.getLogger(__name__)

TEXTS = {
    400: "error.bad_request",
    401: "error.sign_in",
    403: "error.forbidden",
    404: "error.not_found",
    405: "error.method",
    408: "error.too_slow",
    413: "error.too_large",
    415: "error.media",
    422: "error.invalid",
    500: "error.internal",
    503: "error.unavailable",
}
HINTS = {TEXTS[403]: "error.who_may", TEXTS[404]: "error.nothing_at", TEXTS[500]: "error.runs_on"}
"""What a page says below: what it was about, and what to do now."""
LONGEST_ADDRESS = 120
"""Characters of an address that a page repeats."""
LONGEST_VALUE = 120
"""Characters of a wrong value that an answer repeats."""


class PlantBroken(Exception):
    """There is no plant to show: its files have mistakes."""


class Wrong(Exception):
    """A part of a program's request is wrong: which one (`query.limit`), what it says, what was expected."""

    def __init__(
        self, field: str, value: object, expected: str, status: int = 422, said: Refused | None = None
    ) -> None:
        """`said` is the reason in words, if there is a better one than that of the status."""
        super().__init__(f"{field}: {value}, expected {expected}")
        self.fault = fault(field, value, expected)
        self.said = said or Refused(TEXTS[status], status)


def install(app: FastAPI) -> None:
    """Answer every error of `app` from here."""
    app.add_exception_handler(HTTPException, _http)
    app.add_exception_handler(RequestValidationError, _invalid)
    app.add_exception_handler(Refused, _refused)
    app.add_exception_handler(Wrong, _wrong)
    app.add_exception_handler(PlantBroken, _broken_plant)
    app.add_exception_handler(StorageError, _storage)


async def internal(request: Request, reference: str) -> Response:
    """An error of ours: no detail, only the `reference` under which the log has it."""
    try:
        return answer(request, 500, TEXTS[500], reference=reference)
    except Exception:  # the page around it may be what is broken
        log.exception("error page failed id=%s", reference)
        return PlainTextResponse(f"Internal error {reference}", 500)


def answer(
    request: Request,
    status: int,
    key: str,
    reference: str = "",
    fields: Sequence[Mapping[str, str]] = (),
    back: tuple[str, str] | None = None,
    **params: object,
) -> Response:
    """The text `key` in the form that the asker can use; `fields` are the parts of a program's request that are wrong, `back` is the name
    and address of the page that it is about."""
    view: View = request.app.state.view
    text = view.text(request, key, **params).rstrip()
    if request.url.path.startswith("/api/"):
        more = {"reference": reference} if reference else {}
        more |= {"argument": str(params["argument"])} if "argument" in params else {}
        told = {"fields": fields} if fields else {}
        return JSONResponse({"error": key, "text": text} | more | told, status)
    if request.headers.get("hx-request") == "true":
        return view.fragment(request, "fragments/error.html", status=status, text=text, reference=reference)
    return view.page(
        request,
        "pages/error.html",
        status=status,
        title=view.text(request, "error.title"),
        text=text,
        hint=_hint(request, HINTS[key]) if key in HINTS else "",
        reference=reference,
        back=back,
    )


def _hint(request: Request, key: str) -> str:
    view: View = request.app.state.view
    person = getattr(request.state, "person", None)
    address = printable(request.url.path, LONGEST_ADDRESS + 1)
    return view.text(request, key, address=address, who=person.display if person else view.text(request, "nav.guest"))


async def _http(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    response = answer(request, error.status_code, TEXTS.get(error.status_code, "error.unknown"))
    for name, value in (error.headers or {}).items():
        response.headers[name] = value
    return response


async def _invalid(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    faults = []
    for one in error.errors():
        said = None if one["type"] in WITHOUT_VALUE else one.get("input")
        faults.append(fault(".".join(map(str, one["loc"])), said, one["msg"]))
    return answer(request, 422, TEXTS[422], fields=faults)


WITHOUT_VALUE = frozenset({"missing", "json_invalid"})
"""Faults of which the input is what is around it."""


def fault(field: str, value: object, expected: str) -> dict[str, str]:
    """What is wrong with a part of a request, as an answer tells it: a value is as the request wrote it, `null` where it has none."""
    written = value if isinstance(value, str) else json.dumps(value, default=str)
    return {
        "field": printable(field, LONGEST_VALUE),
        "value": printable(written, LONGEST_VALUE),
        "expected": expected,
    }


async def _wrong(request: Request, error: Exception) -> Response:
    assert isinstance(error, Wrong)
    return _said(request, error.said, [error.fault])


async def _refused(request: Request, error: Exception) -> Response:
    assert isinstance(error, Refused)
    return _said(request, error)


def _said(request: Request, error: Refused, fields: Sequence[Mapping[str, str]] = ()) -> Response:
    view: View = request.app.state.view
    written = fmt.parameters(error.params, language_of(request), partial(view.text, request))
    return answer(request, error.status, error.reason, "", fields, None, **written)


async def _storage(request: Request, error: Exception) -> Response:
    """A database did not do what was asked, and nothing else is wrong: the rest goes on."""
    log.error("storage failed method=%s path=%.200r reason=%s", request.method, request.url.path, error)
    return answer(request, 503, "error.storage")


async def _broken_plant(request: Request, error: Exception) -> Response:
    view: View = request.app.state.view
    if request.url.path.startswith("/api/") or request.headers.get("hx-request") == "true":
        return answer(request, 503, TEXTS[503])
    runtime = view.runtime(request)
    return view.page(
        request,
        "pages/problems.html",
        status=503,
        title=view.text(request, "problem.page"),
        problems=runtime.problems,
        folder=str(runtime.settings.plant),
    )
