"""Today's figures on the overview: right in every language, after a restart and over midnight, and honest about what nobody saw."""

import asyncio
import re
from collections.abc import Iterator
from datetime import UTC, datetime
from html import unescape
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.settings import Settings
from app.web import today
from tests.demo_plant import plant_folder
from tests.virtual import VirtualClient, house

NOON = datetime(2026, 3, 9, 11, 0, tzinfo=UTC)
"""12:00 in Zagreb."""
LATE = datetime(2026, 3, 9, 22, 58, tzinfo=UTC)
"""23:58."""


def plain(html: str) -> str:
    return unescape(html).replace("\u202f", "").replace("\u00a0", " ")


def lines(client: TestClient, path: str = "/today", language: str = "en") -> dict[str, str]:
    """Machine → its figures as one text; `` → the heading."""
    client.cookies.set("pogon_lang", language)
    answer = client.get(path)
    assert answer.status_code == 200
    html = plain(answer.text)
    assert not re.search(r"\[today\.|\[[a-z]+\.", html)
    head = re.search(r"<caption>(.*?)</caption>", html, re.DOTALL)
    rows = re.findall(r'<tr>\s*<th scope="row">(.*?)</th>(.*?)</tr>', html, re.DOTALL)

    def said(markup: str) -> str:
        return " ".join(re.sub(r"<[^>]*>", " ", markup).split())

    return {"": said(head[1]) if head else ""} | {said(name): said(cells) for name, cells in rows}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return plant_folder(tmp_path / "plant", "m1")


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[VirtualClient]:
    """A drive and a line that ran for two minutes."""
    folder = tmp_path_factory.mktemp("today")
    settings = Settings(plant=plant_folder(folder / "plant", "m1", "c1"), data=folder / "data")
    with house(settings, begin=NOON) as client:
        client.pass_time(150)
        yield client


@pytest.mark.sweep(8)
def test_it_tells_what_was_seen_and_since_when(running: VirtualClient) -> None:
    found = lines(running)
    assert found[""] == "Today since 00:00 · not known until 12:00"
    assert re.match(r"[23] min Starts [01] – 0\.\d\d kWh 0$", found["Fan 1"])
    products = re.match(r"[23] min Products (\d+) Lost 0 (\d+) s – 0$", found["Conveyor 1"])
    assert products and 5 <= int(products[1]) <= 20 and int(products[2]) > 5


@pytest.mark.sweep(8)
@pytest.mark.parametrize("language", ["hr", "en", "de", "cs"])
def test_the_page_has_them_in_every_language_and_an_area_has_its_own(running: VirtualClient, language: str) -> None:
    running.cookies.set("pogon_lang", language)
    page = plain(running.get("/").text)
    assert 'hx-get="/today"\n  hx-trigger="every 30s"' in page and "<caption>" in page
    whole, area = lines(running, language=language), lines(running, "/today?area=drives", language)
    assert len(whole) == 3 and len(area) == 2 and set(area) < set(whole)
    assert 'hx-get="/today?area=drives"' in running.get("/area/drives").text
    assert running.get("/today?area=attic").status_code == 404


@pytest.mark.sweep(20)
def test_a_restart_takes_nothing_away_and_adds_nothing(folder: Path, tmp_path: Path) -> None:
    settings = Settings(plant=folder, data=tmp_path / "data")
    with house(settings, begin=NOON) as client:
        client.pass_time(300)
    with house(settings, begin=datetime(2026, 3, 9, 12, 0, tzinfo=UTC)) as client:
        client.pass_time(125)
        found = lines(client)
    assert found[""] == "Today since 00:00 · not known for 12 h 55 min in all, last 12:05 – 13:00"
    assert found["Fan 1"].startswith("7 min ")


@pytest.mark.sweep(8)
def test_a_new_day_begins_at_midnight_of_the_plant(folder: Path, tmp_path: Path) -> None:
    with house(Settings(plant=folder, data=tmp_path / "data"), begin=LATE) as client:
        client.pass_time(115)
        assert lines(client)["Fan 1"].startswith("2 min ")
        client.pass_time(185)
        found = lines(client)
    assert found[""] == "Today since 00:00"
    assert re.match(r"3 min Starts 0 0\.\d\d kWh 0$", found["Fan 1"])


@pytest.mark.sweep(8)
def test_whoever_looks_within_seconds_costs_nothing(running: VirtualClient, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    read = today.read_day

    def counted(*given: Any) -> Any:
        asked.append(1)
        return read(*given)

    monkeypatch.setattr(today, "read_day", counted)
    running.pass_time(today.FRESH + 1)
    for _ in range(5):
        assert running.get("/").status_code == 200
    assert len(asked) == 1
    running.pass_time(today.FRESH + 1)
    running.get("/today")
    assert len(asked) == 2


@pytest.mark.sweep(8)
def test_a_history_that_is_slow_keeps_no_page_shut(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The overview comes at once and fetches the figures, which are read once however many ask."""
    read, begun = today._read, list[int]()

    async def slowly(*asked: Any) -> today.Today:
        begun.append(1)
        await asyncio.sleep(20)
        return await read(*asked)

    with house(Settings(plant=folder, data=tmp_path / "data"), begin=NOON) as client:
        client.pass_time(30)
        monkeypatch.setattr(today, "_read", slowly)
        before = client.clock.monotonic()
        page = plain(client.get("/").text)
        assert client.clock.monotonic() - before < 1
        assert 'hx-trigger="load, every 30s"' in page and "<caption>" not in page
        client.get("/")
        assert lines(client)[""].startswith("Today since 00:00")
        assert len(begun) == 1
        client.pass_time(today.FRESH)
        assert "<caption>" in client.get("/").text, "what was read before is better than nothing"
        assert len(begun) == 2
