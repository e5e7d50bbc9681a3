"""Chance comes from one source, and can be repeated."""

from collections.abc import Iterator
from random import Random

import pytest

from app import chance


@pytest.fixture(autouse=True)
def _given_back() -> Iterator[None]:
    before = chance._source
    yield
    chance.use(before)


def drawn() -> list[object]:
    return [
        chance.uniform(2, 3),
        chance.randrange(5, 9),
        chance.choice("abcdef"),
        chance.token_bytes(12),
        chance.token_hex(8),
        chance.token_urlsafe(32),
    ]


def test_one_seed_repeats_everything_and_another_nothing() -> None:
    runs = []
    for seed in (7, 7, 8):
        chance.use(Random(seed))
        runs.append([drawn() for _ in range(5)])
    assert runs[0] == runs[1]
    assert all(a != b for a, b in zip(runs[0], runs[2], strict=True))


def test_without_a_source_it_is_the_operating_systems() -> None:
    chance.use(Random(1))
    chance.use()
    assert chance.token_bytes(32) not in (Random(1).randbytes(32), chance.token_bytes(32))


def test_what_is_drawn_stays_within_its_limits() -> None:
    chance.use(Random(3))
    assert all(2 <= chance.uniform(2, 3) <= 3 for _ in range(200))
    assert {chance.randrange(5, 9) for _ in range(200)} == {5, 6, 7, 8}
    assert {chance.choice("abc") for _ in range(200)} == {"a", "b", "c"}


@pytest.mark.parametrize(("count", "letters"), [(1, 2), (16, 22), (32, 43), (33, 44)])
def test_tokens_have_their_length_and_fit_an_address(count: int, letters: int) -> None:
    assert len(chance.token_bytes(count)) == count and len(chance.token_hex(count)) == 2 * count
    token = chance.token_urlsafe(count)
    assert len(token) == letters and token.replace("-", "").replace("_", "").isalnum()
