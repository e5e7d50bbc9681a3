"""The forms of people and tokens: what was refused is there again as it was chosen, and the password is not."""

import re
from collections.abc import Iterator
from html import unescape

import pytest
from fastapi.testclient import TestClient

from tests.web.people import PASSWORD, Staff


@pytest.fixture(scope="module")
def staff(demo: TestClient) -> Iterator[Staff]:
    crew = Staff(demo)
    yield crew
    crew.have()


def checked(page: str, name: str) -> set[str]:
    return set(re.findall(rf'name="{name}" value="(\w+)"\s+checked', page))


def new_form(page: str) -> str:
    """The form at the right, without those of people who are there."""
    return page[page.rindex("<form") :]


def test_a_refused_account_keeps_the_roles_that_were_chosen(staff: Staff) -> None:
    """Who mistypes the own password and tries again makes the account that was meant, not an operator."""
    staff.enter("head", "admin", "engineer", "operator")
    form = {"name": "gast", "display": "Gäst", "roles": ["viewer", "engineer"], "own_password": "mistyped"}
    page = unescape(staff.post("/users", form).text)
    assert checked(new_form(page), "roles") == {"viewer", "engineer"}
    assert 'value="gast"' in page and 'value="Gäst"' in page and "mistyped" not in page
    made = unescape(staff.post("/users", form | {"own_password": PASSWORD}).text)
    assert checked(new_form(made), "roles") == {"operator"}, "the next one begins anew"


def test_who_may_not_is_told_who_decides(staff: Staff) -> None:
    staff.enter("ivo", "operator")
    staff.client.cookies.set("pogon_lang", "en")
    page = unescape(staff.client.get("/users").text)
    assert "No permission" in page and "ivo may not do this. An administrator decides who may" in page


def test_a_refused_token_keeps_what_it_may_and_how_long(staff: Staff) -> None:
    staff.enter("head", "admin", "engineer", "operator")
    form = {"name": "MES", "days": "7", "permissions": ["view", "export"], "own_password": "mistyped"}
    page = unescape(staff.post("/tokens", form).text)
    assert checked(page, "permissions") == {"view", "export"}
    assert re.findall(r'value="(\d+)"\s+selected', page) == ["7"] and 'value="MES"' in page
    made = unescape(staff.post("/tokens", form | {"own_password": PASSWORD}).text)
    assert checked(made, "permissions") == {"view"} and re.findall(r'value="(\d+)"\s+selected', made) == ["90"]
