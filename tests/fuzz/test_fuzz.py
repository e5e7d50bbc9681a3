"""Hostile values into everything that the web house takes, at two plants; `make fuzz` plays more of them, for longer."""

from collections import Counter
from random import Random

import pytest

from tests.fuzz.asking import JSON, Request
from tests.fuzz.drawing import Drawer
from tests.fuzz.house import PASSWORD, PEOPLE
from tests.fuzz.pages import Page, broken_csv, broken_json
from tests.fuzz.trial import explore, known, played, shortened, told
from tests.fuzz.values import CSRF, FRESH, MARK, NONCE, TEXTS
from tests.fuzz.walking import Walker

SWEPT = (("epos", 1, 150), ("feeding", 4, 120))
"""Plant, seed, requests."""


@pytest.mark.sweep(20)
@pytest.mark.parametrize(("plant", "seed", "count"), SWEPT)
def test_nothing_that_is_sent_breaks_a_page(plant: str, seed: int, count: int) -> None:
    verdict = explore(seed, plant, count)
    assert not verdict.faults, "\n\n".join(told(verdict, name) for name in list(verdict.faults)[:3])
    taken = Counter[str]()
    for (route, status), number in verdict.statuses.items():
        taken[route[:4]] += number * (status < 400)
    assert taken["POST"] > count / 15 and taken["GET "] > count, "what everybody is refused tells nothing"


@pytest.mark.sweep(8)
def test_every_route_is_known_by_what_is_served() -> None:
    """Forms, fields and addresses are found, not written down: of each kind of way in there is a request."""
    routes = known("feeding")
    drawer = Drawer(Random(1), routes, tuple(PEOPLE), PASSWORD)
    drawn = [drawer.request() for _ in range(4000)]
    asked = {f"{one.method} {routes.of(one.method, one.address)}" for one in drawn}
    assert {route for route in routes.table if "/static/" not in route} <= asked
    assert {one.who for one in drawn} == set(PEOPLE)
    named = {name for one in drawn if one.address == "/users" for name, _ in one.form}
    assert {"name", "display", "roles"} <= named
    assert {"equipment", "since", "until", "before"} <= routes.fields["/events/list"].keys()
    assert any(one.kind == JSON and b'"nonce": "[nonce]"' in (one.raw or b"") for one in drawn)


def test_what_is_wrong_with_a_page_is_seen() -> None:
    assert Page(f"<p title='&lt;{MARK}&gt;'>&lt;{MARK}&gt; x {MARK}=1</p><a href='/a?b={MARK}'>x</a>").wrong == []
    for text in TEXTS:
        if text.startswith(("<", '">', "'>", "</", "--", "]]")):
            assert Page(f"<p>{text}</p>").wrong, text
    for text in (f'" {MARK}="1', f'"><{MARK}>'):
        assert Page(f'<input value="{text}">').wrong, text
    for page in (
        "<a href='javascript:x'>",
        "<form action='//evil.test'>",
        "<p onclick='x'>",
        "<p style='x'>",
        f"<script>{MARK}()</script>",
    ):
        assert Page(page).wrong, page


def test_what_is_wrong_with_a_file_is_seen() -> None:
    assert not [*broken_csv("\ufeffa;b\r\n-5,5;'=cmd()\r\n-;%\r\n", "/x.csv?locale=hr")]
    assert [*broken_csv("a,b\r\n1,=cmd()\r\n", "/x.csv")] and [*broken_csv('a\tb\r\n"@SUM(A1)"\r\n', "/x.csv")]
    assert [*broken_csv("a,b\r\n1,x;=1+1\r\n", "/x.csv")] and [*broken_csv('a;b\r\n1;"x\n=1"\r\n', "/x.csv?locale=de")]
    assert [*broken_json('{"a": NaN}')] and [*broken_json("")] and not [*broken_json('{"a": null}')]


FORM = """<form id='f' method='post' action='/alarms/shelve'><input type='hidden' name='csrf' value='c'>
<input type='radio' name='minutes' value='5'><input type='radio' name='minutes' value='30' checked>
<input type='checkbox' name='once' value='1' checked><input name='off' value='x' disabled><textarea name='reason'>
one
two</textarea><select name='class'><option value='a'><option value='b' selected></select>
<input type='number' name='n' min='2' max='9'><button name='do' value='add'></button><button name='do' value='cut'></button></form>"""


def test_a_form_is_filled_in_as_a_browser_would() -> None:
    (form,) = Page(FORM).forms
    walker = Walker(Random(1), None, (), PASSWORD)  # type: ignore[arg-type]  # filling in asks no house
    for _ in range(50):
        sent = [(one.name, value) for one, value in walker._filled(form.fields)]
        names = Counter(name for name, _ in sent)
        assert names["minutes"] == names["do"] == names["n"] == 1 and not names["off"]
        assert ("reason", "one\r\ntwo") in sent and dict(sent)["n"] in ("2", "9") and dict(sent)["class"] in "ab"


@pytest.mark.sweep(20)
def test_who_goes_to_a_page_and_fills_in_its_form_gets_past_the_door(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.fuzz.walking.BROKEN", 0.0)
    verdict = explore(3, "feeding", 80, ("definition", "instructor", "lessons"))
    assert not verdict.faults, "\n\n".join(told(verdict, name) for name in list(verdict.faults)[:3])
    posts = Counter({status < 400: 0 for status in (200, 400)})
    for (route, status), number in verdict.statuses.items():
        posts[status < 400] += number * route.startswith("POST")
    assert posts[True] > posts[False] and posts[True] > 20


@pytest.mark.sweep(8)
def test_a_seed_that_fails_is_told_by_the_one_request_that_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    known("epos")
    monkeypatch.setattr("app.web.favourites.Refused", lambda *_, **__: ZeroDivisionError("nobody thought of it"))
    odd = Request("ada", "POST", "/favourites", (("csrf", CSRF), ("at", "elsewhere"), ("on", "1")))
    other = Request("ivo", "GET", "/alarms")
    verdict = played(5, "epos", lambda _: (other, odd, other, other))
    assert set(verdict.faults) == {"ZeroDivisionError favourites.py mark", "POST /favourites: 500"}
    assert shortened(verdict, "POST /favourites: 500") == [odd]
    assert "POST /favourites  csrf=" in told(verdict, "POST /favourites: 500")


@pytest.mark.sweep(20)
def test_the_mistake_that_began_this_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """As it was: one NaN in a setpoint, and nobody could look at the audit any more."""
    known("epos")

    def number(text: str) -> float | None:
        try:
            return float(text)
        except ValueError:
            return None

    monkeypatch.setattr("app.web.audit_words.number_of", number)
    fields = {"argument": "NaN", "csrf": CSRF, "nonce": NONCE, "id": FRESH}
    odd = Request("ada", "POST", "/equipment/a1/setpoint/target", tuple(fields.items()), fragment=True)
    verdict = played(6, "epos", lambda _: (Request("ivo", "GET", "/alarms"), odd))
    late = next(name for name in verdict.faults if name == "after: GET /audit: 500")
    assert shortened(verdict, late) == [odd]
