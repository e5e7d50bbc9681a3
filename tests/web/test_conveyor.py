"""The screen of a line of belts over HTTP: whole in every language, products as rows, deeds with a reason, an instructor's hand."""

import asyncio
import itertools
import re
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app import bundled
from app.access.audit.search import Filter
from app.plant.loader import read_plant
from app.running.page_tags import page_tags
from app.settings import Settings
from app.sim.conveyor import training as own
from app.sim.machines import MACHINE_FAULTS
from app.tags.quality import is_bad, is_good
from app.web.drawing import Scale
from app.web.points import EquipmentView, PointView
from app.web.tables import TableView
from tests.line_plant import plant
from tests.virtual import house
from tests.web.conftest import _running
from tests.web.operating import Operator, button, line_of, runtime_of, until, words
from tests.web.people import Staff

LANGUAGES = ("hr", "en", "de", "cs")
PLANT = (
    plant('start = "automatic", interval = 5')
    + """
[equipment.c2]
type = "conveyor"
link = "hall"
unit = 11
preset = "simulation"
line_length = 1800
belt_1_end = 600
belt_2_end = 1200
sensor_1 = 200
sensor_2 = 600
sensor_3 = 1200
sensor_4 = 1500
product_slots = 12
label = { hr = "Traka 2", en = "Conveyor 2", de = "Förderer 2", cs = "Dopravník 2" }
simulation = { start = "stopped", arrivals = 0 }
"""
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("plant")
    (found / "plant.toml").write_text(PLANT, "utf-8")
    return found


@pytest.fixture(scope="module")
def line(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    with _running(tmp_path_factory.mktemp("line") / "data", folder) as client:
        tags = runtime_of(client).tags
        assert until(lambda: tags.sample("c1.product_1_id").value and tags.sample("c2.state").value == 0, 30)
        yield client


@pytest.fixture(scope="module")
def crew(line: TestClient) -> Staff:
    return Staff(line)


@pytest.fixture
def ivo(crew: Staff) -> Iterator[Operator]:
    """An engineer who holds both lines."""
    person = Operator(crew, "ivo", ("engineer", "operator"))
    for machine in ("c1", "c2"):
        person.take(machine)
    gate = runtime_of(crew.client).gate
    assert gate is not None
    gate._admission.rate.take = lambda person: True  # type: ignore[method-assign]
    yield person
    for machine in ("c1", "c2"):
        person.post(f"/equipment/{machine}/token/release")
        assert until(lambda name=machine: (p := gate.progress(name)) is None or p.over)


def value(client: TestClient, name: str) -> Any:
    return runtime_of(client).tags.sample(name).value


def table(client: TestClient, machine: str) -> TableView:
    runtime = runtime_of(client)
    assert runtime.plant
    return TableView(EquipmentView(runtime.plant.equipment[machine], runtime, "en", lambda key, **_: key), "product")


def press_until_a_product_stands(person: Operator, machine: str, head: str, length: str) -> None:
    """Insert a product into the table of a line that stands still."""
    answer = person.press(
        f"/equipment/{machine}/command/insert_product", arg_head=head, arg_length=length, confirmed="1", reason="test"
    )
    assert answer.status_code in (200, 202), line_of(answer)


# ---- the page ------------------------------------------------------------------------------------------------


@pytest.mark.sweep(8)
@pytest.mark.parametrize("lang", LANGUAGES)
@pytest.mark.parametrize(
    "path",
    [
        "/equipment/c1",
        "/equipment/c1/faceplate",
        "/",
        "/equipment/c1/part/products",
        "/equipment/c1/part/first",
        "/equipment/c1/page/ramp",
        "/equipment/c2/page/ramp?belt=3",
    ],
)
def test_every_page_of_a_line_is_whole_in_every_language(crew: Staff, line: TestClient, lang: str, path: str) -> None:
    crew.have(crew.enter("ivana", "engineer"))
    line.cookies.set("pogon_lang", lang)
    answer = line.get(path)
    assert answer.status_code == 200
    assert not re.findall(r"[>\"]\s*\[[a-z_.]+\]", answer.text), "a key shows where a text is missing"
    assert not re.findall(r"\[(?:hr|en|de|cs)\] ", answer.text)
    assert not re.search(r"<[^>]*\s(style|on[a-z]+)=", answer.text)


def test_the_picture_is_drawn_to_the_scale_of_each_line(crew: Staff, line: TestClient) -> None:
    crew.have(crew.enter("ivana", "engineer"))
    line.cookies.set("pogon_lang", "en")
    short, long = line.get("/equipment/c1").text, line.get("/equipment/c2").text
    for page, total, sensors in ((short, 660, (100, 215, 445, 560)), (long, 1800, (200, 600, 1200, 1500))):
        scale = Scale(0, total, 40, 872)
        assert f'data-factor="{scale.factor:.6f}"' in page
        for place in sensors:
            assert f'd="M{scale.at(place)} 60V164"' in page
    assert 'data-ends="215.0 445.0 660.0"' in short and 'data-ends="600.0 1200.0 1800.0"' in long
    assert short.count('class="prod"') == 20 and long.count('class="prod"') == 12


def test_the_ruler_ends_with_the_line_and_its_numbers_keep_apart() -> None:
    for length in (660, 610, 1800, 345.5, 25000):
        scale = Scale(0, length, 40, 872)
        assert scale.labels[0] == 0 and scale.labels[-1] == length
        places = [scale.at(label) for label in scale.labels]
        assert min(b - a for a, b in itertools.pairwise(places)) > 40
        assert scale.ticks[0] == 0 and scale.ticks[-1] <= length


@pytest.mark.sweep(8)
def test_products_stand_in_the_table_in_the_order_of_the_line(folder: Path, tmp_path: Path) -> None:
    with _running(tmp_path / "data", folder) as line:  # one that no other test has stopped
        _in_their_order(line)


def _in_their_order(line: TestClient) -> None:
    assert until(lambda: (value(line, "c1.products") or 0) >= 3, 40)
    rows = table(line, "c1").by("head")
    heads = [row.number("head") or 0 for row in rows]
    assert len(rows) >= 3 and heads == sorted(heads)
    ids = [row.id for row in rows]
    assert ids == sorted(ids, reverse=True), "first in, furthest along"
    page = line.get("/equipment/c1/part/products").text
    assert re.findall(r'data-product="(\d+)"', page)


@pytest.fixture
def fresh_line(folder: Path, tmp_path: Path) -> Iterator[TestClient]:
    """As `line`, and nobody has touched it."""
    with _running(tmp_path / "data", folder) as client:
        yield client


def test_the_last_start_of_each_belt_is_drawn_and_a_line_that_never_ran_says_so(fresh_line: TestClient) -> None:
    line, crew = fresh_line, Staff(fresh_line)
    crew.have(crew.enter("ivana", "engineer"))
    line.cookies.set("pogon_lang", "en")
    assert until(lambda: value(line, "c1.ramp_1_state") == 2, 30), "its first start is over"
    for belt, asked in ((1, "1"), (1, "0"), (3, "3"), (3, "99"), (1, "x")):
        page = line.get(f"/equipment/c1/page/ramp?belt={asked}").text
        assert re.search(rf'href="\?belt={belt}" aria-current="true"', page)
        assert f"/equipment/c1/part/ramp?belt={belt}" in page
    drawn = line.get("/equipment/c1/part/ramp?belt=1").text
    for lane in ("speed", "acceleration", "jerk"):
        assert re.search(rf'c-trace-{lane}" d="M[\d.]+ [\d.]+L', drawn)
    told = re.findall(r'<dd class="num">(.*?)</dd>', drawn, re.DOTALL)
    assert [" ".join(one.split()) for one in told] == ["0.0 – 30.0 %", "0.75 s", "7.1 mm", "60.0 %/s", "240 %/s²"]
    assert until(lambda: value(line, "c2.ramp_generation") is not None, 10)
    never = line.get("/equipment/c2/part/ramp?belt=1").text
    assert "No start since" in never and "No stop since" in never and "c-trace" not in never


@pytest.mark.sweep(8)
def test_a_line_without_two_products_has_no_gap_and_nothing_is_bad_about_it(fresh_line: TestClient) -> None:
    line, crew = fresh_line, Staff(fresh_line)
    crew.have(crew.enter("gita", "engineer"))
    line.cookies.set("pogon_lang", "en")
    tags = runtime_of(line).tags
    assert until(lambda: is_good(tags.sample("c2.products").quality), 30)
    face = line.get("/equipment/c2/faceplate").text
    gap, none = (
        re.search(rf'<div class="f-v" data-tag="c2.products" data-show="{when}"( hidden)?>(.*?)</div>', face, re.DOTALL)
        for when in (">1,bad", "0,1")
    )
    assert gap and gap[1] and 'data-tag="c2.gap_limit"' in gap[2]
    assert none and not none[1] and "–" in none[2]
    told = face.replace(gap[0], "")
    assert 'data-tag="c2.smallest_gap"' not in told and 'data-tag="c2.gap_limit"' not in told


def test_of_a_silent_line_no_area_is_drawn_that_is_not_known(fresh_line: TestClient) -> None:
    """Its device says where they end: without that the first would span the line, and the others lie on each other at its end."""
    line, crew = fresh_line, Staff(fresh_line)
    crew.have(crew.enter("gita", "engineer"))
    tags = runtime_of(line).tags
    assert until(lambda: is_good(tags.sample("c1.area_end_1").quality), 30)
    assert line.get("/equipment/c1").text.count('<rect class="c-ground"') == 4
    crew.post("/instructor/c1/line", {"mode": "1"})
    try:
        assert until(lambda: is_bad(tags.sample("c1.area_end_1").quality), 30)
        drawn = line.get("/equipment/c1").text
        assert "data-conveyor" in drawn and 'class="c-ground"' not in drawn
    finally:
        crew.post("/instructor/c1/line", {"mode": "0"})
    assert until(lambda: is_good(tags.sample("c1.area_end_1").quality), 30)


def test_only_the_page_of_the_line_carries_every_cell(line: TestClient) -> None:
    runtime = runtime_of(line)
    assert "c1.product_1_head" in page_tags("equipment/c1", runtime.plant, runtime.points)
    for kind in ("overview", "faceplate/c1", "parameters/c1"):
        names = page_tags(kind, runtime.plant, runtime.points)
        assert "c1.products" in names and "c1.product_1_head" not in names


def test_a_product_that_has_gone_is_said_to_be_gone(crew: Staff, line: TestClient) -> None:
    crew.have(crew.enter("ivana", "engineer"))
    line.cookies.set("pogon_lang", "en")
    answer = line.get("/equipment/c1/table/product/999999", headers={"HX-Request": "true"})
    assert answer.status_code == 404 and "no longer there" in answer.text
    assert line.get("/equipment/c1/table/nothing/1").status_code == 404
    assert line.get("/equipment/c1/part/..%2Fpage").status_code == 404
    assert line.get("/equipment/c1/part/nothing").status_code == 404
    assert line.get(f"/equipment/c1/part/{'a' * 300}").status_code == 404
    assert line.get(f"/equipment/c1/part/{'ž' * 200}").status_code == 404


def test_one_product_is_told_with_what_can_be_done(ivo: Operator) -> None:
    line = ivo.staff.client
    assert until(lambda: table(line, "c1").rows, 30)
    answer = ivo.get(f"/equipment/c1/table/product/{table(line, 'c1').rows[0].id}")
    assert answer.status_code == 200
    text = words(answer.text)
    assert "Head position" in text and "Entered at" in text and re.search(r"Entered at \d\d:\d\d:\d\d\.\d{3}", text)
    assert "/ask/delete_product?product=" in answer.text


# ---- deeds ----------------------------------------------------------------------------------------------------


def test_the_dialog_asks_for_what_the_command_needs_and_knows_the_row(ivo: Operator) -> None:
    press_until_a_product_stands(ivo, "c2", "400", "50")
    line = ivo.staff.client
    assert until(lambda: table(line, "c2").rows)
    row = table(line, "c2").rows[-1]
    answer = ivo.get(f"/equipment/c2/ask/edit_product?product={row.id}")
    assert answer.status_code == 200
    assert f'name="arg_product" value="{row.id}"' in answer.text
    assert 'name="arg_head" value="400.0"' in answer.text and 'name="arg_length" value="50.0"' in answer.text
    assert "0 – 1 800 mm" in words(answer.text)
    assert 'name="reason"' in answer.text and f"#{row.id}" in words(answer.text)
    ivo.language = "de"
    assert 'value="400,0"' in ivo.get(f"/equipment/c2/ask/edit_product?product={row.id}").text
    ivo.language = "en"


def test_an_engineer_moves_and_deletes_a_product_and_the_audit_says_why(ivo: Operator) -> None:
    line = ivo.staff.client
    press_until_a_product_stands(ivo, "c2", "900", "40")
    assert until(lambda: any(row.number("head") == 900 for row in table(line, "c2").rows))
    row = next(row for row in table(line, "c2").rows if row.number("head") == 900)
    given = {"arg_product": str(row.id), "arg_head": "1000.5", "arg_length": "42", "confirmed": "1"}
    answer = ivo.press("/equipment/c2/command/edit_product", **given, reason="measured by hand")
    assert answer.status_code in (200, 202), line_of(answer)
    assert until(lambda: (found := table(line, "c2").row(row.id)) is not None and found.number("head") == 1000.5)
    given = {"arg_product": str(row.id), "confirmed": "1"}
    answer = ivo.press("/equipment/c2/command/delete_product", **given, reason="taken off the belt")
    assert answer.status_code in (200, 202), line_of(answer)
    assert until(lambda: table(line, "c2").row(row.id) is None)

    def told() -> list[str]:
        lines = ivo.staff.wait(ivo.staff.access.audit.find, Filter(), 60)
        return [str(line) for line in lines if "delete_product" in str(line)]

    assert until(lambda: any("taken off the belt" in line and f"product = {row.id}" in line for line in told())), told()


def test_without_a_reason_nothing_is_deleted(ivo: Operator) -> None:
    line = ivo.staff.client
    press_until_a_product_stands(ivo, "c2", "300", "40")
    assert until(lambda: table(line, "c2").rows)
    row = table(line, "c2").rows[0]
    answer = ivo.press("/equipment/c2/command/delete_product", arg_product=str(row.id), confirmed="1")
    assert answer.status_code in (409, 422)
    assert table(line, "c2").row(row.id) is not None


def test_a_reason_is_a_sentence_and_no_book(ivo: Operator, line: TestClient) -> None:
    row = table(line, "c1").rows[0]
    url, given = "/equipment/c1/command/delete_product", {"arg_product": str(row.id), "confirmed": "1"}
    asked = ivo.get(f"/equipment/c1/ask/delete_product?product={row.id}").text
    assert re.search(r'name="reason"[^>]*maxlength="300"', asked)
    answer = ivo.press(url, **given, reason="x" * 5000)
    assert answer.status_code == 422
    assert line_of(answer) == "Reason too long: 5000 characters, permitted 300"
    assert table(line, "c1").row(row.id) is not None
    assert (
        ivo.press("/equipment/c1/parameters", key="jerk", value="250", expected="", reason="x" * 301).status_code == 422
    )


def test_what_is_out_of_range_is_named_with_the_range(ivo: Operator) -> None:
    answer = ivo.press(
        "/equipment/c2/command/insert_product", arg_head="5000", arg_length="50", confirmed="1", reason="x"
    )
    assert answer.status_code == 422 and "0 to 1 800 mm" in line_of(answer)


def test_an_operator_may_not_touch_the_record_of_products(crew: Staff, line: TestClient) -> None:
    ana = Operator(crew, "ana", ("operator",))
    ana.take("c1")
    try:
        page = ana.get("/equipment/c1/commands").text
        assert 'aria-disabled="true"' in button(type("Page", (), {"text": page})(), "c1.delete_product")
        row = table(line, "c1").rows[0]
        assert ana.get(f"/equipment/c1/ask/delete_product?product={row.id}").status_code == 409
        given = {"arg_product": str(row.id), "confirmed": "1", "reason": "because"}
        answer = ana.press("/equipment/c1/command/delete_product", **given)
        assert answer.status_code == 403
        assert table(line, "c1").row(row.id) is not None
    finally:
        ana.post("/equipment/c1/token/release")


def test_a_command_without_arguments_has_no_dialog_for_them(ivo: Operator) -> None:
    assert ivo.get("/equipment/c1/ask/stop").status_code == 404
    assert ivo.get("/equipment/c1/ask/nothing").status_code == 404


@pytest.mark.sweep(8)
def test_by_hand_one_belt_moves_alone(ivo: Operator, line: TestClient) -> None:
    assert ivo.press("/equipment/c2/command/select_manual", confirmed="1").status_code == 202
    assert until(lambda: value(line, "c2.mode") == 2)
    lease = ivo.press("/equipment/c2/hold/jog_reverse_2").json()["lease"]
    ivo.sit()
    with line.websocket_connect("ws://127.0.0.1:8000/live", headers={"origin": "http://127.0.0.1:8000"}) as socket:
        socket.send_json({"subscribe": "frame", "rev": 0})
        for counter in range(1, 12):
            socket.send_json({"hold": {"equipment": "c2", "lease": lease, "counter": counter}})
            while "hold" not in (message := socket.receive_json()):
                pass
            assert message["hold"] == {"lease": lease, "counter": counter}
            ivo.staff.wait(asyncio.sleep, 0.1)
        assert until(lambda: value(line, "c2.speed_2") < -1, 2)
        assert [value(line, f"c2.speed_{n}") for n in (1, 3)] == [0, 0]
    assert until(lambda: value(line, "c2.moving") == 0)


# ---- the instructor --------------------------------------------------------------------------------------------


def test_an_instructor_finds_every_fault_of_a_line_by_its_name(crew: Staff, line: TestClient) -> None:
    crew.have(crew.enter("ivana", "engineer"))
    for lang in LANGUAGES:
        line.cookies.set("pogon_lang", lang)
        page = line.get("/instructor/c1").text
        assert not re.findall(r"[>\"]\s*\[[a-z_.0-9]+\]", page)
        for code in MACHINE_FAULTS["conveyor"]:
            assert re.search(rf'value="{code}"[^>]*><span><b>[^<\d]*[^<]+</b><small>[^<]{{20,}}', page), code


def test_a_jam_is_caused_stops_the_line_and_is_told_as_the_first_cause(crew: Staff, line: TestClient) -> None:
    crew.have(crew.enter("ivana", "engineer"))
    line.cookies.set("pogon_lang", "en")
    assert crew.post("/instructor/c1/fault", {"code": "2"}).status_code == 303
    try:
        assert until(lambda: value(line, "c1.motor_2") == 4 and value(line, "c1.first_out"))
        told = words(line.get("/equipment/c1/part/first").text)
        assert re.match(r"first Stopped: section 2, belt jammed \d\d:\d\d:\d\d\.\d{3}", told)
        assert "Section 2: belt jams" in line.get("/instructor/c1/active").text
    finally:
        crew.post("/instructor/c1/fault", {"code": "0"})


@pytest.mark.sweep(8)
def test_what_stopped_the_line_yesterday_is_not_told_as_of_today(folder: Path, tmp_path: Path) -> None:
    evening = datetime(2026, 3, 9, 22, 59, 30, tzinfo=UTC)  # half a minute before the midnight of the plant
    with house(Settings(plant=folder, data=tmp_path / "data"), begin=evening) as client:
        crew = Staff(client)
        crew.have(crew.enter("ivana", "engineer"))
        client.cookies.set("pogon_lang", "de")
        assert until(lambda: value(client, "c1.state") is not None)
        assert crew.post("/instructor/c1/fault", {"code": "2"}).status_code == 303
        assert until(lambda: value(client, "c1.first_out"), 20)
        told = re.compile(r"\b09\.03\. 23:59:\d\d$|\b23:59:\d\d,\d{3}$")
        seen = told.search(words(client.get("/equipment/c1/part/first").text).strip())
        assert seen and seen[0].startswith("23:59:")
        client.pass_time(40)
        seen = told.search(words(client.get("/equipment/c1/part/first").text).strip())
        assert seen and seen[0].startswith("09.03. 23:59:")


@pytest.mark.parametrize(
    ("rear", "said"), [(12.0, "products 12 and 13 are too near"), (0.0, "two products are too near")]
)
def test_a_line_held_by_two_products_says_how_it_goes_on(
    crew: Staff, line: TestClient, monkeypatch: pytest.MonkeyPatch, rear: float, said: str
) -> None:
    crew.have(crew.enter("ivana", "engineer"))
    line.cookies.set("pogon_lang", "en")
    assert "Held by gap supervision" not in words(line.get("/equipment/c2/part/first").text)
    held, real = {"gap_stop": 1.0, "gap_rear": rear, "gap_front": 13.0}, EquipmentView.point

    def point(machine: EquipmentView, key: str) -> PointView:
        found = real(machine, key)
        return replace(found, value=held[key], text=f"{held[key]:.0f}", state="good") if key in held else found

    monkeypatch.setattr(EquipmentView, "point", point)
    told = words(line.get("/equipment/c2/part/first").text)
    assert said in told and "take one off and delete its record, then start" in told


def test_a_sensor_pressed_by_hand_stays_pressed_until_it_is_pressed_again(crew: Staff, line: TestClient) -> None:
    crew.have(crew.enter("ivana", "engineer"))
    line.cookies.set("pogon_lang", "en")
    for pressed in (1, 0):
        answer = crew.post("/instructor/c2/act", {"act": "sensor", "value": "3"}, **{"HX-Request": "true"})
        assert answer.status_code == 200 and "Read back" in answer.text
        states = re.findall(r'value="(\d)" form="hand-sensor-c2"\s+id="[^"]*" aria-pressed="(\w+)"', answer.text)
        assert dict(states)["3"] == ("true" if pressed else "false")
        assert until(lambda wanted=pressed: value(line, "c2.beam_3") == wanted)


def test_a_product_put_by_hand_is_seen_by_nobody_until_a_sensor_sees_it(crew: Staff, line: TestClient) -> None:
    crew.have(crew.enter("ivana", "engineer"))
    before = value(line, "c2.products")
    answer = crew.post("/instructor/c2/act", {"act": "put", "value": "210"}, **{"HX-Request": "true"})
    assert answer.status_code == 200
    assert until(lambda: value(line, "c2.beam_1") == 1)
    assert crew.post("/instructor/c2/act", {"act": "remove", "value": "1"}).status_code == 303
    assert until(lambda: value(line, "c2.beam_1") == 0)
    assert before is not None


@pytest.mark.parametrize(
    ("given", "status"),
    [
        ({"act": "sensor", "value": "5"}, 422),
        ({"act": "sensor", "value": "0"}, 422),
        ({"act": "put", "value": "-1"}, 422),
        ({"act": "remove", "value": ""}, 422),
        ({"act": "explode", "value": "1"}, 422),
    ],
)
def test_a_hand_that_means_nothing_is_refused(
    crew: Staff, line: TestClient, given: dict[str, str], status: int
) -> None:
    crew.have(crew.enter("ivana", "engineer"))
    assert crew.post("/instructor/c2/act", given).status_code == status


def test_arrivals_and_lengths_are_set_and_read_back(crew: Staff, line: TestClient) -> None:
    crew.have(crew.enter("ivana", "engineer"))
    given = {"arrivals": "0", "interval": "80", "shortest": "25", "longest": "45"}
    assert crew.post("/instructor/c2/world", given).status_code == 303
    link = runtime_of(line).links["hall"]
    area = crew.wait(link.raw_read, 11, own.REG_ARRIVALS, 4)
    assert list(area) == [0, 80, 25, 45]


def test_an_operator_is_no_instructor(crew: Staff, line: TestClient) -> None:
    crew.have(crew.enter("ana", "operator"))
    assert "c-sim" not in line.get("/equipment/c1").text
    assert crew.post("/instructor/c1/act", {"act": "sensor", "value": "1"}).status_code == 403
    crew.have(crew.enter("ivana", "engineer"))
    assert "c-sim" in line.get("/equipment/c1").text


def test_the_plant_of_these_tests_is_without_mistakes(folder: Path) -> None:
    plant, problems = read_plant(folder)
    assert plant is not None and not problems
    assert (bundled("templates") / "screens" / "conveyor" / "page.html").is_file()
