"""Exports: what is asked for wrongly is refused, what a file is called harms nobody, and a place is given back whatever ends an export."""

import asyncio
import re
from collections.abc import Iterator
from typing import Any
from urllib.parse import quote, unquote

import pytest

from app.historian.export import Sheet
from app.settings import Settings
from app.web import history
from app.web.guard import permissions
from app.web.history import MOST_EXPORTS, attachment
from tests.virtual import house
from tests.web.knock import knock
from tests.web.people import Staff

NASTY = [
    "č", 'a";x="b', "..\\..\\x", "\r\nSet-Cookie: sid=x", "\x00", "9" * 5000, "-1", "1e309", "NaN", "T" * 9000, "'; drop --", "²",
    "-999999999d", "9" * 16, "9999-12-31T23:59:59.999999-14:00", "0001-01-01T00:00+14:00", "9" * 18 + "-" + "9" * 18, "m1", "=cmd|x",
]  # fmt: skip
SPAN = {"tags": "m1.speed", "from": "-1m", "to": "now"}
EVENTS = ["equipment", "outcome", "since", "until", "before"]
RING = ["equipment", "event", "since", "until", "q", "before"]
FILES = {
    "/history/export.csv": (SPAN, ["tags", "from", "to", "interval", "locale", "bom"]),
    "/records/passage/export.csv": ({}, [*EVENTS, "product", "correction", "alarm", "locale", "shift"]),
    "/products/export.csv": ({}, ["equipment", "product", "locale"]),
    "/runs/export.csv": ({}, ["equipment", "before", "view"]),
    "/products/export/size": ({}, ["equipment", "product"]),
    "/runs/export/size": ({}, ["equipment", "first_out"]),
    "/events/export.csv": ({}, [*RING, "locale", "shift"]),
    "/records/run/export.csv": ({}, [*EVENTS, "first_out", "longer", "forced", "view", "locale"]),
    "/audit.csv": ({}, ["person", "object", "kind", "since", "until", "before"]),
    "/alarms.csv": (
        {"tab": "journal"},
        ["tab", "source", "area", "q", "event", "priority", "since", "until", "before", "state", "sort", "shift"],
    ),
    "/alarms/statistics.csv": ({}, ["period", "since", "until", "area", "positions"]),
    "/equipment/m1/drive-parameters/export.csv": ({}, []),
    "/users/review.csv": ({}, []),
    "/history/export/size": (SPAN, ["tags", "from", "to", "interval"]),
    "/records/passage/export/size": ({}, [*EVENTS, "product"]),
    "/events/export/size": ({}, RING),
    "/records/run/export/size": ({}, [*EVENTS, "first_out"]),
    "/api/v1/history/m1.speed/raw": (
        {"from": "2026-01-01T00:00:00Z", "to": "2026-01-02T00:00:00Z"},
        ["from", "to", "limit"],
    ),
    "/trends/export": ({"view": "tags=m1.speed&span=1h"}, ["view"]),
}
"""Export → what it needs, and each field that it reads."""
ASK = [("User-Agent", "testclient")]


@pytest.fixture(scope="module")
def staff(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    with house(Settings(data=tmp_path_factory.mktemp("exports") / "data")) as client:
        staff = Staff(client)
        staff.enter("ana", "engineer", "admin")
        yield staff


@pytest.fixture
def headers(staff: Staff) -> list[tuple[str, str]]:
    return [*ASK, ("Cookie", f"sid={staff.enter('ana', 'engineer', 'admin')}")]


def places(staff: Staff) -> dict[Sheet, int]:
    return history.exports_of(staff.client.app)  # type: ignore[arg-type]


@pytest.mark.sweep(8)
def test_every_export_is_swept_here(staff: Staff) -> None:
    csv = {
        route.split()[1].replace("{kind}", "run").replace("{key}", "m1")
        for route, right in permissions(staff.client.app).items()
        if route.endswith(".csv") or right == "export"
    }  # type: ignore[arg-type]
    assert csv - {"/history/export/progress", "/api/v1/history/{name}/raw"} <= set(FILES)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("path", FILES)
def test_no_field_of_an_export_ends_in_an_error_or_keeps_a_place(
    staff: Staff, headers: list[tuple[str, str]], path: str
) -> None:
    needed, fields = FILES[path]
    for field in fields:
        for value in NASTY:
            given = needed | {field: value}
            query = "&".join(f"{name}={quote(text, safe='')}" for name, text in given.items())
            answer = knock(staff.client, "GET", path, headers, query=query)
            assert answer.status in (200, 308, 404, 422), (field, value[:30], answer.status, answer.body[:200])
            told = answer.headers.get("content-disposition", "attachment")
            assert re.fullmatch(
                r"attachment(; filename=\"[A-Za-z0-9._-]+\"(; filename\*=UTF-8''[A-Za-z0-9%._~-]+)?)?", told
            ), told
            assert not places(staff)


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    "path",
    [
        "/records/passage/export.csv",
        "/records/run/export.csv",
        "/records/passage/export/size",
        "/records/run/export/size",
    ],
)
@pytest.mark.parametrize("equipment", ["č", "m9", 'a";x="b', "..\\..\\x", "\r\nX: y", "M1", "m1 x"])
def test_a_machine_that_nobody_knows_is_not_found(
    staff: Staff, headers: list[tuple[str, str]], path: str, equipment: str
) -> None:
    for _ in range(MOST_EXPORTS + 1):
        assert knock(staff.client, "GET", path, headers, query=f"equipment={quote(equipment)}").status == 404
    assert knock(staff.client, "GET", path, headers).status == 200


@pytest.mark.parametrize(
    ("name", "plain", "whole"),
    [
        ("pogon-m1.speed-2026.csv", "pogon-m1.speed-2026.csv", None),
        ("pogon-runs-č.csv", "pogon-runs-_.csv", "pogon-runs-č.csv"),
        ('a";x="b.csv', "a__x__b.csv", "a_;x=_b.csv"),
        ("..\\..\\x", "_.._x", None),
        ("../../etc/passwd", "_.._etc_passwd", None),
        ("a\r\nSet-Cookie: b", "a__Set-Cookie__b", "a__Set-Cookie_ b"),
        ("", "pogon.csv", None),
        ("...", "pogon.csv", None),
        ("\ud800", "_", "?"),
        ("x" * 500, "x" * 150, None),
    ],
)
def test_a_file_name_is_plain_for_all_and_whole_for_who_reads_it(name: str, plain: str, whole: str | None) -> None:
    header = attachment(name)
    header.encode("ascii")
    found = re.fullmatch(
        r"attachment; filename=\"([A-Za-z0-9._-]+)\"(?:; filename\*=UTF-8''([A-Za-z0-9%._~-]+))?", header
    )
    assert found
    assert found[1] == plain
    assert (found[2] and unquote(found[2])) == whole


# ---- places -----------------------------------------------------------------------------------------------

EXPORTS = [
    "/history/export.csv?tags=m1.speed&from=-1m&to=now",
    "/records/passage/export.csv",
    "/records/run/export.csv",
]


@pytest.mark.sweep(8)
@pytest.mark.parametrize("address", EXPORTS)
@pytest.mark.parametrize("where", ["open", "read", "stream", "file_name", "record", "send", "gone", "cancelled"])
def test_a_place_is_given_back_whatever_fails(
    staff: Staff, headers: list[tuple[str, str]], monkeypatch: pytest.MonkeyPatch, address: str, where: str
) -> None:
    def broken(*_: Any, **__: Any) -> Any:
        raise RuntimeError("broken")

    with monkeypatch.context() as patch:
        if where in ("read", "stream"):
            patch.setattr(Sheet, where, broken)
        elif where in ("open", "file_name"):
            for kind in (
                Sheet,
                *Sheet.__subclasses__(),
                *(deep for one in Sheet.__subclasses__() for deep in one.__subclasses__()),
            ):
                if where in vars(kind):
                    patch.setattr(kind, where, property(broken) if where == "file_name" else broken)
        elif where == "record":
            patch.setattr(staff.access.audit, "record", broken)
        for _ in range(MOST_EXPORTS + 1):
            ended = ask(staff, address, headers, where)
            assert not places(staff)
            assert ended != 503
    path, _, query = address.partition("?")
    assert knock(staff.client, "GET", path, headers, query=query).status == 200


def ask(staff: Staff, address: str, headers: list[tuple[str, str]], ending: str) -> int:
    """Ask for an export whose reader ends as `ending` says; the status that was sent, or 0."""
    path, _, query = address.partition("?")
    scope: dict[str, Any] = {
        "type": "http", "asgi": {"version": "3.0", "spec_version": "2.3"}, "http_version": "1.1", "method": "GET", "scheme": "http",
        "path": path, "raw_path": path.encode(), "query_string": query.encode(), "root_path": "", "client": ("127.0.0.1", 1),
        "server": ("127.0.0.1", 8000), "state": {},
        "headers": [(b"host", b"127.0.0.1:8000"), *((name.lower().encode(), value.encode()) for name, value in headers)],
    }  # fmt: skip
    status = 0

    async def receive() -> dict[str, Any]:
        if ending != "gone":
            await asyncio.Event().wait()
        return {"type": "http.disconnect"}

    async def send(message: dict[str, Any]) -> None:
        nonlocal status
        status = message.get("status", status)
        if ending == "send":
            raise OSError("the reader is gone")
        if ending == "cancelled":
            task = asyncio.current_task()
            assert task is not None
            task.cancel()
            await asyncio.sleep(0)

    async def whole() -> None:
        await asyncio.gather(asyncio.ensure_future(staff.client.app(scope, receive, send)), return_exceptions=True)

    assert staff.client.portal is not None
    staff.client.portal.call(whole)
    return status


def test_two_that_come_at_once_do_not_take_a_third_place(staff: Staff, headers: list[tuple[str, str]]) -> None:
    async def together() -> list[int]:
        return await asyncio.gather(*(one() for _ in range(4)))

    async def one() -> int:
        status: list[int] = []
        scope: dict[str, Any] = {
            "type": "http", "asgi": {"version": "3.0", "spec_version": "2.3"}, "http_version": "1.1", "method": "GET", "scheme": "http",
            "path": "/records/run/export.csv", "raw_path": b"/records/run/export.csv", "query_string": b"",
            "root_path": "", "client": ("127.0.0.1", 1),
            "server": ("127.0.0.1", 8000), "state": {},
            "headers": [(b"host", b"127.0.0.1:8000"), *((name.lower().encode(), value.encode()) for name, value in headers)],
        }  # fmt: skip

        async def receive() -> dict[str, Any]:
            await asyncio.Event().wait()
            return {}

        async def send(message: dict[str, Any]) -> None:
            if message["type"] == "http.response.start":
                status.append(message["status"])
            assert len(places(staff)) <= MOST_EXPORTS
            for _ in range(20):
                await asyncio.sleep(0)

        await staff.client.app(scope, receive, send)
        return status[0]

    assert staff.client.portal is not None
    found = staff.client.portal.call(together)
    assert set(found) <= {200, 503}
    assert 200 in found
    assert not places(staff)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("address", EXPORTS)
@pytest.mark.parametrize(("pause", "at_most"), [(3600.0, 5.0), (4.0, 15.0)])
def test_an_export_that_is_read_too_slowly_is_ended_and_told(
    staff: Staff,
    headers: list[tuple[str, str]],
    monkeypatch: pytest.MonkeyPatch,
    address: str,
    pause: float,
    at_most: float,
) -> None:
    path, _, query = address.partition("?")
    scope: dict[str, Any] = {
        "type": "http", "asgi": {"version": "3.0", "spec_version": "2.3"}, "http_version": "1.1", "method": "GET", "scheme": "http",
        "path": path, "raw_path": path.encode(), "query_string": query.encode(), "root_path": "", "client": ("127.0.0.1", 1),
        "server": ("127.0.0.1", 8000), "state": {},
        "headers": [(b"host", b"127.0.0.1:8000"), *((name.lower().encode(), value.encode()) for name, value in headers)],
    }  # fmt: skip
    sent: list[dict[str, Any]] = []

    asked = iter([{"type": "http.request", "body": b"", "more_body": False}])

    async def receive() -> dict[str, Any]:
        for message in asked:
            return message
        await asyncio.Event().wait()
        return {}

    async def send(message: dict[str, Any]) -> None:
        sent.append(message)
        if message["type"] == "http.response.body":
            await asyncio.sleep(pause)

    async def whole() -> float:
        loop = asyncio.get_running_loop()
        began = loop.time()
        await staff.client.app(scope, receive, send)
        return loop.time() - began

    monkeypatch.setattr(history, "SLOWEST_PORTION", 5.0)
    monkeypatch.setattr(history, "LONGEST_EXPORT", 15.0)
    monkeypatch.setattr(Sheet, "done", property(lambda _: False, lambda *_: None), raising=False)
    monkeypatch.setattr(Sheet, "read", lambda *_: b"a line\r\n")
    assert staff.client.portal is not None
    assert staff.client.portal.call(whole) == pytest.approx(at_most, abs=1)
    assert not places(staff)
    assert not any(message["type"] == "http.response.body" and not message.get("more_body") for message in sent)
    page = knock(staff.client, "GET", "/audit", headers, query="kind=history.export_ended")
    assert "čitan je presporo" in page.body.decode()
