"""The code of the first sign-in: printed by the terminal, typed by a person, good for one account and then gone."""

import hmac
import logging
from pathlib import Path

from app import chance
from app.access.private import write_private

log = logging.getLogger(__name__)

ALPHABET = "23456789ABCDEFGHJKLMNPQRSTUVWXYZ"
"""32 signs without 0, 1, I, O: 5 bits each."""
GROUPS, GROUP = 4, 4
FILE = "first-code"


class FirstCode:
    """80 bits in four groups, in memory and in `POGON_DATA/first-code` (0600), anew at every start until used."""

    def __init__(self, data: Path) -> None:
        self.path = data / FILE
        self.text = ""

    @property
    def open(self) -> bool:
        """Whether a first account is still to be made."""
        return bool(self.text)

    def renew(self) -> str:
        """A fresh code; the one before is dead. On a disk that takes no file it is in memory only: the terminal shows it."""
        signs = [chance.choice(ALPHABET) for _ in range(GROUPS * GROUP)]
        self.text = "-".join("".join(signs[at : at + GROUP]) for at in range(0, len(signs), GROUP))
        try:
            write_private(self.path, self.text + "\n")
        except OSError as error:
            log.error("%s not written reason=%s", self.path, error.strerror)
        return self.text

    def matches(self, typed: str) -> bool:
        """Whether `typed` is the code, however it is grouped and in whichever case."""
        given = "".join(typed.split()).replace("-", "").upper().encode()
        return self.open and hmac.compare_digest(given, self.text.replace("-", "").encode())

    def used(self) -> None:
        """There is an account now: the code is gone, its file too."""
        self.text = ""
        try:
            self.path.unlink(missing_ok=True)
        except OSError as error:
            log.error("%s not removed reason=%s", self.path, error.strerror)
