"""Which language a person gets: the one they chose, else what their browser asks for, else the plant's first."""

import re
from collections.abc import Sequence
from functools import lru_cache
from urllib.parse import urlsplit

from starlette.requests import HTTPConnection

COOKIE = "pogon_lang"
YEAR = 365 * 86400
"""How long a choice is kept [s]."""
LONGEST_WISH, LONGEST_CODE = 500, 16
"""So much of what a browser asks for is read [characters]."""
NAMES = {"hr": "Hrvatski", "en": "English", "de": "Deutsch", "cs": "Čeština"}
"""Each language in its own words; one that is not here is shown by its code."""
HTML = {"en": "en-GB"}
"""For `<html lang>`, where the code alone would mean another country's dates."""


def language_of(request: HTTPConnection) -> str:
    """The language of this request's answer, among those of the plant."""
    languages: Sequence[str] = request.app.state.view.languages(request)
    wish = request.headers.get("accept-language", "")[:LONGEST_WISH]
    return _chosen(request.cookies.get(COOKIE, "")[:LONGEST_CODE], wish, tuple(languages))


def choose(cookie: str, accept: str, languages: Sequence[str]) -> str:
    """`cookie` when the plant has that language, else the best of `accept` (RFC 9110, section 12.5.4), else the first.

    `languages` is not empty.
    """
    if cookie in languages:
        return cookie
    wishes = sorted(_wishes(accept), key=lambda wish: -wish[1])
    for tag, weight in wishes:
        if weight > 0 and tag == "*":
            return languages[0]
        if weight > 0 and (primary := tag.split("-")[0]) in languages:
            return primary
    return languages[0]


@lru_cache(256)
def _chosen(cookie: str, accept: str, languages: tuple[str, ...]) -> str:
    """`choose`, once for many: an answer of many texts asks for each of them."""
    return choose(cookie, accept, languages)


def local_path(wish: str) -> str:
    """`wish` when it is a path of this server with its query, else `/`: nobody is sent elsewhere by a link of ours."""
    if not wish.startswith("/") or wish.startswith("//") or re.search(r"[\x00-\x1f\x7f\\]", wish):
        return "/"
    try:
        parts = urlsplit(wish)
    except ValueError:
        return "/"
    return "/" if parts.scheme or parts.netloc else wish


def _wishes(accept: str) -> list[tuple[str, float]]:
    wishes = []
    for part in accept[:LONGEST_WISH].split(","):
        tag, _, parameter = part.strip().lower().partition(";")
        weight = re.fullmatch(r"\s*q\s*=\s*([01](?:\.\d{0,3})?)\s*", parameter)
        if tag.strip() and (weight or not parameter):
            wishes.append((tag.strip(), float(weight[1]) if weight else 1.0))
    return wishes
