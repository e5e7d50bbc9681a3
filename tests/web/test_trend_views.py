"""Saved views of trends: whose they are, who may use them, what is written down, and where the page of trends begins."""

import html
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app.access.audit.search import Filter
from app.historian.saved_views import MOST_VIEWS, view_table
from tests.migrated import differences
from tests.web.people import PASSWORD, Staff

HX = {"HX-Request": "true"}
VIEW = "tags=m1.speed,m1.current&span=1h&axis=fit"


@pytest.fixture(scope="module")
def crew(demo: TestClient) -> Iterator[Staff]:
    crew = Staff(demo)
    crew.add("owner", "operator")
    yield crew


@pytest.fixture
def staff(crew: Staff) -> Staff:
    enter(crew, "owner", "operator")
    return crew


def enter(staff: Staff, name: str, *roles: str) -> None:
    staff.enter(name, *roles)
    staff.client.cookies.set("pogon_lang", "en")


def rows(staff: Staff) -> dict[str, tuple[str, int]]:
    """Name → address and number (0: another's) of what the menu offers."""
    text = staff.client.get("/trends?tags=m1.speed").text
    part = text[text.index('id="trend-views"') : text.index("<section", text.index('id="trend-views"'))]
    found: dict[str, tuple[str, int]] = {}
    for item in re.findall(r"<li>(.*?)</li>", part, re.DOTALL):
        link = re.search(r'<a href="([^"]*)">([^<]*)', item)
        number = re.search(r"/trends/views/(\d+)/", item)
        assert link
        found[html.unescape(link[2])] = html.unescape(link[1]), int(number[1]) if number else 0
    return found


def told(answer: object) -> str:
    found = re.search(r'role="alert".*?<span>([^<]*)</span>', answer.text, re.DOTALL)  # type: ignore[attr-defined]
    return html.unescape(found[1]) if found else ""


def save(staff: Staff, name: str, view: str = VIEW) -> int:
    assert told(staff.post("/trends/views", {"name": name, "view": view}, **HX)) == ""
    return rows(staff)[name][1]


def audited(staff: Staff, kind: str) -> list[tuple[str, str, str]]:
    lines = staff.wait(staff.access.audit.find, Filter(kind=f"trend.{kind}"))
    return [(line.person, line.object, line.new) for line in lines]


def test_the_migration_makes_the_table(tmp_path: Path) -> None:
    assert differences(tmp_path, view_table) == []


def test_a_view_is_kept_as_it_is_and_is_ones_own(staff: Staff) -> None:
    number = save(staff, "Morning check")
    assert rows(staff)["Morning check"] == (f"/trends?{VIEW}", number)
    assert staff.client.get(rows(staff)["Morning check"][0]).status_code == 200
    enter(staff, "other", "engineer")
    assert "Morning check" not in rows(staff)


def test_a_shared_view_is_everybodys_to_use_and_its_owners_to_change(staff: Staff) -> None:
    number = save(staff, "For all")
    staff.post(f"/trends/views/{number}/share", {"view": VIEW}, **HX)
    assert ("owner", "For all", "") in audited(staff, "shared")
    enter(staff, "watcher", "viewer")
    assert rows(staff)["For all"] == (f"/trends?{VIEW}", 0)
    for deed in ("rename", "replace", "unshare", "delete"):
        form = {"view": VIEW, "name": "mine now"} if deed == "rename" else {"view": VIEW}
        assert "no such view of yours" in told(staff.post(f"/trends/views/{number}/{deed}", form, **HX)), deed
    enter(staff, "owner")
    staff.post(f"/trends/views/{number}/rename", {"name": "For everybody", "view": VIEW}, **HX)
    assert audited(staff, "renamed")[-1] == ("owner", "For all", "For everybody")
    staff.post(f"/trends/views/{number}/replace", {"view": "tags=m2.speed&span=8h"}, **HX)
    assert rows(staff)["For everybody"][0] == "/trends?tags=m2.speed&span=8h"
    staff.post(f"/trends/views/{number}/delete", {"view": VIEW}, **HX)
    assert "For everybody" not in rows(staff)
    assert [audited(staff, kind)[-1][1] for kind in ("changed", "deleted")] == ["For everybody"] * 2


def test_what_others_use_of_a_deleted_account_goes_to_who_deleted_it(staff: Staff) -> None:
    enter(staff, "leaver", "operator")
    key = staff.add("leaver")
    for name in ("Kiln", "Line 4"):
        staff.post(f"/trends/views/{save(staff, name)}/share", {"view": VIEW}, **HX)
    save(staff, "Private")
    enter(staff, "chief", "admin", "operator")
    save(staff, "kiln")
    page = staff.client.get("/users").text
    place = page.index(f'id="user-{key}"')
    assert "shared with all: 2. Whoever deletes the account gets them." in page[place : page.index("</details>", place)]
    answer = staff.post(f"/users/{key}/delete", {"own_password": PASSWORD})
    assert answer.headers["location"] == "/users?done=deleted"
    own = {name for name, (_, number) in rows(staff).items() if number}
    assert own == {"kiln", "Kiln (leaver)", "Line 4"}, "and what was the leaver's alone is gone"
    lines = staff.wait(staff.access.audit.find, Filter(kind="trend.handed_over"))
    assert {(line.person, line.object, line.old, line.new) for line in lines} == {
        ("chief", "Kiln (leaver)", "leaver", "chief"),
        ("chief", "Line 4", "leaver", "chief"),
    }
    enter(staff, "owner")
    assert rows(staff)["Line 4"] == (f"/trends?{VIEW}", 0)


@pytest.mark.parametrize("number", ["0", str(2**63), "9" * 20])
def test_a_number_that_no_view_can_have_is_told_as_one_that_is_not_there(staff: Staff, number: str) -> None:
    for deed in ("rename", "replace", "unshare", "delete"):
        form = {"view": VIEW, "name": "mine now"} if deed == "rename" else {"view": VIEW}
        assert "no such view of yours" in told(staff.post(f"/trends/views/{number}/{deed}", form, **HX)), deed


def test_what_is_only_ones_own_is_not_written_down_and_can_be_taken_back(staff: Staff) -> None:
    number = save(staff, "Private")
    before = len(audited(staff, "renamed"))
    staff.post(f"/trends/views/{number}/rename", {"name": "Still private", "view": VIEW}, **HX)
    assert len(audited(staff, "renamed")) == before
    staff.post(f"/trends/views/{number}/share", {"view": VIEW}, **HX)
    staff.post(f"/trends/views/{number}/unshare", {"view": VIEW}, **HX)
    assert audited(staff, "unshared")[-1][1] == "Still private"
    enter(staff, "watcher", "viewer")
    assert "Still private" not in rows(staff)


def test_a_viewer_keeps_views_and_does_not_share_them(staff: Staff) -> None:
    enter(staff, "watcher", "viewer")
    number = save(staff, "Mine")
    assert f"/trends/views/{number}/share" not in staff.client.get("/trends?tags=m1.speed").text
    assert staff.post(f"/trends/views/{number}/share", {"view": VIEW}, **HX).status_code == 403


def test_a_guest_has_no_views(staff: Staff) -> None:
    staff.have()
    assert "trend-views" not in staff.client.get("/trends?tags=m1.speed").text
    assert staff.post("/trends/views", {"name": "x", "view": VIEW}, **HX).status_code == 401
    assert staff.post("/trends/last", {"view": VIEW}, **HX).status_code == 401


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("name", "view", "words"),
    [
        ("   ", VIEW, "needs a name of 1 to 60"),
        ("x" * 61, VIEW, "needs a name of 1 to 60"),
        ("a\u202eb", VIEW, "needs a name of 1 to 60"),
        ("a\u202eb", VIEW, "without hidden signs, not “a\\u202eb”"),
        ("taken", VIEW, "You have a view named “TAKEN” already"),
        ("empty", "span=8h", "No tag is named"),
        ("many", "tags=" + ",".join(f"m1.p{i}" for i in range(9)), "Pens: 9. At most 8"),
        ("span", "tags=m1.speed&span=soon", "The span “soon” cannot be read"),
        ("long", "tags=m1.speed&pen=" + "x" * 2000, "at most 2000 characters"),
    ],
)
def test_what_cannot_be_kept_is_refused_in_words(staff: Staff, name: str, view: str, words: str) -> None:
    if name == "taken":
        save(staff, "Taken")
        name = "TAKEN"
    assert words in told(staff.post("/trends/views", {"name": name, "view": view}, **HX))


def test_a_view_keeps_nothing_that_an_address_does_not_say(staff: Staff) -> None:
    save(staff, "Odd", "tags=m1.speed&evil=1&span=1h&span=8h")
    assert rows(staff)["Odd"][0] == "/trends?tags=m1.speed&span=8h"


@pytest.mark.sweep(8)
def test_there_are_fifty_views_and_no_more(staff: Staff) -> None:
    enter(staff, "hoarder", "operator")
    for number in range(MOST_VIEWS):
        staff.post("/trends/views", {"name": f"view {number}", "view": VIEW}, **HX)
    assert "You have 50 views" in told(staff.post("/trends/views", {"name": "one more", "view": VIEW}, **HX))


def test_without_htmx_a_form_leads_back_to_the_view(staff: Staff) -> None:
    answer = staff.client.post(
        "/trends/views",
        data={"csrf": staff.access.form_token(staff.client.cookies["sid"]), "name": "Plain", "view": VIEW},
        headers={"Origin": "http://127.0.0.1:8000"},
        follow_redirects=False,
    )
    assert (answer.status_code, answer.headers["location"]) == (303, f"/trends?{VIEW}")


def test_the_page_begins_with_ones_last_view_live_and_without_what_is_gone(staff: Staff) -> None:
    def begins() -> str:
        return str(staff.client.get("/trends", follow_redirects=False).headers["location"])

    assert begins().startswith("/trends?tags=m1.speed,m2.speed,cr1.hoist_1_speed")
    assert staff.post("/trends/last", {"view": VIEW}, **HX).status_code == 204
    assert begins() == f"/trends?{VIEW}"
    past = "tags=m1.current,gone.tag&from=2026-03-09T06:00:00Z&to=2026-03-09T08:00:00Z&a=2026-03-09T07:00:00Z"
    staff.post("/trends/last", {"view": past}, **HX)
    assert begins() == "/trends?tags=m1.current&span=7200s"
    staff.post("/trends/last", {"view": "tags=gone.tag"}, **HX)
    assert begins().startswith("/trends?tags=m1.speed,m2.speed")
    enter(staff, "other", "engineer")
    assert begins().startswith("/trends?tags=m1.speed,m2.speed"), "another's last view is not mine"
