"""A sequence is edited on its page: fields and text are one draft, checked as it is typed, kept for whoever typed it."""

import re
import shutil
from collections.abc import Iterator
from functools import partial
from html import unescape
from pathlib import Path

import pytest

from app import bundled
from app.access.roles import Person
from app.errors import Refused
from tests.web.conftest import Start
from tests.web.hand import House
from tests.web.people import Staff

URL = "/equipment/seq1/definition"
FILE = (bundled("plants/feeding") / "sequences" / "feed.toml").read_text("utf-8")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    found = tmp_path / "plant"
    shutil.copytree(bundled("plants/feeding"), found)
    return found


@pytest.fixture
def staff(start: Start, folder: Path) -> Iterator[Staff]:
    people = Staff(start(plant=folder))
    people.enter("ivana", "engineer")
    people.client.cookies.set("pogon_lang", "en")
    yield people


class Window:
    """A page of the editor in a browser."""

    def __init__(self, staff: Staff, section: str = "1") -> None:
        self.staff, self.section = staff, section
        self.page = staff.client.get(f"{URL}?section={section}").text
        tab, seen = (re.search(rf'name="{name}"\s+value="(\w+)"', self.page) for name in ("tab", "seen"))
        assert tab and seen
        self.window = {"tab": tab[1], "seen": seen[1], "section": section}

    def send(self, what: str, **given: str):  # type: ignore[no-untyped-def]
        named = {name.replace("__", "."): value for name, value in given.items()}
        return self.staff.post(f"{URL}/{what}", {**self.window, **named})


def text_of(page: str) -> str:
    found = re.search(r"<textarea[^>]*>\n(.*?)</textarea>", page, re.S)
    assert found
    return found[1]


@pytest.mark.sweep(8)
def test_the_page_shows_a_step_as_fields_and_as_the_text_of_the_file(staff: Staff) -> None:
    page = Window(staff, "2").page
    assert "No mistakes." in page and "As in the file" in page
    assert 'name="minimum" value="20"' in page and "minimum = 20" in text_of(page)
    assert "sequences/feed.toml" in page and re.search(r"Lines \d+–\d+", page)
    assert "does not hold now" in page or "not known now" in page


@pytest.mark.sweep(8)
def test_actions_are_called_as_their_machine_calls_them(start: Start) -> None:
    people = Staff(start(plant=bundled("plants/demo")))
    people.enter("ivana", "engineer")
    for language, called in (("en", "Drive under the mandrel"), ("hr", "Vozi ispod trna")):
        people.client.cookies.set("pogon_lang", language)
        page = people.client.get(f"{URL}?section=2").text
        box = re.search(r'name="actions.drive_to_mandrel"(.*?)</label>', page, re.S)
        assert box and f"<span>{called} <" in box[1] and ">drive_to_mandrel<" in box[1]


@pytest.mark.sweep(8)
def test_only_an_engineer_edits(staff: Staff) -> None:
    window = Window(staff)
    for role in ("viewer", "operator", "admin"):
        staff.enter(f"some_{role}", role)
        assert staff.client.get(URL).status_code == 403
        assert window.send("fields", minimum="3").status_code == 403
    staff.enter("ivana")
    assert staff.client.get("/equipment/m1/definition").status_code == 404


@pytest.mark.sweep(8)
def test_a_field_changes_the_text_and_only_that_line(staff: Staff) -> None:
    window = Window(staff, "2")
    answer = window.send("fields", minimum="21,5", maximum="90")
    assert answer.status_code == 200 and "minimum = 21.5\n" in text_of(answer.text)
    assert "Draft, not taken yet" in answer.text
    assert "minimum = 21.5" in text_of(Window(staff, "2").page)
    text = "".join(text_of(Window(staff, key).page) for key in ("0", "1", "2", "3", "4"))
    text = text.replace("&#34;", '"').replace("&#39;", "'").replace("&gt;", ">")
    assert text == FILE.replace("minimum = 20\n", "minimum = 21.5\n")


@pytest.mark.sweep(8)
def test_a_mistake_is_told_at_its_field_with_line_key_and_what_was_expected(staff: Staff) -> None:
    window = Window(staff, "2")
    answer = window.send("fields", minimum="much", maximum="90").text
    hint = re.search(r'id="h-f-minimum"[^>]*>(.*?)</p>', answer, re.S)
    assert hint and "a number from 0 to 36000" in hint[1]
    line = FILE.splitlines().index("minimum = 20") + 1
    assert f"feed.toml:{line}" in answer and "steps.1.minimum" in answer
    answer = window.send("fields", minimum="20", permissives__0__when="m1.frequncy > 29").text
    assert "perhaps m1.frequency" in answer and "steps.1.permissives.0.when" in answer
    assert "No mistakes." in window.send("fields", permissives__0__when="m1.frequency > 29").text


@pytest.mark.sweep(8)
def test_text_that_is_no_toml_is_kept_and_told(staff: Staff) -> None:
    window = Window(staff, "2")
    answer = window.send("text", text='[[steps]]\nkey = "feed"\nlabel = ')
    assert answer.status_code == 200 and "cannot be read as TOML" in answer.text
    assert "label = " in text_of(Window(staff, "2").page)
    mended = window.send("text", text='[[steps]]\nkey = "feed"\nlabel = "Feed"\nmaximum = 5\n')
    assert "No mistakes." in mended.text and 'name="maximum" value="5"' in mended.text


@pytest.mark.sweep(8)
def test_keys_that_no_field_has_stay_in_the_text_and_are_named(staff: Staff) -> None:
    window = Window(staff, "2")
    text = (
        text_of(window.page)
        .replace("&#34;", '"')
        .replace("&gt;", ">")
        .replace("minimum = 20", "minimum = 20\nbranch = [3, 4]  # mine")
    )
    assert "<code" in window.send("text", text=text).text
    assert "branch = [3, 4]  # mine" in text_of(window.send("fields", maximum="80").text)


@pytest.mark.sweep(8)
def test_steps_are_added_moved_and_removed(staff: Staff) -> None:
    answer = Window(staff, "2").send("do", do="add_step")
    assert (answer.status_code, answer.headers["location"]) == (303, f"{URL}?section=3")
    page = Window(staff, "3").page
    assert "New step" in page and "No mistakes." in page
    assert Window(staff, "3").send("do", do="up").headers["location"] == f"{URL}?section=2"
    assert "New step" in text_of(Window(staff, "2").page)
    Window(staff, "2").send("do", do="remove_step")
    assert text_of(Window(staff, "2").page).startswith("[[steps]]\nkey = &#34;feed&#34;")


@pytest.mark.sweep(8)
def test_orders_and_permissives_are_added_and_removed(staff: Staff) -> None:
    Window(staff, "2").send("do", do="add_order")
    text = text_of(Window(staff, "2").page)
    assert text.count("[[steps.orders]]") == 2
    Window(staff, "2").send("do", do="remove_order:1")
    assert text_of(Window(staff, "2").page).count("[[steps.orders]]") == 1
    Window(staff, "2").send("do", do="remove_bit:0")
    assert "permissives" not in text_of(Window(staff, "2").page)


@pytest.mark.sweep(8)
def test_a_point_is_looked_for_and_becomes_a_permissive(staff: Staff) -> None:
    found = staff.client.get(f"{URL}/points?q=fan frequency&section=2&tab=x&seen=0").text
    assert 'value="m1.frequency"' in found and "Now:" in found
    window = Window(staff, "2")
    answer = window.send("condition", point="m1.frequency", **{"is": ">"}, value="12,5")
    assert answer.headers["location"] == f"{URL}?section=2#b-1"
    page = Window(staff, "2").page
    assert "m1.frequency &gt; 12.5" in text_of(page) and "No mistakes." in page
    assert all(f"{language} = " in text_of(page) for language in ("hr", "en", "de", "cs"))


@pytest.mark.sweep(8)
def test_what_was_typed_is_there_after_the_session_ended_and_is_nobody_elses(staff: Staff) -> None:
    Window(staff, "2").send("fields", minimum="33")
    staff.enter("marko", "engineer")
    staff.client.cookies.set("pogon_lang", "en")
    page = Window(staff, "2").page
    assert "minimum = 20" in page and "ivana" in page and "is editing this sequence too" in page
    staff.enter("ivana")
    assert "minimum = 33" in Window(staff, "2").page


@pytest.mark.sweep(8)
def test_another_window_is_told_and_overwrites_nothing(staff: Staff) -> None:
    first, second = Window(staff, "2"), Window(staff, "2")
    assert first.send("fields", minimum="31").status_code == 200
    refused = second.send("fields", minimum="32")
    assert refused.status_code == 409 and "another window" in refused.text
    assert first.send("fields", minimum="34").status_code == 200
    assert "minimum = 34" in Window(staff, "2").page


@pytest.mark.sweep(8)
def test_an_answer_to_what_changed_nothing_leaves_the_other_view_alone(staff: Staff) -> None:
    window = Window(staff, "2")
    assert 'id="ed-text"' in window.send("fields", minimum="31").text
    assert 'id="ed-text"' not in window.send("fields", minimum="31").text
    text = text_of(Window(staff, "2").page).replace("&#34;", '"').replace("&gt;", ">")
    assert 'id="ed-fields"' not in Window(staff, "2").send("text", text=text).text


@pytest.mark.sweep(8)
def test_fields_that_are_none_are_refused(staff: Staff) -> None:
    window = Window(staff, "2")
    assert window.send("fields", **{"../x": "1"}).status_code == 422
    assert window.send("fields", permissives__9__when="1").status_code == 409
    assert window.send("do", do="remove_order:7").status_code == 409


def test_what_was_made_from_an_older_draft_takes_nothing_away(staff: Staff) -> None:
    """Two requests of one window at once: the later one begins where the first one ended, else it is refused."""
    window = Window(staff, "2")
    state = staff.client.app.state  # type: ignore[attr-defined]
    drafts, person = state.runtime.drafts, Person(staff.add("ivana"), "ivana", "", frozenset(), frozenset(), "")
    before = staff.wait(drafts.draft, person, "feed")
    assert window.send("fields", minimum="25").status_code == 200
    late = partial(drafts.save, person, "feed", before, FILE + "# mine", tab=window.window["tab"], seen=0)
    with pytest.raises(Refused) as refused:
        staff.wait(late)
    assert refused.value.status == 409
    assert "minimum = 25" in text_of(Window(staff, "2").page)


@pytest.mark.sweep(8)
def test_a_window_from_before_the_draft_was_given_up_does_not_bring_it_back(staff: Staff) -> None:
    Window(staff, "2").send("fields", minimum="25")
    old = Window(staff, "2")
    assert staff.post(f"{URL}/discard", {}).status_code == 303
    assert old.send("fields", maximum="80").status_code == 409
    assert "As in the file" in Window(staff, "2").page


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("language", "number", "missing", "sentence", "toml"),
    [
        ("en", "expected a number from 0 to 36000", "missing", "expected expression", "expected TOML (Invalid value"),
        (
            "hr",
            "očekuje se: broj od 0 do 36000",
            "nedostaje",
            "očekuje se: izraz",
            "očekuje se: TOML (neispravna vrijednost",
        ),
        ("de", "erwartet: eine Zahl von 0 bis 36000", "fehlt", "erwartet: Ausdruck", "erwartet: TOML (ungültiger Wert"),
        ("cs", "očekává se: číslo od 0 do 36000", "chybí", "očekává se: výraz", "očekává se: TOML (neplatná hodnota"),
    ],
)
def test_mistakes_are_told_in_the_language_of_who_edits(
    staff: Staff, language: str, number: str, missing: str, sentence: str, toml: str
) -> None:
    window = Window(staff, "2")
    staff.client.cookies.set("pogon_lang", language)
    wrong = unescape(window.send("fields", minimum="much", permissives__0__when="m1.frequency >", key="").text)
    assert number in wrong and sentence in wrong
    shown = unescape(staff.client.get(f"{URL}?section=2").text)
    review = unescape(staff.client.get(f"{URL}/review").text)
    for page in (shown, review):
        assert number in page and f">{missing}</span>" in page
        assert language == "en" or "expected" not in re.sub(r"<[^>]+>", "", page)
    broken = unescape(window.send("text", text="[[steps]]\nkey = \n").text)
    assert toml in broken
    staff.client.cookies.set("pogon_lang", "en")


@pytest.mark.sweep(8)
def test_whether_a_condition_of_the_draft_holds_is_told_as_it_is_now(staff: Staff) -> None:
    """It was told as it had been when the page was drawn."""
    house = House(staff.client)
    staff = house.staff
    window = Window(staff, "2")
    (address,) = re.findall(rf'hx-get="({URL}/now\?section=2&amp;bit=0)"', window.page)
    for least, told in ((0, "yes"), (1000, "no")):
        assert window.send("fields", permissives__0__when=f"m1.frequency > {least}").status_code == 200
        window = Window(staff, "2")
        house.put({"m1.frequency": 20.0})
        assert f'data-holds="{told}"' in staff.client.get(unescape(address)).text
        house.put({"m1.frequency": 0.0})
        assert 'data-holds="no"' in staff.client.get(unescape(address)).text
    for wrong in ("section=1&bit=99", "section=77&bit=0", "section=tests&bit=0", "section=&bit="):
        assert staff.client.get(f"{URL}/now?{wrong}").status_code == 404
