"""Every error number that a drive may tell has its meaning in every language."""

import pytest

from app.plant.plant_files.languages import LANGUAGES
from app.plant.texts import Texts
from app.profidrive.parameter_access.error_numbers import KNOWN, ErrorNumber, MailboxError, key_of, mailbox_key_of

TEXTS = Texts.read()


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_number_has_its_own_text(language: str) -> None:
    told = {number: TEXTS.text(language, key_of(number)) for number in KNOWN}
    told |= {-number: TEXTS.text(language, mailbox_key_of(number)) for number in MailboxError}
    assert not [text for text in told.values() if "[" in text or not text]
    same = {ErrorNumber.NOT_IN_DOWNLOAD, ErrorNumber.NO_DOWNLOAD_NOW}
    assert len({text for number, text in told.items() if number not in same}) == len(told) - len(same)


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_number_that_nobody_knows_is_told_as_it_is(language: str) -> None:
    unknown = sorted({*range(0x100), 0xFFFF} - set(KNOWN))
    assert len(KNOWN) == 57
    assert all("0xee" in TEXTS.text(language, key_of(number), number="0xee") for number in (*unknown, None))
    assert "77" in TEXTS.text(language, mailbox_key_of(77), number=77)


def test_numbers_are_those_of_the_reference() -> None:
    manual = [
        *range(0x08), 0x09, 0x0B, 0x0C, 0x0F, 0x10, 0x11, *range(0x14, 0x19), 0x65, 0x66, 0x68, 0x6A, 0x6B, 0x7F,
        *range(0x81, 0x88), 0xC8, 0xC9, 0xCC,
    ]  # fmt: skip
    assert sorted(number for number, known in KNOWN.items() if known.certainty == "M") == manual
    with_subindex = [0x01, 0x02, 0x03, 0x06, 0x07, 0x14]
    assert sorted(number for number, known in KNOWN.items() if known.info == "subindex") == with_subindex
