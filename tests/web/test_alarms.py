"""The alarm list, the banner and the journal as browsers get them, and who may acknowledge."""

import csv
import io
import re
import time
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from html import unescape
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.access.audit.search import Filter
from app.alarms.definitions import SYSTEM_ALARMS
from app.alarms.engine import AlarmEngine
from app.alarms.watch import ListedAlarm
from app.running.page_tags import page_tags
from app.runtime import Runtime
from app.settings import Settings
from app.tags.batch import Batch
from tests import virtual
from tests.web.people import HOST, Staff

LANGUAGES = ("hr", "en", "de", "cs")
EVIL = "<img src=x onerror=alert(1)>"


class Hall:
    """The demo plant with alarms that tests tell."""

    def __init__(self, client: TestClient) -> None:
        self.client = client
        self.staff = Staff(client)
        self.runtime: Runtime = client.app.state.runtime  # type: ignore[attr-defined]
        self.runtime.sweep.published = lambda: None  # here only tests tell

    @property
    def engine(self) -> AlarmEngine:
        return self.runtime.alarms

    def tell(self, key: str, equipment: str | None = None, active: bool = True, **params: object) -> None:
        self.staff.wait(self.engine.system.report, key, equipment, active, params)

    def put(self, name: str, value: float) -> None:
        """A value as if the device had said it."""
        tags, now = self.runtime.tags, self.runtime.clock.micros()
        handle = tags.handle(name)
        self.staff.wait(tags.publish, Batch(tags.tags[handle].source, 99, now, now, [handle], [value]))

    def standing(self) -> list[ListedAlarm]:
        found: list[ListedAlarm] = self.staff.wait(self.engine.list.active)
        return found

    def one(self, id: str) -> ListedAlarm:
        return next(one for one in self.standing() if one.id == id)

    def page(self, path: str, lang: str = "en") -> str:
        self.client.cookies.set("pogon_lang", lang)
        answer = self.client.get(path)
        assert answer.status_code == 200, (path, answer.status_code)
        return answer.text

    def acknowledge(self, *occurrences: int, **fields: str) -> Any:
        self.client.cookies.set("pogon_lang", "en")
        return self.staff.post(
            "/alarms/acknowledge", {"occurrence": [str(one) for one in occurrences], **fields}, **{"HX-Request": "true"}
        )

    def calm(self) -> None:
        """Acknowledge everything that only somebody's acknowledgement keeps."""
        self.staff.enter("tidy", "operator")
        for key in SYSTEM_ALARMS:
            self.tell(key, None, False)
        if numbers := [one.occurrence for one in self.standing()]:
            for start in range(0, len(numbers), 500):
                self.acknowledge(*numbers[start : start + 500])
        self.staff.have()
        assert virtual.until(lambda: not self.standing())  # off-delays


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Hall]:
    with virtual.house(Settings(data=tmp_path_factory.mktemp("alarms") / "data")) as client:
        yield Hall(client)


@pytest.fixture
def hall(house: Hall) -> Iterator[Hall]:
    house.staff.have()
    yield house
    house.calm()


def rows(html: str) -> list[str]:
    return re.findall(r'data-alarm="([^"]+)"', html)


# ---- the list ---------------------------------------------------------------------------------------------


def test_a_calm_plant_says_so_in_every_language(hall: Hall) -> None:
    said = {
        unescape(re.findall(r'class="banner-none".*?<span>(.*?)</span>', hall.page("/", lang))[0]) for lang in LANGUAGES
    }
    assert said == {"No active alarms", "Nema aktivnih alarma", "Keine anstehenden Alarme", "Žádné aktivní alarmy"}


def test_one_alarm_is_read_by_everybody_in_their_language_with_their_numbers(hall: Hall) -> None:
    hall.tell("history_quota", percent=83.5)
    for lang, text in {
        "hr": "spremište povijesti 83,5 % puno",
        "en": "history storage 83.5 % full",
        "de": "Historienspeicher zu 83,5 % belegt",
        "cs": "zaplněno na 83,5 %",
    }.items():
        for path in ("/", "/alarms", "/alarms/banner", "/equipment/m1"):
            assert text in unescape(hall.page(path, lang)), (lang, path)


def test_an_alarm_of_a_machine_that_was_of_another_type_then_shows_no_key(hall: Hall) -> None:
    """Its command was told as `[point.sp]` on every page once the type of the machine had been changed and the plant been reloaded."""
    hall.tell("command_unconfirmed", "m1", command="@point.former_setpoint")
    for lang in LANGUAGES:
        page = hall.page("/alarms", lang)
        assert "former_setpoint" in page and "[point" not in page and "@point" not in page, lang
    assert "Command not confirmed: former_setpoint" in hall.page("/")


def test_the_list_shows_what_waits_first_and_its_detail_what_to_do(hall: Hall) -> None:
    hall.tell("command_unconfirmed", "m1", command="@command.forward")
    hall.tell("stop_unconfirmed", "m2")
    html = hall.page("/alarms")
    assert rows(html) == ["sys.stop_unconfirmed.m2", "sys.command_unconfirmed.m1"]
    assert "Command not confirmed: " in html and "@command" not in html
    detail = hall.page(f"/alarms/detail/{hall.one('sys.stop_unconfirmed.m2').occurrence}", "de")
    assert "Maschine mit der Vor-Ort-Bedienung stoppen." in unescape(detail)
    assert detail.count("<li>") >= 2, "each sentence of the response is a step"
    assert hall.client.get("/alarms/detail/999999").status_code == 404


def test_a_filter_is_loud_and_never_hides_the_banner(hall: Hall) -> None:
    hall.tell("command_unconfirmed", "m1")
    hall.tell("stop_unconfirmed", "m2")
    html = hall.page("/alarms?area=sys")
    assert rows(html) == []
    assert "FILTERED" in html and "Hidden: 2, unacknowledged: 2" in html
    assert "Stop: not confirmed" in html, "the banner does not know of filters"
    assert rows(hall.page("/alarms?priority=1")) == ["sys.stop_unconfirmed.m2"]
    assert rows(hall.page("/alarms?q=FAN+1")) == ["sys.command_unconfirmed.m1"], "by the name of the machine"
    assert rows(hall.page("/alarms?q=naredba", "hr")) == ["sys.command_unconfirmed.m1"], "in the reader's language"


@pytest.mark.parametrize(
    "query", ["tab=all", "priority=7", "priority=1&priority=2", "page=-1", "page=٣", "event=x", "state=B", "before=1e9"]
)
def test_an_address_that_makes_no_sense_is_refused(hall: Hall, query: str) -> None:
    assert hall.client.get(f"/alarms?{query}").status_code == 422


@pytest.mark.sweep(8)
def test_parameters_are_inert_everywhere(hall: Hall) -> None:
    hall.tell("task_down", task=EVIL)
    named = f"sys.task_down.{EVIL}"
    assert virtual.until(lambda: [one for one in hall.standing() if one.id == named])
    hall.staff.enter("eva", "operator")
    occurrence = hall.one(named).occurrence
    hall.staff.wait(hall.engine.journal.flush)
    paths = (
        "/",
        "/alarms",
        "/alarms/banner",
        "/alarms/list",
        "/alarms/summary",
        f"/alarms/detail/{occurrence}",
        "/alarms?tab=journal",
    )
    for path in paths:
        html = hall.page(path)
        assert "<img" not in html and "Server: task failed" in html, path
    hall.tell("task_down", None, False, task=EVIL)


def test_a_missing_text_comes_in_the_plants_language_with_its_mark(hall: Hall, monkeypatch: pytest.MonkeyPatch) -> None:
    hall.tell("audit_broken")
    texts = hall.runtime.texts
    without = {lang: dict(own) for lang, own in texts._product.items()}
    del without["cs"]["alarm.system.audit_broken.label"]
    monkeypatch.setattr(texts, "_product", without)
    assert "[hr] Revizijski zapis" in unescape(hall.page("/alarms?q=sys", "cs"))


def test_an_empty_list_says_what_is_not_there_and_never_that_no_alarm_is_active(hall: Hall) -> None:
    """Nor is a page beyond the last one empty: there were more alarms when it was opened."""
    hall.tell("history_quota", percent=83.5)
    hall.staff.enter("ana", "operator")
    hall.acknowledge(hall.one("sys.history_quota").occurrence)
    for lang, unack, hidden in zip(
        LANGUAGES,
        (
            "Nema nepotvrđenih alarma",
            "No unacknowledged alarms",
            "Keine unquittierten Alarme",
            "Žádné nekvitované alarmy",
        ),
        ("Nema skrivenih alarma", "No hidden alarms", "Keine ausgeblendeten Alarme", "Žádné skryté alarmy"),
        strict=True,
    ):
        for path in ("/alarms", "/alarms/list"):
            assert unack in unescape(hall.page(f"{path}?tab=unack", lang)), (lang, path)
            assert hidden in unescape(hall.page(f"{path}?tab=hidden", lang)), (lang, path)
            assert rows(hall.page(f"{path}?page=3", lang)) == ["sys.history_quota"], (lang, path)


@pytest.mark.sweep(8)
def test_many_alarms_open_in_time_and_in_pages(hall: Hall) -> None:
    hall.staff.enter("olga", "operator")
    engine = hall.engine
    # five thousand rows as the engine would hold them, without five thousand machines
    hall.tell("link_down", link="template")
    hall.tell("audit_broken")
    (base,) = [one for one in hall.standing() if one.id == "sys.audit_broken"]
    many = [replace(base, id=f"sys.x{n}", occurrence=10**6 + n, priority=1 + n % 4) for n in range(5000)]
    hall.staff.wait(setattr, engine.list, "_drawn", (engine.list.revision, many))
    began = time.process_time()
    html = hall.page("/alarms")
    assert time.process_time() - began < 2
    assert len(rows(html)) == 500
    assert "Alarms: 5000, shown at once: 500" in html
    assert rows(hall.page("/alarms?page=9"))[0] == "sys.x4500"
    hall.staff.wait(engine.list.touch)
    hall.tell("link_down", None, False, link="template")


# ---- acknowledging ----------------------------------------------------------------------------------------


def test_who_may_acknowledge_sees_the_buttons_and_nobody_else(hall: Hall) -> None:
    hall.tell("audit_broken")
    occurrence = hall.one("sys.audit_broken").occurrence
    for role, may in (("viewer", False), ("admin", False), ("operator", True), ("engineer", True)):
        hall.staff.enter(f"a_{role}", role)
        assert ("data-ack" in hall.page("/alarms")) is may, role
        assert ("banner-ack" in hall.page("/alarms/banner")) is may, role
    hall.staff.have()
    assert "data-ack" not in hall.page("/alarms")
    assert hall.staff.post("/alarms/acknowledge", {"occurrence": str(occurrence)}).status_code in (303, 401)


def test_a_viewer_cannot_acknowledge_by_hand_and_the_audit_has_it(hall: Hall) -> None:
    hall.tell("audit_broken")
    hall.staff.enter("vera", "viewer")
    answer = hall.acknowledge(hall.one("sys.audit_broken").occurrence)
    assert answer.status_code == 403
    assert hall.one("sys.audit_broken").unacked
    lines = hall.staff.wait(hall.staff.access.audit.find, Filter(person="vera"), 20)
    assert any(line.result == "refused" for line in lines)


def test_a_form_without_its_token_acknowledges_nothing(hall: Hall) -> None:
    hall.tell("audit_broken")
    hall.staff.enter("ana", "operator")
    occurrence = str(hall.one("sys.audit_broken").occurrence)
    assert (
        hall.client.post("/alarms/acknowledge", data={"occurrence": occurrence}, headers={"Origin": HOST}).status_code
        == 403
    )
    assert hall.one("sys.audit_broken").unacked


def test_acknowledging_says_so_and_the_second_one_by_whom(hall: Hall) -> None:
    hall.tell("audit_broken")
    occurrence = hall.one("sys.audit_broken").occurrence
    hall.staff.enter("ana", "operator")
    first = hall.acknowledge(occurrence, comment="I see it")
    assert (first.status_code, "1 alarm acknowledged" in first.text) == (200, True)
    again = hall.acknowledge(occurrence)
    assert (again.status_code, "1 alarm acknowledged" in again.text) == (200, True), "a double click is no news"
    hall.staff.enter("ivo", "operator")
    second = hall.acknowledge(occurrence)
    assert (second.status_code, "Already acknowledged by ana" in second.text) == (200, True)
    lines = hall.staff.wait(hall.staff.access.audit.find, Filter(kind="alarm"), 50)
    ours = [line for line in lines if line.object == "sys.audit_broken" and line.new == str(occurrence)]
    assert [line.person for line in ours] == ["ana"]
    journal = hall.page("/alarms?tab=journal&event=ACK")
    assert "I see it" in journal
    hall.staff.have()
    journal = hall.page("/alarms?tab=journal&event=ACK")
    assert "I see it" not in journal and "ana<" not in journal


def test_exactly_what_was_on_the_screen_is_acknowledged(hall: Hall) -> None:
    for name in ("one", "two", "three"):
        hall.tell("link_down", link=name)
    hall.tell("audit_broken")
    hall.tell("audit_waiting")
    hall.tell("history_full")
    hall.staff.enter("ana", "operator")
    seen = [hall.one(id).occurrence for id in ("sys.audit_broken", "sys.audit_waiting")]
    answer = hall.acknowledge(*seen)
    assert "2 alarms acknowledged" in answer.text
    assert hall.one("sys.history_full").unacked
    mixed = hall.acknowledge(seen[0], hall.one("sys.history_full").occurrence, 999_999)
    assert "Acknowledged: 1. Not acknowledged, changed in the meantime: 2" in mixed.text
    for name in ("one", "two", "three"):
        hall.tell("link_down", None, False, link=name)


@pytest.mark.parametrize(
    "fields",
    [{}, {"occurrence": "x"}, {"occurrence": "-1"}, {"occurrence": ["1"] * 501}, {"occurrence": "1", "all": "1"}],
)
def test_an_acknowledgement_names_occurrences_and_nothing_else(hall: Hall, fields: dict[str, Any]) -> None:
    hall.staff.enter("ana", "operator")
    assert hall.staff.post("/alarms/acknowledge", fields).status_code == 422


def test_a_reset_is_refused_with_its_reason(hall: Hall) -> None:
    hall.tell("audit_broken")
    hall.staff.enter("ana", "operator")
    hall.client.cookies.set("pogon_lang", "en")
    occurrence = hall.one("sys.audit_broken").occurrence
    answer = hall.staff.post("/alarms/reset", {"occurrence": str(occurrence)}, **{"HX-Request": "true"})
    assert answer.status_code == 409
    assert "still active" in answer.text
    assert hall.staff.post("/alarms/reset", {"occurrence": "999999"}).status_code == 404


# ---- banner, marks, summary -------------------------------------------------------------------------------


def test_the_banner_of_every_page_has_the_most_important_one_and_the_counts(hall: Hall) -> None:
    hall.tell("history_quota", percent=83)
    hall.tell("stop_unconfirmed", "m2")
    for path in ("/", "/alarms", "/equipment/m1", "/alarms/banner"):
        html = hall.page(path)
        assert "Stop: not confirmed" in html and "1 more" in html, path
    html = hall.page("/")
    assert '"of":{"m2":[1,"unack"]}' in unescape(html)
    assert re.search(r'data-mark-area="drives"><svg class="alm alm-1[^"]*" data-state="ack"', html), "tabs do not flash"
    assert re.search(r'data-mark-of="m2"[^>]*><svg class="alm alm-1 alm-l" data-state="unack"', html)
    assert re.search(r'data-mark-of="m1"[^>]*></span>', html)
    assert '"part":{"m2.stop":[1,"unack"]}' in unescape(html)


@pytest.mark.sweep(20)
@pytest.mark.parametrize(
    ("lang", "told"), [("hr", "09.03. 23:59"), ("en", "09/03 23:59"), ("de", "09.03. 23:59"), ("cs", "09.03. 23:59")]
)
def test_the_banner_says_of_which_day_an_alarm_is(tmp_path: Path, lang: str, told: str) -> None:
    evening = datetime(2026, 3, 9, 22, 59, 50, tzinfo=UTC)  # ten seconds before the midnight of the plant
    with virtual.house(Settings(data=tmp_path / "data"), begin=evening) as client:
        hall = Hall(client)
        hall.tell("stop_unconfirmed", "m2")
        for path in ("/", "/alarms/banner"):
            assert re.findall(r"<time class=\"num\"[^>]*>(.*?)</time>", hall.page(path, lang))[0].startswith(
                "23:59:"
            ), path
        client.pass_time(30)
        for path in ("/", "/alarms/banner"):
            shown = re.findall(r"<time class=\"num\"[^>]*>(.*?)</time>", hall.page(path, lang))[0]
            assert re.fullmatch(re.escape(told) + r":\d\d", shown), path


def test_the_hour_that_comes_twice_is_told_apart(tmp_path: Path) -> None:
    with virtual.house(Settings(data=tmp_path / "data"), begin=datetime(2026, 10, 25, 0, 30, 5, tzinfo=UTC)) as client:
        hall = Hall(client)
        hall.tell("stop_unconfirmed", "m2")
        for path in ("/alarms/list", "/alarms/banner"):
            assert re.search(r"02:30:\d\d(,\d{3})? \+02:00", hall.page(path, "hr")), path


def test_the_summary_counts_by_machine(hall: Hall) -> None:
    hall.tell("stop_unconfirmed", "m2")
    hall.tell("audit_broken")
    html = hall.page("/alarms/summary")
    lines = {
        name: re.findall(r"<b>(\d+)</b>", cells)
        for name, cells in re.findall(r'<th scope="row">(.*?)</th>(.*?)</tr>', html, re.S)
    }
    others: list[str] = []
    calm = dict.fromkeys(("Fan 1", "Conveyor 1", "Coil car 1", "Coil transport 1", "Crane 1", "Axis 1"), others)
    assert lines == {**calm, "Fan 2": ["1"], "System": ["1"]}


def test_the_summary_of_an_area_has_its_machines_and_alarms_only(hall: Hall) -> None:
    hall.tell("stop_unconfirmed", "m2")
    hall.tell("stop_unconfirmed", "c1")
    drives, lines = hall.page("/alarms/summary?area=drives"), hall.page("/alarms/summary?area=conveyors")
    assert re.findall(r'<th scope="row">(.*?)</th>', drives) == ["Fan 1", "Fan 2", "Axis 1"]
    assert re.findall(r'<th scope="row">(.*?)</th>', lines) == ["Conveyor 1"]
    assert drives.count("<li>") == lines.count("<li>") == 1 and 'href="/alarms?area=drives"' in drives


def test_a_new_alarm_changes_the_tag_that_pages_listen_to(hall: Hall) -> None:
    tags = hall.runtime.tags
    virtual.pass_time(0.6)
    before = tags.sample("sys.alarms.revision").value
    hall.tell("audit_broken")
    assert virtual.until(lambda: tags.sample("sys.alarms.revision").value != before)
    assert tags.sample("sys.alarms.unack_1").value == 1
    assert "sys.alarms.revision" in page_tags("equipment/m1", hall.runtime.plant, hall.runtime.points)


def test_a_value_above_its_limit_is_written_with_its_limit(hall: Hall) -> None:
    one = replace(_heatsink(hall), value=81.0, limit=75.0)
    for lang, text in {"en": "81 > 75", "hr": "81 > 75"}.items():
        engine = hall.engine
        hall.staff.wait(setattr, engine.list, "_drawn", (engine.list.revision, [one]))
        assert text in unescape(hall.page("/alarms", lang))
    hall.staff.wait(hall.engine.list.touch)


@pytest.mark.parametrize("lang", LANGUAGES)
def test_programs_read_the_text_that_people_read(hall: Hall, lang: str) -> None:
    for file in ("pogon.db", "history.db"):
        hall.tell("database_lost", None, file=file, loss="@alarm.loss.removed")
    hall.tell("stop_unconfirmed", "m1")
    hall.tell("link_down", None, link="hall")
    standing = [*hall.standing(), replace(_heatsink(hall), occurrence=10**9, value=81.25, limit=75.0)]
    hall.staff.wait(setattr, hall.engine.list, "_drawn", (hall.engine.list.revision, standing))
    hall.client.cookies.set("pogon_lang", lang)
    told = {one["occurrence"]: one["text"] for one in hall.client.get("/api/v1/alarms").json()}
    page = unescape(hall.page("/alarms", lang))
    assert set(told) == {one.occurrence for one in standing}
    for text in told.values():
        assert text in page and not re.search(r"[@{}\[\]]", text), text
    hall.staff.wait(hall.engine.list.touch)
    for file in ("pogon.db", "history.db"):
        hall.tell("database_lost", None, False, file=file)
    hall.tell("link_down", None, False, link="hall")


def _heatsink(hall: Hall) -> ListedAlarm:
    hall.tell("stop_unconfirmed", "m1")
    row = next(alarm for alarm in hall.runtime.plant.equipment["m1"].alarms if alarm.key == "heatsink_high")  # type: ignore[union-attr]
    base = hall.one("sys.stop_unconfirmed.m1")
    return replace(base, id="m1.heatsink_high", label=row.label, point=row.value, priority=row.priority)


# ---- the journal ------------------------------------------------------------------------------------------


@pytest.mark.sweep(8)
def test_the_journal_has_pages_filters_and_every_transition(hall: Hall) -> None:
    hall.staff.enter("ana", "operator")
    for _ in range(60):
        hall.tell("command_unconfirmed", "m1")
        hall.acknowledge(hall.one("sys.command_unconfirmed.m1").occurrence)
    first = hall.page("/alarms?tab=journal&source=m1")
    numbers = [int(n) for n in re.findall(r'<td class="r num dim">(\d+)</td>', first)]
    assert numbers == sorted(numbers, reverse=True)
    assert len(numbers) == 100
    older = re.search(r'href="([^"]*before=\d+)" rel="next"', first)
    assert older
    second = [int(n) for n in re.findall(r'<td class="r num dim">(\d+)</td>', hall.page(unescape(older[1])))]
    assert max(second) < min(numbers)
    assert "Acknowledged" not in re.findall(
        r"<tbody>.*</tbody>", hall.page("/alarms?tab=journal&event=RAISED&source=m1"), re.S
    )[0].replace("Active, acknowledged", "")
    assert "no records" in hall.page("/alarms?tab=journal&until=2020-01-01T00:00")
    assert hall.client.get("/alarms?tab=journal&since=yesterday").status_code == 422


def test_the_journal_goes_home_with_the_shift_of_each_line(hall: Hall) -> None:
    hall.tell("command_unconfirmed", "m1")
    hall.staff.enter("ana", "operator")
    hall.staff.wait(hall.engine.journal.flush)
    lines = hall.client.get("/alarms.csv?tab=journal&shift=1").text.splitlines()
    head, *rows = list(csv.reader(lines[1:]))
    assert head[-1] == "shift" and rows
    for row in rows:
        begun, time = datetime.fromisoformat(row[-1]), datetime.fromisoformat(row[2])
        assert begun.hour in (6, 14, 22) and timedelta() <= time - begun < timedelta(hours=9)
    assert "shift=1" in hall.page("/alarms?tab=journal")
    assert "shift" not in hall.client.get("/alarms.csv?tab=journal").text.splitlines()[1]


def test_an_alarm_over_which_the_clock_was_set_back_lasted_nobody_knows_how_long(hall: Hall) -> None:
    hall.tell("audit_broken")
    hall.staff.enter("ana", "operator")
    clock: Any = hall.runtime.clock

    def lasted() -> list[str]:
        lines = hall.client.get("/alarms.csv?tab=active&area=sys").text.splitlines()[1:]
        return [row["duration_s"] for row in csv.DictReader(lines)]

    assert float(lasted()[0]) >= 0
    clock.step_wall(-3600)
    try:
        assert lasted() == [""]
    finally:
        clock.step_wall(3600)


def test_the_export_is_what_the_filter_shows_and_defuses_formulas(hall: Hall) -> None:
    hall.tell("link_down", link="=1+1")
    hall.tell("audit_broken")
    hall.staff.enter("ana", "operator")
    hall.acknowledge(hall.one("sys.audit_broken").occurrence, comment="=HYPERLINK(1)")
    for tab, columns in (("active", 13), ("journal", 21)):
        answer = hall.client.get(f"/alarms.csv?tab={tab}&area=sys")
        assert answer.status_code == 200
        table = list(csv.reader(io.StringIO(answer.text.removeprefix("\ufeff"))))
        assert table[0] == [f"# tab={tab}; area=sys"]
        assert {len(row) for row in table[1:]} == {columns}
        assert not any(cell.startswith(("=", "@")) for row in table for cell in row)
    assert "'=HYPERLINK(1)" in answer.text
    hall.staff.have()
    assert hall.client.get("/alarms.csv").status_code in (303, 401), "a visitor takes nothing home"
    hall.tell("link_down", None, False, link="=1+1")


# ---- every text -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("lang", LANGUAGES)
def test_every_alarm_of_the_plant_and_of_the_system_has_its_text_in_every_language(hall: Hall, lang: str) -> None:
    plant, texts = hall.runtime.plant, hall.runtime.texts
    assert plant
    for item in plant.equipment.values():
        for alarm in item.alarms:
            text = texts.of_type(lang, item.type, alarm.label)
            assert not text.startswith("["), (lang, alarm.key)
            assert len(text) <= 60
    for key, told in SYSTEM_ALARMS.items():
        row = told.row(key)
        for name in (row.label, row.consequence, row.cause, row.response):
            assert not texts.text(lang, name).startswith("["), (lang, name)


def test_the_journal_is_narrowed_to_a_state_and_its_address_can_be_sent(hall: Hall) -> None:
    hall.tell("history_quota", percent=83)
    hall.staff.enter("ana", "operator")
    hall.acknowledge(hall.one("sys.history_quota").occurrence)
    address = "/alarms?tab=journal&state=ack&q=history_quota"
    for session in ("ana", ""):
        if not session:
            hall.staff.have()
        html = unescape(hall.page(address))
        found = set(re.findall(r'<td class="lab">[^<]* → ([^<]*)</td>', html))
        assert found == {"Active, acknowledged"}, session
        assert '<option value="ack" selected>' in html and "FILTERED" in html


@pytest.mark.sweep(8)
@pytest.mark.parametrize("lang", LANGUAGES)
def test_an_alarm_of_a_machine_that_a_reload_took_away_is_listed_and_told(hall: Hall, lang: str) -> None:
    hall.tell("left_changed", "gone", point="@set_frequency")
    try:
        occurrence = hall.one("sys.left_changed.gone").occurrence
        for path in (
            "/",
            "/alarms",
            "/alarms?tab=unack",
            "/alarms?tab=journal",
            "/alarms/statistics",
            "/equipment/m1",
            "/area/drives",
            "/api/v1/alarms",
        ):
            assert "Traceback" not in hall.page(path, lang)
        assert "gone" in hall.page("/alarms", lang)
        assert "gone" in hall.page(f"/alarms/detail/{occurrence}", lang)
    finally:
        hall.tell("left_changed", "gone", False)
        hall.calm()
