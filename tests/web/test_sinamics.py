"""The pages of a SINAMICS drive: every bit of both words in every language, with values, with a fault, without communication."""

import re
from collections.abc import Iterator
from html import unescape
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app import bundled
from app.plant import types
from app.plant.plant_files.languages import LANGUAGES
from app.profidrive.words import CONTROL_BITS, STATUS_BITS, Control, Status
from app.settings import Settings
from app.sim import training
from app.sim.sinamics.messages import FAULTS
from tests.virtual import house, pass_time
from tests.web.people import Staff

KEYS = [f"zsw1_{bit.name.lower()}" for bit in Status] + [f"stw1_{bit.name.lower()}" for bit in Control]
PAGES = ("/equipment/d1", "/equipment/d1/page/words", "/equipment/d1/faceplate", "/equipment/d1/parameters", "/")


@pytest.fixture(scope="module")
def people(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Staff]:
    settings = Settings(plant=bundled("plants/sinamics"), data=tmp_path_factory.mktemp("drives") / "data")
    with house(settings) as browser:
        staff = Staff(browser)
        staff.enter("ivana", "engineer", "operator")
        pass_time(3)
        yield staff


@pytest.fixture
def client(people: Staff) -> TestClient:
    return people.client


def cause(client: TestClient, register: int, value: int) -> None:
    device = client.app.state.runtime.sim.devices["d1"]  # type: ignore[attr-defined]
    device.write(6, register, [value])
    pass_time(3)


def page(client: TestClient, path: str, language: str) -> str:
    client.cookies.set("pogon_lang", language)
    answer = client.get(path)
    assert answer.status_code == 200, path
    return unescape(answer.text)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("path", PAGES)
def test_every_page_is_drawn_in_every_language_without_a_text_missing(
    client: TestClient, path: str, language: str
) -> None:
    drawn = page(client, path, language)
    assert not re.search(
        r"\[(?:[a-z]{2}\]|[a-z_]+(?:\.[a-z0-9_]+)+\])", re.sub(r"<script.*?</script>", "", drawn, flags=re.S)
    )


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("path", ["/equipment/d1/page/words", "/equipment/d1/faceplate"])
def test_all_bits_of_both_words_stand_there_in_order_with_text_and_parameter(
    client: TestClient, path: str, language: str
) -> None:
    drawn = page(client, path, language)
    texts = types.read_type("sinamics", LANGUAGES)[0].type.texts[language]
    rows = re.findall(
        r'<li class="([^"]*)" data-tag="d1\.(\w+)"\s+data-class="([^"]*)">\s*<span class="num">(\d+)</span>(.*?)</li>',
        drawn,
        re.S,
    )
    assert [key for _, key, *_ in rows] == KEYS
    for (worn, key, rules, number, rest), bit in zip(rows, (*STATUS_BITS, *CONTROL_BITS), strict=True):
        assert int(number) == bit.number and texts[f"point.{key}"] in rest
        assert f">{bit.parameter}<" in rest
        odd = {None: "on:1", True: "on:1;ab:0", False: "on:1;ab:1"}[bit.good]
        assert rules == odd, key
        assert ("on" in worn.split()) == (' display="none"' not in rest.partition("</svg>")[0])


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_running_drive_is_usual_in_every_bit(client: TestClient, language: str) -> None:
    drawn = page(client, "/equipment/d1/page/words", language)
    unusual = re.findall(r'<li class="[^"]*\bab\b[^"]*" data-tag="d1\.(\w+)"', drawn)
    assert unusual == []


@pytest.mark.sweep(8)
@pytest.mark.parametrize("number", [30005, 1910, 7452])
def test_a_fault_stands_with_number_name_cause_and_remedy(client: TestClient, number: int) -> None:
    cause(client, training.REG_MACHINE_FAULT, number)
    texts = types.read_type("sinamics", LANGUAGES)[0].type.texts
    for language in LANGUAGES:
        face = page(client, "/equipment/d1/faceplate", language)
        for key in ("cause", "remedy"):
            assert texts[language][f"message.{number}.{key}"] in face
        assert f"F{number:05d}" in face
        assert texts[language][f"message.{number}.name"] in page(client, "/equipment/d1", language)
    assert number in FAULTS
    cause(client, training.REG_RESET, 1)


def test_the_words_are_a_tab_and_every_command_stands_on_page_and_faceplate(client: TestClient) -> None:
    drawn = page(client, "/equipment/d1", "en")
    assert "/equipment/d1/page/words" in drawn and "Words and faults" in drawn
    for path in ("/equipment/d1", "/equipment/d1/page/words", "/equipment/d1/faceplate"):
        drawn = page(client, path, "en")
        for command in ("forward", "reverse", "stop", "quick_stop", "coast", "reset", "set_setpoint"):
            assert f"/{command}" in drawn, (path, command)


@pytest.mark.sweep(8)
def test_without_communication_nothing_is_claimed(client: TestClient) -> None:
    cause(client, training.REG_LINE_FAULT, 1)
    pass_time(5)
    for path in PAGES:
        drawn = page(client, path, "en")
        assert '<li class="on' not in drawn
    cause(client, training.REG_LINE_FAULT, 0)
    cause(client, training.REG_RESET, 1)  # its watchdog has tripped it


def test_its_sheet_is_the_house_s_and_the_demo_keeps_its_own(client: TestClient) -> None:
    assert "css/screens/drive." in client.get("/equipment/d1").text
    assert (Path(bundled("static")) / "screens" / "sinamics.css").is_file()


@pytest.mark.parametrize("lang", LANGUAGES)
def test_the_page_of_parameters_says_what_becomes_of_them_when_the_drive_is_switched_off(
    people: Staff, lang: str
) -> None:
    """A drive of this kind keeps them in RAM."""
    people.client.cookies.set("pogon_lang", lang)
    page = unescape(people.client.get("/equipment/d1/parameters").text)
    people.client.cookies.delete("pogon_lang")
    texts = people.client.app.state.runtime.texts  # type: ignore[attr-defined]
    assert texts.text(lang, "par.volatile") in page
    assert texts.text(lang, "par.stored") not in page
