"""Passwords: what is refused, how they are kept, and that hashing never takes the machine."""

import asyncio
import re
import threading

import pytest

from app.access.passwords import Cost, Passwords, check_policy, initial_password, is_common
from app.errors import Refused
from tests.access.conftest import CHEAP


def why(password: str, *roles: str, words: tuple[str, ...] = ()) -> str:
    try:
        check_policy(password, roles or ("operator",), words)
    except Refused as refused:
        return refused.reason.rpartition(".")[2]
    return "good"


@pytest.mark.parametrize(
    ("password", "verdict"),
    [
        ("elevenchars", "short"),
        ("", "short"),
        ("            ", "short"),
        ("twelve chars it is", "good"),
        ("x" * 129, "long"),
        ("tabs\tare\tnot typed", "control"),
        ("password1234", "common"),
        ("Passw0rd!Passw0rd!", "common"),
        ("qwertzuiopasdf", "common"),
        ("123456789012345", "common"),
        ("aaaaaaaaaaaaaaaa", "common"),
        ("abcabcabcabcabc", "common"),
        ("adminadmin12345", "common"),
        ("correcthorsebatterystaple", "common"),
        ("tri plave ladice u kutu", "good"),
        ("šest žutih čamaca plovi niz đakovačku rijeku i vraća se u luku", "good"),
        ("zG7.pQ-2vTx9w", "good"),
    ],
)
def test_length_and_known_words_decide_and_nothing_else(password: str, verdict: str) -> None:
    assert why(password) == verdict


def test_who_has_power_needs_fifteen() -> None:
    assert why("grbavi pauk 7", "operator") == "good"
    assert why("grbavi pauk 7", "engineer") == "short"
    assert why("grbavi pauk 7", "admin", "operator") == "short"


def test_a_password_made_of_names_is_refused_and_one_that_only_mentions_them_is_not() -> None:
    words = ("ana.kos", "Ana Kos", "Press shop")
    assert why("ana.kos ana.kos", words=words) == "names"
    assert why("PressShop2031", words=words) == "names"
    assert why("the press shop sings at seven", words=words) == "good"


def test_common_lists_of_leaked_passwords_are_known_in_all_four_languages() -> None:
    assert [
        word for word in ("lozinka12345", "heslo1234567", "passwort1234", "letmein12345") if not is_common(word)
    ] == []


def test_what_is_kept_is_argon2id_with_the_promised_cost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.access.passwords.Cost", Cost)
    passwords = Passwords()
    kept = passwords.hash_now("tri plave ladice u kutu")
    passwords.close()
    found = re.fullmatch(r"\$argon2id\$v=19\$m=(\d+),t=(\d+),p=(\d+)\$.+", kept)
    assert found and (int(found[1]), int(found[2]), int(found[3])) == (65536, 3, 4)
    assert "ladice" not in kept


async def test_a_password_matches_however_its_letters_were_composed() -> None:
    passwords = Passwords(CHEAP)
    kept = await passwords.hash("šest žutih čamaca")
    assert await passwords.verify("šest žutih čamaca", kept)
    assert not await passwords.verify("sest zutih camaca", kept)
    passwords.close()


async def test_without_an_account_nothing_matches_not_even_nothing() -> None:
    passwords = Passwords(CHEAP)
    assert not await passwords.verify("", None)
    assert not await passwords.verify("anything", None)
    passwords.close()


async def test_a_hash_of_other_parameters_is_outdated() -> None:
    old, new = Passwords(CHEAP), Passwords(Cost(passes=2, memory=64, lanes=1))
    kept = await old.hash("tri plave ladice")
    assert new.outdated(kept)
    assert not old.outdated(kept)
    old.close()
    new.close()


async def test_never_more_than_two_hashes_at_once() -> None:
    passwords = Passwords(CHEAP)
    running, most, lock, inner = 0, 0, threading.Lock(), passwords._hasher.verify

    def counted(*arguments: str) -> bool:
        nonlocal running, most
        with lock:
            running += 1
            most = max(most, running)
        result = inner(*arguments)
        with lock:
            running -= 1
        return result

    passwords._hasher.verify = counted  # type: ignore[method-assign, assignment]
    await asyncio.gather(*(passwords.verify("wrong", None) for _ in range(40)))
    assert 1 <= most <= 2
    passwords.close()


def test_initial_passwords_are_long_random_and_readable() -> None:
    made = {initial_password() for _ in range(1000)}
    assert len(made) == 1000
    assert all(re.fullmatch(r"[a-zA-Z2-9]{20}", one) and not set(one) & set("lIO0o1") - {"o"} for one in made)
