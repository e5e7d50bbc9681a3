"""Names that an area, a link or a machine may have."""

import re

import pytest

from app.plant.plant_files.names import ID, RESERVED_IDS, check_id


class Notes:
    """A table that notes mistakes."""

    def __init__(self) -> None:
        self.noted: list[tuple[str, object, str]] = []

    def note(self, key: str, value: object, expected: str) -> None:
        self.noted.append((key, value, expected))


@pytest.mark.parametrize(
    ("name", "fits"),
    [
        ("m1", True),
        ("a", True),
        ("press_shop_2", True),
        ("a" * 32, True),
        ("a" * 33, False),
        ("", False),
        ("1m", False),
        ("_m", False),
        ("M1", False),
        ("m-1", False),
        ("m.1", False),
        ("m1\n", False),
        ("č1", False),
        ("sys", False),
        ("system", True),
    ],
)
def test_small_letters_digits_and_underscores_beginning_with_a_letter(name: str, fits: bool) -> None:
    notes = Notes()
    check_id(name, notes)  # type: ignore[arg-type]
    assert (not notes.noted) is fits
    if not fits:
        assert notes.noted[0][1] == name and "not sys" in notes.noted[0][2]


def test_what_is_reserved_would_be_a_name() -> None:
    assert all(re.fullmatch(ID, name) for name in RESERVED_IDS)
