"""What a person reads when a request was not carried out: the page in their language, a line for htmx, JSON for programs."""

import logging
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


class PlantBroken(Exception):
    """There is no plant to show: its files have mistakes."""


def install(app: FastAPI) -> None:
    """Answer every error of `app` from here."""
    app.add_exception_handler(HTTPException, _http)
    app.add_exception_handler(RequestValidationError, _invalid)
    app.add_exception_handler(Refused, _refused)
    app.add_exception_handler(PlantBroken, _broken_plant)
    app.add_exception_handler(StorageError, _storage)


async def internal(request: Request, reference: str) -> Response:
    """An error of ours: no detail, only the `reference` under which the log has it."""
    try:
        return answer(request, 500, TEXTS[500], reference=reference)
    except Exception:  # the page around it may be what is broken
        log.exception("error page failed id=%s", reference)
        return PlainTextResponse(f"Internal error {reference}", 500)


def answer(request: Request, status: int, key: str, reference: str = "", **params: object) -> Response:
    """The text `key` in the form that the asker can use."""
    view: View = request.app.state.view
    text = view.text(request, key, **params).rstrip()
    if request.url.path.startswith("/api/"):
        more = {"reference": reference} if reference else {}
        more |= {"argument": str(params["argument"])} if "argument" in params else {}
        return JSONResponse({"error": key, "text": text} | more, status)
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
    if request.url.path.startswith("/api/"):
        fields = [{"field": ".".join(map(str, fault["loc"])), "expected": fault["msg"]} for fault in error.errors()]
        return JSONResponse({"error": TEXTS[422], "fields": fields}, 422)
    return answer(request, 422, TEXTS[422])


async def _refused(request: Request, error: Exception) -> Response:
    assert isinstance(error, Refused)
    view: View = request.app.state.view
    written = fmt.parameters(error.params, language_of(request), partial(view.text, request))
    return answer(request, error.status, error.reason, "", **written)


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
