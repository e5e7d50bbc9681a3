"""Values of a run, branches, loops and safe steps are edited as fields, in the same text; what no field has stays in it."""

import html
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from app import bundled
from tests.web.conftest import Start
from tests.web.people import Staff

URL = "/equipment/steps1/definition"
OLD = {"&#34;": '"', "&#39;": "'", "&gt;": ">"}


@pytest.fixture
def staff(start: Start, tmp_path: Path) -> Iterator[Staff]:
    shutil.copytree(bundled("plants/drive_steps"), tmp_path / "plant")
    people = Staff(start(plant=tmp_path / "plant"))
    people.enter("ivana", "engineer")
    people.client.cookies.set("pogon_lang", "en")
    yield people


def page(staff: Staff, section: str = "0") -> str:
    return str(staff.client.get(f"{URL}?section={section}").text)


def send(staff: Staff, what: str, section: str = "0", **given: str) -> str:
    window = dict(re.findall(r'name="(tab|seen)"\s+value="(\w+)"', page(staff, section)))
    named = {name.replace("__", "."): value for name, value in given.items()}
    answer = staff.post(f"{URL}/{what}", {**window, "section": section, **named})
    return str(answer.text if answer.status_code != 303 else page(staff, section))


def file(staff: Staff) -> str:
    found = ""
    for key in ("0", "1", "2", "3", "4", "tests"):
        text = re.search(r"<textarea[^>]*>\n(.*?)</textarea>", page(staff, key), re.S)
        found += text[1] if text else ""
    for sign, plain in OLD.items():
        found = found.replace(sign, plain)
    return found


def hint(answer: str, name: str) -> str:
    found = re.search(rf'id="h-f-{name}"[^>]*>(.*?)</p>', answer, re.S)
    return found[1] if found else ""


@pytest.mark.sweep(8)
def test_values_of_a_run_are_fields_of_the_head(staff: Staff) -> None:
    before = file(staff)
    assert 'name="recipe.0.maximum" value="50"' in page(staff)
    answer = send(staff, "fields", recipe__0__maximum="45,5", recipe__1__label__de="Zeit")
    assert "No mistakes." in answer
    after = file(staff)
    assert "maximum = 45.5\n" in after and 'de = "Zeit"' in after
    assert [line for line in after.splitlines() if line not in before.splitlines()].__len__() == 2
    wrong = send(staff, "fields", recipe__0__default="60")
    assert "a number from 5 to 45.5" in hint(wrong, "recipe-0-default")
    send(staff, "fields", recipe__0__default="30")
    shown = send(staff, "do", do="add_recipe")
    assert 'name="recipe.2.key" value="value"' in shown and "No mistakes." in shown
    assert 'name="recipe.2.key"' not in send(staff, "do", do="remove_recipe:2")


@pytest.mark.sweep(8)
def test_a_time_may_be_a_value_of_the_run(staff: Staff) -> None:
    first = page(staff, "2")
    assert 'list="ed-recipe"' in first and '<option value="recipe.duration">' in first
    assert "No mistakes." in send(staff, "fields", "2", minimum="recipe.duration")
    assert 'minimum = "recipe.duration"' in file(staff)
    assert "recipe.frequency" in hint(send(staff, "fields", "2", minimum="recipe.time"), "minimum")


@pytest.mark.sweep(8)
def test_branches_and_loops_are_added_checked_and_removed(staff: Staff) -> None:
    before = file(staff)
    shown = send(staff, "do", do="add_branches")
    assert 'name="branches.0.paths" value="stop, reverse"' in shown and "No mistakes." in shown
    assert '[[branches]]\nafter = "forward"\n' in file(staff)
    wrong = send(staff, "fields", branches__0__paths="stop, revers")
    assert "a step of this file" in hint(wrong, "branches-0-paths") and "branches.0.paths.1" in wrong
    assert "No mistakes." in send(staff, "fields", branches__0__paths="stop,reverse", branches__0__take="first")
    assert "run side by side" in send(staff, "fields", branches__0__take="all")
    send(staff, "do", do="remove_branches:0")
    assert "No mistakes." in send(staff, "do", do="add_loops")
    wrong = send(staff, "fields", loops__0__times="1")
    assert "from 2" in hint(wrong, "loops-0-times")
    assert "No mistakes." in send(staff, "fields", loops__0__times="3", loops__0__to="stop_again")
    assert 'to = "stop_again"\ntimes = 3\n' in file(staff)
    send(staff, "do", do="remove_loops:0")
    assert file(staff).strip() == before.strip()


@pytest.mark.sweep(8)
def test_a_loop_is_counted_by_a_number_or_a_value_of_the_run(staff: Staff) -> None:
    send(staff, "do", do="add_loops")
    send(staff, "do", do="add_recipe")
    shown = page(staff)
    assert re.search(r'name="loops\.0\.times"[^>]*list="ed-recipe"', shown), shown
    wrong = hint(send(staff, "fields", loops__0__times="recipe.value"), "loops-0-times")
    assert "in whole numbers, with decimals = 0" in wrong
    given = {"recipe__2__decimals": "0", "recipe__2__minimum": "1", "recipe__2__default": "2"}
    assert "No mistakes." in send(staff, "fields", **given)
    assert 'times = "recipe.value"\n' in file(staff)
    assert "recipe.times" not in hint(send(staff, "fields", loops__0__times="5"), "loops-0-times")
    assert "times = 5\n" in file(staff)


@pytest.mark.sweep(8)
def test_safe_steps_are_chosen_by_name(staff: Staff) -> None:
    shown = page(staff)
    assert "4 · Stop again" in shown
    assert "No mistakes." in send(staff, "fields", sequence__abort_to="stop_again")
    assert 'abort_to = "stop_again"\n' in file(staff)
    assert "the safe steps are the last" in send(staff, "fields", sequence__abort_to="forward")
    send(staff, "fields", sequence__abort_to="")
    assert "abort_to" not in file(staff)


@pytest.mark.sweep(8)
def test_what_no_field_has_stays(staff: Staff) -> None:
    send(staff, "do", do="add_loops")
    text = re.search(r"<textarea[^>]*>\n(.*?)</textarea>", page(staff, "tests"), re.S)
    assert text
    written = text[1].replace("&#34;", '"').replace("times = 2", "times = 2  # as in the thesis\nmood = 1")
    assert "loops.0.mood" in send(staff, "text", "tests", text=written)
    send(staff, "fields", loops__0__times="4")
    assert "times = 4  # as in the thesis\nmood = 1" in file(staff)


@pytest.mark.sweep(8)
def test_one_value_of_an_order_is_changed_in_the_line_of_its_values(staff: Staff) -> None:
    assert "No mistakes." in send(staff, "fields", "1", orders__0__values__frequency="12,5")
    assert "values = { frequency = 12.5 }\n" in file(staff)
    assert "No mistakes." in send(staff, "fields", "1", orders__0__values__frequency="recipe.frequency")
    assert 'values = { frequency = "recipe.frequency" }\n' in file(staff)


@pytest.mark.sweep(8)
def test_what_only_the_text_can_change_is_named(staff: Staff) -> None:
    found = re.search(r"<textarea[^>]*>\n(.*?)</textarea>", page(staff, "1"), re.S)
    assert found
    text = html.unescape(found[1])
    table = '[[steps.orders]]\nmachine = "m1"\naction = "run_forward"\nvalues = { frequency = "recipe.frequency" }\n'
    assert table in text
    line = 'orders = [{ machine = "m1", action = "run_forward", values = { frequency = "recipe.frequency" } }]\n'
    text = text.replace(table, "").replace("maximum = 60\n", "maximum = 60\n" + line)
    assert "No mistakes." in send(staff, "text", "1", text=text)
    answer = send(staff, "fields", "1", orders__0__values__frequency="12")
    assert "steps.0.orders.0" in answer and "in a way that only the text can change" in answer, answer
    assert line in file(staff)
