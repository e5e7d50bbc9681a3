"""A database that is gone under a running server: every page says so in the reader's language, none breaks."""

import re
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app.main import create_app
from app.settings import Settings
from app.web.guard import permissions
from tests.web.knock import knock
from tests.web.people import HOST, Staff

WORDS = {
    "hr": "Podaci se sada ne mogu",
    "en": "The data cannot be read",
    "de": "Die Daten sind jetzt",
    "cs": "Data nyní nelze",
}
SESSIONS = {"person", "session", "role", "person_role", "factor"}
"""Tables that stay, so that who is signed in still is."""


@pytest.fixture(params=["pogon.db", "history.db"])
def broken(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[Staff, str]]:
    """Somebody with all rights at a server whose tables are gone."""
    app = create_app(Settings(data=tmp_path / "data"))
    client = TestClient(
        app, base_url=HOST, follow_redirects=False, client=("127.0.0.1", 50000), raise_server_exceptions=False
    )
    with client:
        staff = Staff(client)
        staff.enter("ana", "admin", "engineer", "operator")
        assert client.get("/audit").status_code == 200
        with closing(sqlite3.connect(tmp_path / "data" / request.param, timeout=30)) as database, database:
            tables = [name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
            for name in tables:
                if not name.startswith("sqlite") and name not in SESSIONS:
                    database.execute(f'DROP TABLE "{name}"')
        yield staff, request.param


@pytest.mark.sweep(8)
def test_no_page_breaks_and_all_say_what_is_wrong(broken: tuple[Staff, str]) -> None:
    staff, file = broken
    headers = [("Cookie", f"sid={staff.client.cookies['sid']}"), ("User-Agent", "testclient")]
    token = staff.access.form_token(staff.client.cookies["sid"])
    for route in sorted(permissions(staff.client.app)):  # type: ignore[arg-type]
        method, path = route.split()
        if method not in ("GET", "POST") or path == "/signout":
            continue
        address = re.sub(r"\{[^}]*\}", "1", re.sub(r"\{name\}", "m1.speed", re.sub(r"\{key\}", "m1", path)))
        span = "from=2026-01-01T00:00:00Z&to=2026-01-02T00:00:00Z&tags=m1.speed"
        span += "&tab=journal" if path == "/alarms.csv" else ""
        more = [("X-CSRF-Token", token)] if method == "POST" else []
        answer = knock(staff.client, method, address, [*headers, *more], query=span if method == "GET" else "")
        assert answer.status < 500 or answer.status == 503, (route, answer.status, answer.body[:300])
    gone = "/audit" if file == "pogon.db" else "/records/run"
    for lang, words in WORDS.items():
        cookie = [("Cookie", f"sid={staff.client.cookies['sid']}; pogon_lang={lang}"), ("User-Agent", "testclient")]
        answer = knock(staff.client, "GET", gone, cookie)
        assert answer.status == 503
        if file == "pogon.db":
            assert words in answer.body.decode()
        assert f'<html lang="{"en-GB" if lang == "en" else lang}"' in answer.body.decode()
    assert knock(staff.client, "GET", "/", headers).status == 200
