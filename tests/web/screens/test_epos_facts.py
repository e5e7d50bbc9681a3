"""What an axis says of itself with yes and no is said in words."""

import re

import pytest
from fastapi.testclient import TestClient

from tests.web.people import Staff


@pytest.mark.sweep(8)
@pytest.mark.parametrize(("lang", "words"), [("hr", "da|ne"), ("en", "yes|no"), ("de", "ja|nein"), ("cs", "ano|ne")])
def test_bits_of_the_status_are_words(demo: TestClient, lang: str, words: str) -> None:
    Staff(demo).enter(f"eva_{lang}", "operator")
    demo.cookies.set("pogon_lang", lang)
    page = demo.get("/equipment/a1").text
    for bit in ("zsw1_home_position_set", "zsw1_target_position_reached"):
        told = re.findall(rf'data-tag="a1.{bit}" data-show="([01])"( hidden)?>(\w+)</span>', page)
        assert [(shows, bool(re.fullmatch(words, word))) for shows, _, word in told] == [("1", True), ("0", True)]
        assert [hidden for _, hidden, _ in told].count("") <= 1, "one of them is shown"
