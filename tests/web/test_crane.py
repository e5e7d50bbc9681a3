"""The pages of the ladle crane: drawn in every language, with values and without; a jog ends without an alarm; words of what is missing."""

import asyncio
import re
from collections.abc import Iterator
from html import unescape
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app import bundled
from app.plant.plant_files.languages import LANGUAGES
from app.settings import Settings
from app.sim import training
from app.sim.crane import training as own
from tests.virtual import house, pass_time, until
from tests.web.operating import Operator, runtime_of
from tests.web.people import Staff

DRIVES = ("hoist_1", "hoist_2", "trolley_1", "bridge_1")
TABS = ("hoist", "trolley", "bridge", "drives", "sequence", "thesis")
PAGES = (
    "/",
    "/equipment/cr1",
    "/equipment/cr1/faceplate",
    "/equipment/cr1/parameters",
    "/records/crane_cycle?equipment=cr1&view=steps",
    *(f"/equipment/cr1/page/{name}" for name in TABS),
    *(f"/equipment/cr1/page/thesis?run={test}" for test in ("positioner", "arc")),
    *(f"/equipment/cr1/part/drive?drive={drive}" for drive in DRIVES),
)
ASKS = ("start_cycle", "confirm_weight", "select_drives", "select_path", "reset_hours")
MOVED = re.compile(
    r'data-tag="cr1\.(\w+)_position"\s+data-move="([xy])"\s+data-map="0:([\d.]+) ([\d.]+):([\d.]+)"\s+'
    r'transform="translate\(([\d.]+) ([\d.]+)\)"'
)
"""Axis, way, where 0 is drawn, greatest position, where that is drawn, where it is drawn now."""
UNTOLD = re.compile(r"\[(?:[a-z]{2}\]|[a-z_]+(?:\.[a-z0-9_]+)+\])")


@pytest.fixture(scope="module")
def staff(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    settings = Settings(plant=bundled("plants/crane"), data=tmp_path_factory.mktemp("crane") / "data")
    with house(settings) as browser:
        crew = Staff(browser)
        crew.enter("ivana", "engineer", "operator")
        pass_time(3)
        yield crew


@pytest.fixture(scope="module")
def ivana(staff: Staff) -> Operator:
    return Operator(staff, "ivana", ("engineer", "operator"))


def value(client: TestClient, tag: str) -> object:
    return runtime_of(client).tags.sample(f"cr1.{tag}").value


def page(operator: Operator, path: str, language: str = "en") -> str:
    operator.sit().staff.client.cookies.set("pogon_lang", language)
    answer = operator.staff.client.get(path)
    assert answer.status_code == 200, (path, answer.text[:300])
    return unescape(answer.text)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("path", PAGES)
def test_every_page_is_drawn_in_every_language_without_a_text_missing(
    ivana: Operator, path: str, language: str
) -> None:
    drawn = re.sub(r"<script.*?</script>", "", page(ivana, path, language), flags=re.DOTALL)
    assert not UNTOLD.search(drawn), UNTOLD.findall(drawn)


def test_its_pages_are_tabs_in_the_order_of_the_crane(ivana: Operator) -> None:
    found = re.search(r'<span class="tabs-sub many">(.*?)</span>', page(ivana, "/equipment/cr1"), re.DOTALL)
    assert found
    assert re.findall(r'href="/equipment/cr1(?:/page/(\w+))?"', found[1]) == ["", *TABS]


def test_positions_stand_where_the_numbers_say(ivana: Operator) -> None:
    """Both views have one scale, and what moves is there before any script runs."""
    drawn = page(ivana, "/equipment/cr1")
    maps = MOVED.findall(drawn)
    assert {axis for axis, *_ in maps} == {"hoist", "trolley", "bridge"}
    scales = []
    for axis, way, low, most, high, x, y in maps:
        at, now = float(x if way == "x" else y), value(ivana.staff.client, f"{axis}_position")
        assert isinstance(now, float)
        expected = float(low) + (float(high) - float(low)) * now / float(most)
        assert at == pytest.approx(expected, abs=0.11), axis
        if float(high) - float(low) != 158:  # the bar of a table is as long for every axis
            scales.append(abs(float(high) - float(low)) / float(most))
    assert max(scales) == pytest.approx(min(scales), rel=1e-3)


@pytest.mark.parametrize("drive", DRIVES)
def test_every_bit_of_a_drive_stands_in_its_dialog(ivana: Operator, drive: str) -> None:
    drawn = page(ivana, f"/equipment/cr1/part/drive?drive={drive}")
    for word in ("zsw", "stw"):
        assert len(re.findall(rf'data-tag="cr1\.{drive}_{word}_\w+"\s+data-class="on:1', drawn)) == 16
    assert len(set(re.findall(rf'data-tag="cr1\.({drive}_permit_\w+)"', drawn))) == 12
    assert len(set(re.findall(rf'data-tag="cr1\.({drive}_alarm_\w+)"', drawn))) == 8
    assert f"reset_hours?motor={DRIVES.index(drive) + 1}" in drawn


@pytest.mark.sweep(8)
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize(
    "path", ["page/hoist", "page/trolley", "page/bridge", "page/sequence", "part/drive?drive=hoist_1"]
)
def test_a_condition_says_in_other_words_that_it_is_missing(ivana: Operator, path: str, language: str) -> None:
    """Both are there, and the value picks: the good one is not read beside an empty box."""
    drawn = page(ivana, f"/equipment/cr1/{path}", language)
    lines = re.findall(r'<li data-tag="(cr1\.\w+)" data-class="k-no:0,bad"(.*?)</li>', drawn, re.DOTALL)
    assert len(lines) >= 5
    for tag, line in lines:
        said = re.findall(rf'<span\s+data-tag="{tag}" data-show="(1,bad|0)"( hidden)?>([^<]+)</span>', line)
        assert [shows for shows, _, _ in said] == ["1,bad", "0"], line
        met = value(ivana.staff.client, tag.removeprefix("cr1.")) == 1
        assert [bool(hidden) for _, hidden, _ in said] == [not met, met], line
        assert said[0][2] != said[1][2], line


@pytest.mark.parametrize("given", ["", "?drive=none", "?drive=hoist_1%22"])
def test_another_drive_than_there_is_is_the_first_one(ivana: Operator, given: str) -> None:
    assert "Hoist drive 1" in page(ivana, f"/equipment/cr1/part/drive{given}")


@pytest.mark.parametrize("language", LANGUAGES)
def test_what_a_command_needs_is_asked_with_the_choices_there_are(ivana: Operator, language: str) -> None:
    ivana.sit()
    ivana.take("cr1")
    for key in ASKS:
        answer = ivana.get(f"/equipment/cr1/ask/{key}")
        assert answer.status_code in (200, 409), (key, answer.text)
        if answer.status_code == 200:
            assert not UNTOLD.search(answer.text)
            assert "arg_" in answer.text
    drives = ivana.get("/equipment/cr1/ask/select_drives").text
    assert re.findall(r'<option value="(\d)"', drives) == ["0", "1", "2", "3", "4"]


def hold(operator: Operator, command: str, seconds: float) -> None:
    """Hold a button of the crane, then let go of it."""
    staff = operator.staff
    lease = operator.press(f"/equipment/cr1/hold/{command}").json()["lease"]
    operator.sit()
    with staff.client.websocket_connect(
        "ws://127.0.0.1:8000/live", headers={"origin": "http://127.0.0.1:8000"}
    ) as socket:
        socket.send_json({"subscribe": "frame", "rev": 0})
        for counter in range(1, int(seconds / 0.15)):
            socket.send_json({"hold": {"equipment": "cr1", "lease": lease, "counter": counter}})
            while "hold" not in socket.receive_json():
                pass
            staff.wait(asyncio.sleep, 0.15)
        assert operator.post("/equipment/cr1/release", lease=lease, cause="released").status_code == 204


@pytest.mark.sweep(8)
@pytest.mark.parametrize("command", ["jog_hoist_up", "jog_trolley_down", "jog_bridge_up"])
def test_a_jog_moves_its_axis_and_its_end_is_confirmed(ivana: Operator, command: str) -> None:
    client = ivana.staff.client
    _, axis, way = command.split("_")
    ivana.sit()
    ivana.take("cr1")
    ivana.press("/equipment/cr1/command/select_manual", confirmed="1")
    assert until(lambda: value(client, "mode") == 2)
    assert ivana.press("/equipment/cr1/command/select_step", arg_step="4").status_code in (200, 202)
    before = value(client, f"{axis}_position")
    hold(ivana, command, 4)
    gate = runtime_of(client).gate
    assert gate is not None
    assert until(lambda: (told := gate.progress("cr1")) is not None and told.over, 20)
    told = gate.progress("cr1")
    assert told is not None and (told.state.value, told.reason) == ("confirmed", "hold.cause.released")
    now = value(client, f"{axis}_position")
    assert isinstance(before, float) and isinstance(now, float)
    assert (now - before > 20) if way == "up" else (before - now > 20)
    assert value(client, "mode") == 2, "manual stays, the next jog needs no other press"


def test_before_the_first_cycle_it_has_no_time_of_one(ivana: Operator, staff: Staff) -> None:
    """It was told as 0.0 s."""

    def shown() -> list[str]:
        page = ivana.get("/equipment/cr1/page/sequence").text
        behind = page.split("Time of the cycle</dt>", 1)[1].split("</dd>", 1)[0]
        parts = re.findall(r'<span data-tag="cr1\.cycle" data-show="[^"]*"\s*( hidden)?>(.*?)</span>', behind, re.S)
        return [re.sub(r"<[^>]*>", "", text) for hidden, text in parts if not hidden]

    tags = runtime_of(staff.client).tags
    assert tags.sample("cr1.cycle").value == 0
    assert shown() == ["–"]


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("register", "word", "alarms", "cause"),
    [
        (training.REG_MACHINE_FAULT, own.EMERGENCY_STOP, {"emergency_stop"}, "Emergency stop"),
        (training.REG_POWER, 1, {"safety_brake"}, "Power lost"),
    ],
)
def test_what_the_safety_brakes_fell_in_by_is_one_alarm_and_stands_on_the_page_of_the_hoist(
    tmp_path: Path, register: int, word: int, alarms: set[str], cause: str
) -> None:
    """An emergency stop brings them along: one press is one alarm."""
    with house(Settings(plant=bundled("plants/crane"), data=tmp_path / "data")) as client:
        crew = Staff(client)
        crew.enter("ivana", "engineer", "operator")
        ivana = Operator(crew, "ivana", ("engineer", "operator"))
        pass_time(3)
        engine = runtime_of(client).alarms
        assert engine is not None
        sim = runtime_of(client).sim
        assert sim is not None
        sim.devices["cr1"].write(6, register, [word])
        pass_time(5)
        found = {one.id for one in crew.wait(engine.list.active)}
        assert found & {"cr1.emergency_stop", "cr1.safety_brake"} == {f"cr1.{one}" for one in alarms}
        shown = page(ivana, "/equipment/cr1/page/hoist")
        (hidden,) = re.findall(r'<span class="k-cause" data-tag="cr1.safety_trip" data-show=">0"\s*( hidden)?>', shown)
        assert not hidden and f">{cause}</span>)" in shown
