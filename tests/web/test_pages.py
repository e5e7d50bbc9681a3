"""The frame of every page in every language and both themes, changing them in place, and pages when something is wrong."""

import json
import re
from html import unescape
from pathlib import Path

import pytest
from fastapi import FastAPI, HTTPException
from fastapi.testclient import TestClient

from app.errors import ConfigurationError, Refused
from app.plant.texts import read_product
from app.running.page_tags import page_tags
from app.sim.epos.training import REG_INTERLOCK
from app.sim.training import REG_MACHINE_FAULT
from app.web.guard import allow, check_declared, permissions
from tests.virtual import until
from tests.web.conftest import HOST, Start, send

LANGUAGES = {"hr": "hr", "en": "en-GB", "de": "de", "cs": "cs"}
AREA = {"hr": "Pogoni", "en": "Drives", "de": "Antriebe", "cs": "Pohony"}
NOT_FOUND = {"hr": "nije pronađena", "en": "not found", "de": "nicht gefunden", "cs": "nenalezena"}


@pytest.mark.sweep(8)
@pytest.mark.parametrize("path", ["/", "/area/drives", "/equipment/m1", "/nowhere"])
@pytest.mark.parametrize("theme", ["light", "dark", "auto"])
@pytest.mark.parametrize("lang", LANGUAGES)
def test_a_page_is_whole_in_every_language_and_theme(client: TestClient, lang: str, theme: str, path: str) -> None:
    client.cookies.update({"pogon_lang": lang, "pogon_theme": theme})
    page = client.get(path).text
    assert f'<html lang="{LANGUAGES[lang]}" data-theme="{theme}"' in page
    assert AREA[lang] in page
    assert page.count("<h1>") == 1
    for landmark in ("<header", "<nav", "<main", "<footer"):
        assert landmark in page
    assert not re.findall(r">\s*\[[a-z_.]+\]", page), "a key shows where a text is missing"
    assert not re.findall(r"\[(?:hr|en|de|cs)\] ", page), "a text of another language shows"


def test_nothing_in_a_page_needs_the_policy_to_look_away(client: TestClient) -> None:
    for path in ("/", "/equipment/m1", "/nowhere"):
        page = client.get(path).text
        assert not re.search(r"<[^>]*\s(style|on[a-z]+)=", page)
        assert "<style" not in page
        assert all("src=" in tag for tag in re.findall(r"<script[^>]*>", page))
        assert not re.search(r'\s(?:src|href)="(?!/|#)', page), "something comes from elsewhere"


def test_the_language_is_the_browsers_until_one_is_chosen(client: TestClient) -> None:
    assert '<html lang="cs"' in client.get("/", headers={"Accept-Language": "cs-CZ,cs;q=0.9"}).text
    send(client, "/language", {"to": "de"})
    assert '<html lang="de"' in client.get("/", headers={"Accept-Language": "cs-CZ,cs;q=0.9"}).text


def test_a_change_of_language_comes_back_to_the_same_place(client: TestClient) -> None:
    place = "/equipment/m1?from=07:00&note=š%26b"
    page = client.get(place).text
    assert 'name="next" value="/equipment/m1?from=07:00&amp;note=%C5%A1%26b"' in page
    answer = send(client, "/language", {"to": "en", "next": "/equipment/m1?from=07:00&note=%C5%A1%26b"})
    assert (answer.status_code, answer.headers["location"]) == (303, "/equipment/m1?from=07:00&note=%C5%A1%26b")
    assert "HttpOnly" in answer.headers["set-cookie"] and "SameSite=lax" in answer.headers["set-cookie"]


def test_a_place_with_odd_signs_comes_back_as_it_was_asked_for(client: TestClient) -> None:
    for place in ("/equipment/m1%00", "/equipment/m1%3Fx=1%23y", "/equipment/%C5%A1%25"):
        page = client.get(place).text
        assert f'name="next" value="{place}"' in page and "\x00" not in page
        assert page.count(f'href="{place}"') == 1, "to load the page anew"
    assert "\u202e" not in client.get("/equipment/m1%E2%80%AEx").text
    asked = client.get("/equipment/m1%3Fx/encoder")
    assert (asked.status_code, asked.headers["location"]) == (303, "/signin?next=/equipment/m1%253Fx/encoder")


def test_a_change_of_language_never_leads_elsewhere(client: TestClient) -> None:
    assert send(client, "/language", {"to": "en", "next": "//evil.test/x"}).headers["location"] == "/"


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("path", "data", "status"),
    [
        ("/language", {"to": "fr"}, 400),
        ("/language", {"to": "../de"}, 400),
        ("/language", {}, 422),
        ("/theme", {"to": "pink"}, 400),
        ("/theme", {"profile": "panel-99"}, 400),
        ("/theme", {}, 400),
        ("/theme", {"to": "dark"}, 303),
        ("/theme", {"profile": "panel-10"}, 303),
    ],
)
def test_only_what_there_is_can_be_chosen(client: TestClient, path: str, data: dict[str, str], status: int) -> None:
    answer = send(client, path, data)
    assert answer.status_code == status
    assert ("pogon_" in answer.headers.get("set-cookie", "")) == (status == 303)


def test_a_chosen_panel_is_kept(client: TestClient) -> None:
    send(client, "/theme", {"profile": "panel-7"})
    send(client, "/theme", {"to": "dark"})
    assert 'data-theme="dark" data-profile="panel-7"' in client.get("/").text


def test_a_cookie_with_nonsense_changes_nothing(client: TestClient) -> None:
    client.cookies.update({"pogon_theme": "x onload=1", "pogon_lang": "zz", "pogon_profile": "y"})
    assert '<html lang="hr" data-theme="light" data-profile="desk"' in client.get("/").text


def test_only_pages_that_exist_have_a_tab(client: TestClient) -> None:
    page = client.get("/equipment/m2").text
    tabs = re.findall(
        r'<a href="([^"]+)"( aria-current="page")?>', page[page.index('<nav class="tabs"') :].split("</nav>")[0]
    )
    assert ("/area/drives", ' aria-current="page"') in tabs
    for url, _ in tabs:
        assert client.get(url, follow_redirects=True).status_code == 200


def test_an_area_with_one_machine_leads_straight_to_it(start: Start, tmp_path: Path) -> None:
    text = Path("plants/demo/plant.toml").read_text("utf-8")
    (tmp_path / "plant").mkdir()
    (tmp_path / "plant" / "plant.toml").write_text(text[: text.index("# Hold-to-run")], "utf-8")
    client = start(plant=tmp_path / "plant")
    page = client.get("/equipment/m1").text
    assert 'href="/area/drives"' not in page
    assert re.search(r'<a href="/equipment/m1" aria-current="page">', page)


def test_simulation_is_said_on_every_page(client: TestClient) -> None:
    for path in ("/", "/equipment/m1", "/nowhere"):
        assert "SIMULACIJA – bez stvarne opreme" in client.get(path).text


@pytest.mark.parametrize(
    "path", ["/equipment/none", "/equipment/m1%2f..", "/equipment/%3Cscript%3E", "/area/none", "/x"]
)
@pytest.mark.parametrize("lang", LANGUAGES)
def test_what_is_not_there_says_so_in_the_frame(client: TestClient, lang: str, path: str) -> None:
    client.cookies.set("pogon_lang", lang)
    answer = client.get(path)
    assert answer.status_code == 404
    assert NOT_FOUND[lang] in answer.text and 'class="tabs"' in answer.text
    assert "<script>" not in answer.text


@pytest.mark.parametrize("lang", LANGUAGES)
def test_a_page_that_is_not_there_says_which_and_offers_the_search(client: TestClient, lang: str) -> None:
    client.cookies.set("pogon_lang", lang)
    page = client.get("/equipment/m9%3Cb%3E")
    assert page.status_code == 404 and NOT_FOUND[lang] in unescape(page.text)
    content = page.text[page.text.index("er-hint") :]
    assert "/equipment/m9&lt;b&gt;" in content and "m9<b>" not in page.text
    assert 'data-over="/palette"' in content
    long = client.get("/" + "x" * 500).text
    said = long[long.index("er-hint") :].partition("</p>")[0]
    assert "x" * 119 + "…" in said and "x" * 120 not in said


def refusing(app: FastAPI) -> None:
    @app.get("/no", dependencies=[allow("open")])
    @app.get("/api/no", dependencies=[allow("open")])
    async def no() -> None:
        raise HTTPException(403)

    @app.get("/refused", dependencies=[allow("open")])
    async def refused() -> None:
        raise Refused("error.reference", 409, id="<b>7</b>")


def test_who_asks_decides_the_form_of_an_error(start: Start) -> None:
    client = start(extend=refusing)
    client.cookies.set("pogon_lang", "en")
    page, line, json = client.get("/no"), client.get("/no", headers={"HX-Request": "true"}), client.get("/api/no")
    assert page.status_code == line.status_code == json.status_code == 403
    assert "No permission" in page.text and "<footer" in page.text
    assert "No permission" in line.text and "<footer" not in line.text
    assert json.json() == {"error": "error.forbidden", "text": "No permission"}
    answer = client.get("/refused", headers={"HX-Request": "true"})
    assert answer.status_code == 409
    assert "&lt;b&gt;7&lt;/b&gt;" in answer.text and "<b>" not in answer.text


UNKNOWN_ALARMS = {
    "hr": "Alarmi nisu poznati: postrojenje se ne može pokrenuti",
    "en": "Alarms not known: the plant cannot start",
    "de": "Alarme nicht bekannt: Die Anlage kann nicht gestartet werden",
    "cs": "Alarmy nejsou známy: provoz nelze spustit",
}


NO_ALARM = {"hr": "Nema aktivnih", "en": "No active", "de": "Keine anstehenden", "cs": "Žádné aktivní"}


@pytest.mark.sweep(8)
def test_a_broken_plant_is_explained_on_every_page(start: Start, tmp_path: Path) -> None:
    (tmp_path / "plant").mkdir()
    (tmp_path / "plant" / "plant.toml").write_text(
        '[plant]\nname = "X"\ntimezone = "Mars/Olympus"\n[equipment.m1]\ntype = "<b>nonsense</b>"\n', "utf-8"
    )
    folder = tmp_path / "plant"
    client = start(plant=folder)
    client.cookies.set("pogon_lang", "de")
    for path in ("/", "/equipment/m1", "/area/drives"):
        answer = client.get(path)
        assert answer.status_code == 503
        assert "Fehler in den Anlagendateien" in answer.text
        for word in ("plant.toml", "Mars/Olympus", "&lt;b&gt;nonsense&lt;/b&gt;", str(folder)):
            assert word in answer.text
    for lang, told in UNKNOWN_ALARMS.items():
        client.cookies.set("pogon_lang", lang)
        banner = re.findall(r'class="banner-none".*?</div>(.*?)</section>', page := client.get("/").text, re.S)
        assert unescape(re.findall(r'class="banner-none".*?<span>(.*?)</span>', page, re.S)[0]).strip() == told
        assert 'class="counts"' not in banner[0] and "sys.alarms.total" not in banner[0], "0 would be a claim"
        lists = [unescape(client.get(path).text) for path in ("/alarms", "/alarms?tab=unack", "/alarms/list")]
        assert [one.count(told) for one in lists] == [2, 2, 1] and not any(NO_ALARM[lang] in one for one in lists)
        pages = [*lists, *(client.get(path).text for path in ("/", "/alarms?tab=journal", "/alarms/statistics"))]
        assert not any(re.search(r"sys\.alarms\.(total|unack|hidden)", one) for one in pages), (
            "nor is 0 counted elsewhere"
        )
    counts = {
        one: client.get(f"/api/v1/tags/sys.alarms.{one}").json() for one in ("total", "unack_1", "active_4", "hidden")
    }
    assert {one: said["quality"] for one, said in counts.items()} == dict.fromkeys(counts, "uncertain:configuration")
    assert client.get("/", headers={"HX-Request": "true"}).status_code == 503
    assert client.get("/static/css/frame.css").status_code == 200
    assert send(client, "/language", {"to": "en"}).status_code == 303


def test_every_route_says_who_may_use_it(client: TestClient) -> None:
    table = permissions(client.app)  # type: ignore[arg-type]
    assert table["GET /equipment/{key}"] == "view"
    assert table["POST /language"] == "open"
    assert all(table.values())


@pytest.mark.parametrize("kind", ["route", "socket", "router"])
def test_a_silent_route_is_found_at_the_start(kind: str) -> None:
    from fastapi import APIRouter

    app, router = FastAPI(docs_url=None, redoc_url=None, openapi_url=None), APIRouter()
    if kind == "socket":
        app.websocket("/silent")(test_a_silent_route_is_found_at_the_start)
    else:
        (router if kind == "router" else app).get("/silent")(lambda: None)
        app.include_router(router)
    with pytest.raises(ConfigurationError, match="/silent: no permission declared"):
        check_declared(app)


def test_an_unknown_permission_is_refused_where_it_is_written() -> None:
    with pytest.raises(ConfigurationError, match='"everything" is unknown'):
        allow("everything")


def test_the_languages_have_the_same_texts() -> None:
    product = read_product()
    assert set(product) >= set(LANGUAGES)
    plural = re.compile(r"\.(one|few|many|other)$")
    keys = {lang: {plural.sub("", key) for key in texts} for lang, texts in product.items()}
    for lang in LANGUAGES:
        assert keys[lang] == keys["en"], f"{lang} and en differ"


def test_a_form_of_another_site_changes_nothing(client: TestClient) -> None:
    for headers in ({}, {"Origin": "https://evil.test"}, {"Origin": HOST}):
        answer = client.post("/language", data={"to": "de"}, headers=headers)
        assert answer.status_code == 403
        assert "pogon_lang" not in answer.headers.get("set-cookie", "")


def test_the_overview_begins_with_every_machine_at_its_place(demo: TestClient) -> None:
    plant = demo.app.state.runtime.plant  # type: ignore[attr-defined]
    page = demo.get("/").text
    start = page.index('<section class="pp')
    picture = page[start : page.index("</section>", start)]
    for item in plant.equipment.values():
        shown = item.type.picture
        assert picture.count(f'href="/equipment/{item.id}"') == 1 and f'data-mark-of="{item.id}"' in picture
        assert shown is not None and f"#{item.type.symbol}" in picture
        assert all(
            f'data-tag="{item.points[key].name}"' in picture for key in (shown.state, shown.moving, shown.figure)
        )
    assert picture.count("<path") == sum(1 for item in plant.equipment.values() if item.machine) > 0
    assert 'class="pp' not in demo.get("/area/drives").text


def test_tiles_say_how_far_it_is_and_what_it_waits_for(demo: TestClient) -> None:
    demo.cookies.set("pogon_lang", "en")
    page = unescape(demo.get("/").text)
    tiles = {
        found[1]: found[0]
        for found in re.findall(r'(<article class="panel ov.*?href="/equipment/(\w+)".*?</article>)', page, re.S)
    }
    waits = re.search(r'hx-get="/equipment/seq1/part/why"\s+hx-trigger="signal">\s*(.*?)\s*</p>', tiles["seq1"])
    assert waits and len(waits[1]) > 10
    assert demo.get("/equipment/seq1/part/why").status_code == 200
    for machine in ("a1", "cc1", "m1", "m2", "c1", "cr1"):
        says = re.search(rf'hx-get="/equipment/{machine}/part/why"[^>]*>\s*(.*?)\s*</p>', tiles[machine])
        assert says and says[1] == demo.get(f"/equipment/{machine}/part/why").text.strip()
    assert demo.get("/equipment/m1/part/nothing").status_code == 404
    crane = demo.app.state.runtime.plant.equipment["cr1"].points["step"]  # type: ignore[attr-defined]
    steps = [number for number in crane.texts if number > 2]
    assert re.findall(r'data-class="d:>(\d+);a:\1"', tiles["cr1"]) == [str(number) for number in steps]
    assert (
        'data-tag="cr1.suspension"' in tiles["cr1"]
        and 'data-tag="a1.block"' in tiles["a1"]
        and 'data-tag="a1.task"' in tiles["a1"]
    )
    sent = page_tags("overview", demo.app.state.runtime.plant, ())  # type: ignore[attr-defined]
    assert set(re.findall(r'data-tag="((?:cr1|a1|seq1|cc1)\.\w+)"', "".join(tiles.values()))) <= set(sent)


def test_the_tile_of_a_machine_names_what_is_missing_for_the_next_thing(demo: TestClient) -> None:
    demo.cookies.set("pogon_lang", "en")
    devices = demo.app.state.runtime.sim.devices  # type: ignore[attr-defined]
    says = "Run interlock open: close it at the drive"
    devices["a1"].write(6, REG_INTERLOCK, [1])
    assert until(lambda: demo.get("/equipment/a1/part/why").text.strip() == says)
    devices["cc1"].write(6, REG_MACHINE_FAULT, [50])
    says_car = "Emergency stop pressed: release it at the machine, then fault reset"
    assert until(lambda: demo.get("/equipment/cc1/part/why").text.strip() == says_car)
    page = unescape(demo.get("/").text)
    assert says in page and says_car in page
    devices["a1"].write(6, REG_INTERLOCK, [0])
    devices["cc1"].write(6, REG_MACHINE_FAULT, [0])


def test_an_area_has_its_own_flow_alarms_figures_and_curves(demo: TestClient) -> None:
    page = unescape(demo.get("/area/sequences").text)
    start = page.index('<section class="pp')
    picture = page[start : page.index("</section>", start)]
    assert set(re.findall(r'href="/equipment/(\w+)"', picture)) == {"cc1", "seq1"} and picture.count("<path") == 1
    alarms = page[page.index('id="alarm-summary"') :]
    assert 'hx-get="/alarms/summary?area=sequences"' in alarms and 'href="/alarms?area=sequences"' in alarms
    assert len(re.findall(r"<tbody>.*</tbody>", alarms, re.S)) == 1 and alarms.count('<th scope="row">') == 2
    pens = json.loads(re.findall(r'data-panel="([^>]*)" aria-label', page)[0])
    assert [pen["tag"] for pen in pens] == ["cc1.horizontal", "seq1.run_time"]
    assert "uPlot.iife" in page and "uPlot.iife" not in demo.get("/").text
    whole = unescape(demo.get("/").text)
    assert 'hx-get="/alarms/summary"' in whole and "data-panel" not in whole


def test_the_permissives_of_a_sequence_are_drawn_anew_when_a_row_of_a_force_or_a_fall_comes(demo: TestClient) -> None:
    """Over a wire it comes after the word that says so: till then nobody knows how long a force still stands."""
    page = demo.get("/equipment/seq1").text
    found = re.search(r'class="panel q-word"[^>]*data-tags="([^"]*)"', page)
    assert found is not None
    handles = demo.app.state.runtime.tags.handles  # type: ignore[attr-defined]
    rows = {name for name in handles if re.fullmatch(r"seq1\.(force|fall)_\d+_(id|state)", name)}
    assert len(rows) > 8 and rows <= {*found[1].split()}
