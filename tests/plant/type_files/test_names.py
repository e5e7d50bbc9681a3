"""Names that the files of a type give."""

import re

import pytest

from app.access.roles import ROLE_PERMISSION
from app.plant.type_files.names import KEY, ROLES


@pytest.mark.parametrize(
    ("name", "is_key"),
    [
        ("speed", True),
        ("a1_b", True),
        ("", False),
        ("1a", False),
        ("_a", False),
        ("Speed", False),
        ("č", False),
        ("a.b", False),
        ("a\n", False),
    ],
)
def test_a_key_has_small_letters_digits_and_underscores_and_begins_with_a_letter(name: str, is_key: bool) -> None:
    assert bool(re.fullmatch(KEY, name)) is is_key


def test_the_roles_that_a_file_may_ask_for_are_those_that_people_have() -> None:
    assert set(ROLES) == set(ROLE_PERMISSION)
