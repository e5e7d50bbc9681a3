"""The order that a conveyor feeds: the editor offers it in words, its page names it, a refusal says what is missing."""

import re
from collections.abc import Iterator

import pytest

from tests.web.conftest import Start
from tests.web.operating import until
from tests.web.people import Staff
from tests.web.test_sequence_editor import URL, Window, folder, text_of

__all__ = ["folder"]
WORDS = {
    "en": ("Feed products to the end", "Feed a product to sensor 2"),
    "hr": ("Dopremi proizvode do kraja", "Dopremi proizvod do senzora 2"),
    "de": ("Produkte bis zum Ende fördern", "Ein Produkt bis Sensor 2 fördern"),
    "cs": ("Dopravit výrobky na konec", "Dopravit výrobek ke snímači 2"),
}


@pytest.fixture
def staff(start: Start, folder) -> Iterator[Staff]:  # type: ignore[no-untyped-def]
    people = Staff(start(plant=folder))
    people.enter("ivana", "engineer")
    people.client.cookies.set("pogon_lang", "en")
    yield people


@pytest.mark.sweep(8)
@pytest.mark.parametrize("language", WORDS)
def test_the_editor_offers_it_in_words(staff: Staff, language: str) -> None:
    staff.client.cookies.set("pogon_lang", language)
    page = Window(staff, "2").page
    for key, called in zip(("feed", "feed_to_2"), WORDS[language], strict=True):
        assert re.search(rf'<option value="{key}"[^>]*>{key} · {called}</option>', page), page


@pytest.mark.sweep(8)
def test_its_number_of_products_is_asked_and_checked(staff: Staff) -> None:
    window = Window(staff, "2")
    wrong = window.send("fields", orders__0__action="feed").text
    assert "orders.0.values.count" in wrong and "No mistakes." not in wrong
    assert "number from 1 to 10000" in Window(staff, "2").send("fields", orders__0__values__count="0").text
    assert "a whole number" in Window(staff, "2").send("fields", orders__0__values__count="1.5").text
    assert "No mistakes." in Window(staff, "2").send("fields", orders__0__values__count="3").text
    assert "action = &#34;feed&#34;" in text_of(Window(staff, "2").page)


@pytest.mark.sweep(8)
def test_a_trial_that_is_refused_says_what_is_missing(staff: Staff) -> None:
    """The line is never put into automatic."""
    Window(staff, "1").send("do", do="remove_order:1")
    Window(staff, "2").send("fields", orders__0__action="feed")
    Window(staff, "2").send("fields", orders__0__values__count="2")
    assert staff.post(f"{URL}/try").status_code == 303
    assert until(lambda: "was not carried out" in staff.client.get(f"{URL}/try").text, 60)
    told = staff.client.get(f"{URL}/try").text
    assert "Order c1.feed(count = 2) was not carried out: Not in automatic mode: select automatic first" in told, told


def test_its_page_says_what_a_step_orders(start: Start, folder) -> None:  # type: ignore[no-untyped-def]
    file = folder / "sequences" / "feed.toml"
    text = file.read_text("utf-8").replace('action = "start"\n', 'action = "feed"\nvalues = { count = 2 }\n')
    file.write_text(text, "utf-8")
    people = Staff(start(plant=folder))
    people.enter("ivana", "engineer")
    people.client.cookies.set("pogon_lang", "de")
    assert "Förderband 1: Produkte bis zum Ende fördern (Produkte 2)" in people.client.get("/equipment/seq1").text
