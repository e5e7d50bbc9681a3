"""The page "Storage": how full the history is, how fast it grows, when its quota is reached, and whether all of it is written."""

from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import Response

from app.historian.recorder import Recorder
from app.historian.upkeep import WARN_AT
from app.web import format as fmt
from app.web.guard import allow
from app.web.language import language_of
from app.web.signin import moment, view_of, zone_of

router = APIRouter()

MB = 1_000_000
GB = 1_000_000_000


@router.get("/storage", dependencies=[allow("diagnose")])
async def storage(request: Request) -> Response:
    """The page; its figures renew themselves."""
    view = view_of(request)
    return view.page(
        request,
        "pages/storage.html",
        title=view.text(request, "storage.title"),
        kind="storage",
        **_figures(request, view.runtime(request).recorder),
    )


@router.get("/storage/figures", dependencies=[allow("diagnose")])
async def figures(request: Request) -> Response:
    """The figures alone."""
    view = view_of(request)
    return view.fragment(request, "fragments/storage.html", **_figures(request, view.runtime(request).recorder))


def _figures(request: Request, recorder: Recorder) -> dict[str, Any]:
    lang, size = language_of(request), recorder.upkeep.size
    text = view_of(request).text
    unknown = text(request, "storage.not_known")

    def amount(value: float | None) -> str:
        if value is None:
            return unknown
        return fmt.quantity(value / GB, 2, "GB", lang) if value >= GB else fmt.quantity(value / MB, 1, "MB", lang)

    return {
        "full": recorder.full,
        "reason": recorder.error,
        "warning": recorder.upkeep.fill >= WARN_AT,
        "part": min(100.0, round(100 * recorder.upkeep.fill, 1)),
        "fill": fmt.percent(100 * recorder.upkeep.fill, 1, lang) if size else unknown,
        "rows": [
            ("used", amount(size.used if size else None)),
            ("quota", amount(recorder.upkeep.quota)),
            ("keep", fmt.quantity(recorder.upkeep.keep_days, fmt.shortest(recorder.upkeep.keep_days, 1), "d", lang)),
            ("oldest", moment(request, size.oldest) if size and size.oldest else unknown),
            ("growth", _per_day(amount, recorder.upkeep.growth, unknown)),
            ("written", _per_day(amount, recorder.upkeep.written.per_day, unknown)),
            ("rows_today", fmt.number(size.rows_today, 0, lang) if size else unknown),
            ("rows_per_second", fmt.quantity(recorder.rows_per_second, 1, "1/s", lang)),
            ("reached", _reached(request, recorder, unknown)),
            ("free", amount(size.free if size else None)),
            ("dropped", fmt.number(recorder.dropped, 0, lang)),
        ],
        "measured": moment(request, recorder.upkeep.measured) if recorder.upkeep.measured else unknown,
    }


def _per_day(amount: Any, growth: float | None, unknown: str) -> str:
    return unknown if growth is None else f"{amount(growth)}/d"


def _reached(request: Request, recorder: Recorder, unknown: str) -> str:
    """When the quota is reached at today's rate: the day, and in how many."""
    days, text = recorder.upkeep.quota_days, view_of(request).text
    if days is None:
        return unknown
    if days <= 0:
        return text(request, "storage.now")
    if days > recorder.upkeep.keep_days:
        return text(request, "storage.never", days=fmt.number(recorder.upkeep.keep_days, 0, language_of(request)))
    lang = language_of(request)
    return text(
        request,
        "storage.on_day",
        day=fmt.date(recorder.upkeep.measured + int(days * 86_400e6), zone_of(request), lang),
        days=fmt.number(days, 1 if days < 10 else 0, lang),
    )
