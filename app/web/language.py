"""Which language a person gets: the one they chose, else what their browser asks for, else the plant's first."""

import re
from collections.abc import Sequence
from functools import lru_cache
from urllib.parse import quote, urlsplit

from starlette.requests import HTTPConnection, Request

COOKIE = "pogon_lang"
PAGE = "x-page-language"
"""Header by which a page that is open already asks for parts of itself: it stays in one language, also when another one was chosen since
in another window of the same browser, and what is typed there is read in it."""
YEAR = 365 * 86400
"""How long a choice is kept [s]."""
LONGEST_ACCEPT, LONGEST_CODE = 500, 16
"""So much of what a browser asks for is read [characters]."""
NAMES = {"hr": "Hrvatski", "en": "English", "de": "Deutsch", "cs": "Čeština"}
"""Each language in its own words; one that is not here is shown by its code."""
HTML = {"en": "en-GB"}
"""For `<html lang>`, where the code alone would mean another country's dates."""


def language_of(request: HTTPConnection) -> str:
    """The language of this request's answer, among those of the plant."""
    languages: Sequence[str] = request.app.state.view.languages(request)
    accept = request.headers.get("accept-language", "")[:LONGEST_ACCEPT]
    page = request.headers.get(PAGE, "")[:LONGEST_CODE]
    chosen = page if page in languages else request.cookies.get(COOKIE, "")[:LONGEST_CODE]
    return _chosen(chosen, accept, tuple(languages))


def choose(cookie: str, accept: str, languages: Sequence[str]) -> str:
    """`cookie` when the plant has that language, else the best of `accept` (RFC 9110, section 12.5.4), else the first.

    `languages` is not empty.
    """
    if cookie in languages:
        return cookie
    accepted = sorted(_accepted(accept), key=lambda one: -one[1])
    for tag, weight in accepted:
        if weight > 0 and tag == "*":
            return languages[0]
        if weight > 0 and (primary := tag.split("-")[0]) in languages:
            return primary
    return languages[0]


@lru_cache(256)
def _chosen(cookie: str, accept: str, languages: tuple[str, ...]) -> str:
    """`choose`, once for many: an answer of many texts asks for each of them."""
    return choose(cookie, accept, languages)


def place_of(request: Request) -> str:
    """Where a request went, with its query, so that it can be gone to again: signs that mean something in an address are quoted."""
    path, query = quote(request.scope["path"], safe="/:@!$&'()*+,;=~"), request.scope["query_string"].decode("latin-1")
    return path + (f"?{query}" if query else "")


def local_path(path: str) -> str:
    """`path` when it is a path of this server with its query, else `/`: nobody is sent elsewhere by a link of ours."""
    if not path.startswith("/") or path.startswith("//") or re.search(r"[\x00-\x1f\x7f\\]", path):
        return "/"
    try:
        parts = urlsplit(path)
    except ValueError:
        return "/"
    return "/" if parts.scheme or parts.netloc else path


def _accepted(accept: str) -> list[tuple[str, float]]:
    accepted = []
    for part in accept[:LONGEST_ACCEPT].split(","):
        tag, _, parameter = part.strip().lower().partition(";")
        weight = re.fullmatch(r"\s*q\s*=\s*([01](?:\.\d{0,3})?)\s*", parameter)
        if tag.strip() and (weight or not parameter):
            accepted.append((tag.strip(), float(weight[1]) if weight else 1.0))
    return accepted
