"""Signing in as a browser does: first account, sheet, forced change, own account, people, tokens, audit."""

import csv
import io
import re
from collections.abc import Iterator
from datetime import UTC, datetime
from html.parser import HTMLParser

import pytest

from app.access.audit.line import entry_at
from app.access.audit.search import Filter
from app.access.sessions import hash_of
from app.clock import to_micros
from app.errors import StorageError
from app.settings import Settings
from tests.virtual import house
from tests.web.conftest import Start
from tests.web.people import BOSS, HOST, PASSWORD, Staff

PAYLOADS = [
    "<script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "javascript:alert(1)",
    "{{7*7}}${7*7}",
    "<svg/onload=alert(1)>",
    "</textarea><b>",
    "a\u2028b",
    "\u202eevil",
]


@pytest.fixture(scope="module")
def staff(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    with house(Settings(data=tmp_path_factory.mktemp("signin") / "data")) as client:
        made = Staff(client)
        made.add("chief", "admin", "engineer", "operator")
        yield made


def sid_of(answer: object) -> str:
    cookies = [line for line in answer.headers.get_list("set-cookie") if line.startswith("sid=")]  # type: ignore[attr-defined]
    return re.match(r"sid=([\w-]{43});", cookies[0])[1] if cookies else ""  # type: ignore[index]


# ---- the first account ------------------------------------------------------------------------------------


@pytest.mark.sweep(8)
def test_a_newcomer_sees_the_plant_types_the_code_and_may_do_everything(start: Start) -> None:
    client = start()
    staff = Staff(client)
    assert client.get("/").status_code == 200
    assert client.get("/signin").headers["location"] == "/first"
    sheet = client.get("/first").text
    code = staff.access.first_code.text
    assert code and code not in sheet
    form = {"code": code.lower(), "name": "ana", "display": "Ana Kos", "password": PASSWORD, "again": PASSWORD}
    wrong = staff.post("/first", {**form, "code": "AAAA-AAAA-AAAA-AAAA"})
    assert wrong.status_code == 401
    assert PASSWORD not in wrong.text and "AAAA-AAAA" not in wrong.text
    for mistake in ({"again": "something else"}, {"password": "short", "again": "short"}, {"name": "a b"}):
        refused = staff.post("/first", {**form, **mistake})
        assert refused.status_code == 422 and f'value="{code.lower()}"' in refused.text  # not to be typed again
        assert PASSWORD not in refused.text
    answer = staff.post("/first", form)
    assert (answer.status_code, answer.headers["location"]) == (303, "/welcome")
    staff.have(sid_of(answer))
    assert client.get("/users").status_code == 200
    assert client.get("/first").headers["location"] == "/signin"
    assert staff.post("/first", form).status_code == 409


@pytest.mark.sweep(8)
def test_an_account_of_the_terminal_closes_the_first_page_too(start: Start) -> None:
    client = start()
    staff = Staff(client)
    staff.access.people.add_now(BOSS, [("ana", "Ana", ["admin"])])
    assert client.get("/first").headers["location"] == "/signin"
    assert client.get("/signin").status_code == 200


# ---- the sheet --------------------------------------------------------------------------------------------


def test_signing_in_leads_back_and_gives_a_new_session(staff: Staff) -> None:
    staff.have()
    assert staff.client.get("/signin?next=/equipment/m1").status_code == 200
    answer = staff.post("/signin", {"name": "chief", "password": PASSWORD, "next": "/equipment/m1"})
    assert (answer.status_code, answer.headers["location"]) == (303, "/equipment/m1")
    cookie = next(line for line in answer.headers.get_list("set-cookie") if line.startswith("sid="))
    assert {"HttpOnly", "SameSite=strict", "Path=/"} <= set(cookie.split("; "))
    assert "Max-Age" not in cookie
    sid = sid_of(answer)
    staff.have(sid)
    page = staff.client.get("/")
    assert sid not in page.text and hash_of(sid) not in page.text
    again = staff.post("/signin", {"name": "chief", "password": PASSWORD})
    assert sid_of(again) != sid
    staff.have(sid)
    assert staff.client.get("/account").status_code == 303


def test_under_tls_the_cookie_belongs_to_this_host_alone(start: Start) -> None:
    client = start()
    client.base_url = HOST.replace("http:", "https:")
    staff = Staff(client)
    staff.add("ana", "operator")
    client.cookies.set("__Host-pre", "a" * 22)
    form = {"name": "ana", "password": PASSWORD, "csrf": staff.access.form_token("a" * 22)}
    answer = client.post("/signin", data=form, headers={"Origin": HOST.replace("http:", "https:")})
    cookie = next(line for line in answer.headers.get_list("set-cookie") if "sid=" in line)
    assert cookie.startswith("__Host-sid=")
    assert {"Secure", "HttpOnly", "SameSite=strict", "Path=/"} <= set(cookie.split("; "))
    assert "Domain" not in cookie


@pytest.mark.parametrize(
    ("name", "password"), [("chief", "wrong"), ("nobody", "wrong"), ("chief", " "), ("<b>", "' OR 1=1--")]
)
def test_a_failure_says_the_same_for_every_cause_and_keeps_the_plant_visible(
    staff: Staff, name: str, password: str
) -> None:
    staff.have()
    staff.access.throttle.clear("chief")
    answer = staff.post("/signin", {"name": name, "password": password})
    assert answer.status_code == 401
    assert re.findall(r'role="alert" hx-ignore>.*?<span>(.*?)</span>', answer.text) == [
        "Prijava nije uspjela ili je račun zaključan."
    ]
    assert 'data-tag="m1.speed"' in answer.text
    assert sid_of(answer) == ""


@pytest.mark.parametrize(
    "data",
    [
        {"name": "chief"},
        {"password": PASSWORD},
        {"name": "chief", "password[]": PASSWORD},
        {"name": "chief", "password": [PASSWORD, PASSWORD]},
        {"name": ["chief", "ana"], "password": PASSWORD},
        {"name": "chief", "password": PASSWORD, "role": "admin"},
        {"name": "chief", "password": PASSWORD, "id": "1"},
    ],
)
def test_a_form_with_missing_doubled_or_foreign_fields_is_refused(staff: Staff, data: dict[str, object]) -> None:
    staff.have()
    answer = staff.post("/signin", data)
    assert answer.status_code == 422
    assert sid_of(answer) == ""


def test_a_sign_in_from_another_site_is_refused(staff: Staff) -> None:
    staff.have()
    form = {"name": "chief", "password": PASSWORD}
    assert staff.client.post("/signin", data=form, headers={"Origin": HOST}).status_code == 403
    assert staff.post("/signin", form, **{"Sec-Fetch-Site": "cross-site"}).status_code == 403


@pytest.mark.parametrize(
    "next_",
    [
        "//evil.example",
        "/\\evil.example",
        "https:evil.example",
        "evil",
        "/a\r\nSet-Cookie: x=1",
        "/\tevil",
        "",
    ],
)
def test_nobody_is_led_to_another_site(staff: Staff, next_: str) -> None:
    staff.have()
    answer = staff.post("/signin", {"name": "chief", "password": PASSWORD, "next": next_})
    assert answer.headers["location"] == "/"
    staff.have()
    sheet = staff.client.get("/signin", params={"next": next_}).text
    form = sheet[sheet.index('action="/signin"') :]
    assert re.findall(r'name="next" value="([^"]*)"', form) == ["/"]
    assert [link for link in re.findall(r'href="([^"]*)"', sheet) if not re.match(r"/(?![/\\])|#", link)] == []


def test_signing_out_ends_the_session_on_the_server(staff: Staff) -> None:
    sid = staff.enter("chief", "admin", "engineer", "operator")
    answer = staff.post("/signout")
    assert answer.headers["clear-site-data"] == '"cache", "storage"'
    staff.have(sid)
    assert staff.client.get("/account").status_code == 303


def test_signing_out_works_while_the_disk_is_full_and_is_written_when_it_has_room(staff: Staff) -> None:
    sid = staff.enter("chief", "admin", "engineer", "operator")
    database = staff.access.sessions._db
    full = "CREATE TRIGGER full BEFORE DELETE ON session BEGIN SELECT RAISE(ABORT, 'database or disk is full'); END"
    staff.wait(database.write, lambda connection: connection.exec_driver_sql(full) and None)
    answer = staff.post("/signout")
    assert answer.status_code == 303 and answer.headers["clear-site-data"] == '"cache", "storage"'
    staff.have(sid)
    assert staff.client.get("/account").status_code == 303
    assert staff.post("/equipment/m1/token/take").status_code == 401
    with pytest.raises(StorageError):
        staff.wait(staff.access.sessions.write_ends)
    staff.wait(database.write, lambda connection: connection.exec_driver_sql("DROP TRIGGER full") and None)
    staff.wait(staff.access.sessions.write_ends)
    query = "SELECT count(*) FROM session WHERE id_hash = ?"
    assert (
        staff.wait(database.read, lambda connection: connection.exec_driver_sql(query, (hash_of(sid),)).scalar()) == 0
    )
    assert staff.client.get("/account").status_code == 303


def test_on_a_full_disk_people_come_in_stop_and_read_their_language(staff: Staff) -> None:
    staff.add("guard", "operator")
    staff.have()
    database = staff.access.sessions._db
    for table, deed in (("session", "INSERT"), ("audit", "INSERT"), ("person", "UPDATE")):
        full = f"CREATE TRIGGER full_{table} BEFORE {deed} ON {table} BEGIN SELECT RAISE(ABORT, 'disk is full'); END"
        staff.wait(database.write, lambda connection: connection.exec_driver_sql(full) and None)  # noqa: B023
    try:
        answer = staff.post("/signin", {"name": "guard", "password": PASSWORD, "next": "/equipment/m1"})
        assert (answer.status_code, answer.headers["location"]) == (303, "/equipment/m1")
        staff.have(sid_of(answer))
        assert staff.client.get("/equipment/m1").status_code == 200
        assert staff.post("/equipment/m1/stop").status_code == 303
        for path, choice in (("/language", "de"), ("/theme", "dark")):
            answer = staff.post(path, {"to": choice, "next": "/"})
            assert answer.status_code == 303 and f"={choice};" in answer.headers["set-cookie"]
    finally:
        for table in ("session", "audit", "person"):
            off = f"DROP TRIGGER full_{table}"
            staff.wait(database.write, lambda connection: connection.exec_driver_sql(off) and None)  # noqa: B023
    staff.wait(staff.access.sessions.standing.write)
    staff.wait(staff.access.audit.replay)
    assert staff.client.get("/account").status_code == 200
    kinds = [line.kind for line in staff.wait(staff.access.audit.find, Filter(person="guard"))]
    assert {"signin.ok", "command.stop"} & set(kinds) >= {"signin.ok"}, kinds


def test_an_idle_person_signs_in_again_where_they_were(staff: Staff, monkeypatch: pytest.MonkeyPatch) -> None:
    staff.enter("idler", "operator")
    monkeypatch.setattr("app.access.session_person.IDLE_AFTER", 0.0)
    assert staff.client.get("/").status_code == 200
    sheet = staff.client.get("/signin?next=/equipment/m1").text
    assert 'value="idler"' in sheet
    assert staff.post("/session/active").headers["x-idle"] == "1"


# ---- language and colours go with the person -----------------------------------------------------------------


def test_language_and_colours_follow_the_person_to_another_browser(staff: Staff) -> None:
    staff.enter("zora", "operator")
    staff.post("/language", {"to": "cs"})
    staff.post("/theme", {"to": "dark"})
    staff.have()
    answer = staff.post("/signin", {"name": "zora", "password": PASSWORD})
    set_ = " ".join(answer.headers.get_list("set-cookie"))
    assert "pogon_lang=cs" in set_ and "pogon_theme=dark" in set_


# ---- an initial password ------------------------------------------------------------------------------------


def test_an_initial_password_leads_to_its_change_and_nowhere_else(staff: Staff) -> None:
    staff.enter("chief", "admin", "engineer", "operator")
    page = staff.post(
        "/users", {"name": "marko", "display": "Marko Babić", "roles": ["operator"], "own_password": PASSWORD}
    )
    initial = re.search(r'u-secret" hx-ignore>([^<]{20})<', page.text)
    assert page.status_code == 200 and initial
    assert initial[1] not in staff.client.get("/users").text
    staff.have()
    answer = staff.post("/signin", {"name": "marko", "password": initial[1], "next": "/equipment/m1"})
    assert answer.headers["location"] == "/account"
    staff.have(sid_of(answer))
    assert staff.client.get("/").headers["location"] == "/account"
    assert staff.client.get("/", headers={"HX-Request": "true"}).status_code == 403
    form = {"current": initial[1], "password": "kratka", "again": "kratka"}
    assert staff.post("/account/password", form).status_code == 422
    form |= {"password": "sedam zelenih biciklista", "again": "sedam zelenih biciklista"}
    answer = staff.post("/account/password", form)
    assert answer.status_code == 303
    staff.have(sid_of(answer))
    assert staff.client.get("/").status_code == 200


# ---- people -------------------------------------------------------------------------------------------------


@pytest.mark.sweep(8)
def test_people_are_changed_only_with_ones_own_password(staff: Staff) -> None:
    key = staff.add("victim", "operator")
    staff.enter("chief", "admin", "engineer", "operator")
    for path, data in (
        (f"/users/{key}/roles", {"roles": ["admin"]}),
        (f"/users/{key}/name", {"display": "X"}),
        (f"/users/{key}/disable", {}),
        (f"/users/{key}/delete", {}),
        (f"/users/{key}/password", {}),
        ("/users", {"name": "eve", "roles": ["admin"]}),
        ("/tokens", {"name": "x", "days": "7", "permissions": ["view"]}),
    ):
        staff.access.throttle.clear("chief")
        assert staff.post(path, {**data, "own_password": "wrong"}).status_code == 401, path
    staff.access.throttle.clear("chief")
    account = staff.wait(staff.access.people.get, key)
    assert (account.roles, account.disabled) == ({"operator"}, False)


def test_an_administrator_changes_roles_names_and_state(staff: Staff) -> None:
    key = staff.add("jan", "operator")
    staff.enter("chief", "admin", "engineer", "operator")
    for path, data, done in (
        ("roles", {"roles": ["viewer", "engineer"]}, "roles"),
        ("name", {"display": "Jan Novák"}, "renamed"),
        ("disable", {}, "disabled"),
        ("enable", {}, "enabled"),
    ):
        answer = staff.post(f"/users/{key}/{path}", {**data, "own_password": PASSWORD})
        assert answer.headers["location"] == f"/users?done={done}"
        assert staff.client.get(answer.headers["location"]).status_code == 200
    account = staff.wait(staff.access.people.get, key)
    assert (account.roles, account.display, account.disabled) == ({"viewer", "engineer"}, "Jan Novák", False)
    kinds = [line.kind for line in staff.wait(staff.access.audit.find, Filter(object="jan"))]
    assert {"person.roles", "person.renamed", "person.disabled", "person.enabled"} <= set(kinds)
    assert staff.post(f"/users/{key}/delete", {"own_password": PASSWORD}).status_code == 303
    assert "Jan Novák" not in staff.client.get("/users").text


@pytest.mark.parametrize("field", ["role", "id", "is_active", "password", "must_change", "disabled"])
def test_extra_fields_give_nobody_rights(staff: Staff, field: str) -> None:
    staff.enter("mallory", "operator")
    form = {
        "current": PASSWORD,
        "password": "sedam zelenih biciklista",
        "again": "sedam zelenih biciklista",
        field: ["admin", "x"],
    }
    assert staff.post("/account/password", form).status_code == 422
    assert staff.wait(staff.access.people.get, staff.add("mallory")).roles == {"operator"}


def test_sessions_can_be_ended_by_their_owner_and_only_by_them(staff: Staff) -> None:
    other = staff.enter("first-one", "operator")
    mine = staff.enter("second-one", "operator")
    assert staff.post("/account/sessions/end", {"session": hash_of(other)[:16]}).status_code == 404
    assert staff.post("/account/sessions/end", {"session": hash_of(mine)[:16]}).status_code == 303
    assert staff.client.get("/account").status_code == 303
    staff.have(other)
    assert staff.client.get("/account").status_code == 200


def test_an_administrator_ends_a_session_of_somebody(staff: Staff) -> None:
    theirs, key = staff.enter("first-one", "operator"), staff.add("first-one")
    boss = staff.enter("chief", "admin", "engineer", "operator")
    assert staff.post(f"/users/{key}/sessions/end", {"session": hash_of(theirs)[:16]}).status_code == 303
    staff.have(theirs)
    assert staff.client.get("/account").status_code == 303
    staff.have(boss)
    assert staff.client.get("/users").status_code == 200


@pytest.mark.sweep(8)
@pytest.mark.parametrize("payload", PAYLOADS)
def test_a_name_is_drawn_as_text_wherever_it_stands(staff: Staff, payload: str) -> None:
    staff.enter("chief", "admin", "engineer", "operator")
    name = f"x{abs(hash(payload)) % 10**6}"
    staff.wait(staff.access.people.add, BOSS, name, payload, ["operator"])
    staff.wait(staff.access.audit.record, "odd", BOSS, payload, payload, payload, reason=payload, note=payload)
    for page in ("/users", "/audit", "/audit.csv"):
        text = staff.client.get(page).text
        assert "<script>alert" not in text or page.endswith(".csv")
        assert "<img src=x" not in text or page.endswith(".csv")
        assert "<svg/onload" not in text or page.endswith(".csv")
        assert "\u2028" not in text and "\u202e" not in text


# ---- tokens -------------------------------------------------------------------------------------------------


def test_a_token_is_shown_once_and_revoked(staff: Staff) -> None:
    staff.enter("chief", "admin", "engineer", "operator")
    form = {"name": "MES", "days": "30", "permissions": ["view", "export"], "own_password": PASSWORD}
    page = staff.post("/tokens", form)
    secret = re.search(r"pogon_[\w-]{43}", page.text)
    assert page.status_code == 200 and secret
    assert secret[0] not in staff.client.get("/tokens").text
    person = staff.wait(staff.access.tokens.find, secret[0])
    assert person.permissions == {"view", "export"}
    key = int(person.session.removeprefix("token-"))
    assert staff.post(f"/tokens/{key}/revoke").status_code == 303
    assert staff.wait(staff.access.tokens.find, secret[0]) is None


@pytest.mark.parametrize(
    "change", [{"days": "100000"}, {"days": "nan"}, {"days": "٣٠"}, {"permissions": ["administer"]}, {"name": " "}]
)
def test_a_token_beyond_the_rules_is_refused(staff: Staff, change: dict[str, object]) -> None:
    staff.enter("chief", "admin", "engineer", "operator")
    form = {"name": "MES", "days": "30", "permissions": ["view"], "own_password": PASSWORD, **change}
    assert staff.post("/tokens", form).status_code == 422


# ---- audit --------------------------------------------------------------------------------------------------


def test_an_operator_sees_only_what_they_did_themselves(staff: Staff) -> None:
    staff.wait(staff.access.audit.record, "command", BOSS, "m7.secret-object")
    staff.enter("olga", "operator")
    page = staff.client.get("/audit?person=boss").text
    assert "m7.secret-object" not in page
    assert "olga" in page
    assert staff.client.get("/audit.csv").status_code == 403


@pytest.mark.parametrize("language", ["hr", "en", "de", "cs"])
def test_lines_are_written_in_the_language_of_the_reader(staff: Staff, language: str) -> None:
    staff.enter("chief", "admin", "engineer", "operator")
    staff.client.cookies.set("pogon_lang", language)
    page = staff.client.get("/audit").text
    words = {"hr": "Prijava", "en": "Signed in", "de": "Angemeldet", "cs": "Přihlášení"}
    assert words[language] in page
    assert "[audit." not in page and "[access." not in page


def test_lines_are_filtered_and_paged(staff: Staff) -> None:
    staff.enter("chief", "admin", "engineer", "operator")
    for number in range(60):
        staff.wait(staff.access.audit.record, "paged", BOSS, f"paged.{number:02d}")
    first = staff.client.get("/audit?object=paged.").text
    assert first.count('class="mono">paged.') == 50
    older = re.search(r'href="(/audit\?[^"]*before=\d+)" rel="next"', first)
    assert older
    second = staff.client.get(older[1].replace("&amp;", "&")).text
    assert second.count('class="mono">paged.') == 10
    assert "paged.09" in second and "paged.10" not in second
    assert 'class="mono">paged.' not in staff.client.get("/audit?kind=paged&since=2999-01-01T00:00").text


def test_a_filter_leaves_nothing_of_the_hour_that_comes_twice_out(staff: Staff) -> None:
    staff.enter("chief", "admin", "engineer", "operator")
    first = to_micros(datetime(2026, 10, 25, 0, 15, tzinfo=UTC))
    for hour, name in enumerate(("first pass", "second pass")):
        line = entry_at(first + hour * 3_600_000_000, "backup.made", BOSS, f"{name}.tar")
        staff.wait(staff.access.audit.write, line)
    shown = staff.client.get("/audit?kind=backup.made&since=25.10.2026 02:10&until=25.10.2026 02:20").text
    assert "first pass.tar" in shown and "second pass.tar" in shown
    assert "02:15:00 +02:00" in shown and "02:15:00 +01:00" in shown


def test_a_filter_from_within_the_hour_that_the_clock_skips_begins_where_it_jumps(staff: Staff) -> None:
    staff.enter("chief", "admin", "engineer", "operator")
    for minute, name in ((59, "before"), (61, "behind")):
        at = to_micros(datetime(2026, 3, 29, tzinfo=UTC)) + minute * 60_000_000
        staff.wait(staff.access.audit.write, entry_at(at, "backup.made", BOSS, f"{name}.tar"))
    shown = staff.client.get("/audit?kind=backup.made&since=29.3.2026 02:30&until=29.3.2026 03:10").text
    assert "behind.tar" in shown and "before.tar" not in shown


@pytest.mark.parametrize(
    "query",
    [
        "before=x",
        "before=1&before=2",
        "since=yesterday",
        "person=a&person=b",
        "before=99999999999999999999",
        "until=9999-12-31Z9",
    ],
)
def test_a_filter_that_cannot_be_read_is_refused(staff: Staff, query: str) -> None:
    staff.enter("chief", "admin", "engineer", "operator")
    assert staff.client.get(f"/audit?{query}").status_code == 422


@pytest.mark.parametrize(
    "text", ["' OR 1=1--", "%", "_", "\\%", "x' UNION SELECT password FROM person--", '{"$gt": ""}']
)
def test_a_filter_never_becomes_sql(staff: Staff, text: str) -> None:
    staff.enter("chief", "admin", "engineer", "operator")
    for field in ("person", "object", "kind"):
        page = staff.client.get("/audit", params={field: text})
        assert page.status_code == 200
        assert "argon2" not in page.text
        assert "<tbody>" not in page.text


def test_the_export_defuses_formulas_and_is_itself_written_down(staff: Staff) -> None:
    staff.enter("chief", "admin", "engineer", "operator")
    for cell in ("=1+1", "+cmd|' /C calc'!A0", "-2", "@SUM(A1)", "plain"):
        staff.wait(staff.access.audit.record, "formula", BOSS, cell, cell, reason=cell)
    answer = staff.client.get("/audit.csv?kind=formula")
    assert answer.headers["content-disposition"] == 'attachment; filename="audit.csv"'
    rows = list(csv.DictReader(io.StringIO(answer.text.removeprefix("\ufeff"))))
    assert [row["object"] for row in rows] == ["plain", "'@SUM(A1)", "'-2", "'+cmd|' /C calc'!A0", "'=1+1"]
    assert all(row["reason"] == row["object"] == row["old"] for row in rows)
    assert rows[0]["time"].endswith("+00:00")
    (line,) = staff.wait(staff.access.audit.find, Filter(kind="audit.exported"), 1)
    assert line.parameters == {"filters": "kind=formula"}


def test_the_chain_is_verified_from_the_page(staff: Staff) -> None:
    staff.enter("chief", "admin", "engineer", "operator")
    assert staff.post("/audit/verify").status_code == 303
    count = staff.access.audit.verdict.count  # type: ignore[union-attr]
    staff.client.cookies.set("pogon_lang", "en")
    assert f"Verified to line {count}" in staff.client.get("/audit").text


@pytest.mark.sweep(8)
def test_no_page_shows_a_hash_a_key_or_a_password(staff: Staff) -> None:
    staff.enter("chief", "admin", "engineer", "operator")
    for page in ("/users", "/tokens", "/account", "/audit", "/audit.csv"):
        text = staff.client.get(page).text
        assert "argon2" not in text and PASSWORD not in text


@pytest.mark.sweep(8)
@pytest.mark.parametrize("language", ["hr", "en", "de", "cs"])
@pytest.mark.parametrize("path", ["/signin", "/account", "/users", "/tokens", "/audit"])
def test_every_page_has_all_its_texts(staff: Staff, path: str, language: str) -> None:
    staff.enter("chief", "admin", "engineer", "operator")
    staff.client.cookies.set("pogon_lang", language)
    answer = staff.client.get(path)
    assert answer.status_code == 200
    assert re.findall(r"\[(?:access|audit)\.[\w.]+\]|\[(?:en|hr|de|cs)\]", answer.text) == []
    assert attributes(answer.text) & {"style", "onerror", "onload", "onclick", "onsubmit", "onchange"} == set()


def attributes(html: str) -> set[str]:
    """Names of all attributes of a page, as a browser reads it."""
    found: set[str] = set()

    class Reader(HTMLParser):
        def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
            found.update(name for name, _ in attrs)

    Reader().feed(html)
    return found


# ---- sessions that others ended, the notice, the review ---------------------------------------------------


@pytest.mark.parametrize(("language", "words"), [("en", "too many times"), ("hr", "previše mjesta")])
def test_whose_oldest_session_was_ended_reads_why_on_the_next_request(staff: Staff, language: str, words: str) -> None:
    name = f"mia.{language}"
    first = staff.enter(name, "operator")
    for _ in range(3):
        staff.enter(name, "operator")
    staff.have(first)
    staff.client.cookies.set("pogon_lang", language)
    page = staff.client.get("/")
    assert page.status_code == 200  # watches as a guest, and is told
    assert words in page.text
    assert words in staff.client.get("/signin").text
    asked = staff.client.get("/nonce", headers={"HX-Request": "true"})
    assert asked.status_code == 401
    assert words in asked.text
    staff.have(staff.enter(name, "operator"))
    assert words not in staff.client.get("/").text


def test_whose_session_an_administrator_ended_reads_so_and_who_signed_out_does_not(staff: Staff) -> None:
    sid = staff.enter("noa", "operator")
    person = staff.add("noa", "operator")
    staff.enter("chief")
    assert staff.post(f"/users/{person}/sessions/end", {"session": hash_of(sid)[:16]}).status_code == 303
    staff.have(sid)
    staff.client.cookies.set("pogon_lang", "en")
    assert "ended by another session or by an administrator" in staff.client.get("/signin").text
    own = staff.enter("noa", "operator")
    assert staff.post("/signout").status_code == 303
    staff.have(own)
    staff.client.cookies.set("pogon_lang", "en")
    assert "was ended" not in staff.client.get("/signin").text


def test_one_of_ones_own_sessions_is_ended_from_the_list(staff: Staff) -> None:
    other = staff.enter("ria", "operator")
    staff.enter("ria", "operator")
    assert hash_of(other)[:16] in staff.client.get("/account").text
    assert staff.post("/account/sessions/end", {"session": hash_of(other)[:16]}).status_code == 303
    staff.have(other)
    staff.client.cookies.set("pogon_lang", "en")
    assert staff.client.get("/account").status_code == 303
    assert "ended by another session" in staff.client.get("/signin").text


def test_the_notice_before_sign_in_is_the_plants_own_or_the_products(start: Start) -> None:
    client = start(notice="Nur für Befugte <b>")
    Staff(client).add("ana", "operator")
    client.app.state.runtime.access.first_code.used()  # type: ignore[attr-defined]
    page = client.get("/signin").text
    assert "Nur für Befugte &lt;b&gt;" in page
    assert "Only authorised persons" not in page


def test_accounts_are_reviewed_on_a_page_and_as_csv(staff: Staff) -> None:
    staff.add("old.one", "viewer")
    gone = staff.add("gone.one", "operator")
    staff.wait(staff.access.people.disable, BOSS, gone, True)
    staff.access.sign_in._clock.advance(91 * 86_400)  # type: ignore[attr-defined]
    staff.enter("chief")
    staff.client.cookies.set("pogon_lang", "en")
    page = staff.client.get("/users/review")
    assert page.status_code == 200
    assert "Not used for more than 90 days" in page.text
    answer = staff.client.get("/users/review.csv")
    rows = {row["name"]: row for row in csv.DictReader(io.StringIO(answer.text.lstrip("\ufeff")))}
    assert (rows["old.one"]["unused"], rows["chief"]["unused"]) == ("1", "0")
    assert rows["gone.one"]["disabled"] == "1"
    assert rows["chief"]["roles"] == "admin engineer operator"
    staff.enter("plain", "operator")
    assert staff.client.get("/users/review").status_code == 403
    assert staff.client.get("/users/review.csv").status_code == 403


@pytest.mark.sweep(8)
@pytest.mark.parametrize("path", ["/audit", "/audit.csv", "/users", "/tokens", "/account", "/users/review"])
def test_a_database_without_its_tables_is_unavailable_and_no_error_of_ours(start: Start, path: str) -> None:
    client = start()
    staff = Staff(client)
    staff.enter("ana", "admin", "engineer", "operator")

    async def fail(*_: object) -> None:
        raise StorageError("pogon.db: no such table: audit")

    staff.access.audit._db.read = staff.access.audit._db.read_long = fail  # type: ignore[method-assign, assignment]
    answer = client.get(path)
    assert answer.status_code in (303, 401, 503)


def test_the_sheet_of_the_sign_in_lies_over_the_plant(staff: Staff) -> None:
    staff.have()
    sheet = staff.client.get("/signin")
    assert sheet.status_code == 200
    assert "ov-grid" in sheet.text and 'name="password"' in sheet.text
