"""The code of the first sign-in: 80 bits, typed however one likes, gone with the first account."""

import logging
from pathlib import Path

import pytest

from app.access.first_code import ALPHABET, FILE, GROUP, GROUPS, FirstCode


def test_every_code_is_another_one_and_lies_in_a_private_file(tmp_path: Path) -> None:
    code = FirstCode(tmp_path)
    assert not code.open
    codes = [code.renew() for _ in range(200)]
    assert len(set(codes)) == 200
    for text in codes:
        groups = text.split("-")
        assert [len(group) for group in groups] == [GROUP] * GROUPS
        assert set("".join(groups)) <= set(ALPHABET)
    assert (tmp_path / FILE).read_text() == codes[-1] + "\n"
    assert (tmp_path / FILE).stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize(
    "typed",
    [str, str.lower, lambda text: text.replace("-", ""), lambda text: f" {text}\n", lambda text: " ".join(text)],
)
def test_it_is_understood_however_it_is_typed(tmp_path: Path, typed: object) -> None:
    code = FirstCode(tmp_path)
    assert code.matches(typed(code.renew()))  # type: ignore[operator]


@pytest.mark.parametrize(
    "wrong", ["", "-", "0", "é", "\ud800".encode("utf-8", "replace").decode(), "AAAA-AAAA-AAAA-AAAA"]
)
def test_nothing_else_is_it(tmp_path: Path, wrong: str) -> None:
    code = FirstCode(tmp_path)
    assert not code.matches(wrong)
    text = code.renew()
    assert not code.matches(wrong)
    assert not code.matches(text[:-1])
    assert not code.matches(text + "2")
    code.renew()
    assert not code.matches(text), "the one before is dead"


def test_used_it_is_gone_with_its_file(tmp_path: Path) -> None:
    code = FirstCode(tmp_path)
    text = code.renew()
    for _ in range(2):
        code.used()
        assert not code.open
        assert not code.matches(text)
        assert not (tmp_path / FILE).exists()


def test_a_code_whose_file_cannot_be_removed_is_dead_all_the_same(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    code = FirstCode(tmp_path)
    text = code.renew()
    (tmp_path / FILE).unlink()
    (tmp_path / FILE).mkdir()
    with caplog.at_level(logging.ERROR):
        code.used()
    assert not code.matches(text)
    assert "not removed" in caplog.text


def test_on_a_disk_that_takes_no_file_it_is_in_memory(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    code = FirstCode(tmp_path / "nowhere")
    with caplog.at_level(logging.ERROR):
        text = code.renew()
    assert code.matches(text)
    assert "not written" in caplog.text
