"""The alarms in figures as browsers get them: who may, what is refused, every language, and the same numbers in the file."""

import csv
import io
import re
from collections.abc import Iterator
from html import unescape

import pytest

from app.access.audit.search import Filter
from app.alarms.statistics import measures
from app.alarms.statistics_query import read_figures
from app.settings import Settings
from tests import virtual
from tests.web.test_alarms import LANGUAGES, Hall

PAGE = "/alarms/statistics"


@pytest.fixture(scope="module")
def hall(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Hall]:
    with virtual.house(Settings(data=tmp_path_factory.mktemp("statistics") / "data")) as client:
        hall = Hall(client)
        hall.staff.enter("ana", "operator")
        for percent in (83, 84, 85):
            hall.tell("history_quota", percent=percent)
            hall.acknowledge(hall.one("sys.history_quota").occurrence)
            hall.tell("history_quota", None, False)
            assert virtual.until(lambda: all(one.id != "sys.history_quota" for one in hall.standing()))
        for machine in ("m1", "m2"):
            hall.tell("stop_unconfirmed", machine)
        hall.staff.wait(hall.engine.journal.flush)
        hall.staff.have()
        yield hall


def lines(hall: Hall, query: str = "") -> list[dict[str, str]]:
    hall.staff.enter("ina", "engineer")
    hall.client.cookies.set("pogon_lang", "en")
    answer = hall.client.get(f"{PAGE}.csv{query}")
    assert answer.status_code == 200
    text = answer.content.decode("utf-8-sig")
    hall.staff.have()
    return list(csv.DictReader(io.StringIO(text.partition("\r\n")[2])))


def test_the_page_says_in_every_language_what_the_journal_holds(hall: Hall) -> None:
    now = hall.runtime.clock.micros()
    found = hall.runtime.db.run(lambda connection: read_figures(connection, 0, now + 1))
    assert found is not None and found.total >= 5
    for lang, words in zip(
        LANGUAGES, ("Dojavljeni alarmi", "Annunciated alarms", "Gemeldete Alarme", "Ohlášené alarmy"), strict=True
    ):
        html = unescape(hall.page(PAGE, lang))
        assert f"{words}: {found.total}" in html, lang
        assert html.count("data-verdict=") == len(measures(found))
        assert "[alarm." not in html
    assert 'style="' not in html


def test_the_most_frequent_alarm_leads_to_its_records(hall: Hall) -> None:
    html = unescape(hall.page(PAGE))
    found = re.search(r'<a href="(/alarms\?tab=journal&q=sys\.history_quota[^"]*)">([^<]*)</a>', html)
    assert found is not None and "history storage" in found[2]
    assert "history storage" in hall.page(found[1])


def test_an_area_and_more_positions_change_the_figures(hall: Hall) -> None:
    whole, system = lines(hall), lines(hall, "?area=sys")
    total = {one["key"]: int(one["value"]) for one in whole if one["section"] == "total"}
    own = {one["key"]: int(one["value"]) for one in system if one["section"] == "total"}
    assert 3 <= own["annunciated"] < total["annunciated"]
    shared = lines(hall, "?positions=2")
    rates = [
        float(one["value"]) for part in (whole, shared) for one in part if (one["section"], one["key"]) == ("measure", "hour")
    ]  # fmt: skip
    assert rates[1] == pytest.approx(rates[0] / 2, rel=0.2)


def test_the_file_has_the_same_figures_and_the_audit_has_the_file(hall: Hall) -> None:
    rows = lines(hall, "?span=day")
    frequent = {one["key"]: one for one in rows if one["section"] == "frequent"}
    assert frequent["sys.history_quota"]["value"] == "3" and frequent["sys.history_quota"]["source"] == "sys"
    assert sum(int(one["value"]) for one in frequent.values()) == sum(
        int(one["value"]) for one in rows if one["section"] == "priority"
    )
    hall.staff.enter("ina", "engineer")
    written = hall.staff.wait(hall.staff.access.audit.find, Filter(kind="alarm", person="ina"), 1)
    assert "statistics; span=day" in written[0].parameters["filters"]
    hall.staff.have()


@pytest.mark.sweep(8)
@pytest.mark.parametrize(("role", "may"), [("", False), ("viewer", True), ("operator", True), ("engineer", True)])
def test_who_may_see_and_who_may_take_the_file(hall: Hall, role: str, may: bool) -> None:
    if role:
        hall.staff.enter(f"s_{role}", role)
    else:
        hall.staff.have()
    html = hall.page(PAGE)
    assert (f'href="{PAGE}.csv' in html) is may
    assert (hall.client.get(f"{PAGE}.csv", follow_redirects=False).status_code == 200) is may
    hall.staff.have()


@pytest.mark.parametrize(
    "query",
    [
        "span=year", "span=day&span=week", "positions=0", "positions=10", "area=nowhere", "span=own", "span=own&since=x",
        "span=own&since=2026-01-02T00:00&until=2026-01-01T00:00", "span=own&since=1990-01-01T00:00",
    ],
)  # fmt: skip
def test_an_address_that_makes_no_sense_is_refused(hall: Hall, query: str) -> None:
    assert hall.client.get(f"{PAGE}?{query}").status_code == 422


def test_a_time_of_ones_own_before_the_first_record_says_that_there_is_nothing(hall: Hall) -> None:
    year = hall.page(PAGE).count("data-verdict")
    html = hall.page(f"{PAGE}?span=own&since=2001-01-01T00:00&until=2001-01-02T00:00")
    assert year and "No alarms were recorded in this period" in html and "data-verdict" not in html


@pytest.mark.parametrize(
    ("lang", "told"),
    [
        ("hr", "Od mora biti prije Do"),
        ("en", "From must be before To"),
        ("de", "Von muss vor Bis"),
        ("cs", "Od musí být před Do"),
    ],
)
@pytest.mark.parametrize(
    "typed", ["since=2026-01-02T00:00&until=2026-01-01T00:00", "since=2126-01-01T00:00", "until=2026-01-02T00:00", ""]
)
def test_a_period_that_is_none_is_told_in_the_words_of_the_form(hall: Hall, lang: str, told: str, typed: str) -> None:
    answer = hall.client.get(f"{PAGE}?span=own&{typed}", headers={"Cookie": f"pogon_lang={lang}"})
    assert answer.status_code == 422
    assert (
        told in answer.text
        and "366" in answer.text
        and "until" not in answer.text.split("<main")[-1].split("</main")[0]
    )


def test_while_figures_are_counted_those_who_want_others_are_asked_to_come_later(hall: Hall) -> None:
    hall.staff.have()
    assert hall.client.get(PAGE).status_code == 200
    place = hall.client.app.state.alarm_statistics  # type: ignore[attr-defined]
    hall.staff.wait(place.acquire)
    try:
        assert hall.client.get(PAGE).status_code == 503
    finally:
        place.release()
    assert hall.client.get(PAGE).status_code == 200
    assert not place.locked()
