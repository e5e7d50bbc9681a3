"""Pages of sequences and of their machine over HTTP: whole in every language, permissives and dialogs by name."""

import re
import shutil
from collections.abc import Iterator, Sequence
from html.parser import HTMLParser
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app import bundled
from app.blocks.sequence import SequenceState
from app.running.page_tags import page_tags
from app.sim.training import REG_MACHINE_FAULT
from app.web.points import EquipmentView
from app.web.screens.sequence import SequenceView, sequence_of, sequences_for
from tests import coil_plant
from tests.web import sequence_plant
from tests.web.conftest import Start, _running
from tests.web.operating import Operator, line_of, runtime_of, until, words
from tests.web.people import PASSWORD, Staff

LANGUAGES = ("hr", "en", "de", "cs")
PAGES = ("/equipment/seq1", "/equipment/seq2", "/equipment/cc1", "/forces", "/")


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    folder: Path = coil_plant.write(tmp_path_factory.mktemp("coils") / "plant")
    with _running(folder.parent / "data", folder) as client:
        tags = runtime_of(client).tags
        assert until(lambda: tags.sample("seq2.step_12_id").value and tags.sample("seq1.start_possible").value, 30)
        yield client


@pytest.fixture(scope="module")
def crew(plant: TestClient) -> Staff:
    return Staff(plant)


@pytest.fixture
def engineer(crew: Staff) -> Operator:
    return Operator(crew, "ivana", ("engineer", "operator"))


@pytest.fixture
def operator(crew: Staff) -> Operator:
    return Operator(crew, "ivo", ("operator",))


def sequence(client: TestClient, key: str, lang: str = "en") -> SequenceView:
    runtime = runtime_of(client)
    assert runtime.plant
    text = lambda name, **params: runtime.texts.text(lang, name, **params)  # noqa: E731
    found = sequence_of(EquipmentView(runtime.plant.equipment[key], runtime, lang, text))
    assert found
    return found


@pytest.mark.sweep(8)
@pytest.mark.parametrize("lang", LANGUAGES)
@pytest.mark.parametrize("path", PAGES)
def test_a_page_is_whole_in_every_language(plant: TestClient, engineer: Operator, path: str, lang: str) -> None:
    engineer.language = lang
    answer = engineer.get(path, fragment=False)
    assert answer.status_code == 200
    assert not re.search(r">\s*\[?[a-z_]+(?:\.[a-z_0-9]+){1,3}\]?\s*<|\[(?:hr|en|de|cs)\] ", answer.text)
    assert 'style="' not in answer.text and not re.search(r"<script(?![^>]* src=)", answer.text)


def tags_of(plant: TestClient, kind: str) -> set[str]:
    """What a kind of page is sent."""
    runtime = runtime_of(plant)
    return set(page_tags(kind, runtime.plant, runtime.points))


def test_the_page_of_a_sequence_has_the_points_of_its_machine(plant: TestClient) -> None:
    names = tags_of(plant, "equipment/seq1")
    assert {"cc1.horizontal", "cc1.coil_diameter", "seq1.step_8_elapsed", "sys.commands.seq1"} <= names
    assert "cc1.horizontal" not in tags_of(plant, "equipment/seq2")
    assert {"seq1.forces", "seq2.forces"} <= tags_of(plant, "frame")
    assert "seq2.force_1_remaining" in tags_of(plant, "forces")


def test_the_list_of_forces_is_fetched_again_when_the_event_is_kept_that_tells_why(
    plant: TestClient, engineer: Operator
) -> None:
    """A force stands in the device before its event is in the history."""
    found = re.search(r'hx-get="/forces/list"[^>]* data-tags="([^"]*)"', engineer.get("/forces", fragment=False).text)
    told = {"sys.events.seq1", "sys.events.seq2"}
    assert found and told <= set(found[1].split())
    assert told <= tags_of(plant, "forces")


def test_a_machine_knows_the_sequences_that_move_it(plant: TestClient) -> None:
    view = sequence(plant, "seq1")
    assert view.machine and [one.id for one in sequences_for(view.machine)] == ["seq1"]
    assert sequence(plant, "seq2").machine is None and not sequences_for(sequence(plant, "seq2").equipment)


def test_permissives_have_the_names_of_the_definition(plant: TestClient, operator: Operator) -> None:
    part = operator.get("/equipment/seq1/part/word?step=4&all=1").text
    assert part.count("<li") == 16
    assert "Coil touches the car" in part and "Pressure is there" in part and part.count("not used") == 14
    assert "Permissives of step 4" in part and "/ask/force" not in part


@pytest.mark.parametrize("step", ["99", "-1", "x", "1e3", "²"])
def test_a_step_that_is_none_shows_what_decides_now(plant: TestClient, operator: Operator, step: str) -> None:
    answer = operator.get(f"/equipment/seq1/part/word?step={step}")
    assert answer.status_code == 200 and "Permissives of step 1" in answer.text


def test_what_is_missing_comes_first_and_is_counted(plant: TestClient) -> None:
    view = sequence(plant, "seq1")
    assert view.count(1) == 16 and view.missing(1) == []
    assert [one.label for one in view.missing(4)] == ["Coil touches the car"] and view.bits(4)[0].bit == 6
    assert view.named(sequence(plant, "seq2").bits(1)[:5]).endswith("2 more")


def test_the_headline_of_one_that_may_start(plant: TestClient) -> None:
    for lang in LANGUAGES:
        head = sequence(plant, "seq1", lang).headline
        assert head.kind == "calm" and head.before and head.detail and "{" not in head.before + head.detail


WHY_NOT = {
    "hr": "Korak 1 čeka: Prenizak tlak hidraulike",
    "en": "Step 1 waits: Hydraulic pressure too low",
    "de": "Schritt 1 wartet: Hydraulikdruck zu niedrig",
    "cs": "Krok 1 čeká: Nízký tlak hydrauliky",
}
PRESSURE_LOST = 31


@pytest.mark.sweep(8)
def test_the_headline_says_what_is_so_and_not_what_ought_to_be(start: Start, tmp_path: Path) -> None:
    """Whoever reads "missing: no collision" has to think twice, or takes it that there is none."""
    folder = coil_plant.write(tmp_path / "plant")
    shutil.copy(bundled("plants/demo") / "sequences" / "coil_transport.toml", folder / "sequences" / "transport.toml")
    client = start(plant=folder)
    assert until(lambda: runtime_of(client).tags.sample("seq1.state").value == SequenceState.IDLE)
    runtime_of(client).sim.devices["cc1"].write(6, REG_MACHINE_FAULT, [PRESSURE_LOST])
    assert until(lambda: sequence(client, "seq1").missing(1))
    assert {lang: sequence(client, "seq1", lang).headline.detail for lang in WHY_NOT} == WHY_NOT


def test_a_force_is_asked_for_by_name_with_password_and_no_longer_than_allowed(
    plant: TestClient, engineer: Operator
) -> None:
    engineer.post("/equipment/seq2/token/take")
    dialog = engineer.get("/equipment/seq2/ask/force?step=3&bit=1").text
    assert "Tank 3 is ready" in dialog and 'name="password"' in dialog and 'name="reason"' in dialog
    assert re.findall(r'<option value="(\d+)"', dialog) == ["6"], "the definition allows 6 s"
    other = engineer.get("/equipment/seq1/part/word?step=4&all=1").text
    assert "Relevant to safety" in other and "bit=6" not in other
    refused = engineer.post(
        "/equipment/seq2/command/force",
        id="one", nonce=engineer.nonce(), arg_step="3", arg_bit="1", arg_duration="5", reason="test", confirmed="1",
    )  # fmt: skip
    assert refused.status_code == 409 and 'name="password"' in refused.text, "without the password it is asked for"
    wrong = engineer.post(
        "/equipment/seq2/command/force", id="two", nonce=engineer.nonce(), arg_step="3", arg_bit="1",
        arg_duration="5", reason="test", confirmed="1", password="certainly not this one",
    )  # fmt: skip
    assert wrong.status_code == 401
    assert runtime_of(plant).tags.sample("seq2.forces").value == 0
    engineer.post("/equipment/seq2/token/release")


def test_a_force_is_told_by_the_name_of_its_permissive_and_in_hours(plant: TestClient, engineer: Operator) -> None:
    view = sequence(plant, "seq1")
    bit = next(
        bit
        for bit in range(16)
        if (view.word(3, "forceable") or 0) >> bit & 1 and view.definition.permissive(3, bit) is not None
    )
    engineer.take("seq1")
    try:
        given = {"arg_step": "3", "arg_bit": str(bit), "reason": "test", "confirmed": "1", "password": PASSWORD}
        said = line_of(engineer.press("/equipment/seq1/command/force", arg_duration="7200", **given))
        assert f"(step 3 · {view.label(3, bit)}, Duration 2 h 00 min)" in said
        assert until(lambda: runtime_of(plant).tags.sample("seq1.forces").value == 1)
        said = line_of(engineer.press("/equipment/seq1/command/release", arg_step="3", arg_bit=str(bit), confirmed="1"))
        assert f"(step 3 · {view.label(3, bit)})" in said
        assert until(lambda: runtime_of(plant).tags.sample("seq1.forces").value == 0)
    finally:
        engineer.post("/equipment/seq1/token/release")


@pytest.mark.parametrize("lang", LANGUAGES)
def test_what_nobody_knows_is_not_said_to_be_nothing(plant: TestClient, engineer: Operator, lang: str) -> None:
    engineer.language = lang
    texts = runtime_of(plant).texts
    nothing, unknown = (texts.text(lang, f"sequence.screen.{key}") for key in ("no_first", "first_unknown"))

    def first() -> str:
        return words(engineer.get("/equipment/seq2/part/first").text)

    assert nothing in first()
    engineer.post("/instructor/seq2/line", mode="1")
    try:
        assert until(lambda: sequence(plant, "seq2").value("first_out_cause") is None, 20)
        assert unknown in first() and nothing not in first()
    finally:
        engineer.post("/instructor/seq2/line", mode="0")
    assert until(lambda: nothing in first(), 20)
    assert unknown not in first()


@pytest.mark.sweep(8)
@pytest.mark.parametrize("lang", LANGUAGES)
def test_what_a_program_that_stands_still_told_last_is_said_to_be_that(
    plant: TestClient, engineer: Operator, lang: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    engineer.language = lang
    texts, sim = runtime_of(plant).texts, runtime_of(plant).sim
    assert sim is not None
    unknown, why = texts.text(lang, "live.state_unknown"), texts.text(lang, "quality.reason.halted")

    def part(name: str) -> str:
        return re.sub(
            r"<(\w+)[^>]*when-offline.*?</\1>", "", engineer.get(f"/equipment/seq2/part/{name}").text, flags=re.S
        )

    seen = sequence(plant, "seq2", lang).headline
    assert seen.before in words(part("head")) and unknown not in words(part("head"))
    with monkeypatch.context() as patch:
        patch.setattr(sim.devices["seq2"], "step", lambda: None)
        assert until(lambda: sequence(plant, "seq2", lang).headline.unseen, 20)
        told = words(part("head"))
        assert told.index(unknown) < told.index(texts.text(lang, "live.last_state").replace("{}", seen.before))
        assert why[1:] in told and why[1:] in words(part("why")) and seen.detail not in told
        for name in ("steps", "word"):
            assert set(re.findall(r'class="[^"]*num[^"]*"\s+data-q="(\w+)"', part(name))) == {"uncertain"}, name
    assert until(lambda: not sequence(plant, "seq2", lang).headline.unseen, 20)
    assert seen.before in words(part("head")) and unknown not in words(part("head"))


def test_the_dialog_of_times_says_what_is_there(plant: TestClient, engineer: Operator) -> None:
    engineer.post("/equipment/seq2/token/take")
    dialog = engineer.get("/equipment/seq2/ask/set_times?step=2").text
    assert "Exercise 2" in dialog and re.search(r'name="arg_maximum"\s+value="0"', dialog)
    engineer.post("/equipment/seq2/token/release")


@pytest.mark.parametrize("key", ["cc1", "seq1"])
@pytest.mark.parametrize("lang", LANGUAGES)
def test_an_instructor_reads_every_fault_by_name(plant: TestClient, engineer: Operator, key: str, lang: str) -> None:
    engineer.language = lang
    page = engineer.get(f"/instructor/{key}", fragment=False)
    assert page.status_code == 200
    assert not re.search(r"instructor\.[a-z_]+\.", page.text)
    named = re.findall(r'name="code" value="\d+"[^>]*>\s*<span[^>]*>\s*<b>([^<]+)', page.text)
    assert all(not name.strip().isdigit() for name in named)


def test_nobody_signed_in_learns_who_forced(plant: TestClient) -> None:
    plant.cookies.clear()
    assert plant.get("/forces").status_code == 200
    assert plant.get("/equipment/seq2/ask/force?step=3&bit=1", headers={"HX-Request": "true"}).status_code in (401, 303)


@pytest.mark.parametrize("lang", LANGUAGES)
@pytest.mark.parametrize("key", ["seq1", "seq2"])
def test_nobody_reads_an_expression(plant: TestClient, operator: Operator, key: str, lang: str) -> None:
    """What a permissive is made of is told in names and words, and one that is missing by what is so then."""
    view = sequence(plant, key, lang)
    bits = [one for step in range(view.total + 1) for one in view.bits(step) if one.named]
    raw = re.compile(r"==|!=|\b[a-z]+_[a-z_0-9]+|\b[a-z]+[0-9]\.[a-z]")
    assert bits and not [one.when for one in bits if raw.search(one.when)]
    assert all(one.lacking and one.lacking != one.label for one in bits)
    operator.language = lang
    part = operator.get(f"/equipment/{key}/part/word?all=1&step=1")
    assert part.status_code == 200 and "==" not in part.text


def test_nothing_is_said_to_be_unforced_that_no_device_told(plant: TestClient, engineer: Operator) -> None:
    """Where nothing is forced the page leads to the sequences and to what was forced; where a device is silent it says so."""
    engineer.language = "en"
    assert until(lambda: "Nothing is forced" in engineer.get("/forces/list").text)
    page = engineer.get("/forces/list").text
    assert "not known" not in page
    for key in ("seq1", "seq2"):
        assert f'href="/equipment/{key}"' in page and f'href="/records/force?equipment={key}"' in page
    assert engineer.get("/records/force?equipment=seq2", fragment=False).status_code == 200
    engineer.post("/instructor/seq2/line", mode="1")
    try:
        assert until(lambda: "forces not known" in engineer.get("/forces/list").text)
        assert "Nothing is forced" not in engineer.get("/forces/list").text
        assert "?</span>" in engineer.get("/forces/count").text
    finally:
        engineer.post("/instructor/seq2/line", mode="0")
    assert until(lambda: "Nothing is forced" in engineer.get("/forces/list").text)


class Seen(HTMLParser):
    """What a reader of a page sees: its text without what is hidden."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.parts: list[str] = []
        self._hidden = 0
        self.feed(source)

    def handle_starttag(self, tag: str, attrs: Sequence[tuple[str, str | None]]) -> None:
        if self._hidden or ("hidden" in dict(attrs) and tag == "span"):
            self._hidden += tag == "span"

    def handle_endtag(self, tag: str) -> None:
        self._hidden -= bool(self._hidden) and tag == "span"

    def handle_data(self, data: str) -> None:
        if not self._hidden:
            self.parts.append(data)


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("lang", "last", "mean", "none"),
    [
        ("hr", "Zadnji ciklus", "Prosječni ciklus", "još nijedan"),
        ("en", "Last run", "Mean run", "none yet"),
        ("de", "Letzter Lauf", "Mittlerer Lauf", "noch keiner"),
        ("cs", "Poslední běh", "Průměrný běh", "zatím žádný"),
    ],
)
def test_before_the_first_run_there_is_no_time_of_one(
    tmp_path: Path, lang: str, last: str, mean: str, none: str
) -> None:
    """It was told as 0.0 s; afterwards the first one stands there."""
    labels = {"/equipment/seq2": [last], "/equipment/seq2/faceplate": [last, mean], "/": [last]}
    with _running(tmp_path / "data", sequence_plant.write(tmp_path / "plant")) as client:
        ivo, runtime = Operator(Staff(client), "ivo", ("operator",), lang), runtime_of(client)
        assert until(lambda: runtime.tags.sample("seq2.start_possible").value)

        def seen(path: str) -> str:
            return words(" ".join(Seen(ivo.get(path, fragment=False).text).parts))

        for path, told in labels.items():
            for label in told:
                assert f"{label} {none}" in seen(path), (path, label)
        ivo.take("seq2")
        ivo.press("/equipment/seq2/command/start", confirmed="1")
        assert until(lambda: runtime.tags.sample("seq2.runs_done").value == 1)
        for path, told in labels.items():
            for label in told:
                assert re.search(rf"{label} +0[,.]4", seen(path)), (path, label)
        for kind in ("equipment/seq2", "overview"):
            assert "seq2.last_outcome" in page_tags(kind, runtime.plant, runtime.points), kind
