"""Passwords: argon2id, a policy of length and known words instead of composition, and never more than two hashes at once."""

import asyncio
import re
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files

from pwdlib.hashers.argon2 import Argon2Hasher

from app import chance
from app.errors import Refused
from app.threads import Threads, threads

SHORTEST = 12
SHORTEST_WITH_POWER = 15
"""Least length for an administrator or an engineer."""
LONGEST = 128
OWN_PART = 8
"""Characters that must be left when user name and plant name are taken out."""
AT_ONCE = 2
"""Hashes computed at the same time; each takes 64 MiB."""
INITIAL_ALPHABET = "abcdefghijkmnpqrstuvwxyzABCDEFGHJKLMNPQRSTUVWXYZ23456789"
INITIAL_LENGTH = 20

_LEET = str.maketrans("013457@$!€", "oleastasie")
_ROWS = (
    "qwertzuiopasdfghjklyxcvbnm",
    "qwertyuiopasdfghjklzxcvbnm",
    "azertyuiopqsdfghjklmwxcvbn",
    "abcdefghijklmnopqrstuvwxyz",
)
_DIGITS = "01234567890123456789"


@dataclass(frozen=True, slots=True)
class Cost:
    """What one hash costs: RFC 9106, low-memory profile; above the OWASP floor of 19 MiB and 2 passes."""

    passes: int = 3
    memory: int = 65536
    """KiB."""
    lanes: int = 4


class Passwords:
    """Hashes and checks off the event loop, and knows what a password of this installation may not be made of."""

    def __init__(self, cost: Cost | None = None, threads: Threads = threads) -> None:
        cost = cost or Cost()
        self._hasher = Argon2Hasher(cost.passes, cost.memory, cost.lanes)
        self._threads = threads(AT_ONCE, "argon2")
        self.plant_name = ""
        """A password may not be made of it."""

    def check(self, password: str, roles: Iterable[str], *names: str) -> None:
        """`check_policy` with the `names` of the account and that of the plant.

        Raises:
            Refused: 422.
        """
        check_policy(password, roles, [*names, self.plant_name])

    def hash_now(self, password: str) -> str:
        """The argon2id hash, on the caller's thread."""
        return self._hasher.hash(normal(password))

    async def hash(self, password: str) -> str:
        """The argon2id hash of `password`."""
        return await asyncio.get_running_loop().run_in_executor(self._threads, self.hash_now, password)

    async def verify(self, password: str, kept: str | None) -> bool:
        """Whether `password` belongs to the hash `kept`; without one a dummy is checked, so the answer takes as long."""
        known = kept is not None
        matches = await asyncio.get_running_loop().run_in_executor(
            self._threads, self._verify_now, normal(password)[:LONGEST], kept
        )
        return matches and known and bool(password)

    def outdated(self, kept: str) -> bool:
        """Whether `kept` was made with other parameters than today's."""
        return bool(self._hasher.check_needs_rehash(kept))

    def _verify_now(self, password: str, kept: str | None) -> bool:
        dummy = self._dummy  # asked first, so that its making tells nobody whether there is such an account
        return self._hasher.verify(password, kept if kept is not None else dummy)

    @cached_property
    def _dummy(self) -> str:
        """A hash that nobody has a password for; made when it is first needed, since it costs a start 0.2 s of CPU."""
        return self._hasher.hash(chance.token_urlsafe(16))

    def close(self) -> None:
        """End the threads."""
        self._threads.shutdown(wait=True)


def normal(password: str) -> str:
    """The same characters however a keyboard composed them (č in one or in two code points)."""
    return unicodedata.normalize("NFKC", password)


def check_policy(password: str, roles: Iterable[str], words: Iterable[str] = ()) -> None:
    """Refuse a password that others would guess; `words` are user, display and plant names.

    Raises:
        Refused: too short (12; 15 for administrators and engineers), longer than 128, common, or mostly made of `words`.
    """
    text = normal(password)
    least = SHORTEST_WITH_POWER if {"admin", "engineer"} & set(roles) else SHORTEST
    if len(text.strip()) < least:
        raise Refused("access.password.short", 422, least=least)
    if len(text) > LONGEST:
        raise Refused("access.password.long", 422, most=LONGEST)
    if any(unicodedata.category(letter) == "Cc" for letter in text):
        raise Refused("access.password.control", 422)
    if is_common(text):
        raise Refused("access.password.common", 422)
    rest = text.casefold()
    for word in _context(words):
        rest = rest.replace(word, "")
    if rest != text.casefold() and len(re.sub(r"[\W_]", "", rest)) < OWN_PART:
        raise Refused("access.password.names", 422)


def is_common(password: str) -> bool:
    """Whether `password` is a common one, a run of keys, or one of these with digits, signs or repetition around it."""
    text = password.casefold()
    plain = re.sub(r"[\W_]", "", text)
    if len(set(plain)) < 5:
        return True
    for form in {plain, re.sub(r"[\W_]", "", text.translate(_LEET))}:
        unit = _period(form)
        core = unit.strip("0123456789") or unit
        if unit in COMMON or core in COMMON or unit.translate(_LEET) in COMMON or _is_run(unit) or _is_run(core):
            return True
        if _covered(core):
            return True
    return False


def initial_password() -> str:
    """20 characters of 5.8 bits that cannot be mistaken for each other."""
    return "".join(chance.choice(INITIAL_ALPHABET) for _ in range(INITIAL_LENGTH))


def _context(words: Iterable[str]) -> list[str]:
    parts = {part for word in (*words, "pogon") for part in [normal(word), *re.split(r"[\W_]+", normal(word))]}
    return sorted({part.casefold() for part in parts if len(part) >= 3}, key=len, reverse=True)


def _period(text: str) -> str:
    """The shortest beginning whose repetition is `text`."""
    return next(
        (text[:n] for n in range(1, len(text) // 2 + 1) if (text[:n] * (len(text) // n + 1))[: len(text)] == text), text
    )


def _is_run(text: str) -> bool:
    """Whether `text` is one walk along a row of keys, the alphabet or the digits, either way."""
    return len(text) >= 4 and any(text in row or text in row[::-1] for row in (*_ROWS, _DIGITS))


def _covered(text: str) -> bool:
    """Whether `text` is nothing but two or three common words or key runs (`adminpassword`, `qwertz12345678`)."""
    reach = {0: 0}
    for end in range(1, len(text) + 1):
        for start, words in list(reach.items()):
            piece = text[start:end]
            if words < 3 and (piece in COMMON or _is_run(piece)):
                reach[end] = min(words + 1, reach.get(end, 9))
    return len(text) in reach


COMMON = frozenset(files("app.access").joinpath("common_passwords.txt").read_text("utf-8").split())
"""Words and numbers that lists of leaked passwords begin with, and those of this trade, lower case."""
