"""Which language a person gets, and that a choice never leads away from here."""

from types import SimpleNamespace

import pytest

from app.web.language import COOKIE, PAGE, choose, language_of, local_path

PLANT = ["hr", "en", "de", "cs"]


@pytest.mark.parametrize(
    ("cookie", "accept", "expected"),
    [
        ("", "", "hr"),
        ("de", "cs", "de"),
        ("fr", "cs", "cs"),
        ("", "de-AT,de;q=0.9,en;q=0.8", "de"),
        ("", "fr,en;q=0.4,cs;q=0.7", "cs"),
        ("", "fr-FR,it;q=0.5", "hr"),
        ("", "en;q=0,de;q=0.1", "de"),
        ("", "fr,*;q=0.1", "hr"),
        ("", "en;q=abc,,;;q=1,cs;q=0.2", "cs"),
        ("../en", "EN-us", "en"),
    ],
)
def test_the_choice_then_the_browser_then_the_plant_decides(cookie: str, accept: str, expected: str) -> None:
    assert choose(cookie, accept, PLANT) == expected


class _Asked:
    """A request, as far as `language_of` looks at one."""

    def __init__(self, cookie: str, shown: str) -> None:
        self.headers = {"accept-language": "cs"} | ({PAGE: shown} if shown else {})
        self.cookies = {COOKIE: cookie} if cookie else {}
        self.app = SimpleNamespace(state=SimpleNamespace(view=SimpleNamespace(languages=lambda _: PLANT)))


@pytest.mark.parametrize(
    ("cookie", "shown", "expected"),
    [
        ("de", "en", "en"),
        ("de", "", "de"),
        ("", "hr", "hr"),
        ("de", "fr", "de"),
        ("de", "x" * 999, "de"),
        ("", "", "cs"),
    ],
)
def test_parts_of_an_open_page_are_in_its_language_whatever_was_chosen_since(
    cookie: str, shown: str, expected: str
) -> None:
    assert language_of(_Asked(cookie, shown)) == expected  # type: ignore[arg-type]


def test_a_plant_with_one_language_has_one_language() -> None:
    assert choose("hr", "hr", ["cs"]) == "cs"


@pytest.mark.parametrize("path", ["/", "/equipment/m1?from=2&to=3", "/trends?tags=m1.speed#now", "/a//b"])
def test_a_path_of_ours_is_where_one_comes_back_to(path: str) -> None:
    assert local_path(path) == path


@pytest.mark.parametrize(
    "path",
    ["", "//evil.test/", "https://evil.test", "/\\evil.test", "\\\\evil", "javascript:alert(1)", "/a\r\nX: 1", "evil"],
)
def test_nobody_is_sent_to_another_server(path: str) -> None:
    assert local_path(path) == "/"
