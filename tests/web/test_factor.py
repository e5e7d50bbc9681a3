"""The second factor as a browser meets it: the sheet after the password, one's own page, what administrators see."""

import csv
import io
import re
from collections.abc import Iterator

import pytest
import segno
from pyotp import TOTP

from app.access.audit.search import Filter
from app.access.factors import STEP
from app.access.signin import HALF_LIFE
from app.settings import Settings
from app.web.factor import QUIET, provisioning, qr_code
from tests.virtual import house
from tests.web.people import HOST, PASSWORD, Staff

LANGUAGES = ("hr", "en", "de", "cs")


@pytest.fixture(scope="module")
def staff(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    with house(Settings(data=tmp_path_factory.mktemp("factor") / "data", second_factor="engineer")) as client:
        made = Staff(client)
        made.add("chief", "admin")
        yield made


def cookie(answer: object, name: str) -> str:
    lines = [line for line in answer.headers.get_list("set-cookie") if line.startswith(f"{name}=")]  # type: ignore[attr-defined]
    found = re.match(r"[a-z]+=\"?([\w-]*)", lines[0]) if lines else None
    return found[1] if found else ""


def code_of(staff: Staff, key: str) -> str:
    """What a telephone shows, some steps after the last time it was asked."""
    staff.access.factors._clock.advance(2 * STEP)  # type: ignore[attr-defined]
    return TOTP(key).generate_otp(staff.access.factors._clock.micros() // (STEP * 1_000_000))


def enrol(staff: Staff, name: str, *roles: str) -> tuple[str, list[str]]:
    """Turn the factor of `name` on by its page; returns the key and the recovery codes, and stays signed in."""
    staff.enter(name, *roles)
    page = staff.post("/account/factor/begin", {"own_password": PASSWORD})
    shown = re.search(r'u-key" hx-ignore>([A-Z2-7 ]+)<', page.text)
    assert page.status_code == 200 and shown
    key = shown[1].replace(" ", "")
    answer = staff.post("/account/factor/confirm", {"code": code_of(staff, key)})
    assert answer.status_code == 200
    staff.have(cookie(answer, "sid"))
    return key, re.findall(r"<li>([2-9A-Z]{4}(?:-[2-9A-Z]{4}){3})</li>", answer.text)


def half(staff: Staff, name: str, next: str = "/") -> object:
    """Give the right password; the browser has its ticket."""
    staff.have()
    answer = staff.post("/signin", {"name": name, "password": PASSWORD, "next": next})
    assert answer.status_code == 303 and answer.headers["location"].startswith("/signin/code?next=")
    staff.client.cookies.set("half", cookie(answer, "half"))
    return answer


@pytest.mark.sweep(8)
def test_a_person_enrols_and_signs_in_with_a_code(staff: Staff) -> None:
    key, codes = enrol(staff, "ana", "operator")
    assert len(key) == 32 and len(set(codes)) == 10
    page = staff.client.get("/account/factor").text
    assert key not in page and not [one for one in codes if one in page]
    answer = half(staff, "ana", "/equipment/m1?tab=2")
    line = next(one for one in answer.headers.get_list("set-cookie") if one.startswith("half="))  # type: ignore[attr-defined]
    assert {"HttpOnly", "SameSite=strict", "Path=/", f"Max-Age={HALF_LIFE:.0f}"} <= set(line.split("; "))
    assert cookie(answer, "sid") == ""
    assert staff.client.get("/account").headers["location"] == "/signin?next=/account"
    sheet = staff.client.get(answer.headers["location"])  # type: ignore[attr-defined]
    assert sheet.status_code == 200 and 'autocomplete="one-time-code"' in sheet.text
    wrong = staff.post("/signin/code", {"code": "98-71-2x", "next": "/"})
    assert wrong.status_code == 401 and "98-71-2x" not in wrong.text
    assert "pola minute" in wrong.text, "a right code of a clock that is off is told no otherwise"
    answer = staff.post("/signin/code", {"code": code_of(staff, key), "next": "/equipment/m1?tab=2"})
    assert (answer.status_code, answer.headers["location"]) == (303, "/equipment/m1?tab=2")
    assert 'half=""' in " ".join(answer.headers.get_list("set-cookie"))
    staff.have(cookie(answer, "sid"))
    assert staff.client.get("/account").status_code == 200


def test_under_tls_the_ticket_belongs_to_this_host_alone(staff: Staff) -> None:
    enrol(staff, "tls", "operator")
    staff.have()
    staff.client.cookies.set("__Host-pre", "a" * 22)
    form = {"name": "tls", "password": PASSWORD, "csrf": staff.access.form_token("a" * 22)}
    secure = HOST.replace("http:", "https:")
    answer = staff.client.post(f"{secure}/signin", data=form, headers={"Origin": secure})
    line = next(one for one in answer.headers.get_list("set-cookie") if "half=" in one)
    assert line.startswith("__Host-half=") and {"Secure", "HttpOnly", "Path=/"} <= set(line.split("; "))


def test_a_recovery_code_signs_in_where_the_telephone_is_lost(staff: Staff) -> None:
    _, codes = enrol(staff, "lost", "operator")
    half(staff, "lost")
    answer = staff.post("/signin/code", {"code": codes[4].lower()})
    assert answer.status_code == 303
    half(staff, "lost")
    assert staff.post("/signin/code", {"code": codes[4]}).status_code == 401


@pytest.mark.sweep(8)
@pytest.mark.parametrize("way", ["no ticket", "foreign", "late", "signed out"])
def test_without_its_ticket_a_sign_in_begins_with_the_password(staff: Staff, way: str) -> None:
    key, _ = enrol(staff, f"w{way.replace(' ', '')}", "operator")
    half(staff, f"w{way.replace(' ', '')}")
    if way == "no ticket":
        staff.have()
    elif way == "foreign":
        staff.have()
        staff.client.cookies.set("half", "A" * 43)
    elif way == "late":
        staff.access.sign_in._clock.advance(HALF_LIFE)  # type: ignore[attr-defined]
    else:
        staff.post("/signout")
    assert staff.client.get("/signin/code?next=/equipment/m1").headers["location"] == "/signin?next=/equipment/m1"
    answer = staff.post("/signin/code", {"code": code_of(staff, key)})
    assert (answer.status_code, cookie(answer, "sid")) == (401, "")
    assert 'action="/signin"' in answer.text


@pytest.mark.parametrize("next_", ["//evil.example", "/\\evil", "https:evil", "/a\r\nSet-Cookie: x=1", ""])
def test_nobody_is_led_to_another_site(staff: Staff, next_: str) -> None:
    if not staff.wait(staff.access.factors.of, staff.add("led", "operator")):
        enrol(staff, "led", "operator")
    assert half(staff, "led", next_).headers["location"] == "/signin/code?next=/"  # type: ignore[attr-defined]
    sheet = staff.client.get("/signin/code", params={"next": next_}).text
    assert re.findall(r'name="next" value="([^"]*)"', sheet[sheet.index('action="/signin/code"') :])[:1] == ["/"]


@pytest.mark.parametrize(
    "data", [{}, {"code": ["1", "2"]}, {"code[]": "1"}, {"code": "1", "name": "chief"}, {"code": "1", "person": "1"}]
)
def test_a_form_with_missing_doubled_or_foreign_fields_is_refused(staff: Staff, data: dict[str, object]) -> None:
    if not staff.wait(staff.access.factors.of, staff.add("fields", "operator")):
        enrol(staff, "fields", "operator")
    half(staff, "fields")
    assert staff.post("/signin/code", data).status_code == 422


@pytest.mark.sweep(8)
def test_a_role_that_asks_for_it_leads_to_enrolment_and_nowhere_else(staff: Staff) -> None:
    staff.enter("inge", "engineer")
    for page in ("/", "/equipment/m1", "/account", "/tokens", "/audit"):
        assert staff.client.get(page).headers["location"] == "/account/factor", page
    assert staff.client.get("/", headers={"HX-Request": "true"}).status_code == 403
    form = {"name": "x", "days": "7", "permissions": ["view"], "own_password": PASSWORD}
    assert staff.post("/tokens", form).status_code == 403
    page = staff.client.get("/account/factor")
    assert page.status_code == 200 and "/signout" in page.text
    key, _ = enrol(staff, "inge", "engineer")
    assert staff.client.get("/").status_code == 200
    assert staff.post("/tokens", form).status_code == 200
    answer = staff.post("/account/factor/remove", {"own_password": PASSWORD, "code": code_of(staff, key)})
    assert answer.headers["location"] == "/account/factor?done=removed"
    assert staff.client.get("/").headers["location"] == "/account/factor"


@pytest.mark.sweep(8)
@pytest.mark.parametrize("path", ["codes", "remove"])
@pytest.mark.parametrize(("password", "code"), [("wrong", True), (PASSWORD, False), ("wrong", False)])
def test_what_changes_the_factor_asks_for_both(staff: Staff, path: str, password: str, code: bool) -> None:
    name = f"both{path}{password[:2]}{code}".lower()
    key, codes = enrol(staff, name, "operator")
    typed = code_of(staff, key) if code else "123456"
    answer = staff.post(f"/account/factor/{path}", {"own_password": password, "code": typed})
    assert answer.status_code == 401
    factor = staff.wait(staff.access.factors.of, staff.add(name))
    assert factor and factor.recovery == 10
    assert not [one for one in codes if one in answer.text]


def test_turning_it_on_asks_for_the_password(staff: Staff) -> None:
    staff.enter("asks", "operator")
    answer = staff.post("/account/factor/begin", {"own_password": "wrong"})
    assert answer.status_code == 401 and "u-qr" not in answer.text
    assert staff.post("/account/factor/confirm", {"code": "123456"}).status_code == 409


def test_a_wrong_first_code_shows_the_same_key_again(staff: Staff) -> None:
    staff.enter("again", "operator")
    keys = set()
    page = staff.post("/account/factor/begin", {"own_password": PASSWORD})
    for _ in range(3):
        keys |= set(re.findall(r'u-key" hx-ignore>([A-Z2-7 ]+)<', page.text))
        page = staff.post("/account/factor/confirm", {"code": "12345"})
        assert page.status_code == 401
    assert len(keys) == 1


@pytest.mark.sweep(8)
def test_administrators_see_and_reset_it(staff: Staff) -> None:
    enrol(staff, "vic", "operator")
    key = staff.add("vic")
    staff.add("lacks", "engineer")
    staff.enter("chief", "admin")
    users = staff.client.get("/users").text
    assert f"/users/{key}/factor" in users
    rows = csv.DictReader(io.StringIO(staff.client.get("/users/review.csv").text.removeprefix("\ufeff")))
    seen = {row["name"]: (row["second_factor"], row["second_factor_missing"]) for row in rows}
    assert (seen["vic"], seen["lacks"], seen["chief"]) == (("1", "0"), ("0", "1"), ("0", "0"))
    assert "Drugi faktor" in staff.client.get("/users/review").text
    assert staff.post(f"/users/{key}/factor", {"own_password": "wrong"}).status_code == 401
    answer = staff.post(f"/users/{key}/factor", {"own_password": PASSWORD})
    assert answer.headers["location"] == "/users?done=factor"
    assert staff.client.get("/users?done=factor").status_code == 200
    assert staff.post(f"/users/{key}/factor", {"own_password": PASSWORD}).status_code == 409
    kinds = [line.kind for line in staff.wait(staff.access.audit.find, Filter(object="vic"))]
    assert {"factor.enrolled", "factor.reset"} <= set(kinds)
    assert staff.client.get("/audit?kind=factor.reset").status_code == 200


@pytest.mark.sweep(8)
def test_wrong_codes_wait_and_say_so(staff: Staff) -> None:
    enrol(staff, "waits", "operator")
    statuses = []
    for _ in range(6):
        half(staff, "waits")
        statuses.append(staff.post("/signin/code", {"code": "12345"}).status_code)
    assert statuses == [401] * 5 + [429]
    staff.enter("chief", "admin")
    assert f"/users/{staff.add('waits')}/unlock" in staff.client.get("/users").text


@pytest.mark.sweep(8)
@pytest.mark.parametrize("lang", LANGUAGES)
def test_its_pages_speak_every_language_and_have_nothing_inline(staff: Staff, lang: str) -> None:
    name = f"lang-{lang}"
    staff.enter(name, "operator")
    staff.client.cookies.set("pogon_lang", lang)
    pages = [staff.client.get("/account/factor"), staff.client.get("/account")]
    pages.append(staff.post("/account/factor/begin", {"own_password": PASSWORD}))
    shown = re.search(r'u-key" hx-ignore>([A-Z2-7 ]+)<', pages[-1].text)
    assert shown
    pages.append(staff.post("/account/factor/confirm", {"code": code_of(staff, shown[1].replace(" ", ""))}))
    staff.have(cookie(pages[-1], "sid"))
    staff.client.cookies.set("pogon_lang", lang)
    pages.append(staff.client.get("/account/factor"))
    half(staff, name)
    staff.client.cookies.set("pogon_lang", lang)
    pages.append(staff.client.get("/signin/code"))
    for page in pages:
        assert page.status_code == 200
        assert not re.search(r"\sstyle=|<style|<script(?![^>]*\ssrc=)|\son\w+=|access\.factor|src=\"data:", page.text)
        assert "no-store" in page.headers["cache-control"]


# ---- the QR code ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "plant"), [("ana", "Demo"), ("ivo.kos", "Tvornica vijaka Đurđevac: linija 3"), ("x" * 32, "Ž" * 60)]
)
def test_the_qr_code_is_the_address_that_authenticators_read(name: str, plant: str) -> None:
    key = "JBSWY3DPEHPK3PXPJBSWY3DPEHPK3PXP"
    text = provisioning(key, name, f"Pogon {plant}")
    assert text.startswith("otpauth://totp/Pogon%20") and f"secret={key}" in text and text.isascii()
    path, size = qr_code(text)
    drawn = [[0] * size for _ in range(size)]
    for x, y, run in re.findall(r"M(\d+) (\d+)h(\d+)v1h-\3z", path):
        drawn[int(y)][int(x) : int(x) + int(run)] = [1] * int(run)
    assert [list(row) for row in segno.make_qr(text, error="m").matrix_iter(border=QUIET)] == drawn


def test_the_page_draws_the_key_that_it_writes(staff: Staff) -> None:
    staff.enter("draws", "operator")
    page = staff.post("/account/factor/begin", {"own_password": PASSWORD}).text
    key = re.search(r'u-key" hx-ignore>([A-Z2-7 ]+)<', page)
    path = re.search(r'<path d="(M[^"]*z)"', page)
    assert key and path
    runtime = staff.client.app.state.runtime  # type: ignore[attr-defined]
    labels = runtime.plant.name.values()
    texts = [provisioning(key[1].replace(" ", ""), "draws", f"Pogon {label}") for label in labels]
    assert path[1] in {qr_code(text)[0] for text in texts}
