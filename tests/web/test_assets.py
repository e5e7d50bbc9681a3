"""Static files: fetched once under a name that contains their content, never stale, nothing else of the disk."""

import gzip
import os
import re
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app.web.assets import JOINED, Assets
from tests.conftest import ROOT

CSS = b"body { color: red }\n" * 100


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    static = tmp_path / "static"
    (static / "css").mkdir(parents=True)
    (static / "css" / "a.css").write_bytes(CSS)
    (static / ".secret.css").write_text("x")
    (static / "notes.db").write_text("x")
    (tmp_path / "outside.css").write_text("x")
    (static / "link.css").symlink_to(tmp_path / "outside.css")
    return static


def test_the_address_follows_the_content(folder: Path) -> None:
    assets = Assets(folder)
    first = assets.url("css/a.css")
    assert assets.url("css/a.css") == first != "/static/css/a.css"
    (folder / "css" / "a.css").write_bytes(CSS + b"p { color: blue }")
    assert assets.url("css/a.css") != first


def test_a_missing_file_is_named_once_and_breaks_no_page(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    assets = Assets(folder)
    assert assets.url("js/none.js") == assets.url("js/none.js") == "/static/js/none.js"
    assert caplog.text.count("js/none.js") == 1


def test_the_build_changes_with_our_files_only(folder: Path) -> None:
    before = Assets(folder).build
    (folder / "vendor").mkdir()
    (folder / "vendor" / "x.js").write_text("1")
    assert Assets(folder).build == before
    (folder / "css" / "b.css").write_text("b{}")
    assert Assets(folder).build != before


def test_what_a_style_sheet_names_gets_its_lasting_name(folder: Path) -> None:
    (folder / "vendor").mkdir()
    (folder / "vendor" / "x.woff2").write_bytes(b"wOF2")
    (folder / "css" / "sub").mkdir()
    (folder / "css" / "sub" / "f.css").write_text(
        'a { src: url("../../vendor/x.woff2") } b { src: url("../../../outside.woff2") } c { src: url("data:,x") }'
    )
    assets = Assets(folder)
    sheet = assets._find("css/sub/f.css")
    assert sheet is not None
    text = sheet.content.decode()
    assert f'url("{assets.url("vendor/x.woff2")}")' in text
    assert 'url("data:,x")' in text
    before = assets.url("css/sub/f.css")
    (folder / "vendor" / "x.woff2").write_bytes(b"wOF2 other")
    assert Assets(folder).url("css/sub/f.css") != before


def test_what_scripts_import_gets_its_lasting_name_and_never_in_a_circle() -> None:
    assets = Assets(ROOT / "static")
    for path in (ROOT / "static" / "js").glob("*.js"):
        script = assets._find(f"js/{path.name}")
        assert script is not None
        for way in re.findall(r'\bfrom "([^"]+)"', script.content.decode()):
            assert re.fullmatch(r"/static/js/\w+\.[0-9a-f]{12}\.js", way), (path, way)


def test_sheets_that_all_pages_need_are_one_file_in_their_order(client: TestClient) -> None:
    assets = client.app.state.view.assets  # type: ignore[attr-defined]
    joined = client.get(assets.url("css/pages.css"))
    assert joined.headers["cache-control"] == "public, max-age=31536000, immutable"
    places = [joined.content.find(client.get(f"/static/{part}").content) for part in JOINED["css/pages.css"]]
    assert places == sorted(places) and places[0] == 0


def test_a_joined_file_follows_each_of_its_parts(folder: Path) -> None:
    assets = Assets(folder)
    assert assets.url("css/pages.css") == "/static/css/pages.css"
    (folder / "css" / "font.css").write_text("a {}")
    first = assets.url("css/pages.css")
    (folder / "css" / "base.css").write_text("b {}")
    assert len({"/static/css/pages.css", first, assets.url("css/pages.css")}) == 3


def test_a_hashed_name_is_kept_for_ever(client: TestClient) -> None:
    url = client.app.state.view.assets.url("css/frame.css")  # type: ignore[attr-defined]
    answer = client.get(url)
    assert answer.status_code == 200
    assert answer.headers["cache-control"] == "public, max-age=31536000, immutable"
    assert answer.headers["content-type"] == "text/css; charset=utf-8"


def test_a_plain_name_or_an_old_hash_is_asked_for_again(client: TestClient) -> None:
    for url in ("/static/css/frame.css", "/static/css/frame.000000000000.css"):
        answer = client.get(url)
        assert (answer.status_code, answer.headers["cache-control"]) == (200, "no-cache")
    again = client.get("/static/css/frame.css", headers={"If-None-Match": answer.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")


def test_text_is_packed_for_who_can_unpack_it(client: TestClient) -> None:
    with client.stream("GET", "/static/css/frame.css", headers={"Accept-Encoding": "gzip"}) as answer:
        packed = b"".join(answer.iter_raw())
    plain = client.get("/static/css/frame.css", headers={"Accept-Encoding": "identity"})
    assert answer.headers["content-encoding"] == "gzip"
    assert "content-encoding" not in plain.headers
    assert gzip.decompress(packed) == plain.content
    assert len(packed) < len(plain.content) / 2


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    "name",
    [
        "",
        "css",
        "../pyproject.toml",
        "..%2f..%2fpyproject.toml",
        "css/../../outside.css",
        ".secret.css",
        "notes.db",
        "link.css",
        "%00.css",
    ],
)
def test_nothing_else_of_the_disk_is_served(
    client: TestClient, folder: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client.app.state.view, "assets", Assets(folder))  # type: ignore[attr-defined]
    assert client.get(f"/static/{name}").status_code == 404


def test_a_cold_page_stays_below_its_weight(client: TestClient) -> None:
    page = client.get("/equipment/m1").text
    files = set(re.findall(r'(?:href|src)="(/static/[^"#]+)', page))
    assert len(files) > 10
    weight = len(gzip.compress(page.encode()))
    for url in files:
        with client.stream("GET", url, headers={"Accept-Encoding": "gzip"}) as answer:
            weight += len(b"".join(answer.iter_raw()))
    assert weight < 150_000


def test_a_file_that_becomes_a_way_out_is_served_no_more(folder: Path) -> None:
    """Also when the file outside is as long and as old as the one that was there."""
    assets, file, outside = Assets(folder), folder / "css" / "seen.css", folder.parent / "outside.css"
    file.parent.mkdir(exist_ok=True)
    file.write_bytes(b"x" * len(outside.read_bytes()))
    then = outside.stat().st_mtime_ns
    os.utime(file, ns=(then, then))
    assert assets.url("css/seen.css") != "/static/css/seen.css"
    file.unlink()
    file.symlink_to(outside)
    assert assets.url("css/seen.css") == "/static/css/seen.css"
    file.unlink()
    assert assets.url("css/seen.css") == "/static/css/seen.css"


def test_a_file_that_is_known_costs_one_look_at_the_disk(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assets = Assets(folder)
    (folder / "css").mkdir(exist_ok=True)
    (folder / "css" / "seen.css").write_text("a {}", "utf-8")
    first = assets.url("css/seen.css")
    looks: list[object] = []
    look = Path.stat
    monkeypatch.setattr(Path, "stat", lambda *given, **how: looks.append(given) or look(*given, **how))
    monkeypatch.setattr(Path, "resolve", lambda *given: looks.append(given))
    assert assets.url("css/seen.css") == first
    assert len(looks) == 1
