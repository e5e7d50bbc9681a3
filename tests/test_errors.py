"""Errors are one tree, say what they are called for, and name what was found and expected."""

import inspect
from pathlib import Path

import pytest

from app import errors
from app.errors import DeviceException, LinkError, MissingFile, PogonError, Refused, Rejected, UnusableFile
from app.plant.plant_files.languages import LANGUAGES
from app.plant.texts import Texts

TEXTS = Texts.read()
OURS = [one for _, one in inspect.getmembers(errors, inspect.isclass) if issubclass(one, Exception)]


@pytest.mark.parametrize("error", OURS)
def test_every_error_is_ours_and_stands_in_the_tree(error: type[Exception]) -> None:
    assert issubclass(error, PogonError)
    assert error.__name__ in (errors.__doc__ or "")


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("error", [one for one in OURS if issubclass(one, LinkError)])
def test_every_error_of_a_link_has_its_product_text(error: type[LinkError], language: str) -> None:
    assert TEXTS.has(language, f"link.error.{error.kind}")


@pytest.mark.parametrize(
    ("code", "what", "said"),
    [
        (2, "", "exception 02 illegal data address"),
        (4, "reset refused", "reset refused: exception 04 server device failure"),
        (99, "", "exception 99 unknown exception"),
    ],
)
def test_an_exception_of_a_device_has_its_name(code: int, what: str, said: str) -> None:
    assert str(DeviceException(code, what)) == said and DeviceException(code).code == code


def test_what_a_device_rejects_says_why_in_its_numbers() -> None:
    assert str(Rejected("c1.start", 3)) == "c1.start: rejected by the device, reason 3"
    assert str(Rejected("c1.start", 3, 17, "failed")) == "c1.start: failed by the device, reason 3 (17)"


def test_a_file_that_cannot_be_used_names_its_line() -> None:
    assert str(UnusableFile(Path("a.toml"), "x", "y", 7)) == "a.toml:7: x, expected y"
    assert str(MissingFile(Path("a.toml"), "no such file", "y")) == "a.toml: no such file, expected y"


def test_a_refusal_keeps_reason_status_and_parameters() -> None:
    refused = Refused("command.writes_off", 423, link="hall")
    assert (refused.reason, refused.status, refused.params) == ("command.writes_off", 423, {"link": "hall"})
    assert Refused("x").status == 409 and str(Refused("x")) == "x"
