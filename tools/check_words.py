"""One word for one thing: every text is held against the glossary, app/locale/glossary.toml.

A text is one of the product (app/locale), of an equipment type, of a lesson, of a sequence or of a plant. Two rules, both by the beginnings
of words, so that every inflected form counts:
- where the English text has the word of an entry, the others have theirs: any other word for it is found, also one that nobody thought of;
- what an entry lists under `second` stands nowhere.
What is excused is named in the glossary with its reason, and an excuse that excuses nothing is a problem as well.
"""

import re
import sys
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
GLOSSARY = ROOT / "app" / "locale" / "glossary.toml"
LANGUAGES = ("en", "hr", "de", "cs")
KEYS = {*LANGUAGES, "stems", "second", "said", "only", "note", "except"}
PLURAL = {"zero", "one", "two", "few", "many", "other"}
Texts = dict[str, dict[str, str]]
"""Place of a text → language → text; the forms of a plural stand in one text, one after the other."""


@dataclass(frozen=True)
class Entry:
    """One thing and its word in each language."""

    name: str
    words: dict[str, str]
    stems: dict[str, list[str]] = field(default_factory=dict)
    """How the word begins; where the first language has one, each other that is named here must have one."""
    second: dict[str, list[str]] = field(default_factory=dict)
    """Beginnings of the words that must not stand for it."""
    said: dict[str, list[str]] = field(default_factory=dict)
    """Phrases that mean something else and are not looked at."""
    only: tuple[str, ...] = ()
    """Places where the entry counts; none: everywhere."""
    excused: tuple[tuple[str, str], ...] = ()
    """(place, language or `*`) with a reason in the glossary."""


def main() -> int:
    entries, problems = read_glossary(tomllib.loads(GLOSSARY.read_text("utf-8")))
    problems += two_words(collect(), entries)
    print(*problems, sep="\n", end="\n" if problems else "")
    return 1 if problems else 0


def read_glossary(table: Mapping[str, Any]) -> tuple[list[Entry], list[str]]:
    """The entries and what is wrong with them."""
    entries, problems = [], []
    for name, row in table.items():
        where = f"{GLOSSARY.relative_to(ROOT)}: [{name}]"
        if unknown := sorted(set(row) - KEYS):
            problems.append(f"{where} has {unknown}, expected some of {sorted(KEYS)}")
        if lacking := [language for language in LANGUAGES if not row.get(language)]:
            problems.append(f"{where} lacks the word in {lacking}")
        for one in row.get("except", ()):
            if set(one) != {"text", "language", "why"} or not one["why"]:
                problems.append(f"{where}: an exception has text, language and why, not {one}")
        entries.append(
            Entry(
                name=name,
                words={language: row.get(language, "") for language in LANGUAGES},
                stems=row.get("stems", {}),
                second=row.get("second", {}),
                said=row.get("said", {}),
                only=tuple(row.get("only", ())),
                excused=tuple((one.get("text", ""), one.get("language", "*")) for one in row.get("except", ())),
            )
        )
    return entries, problems


def two_words(texts: Texts, entries: list[Entry]) -> Iterator[str]:
    """What has another word than the glossary, and excuses that nothing needs."""
    for entry in entries:
        used = set()
        for place, text in texts.items():
            if entry.only and not any(fnmatchcase(place, one) for one in entry.only):
                continue
            for language, problem in _wrong(entry, text):
                excuses = {one for one in entry.excused if fnmatchcase(place, one[0]) and one[1] in (language, "*")}
                used |= excuses
                if not excuses:
                    yield f"{place}: {language} {problem}, the glossary has {entry.words[language]!r} for {entry.name}: {text[language]!r}"
        for one in entry.excused:
            if one not in used:
                yield f"{GLOSSARY.relative_to(ROOT)}: [{entry.name}] excuses {one}, which needs no excuse"


def _wrong(entry: Entry, text: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    meant = "en" in text and bool(_found(_rest(entry, "en", text["en"]), entry.stems.get("en", [])))
    for language, words in text.items():
        if second := _found(_rest(entry, language, words), entry.second.get(language, [])):
            yield language, f"says {second!r}"
        elif meant and (stems := entry.stems.get(language)) and not _found(words, stems):
            yield language, f"says none of {', '.join(stems)}"


def _rest(entry: Entry, language: str, text: str) -> str:
    for phrase in entry.said.get(language, []):
        text = _pattern(phrase).sub(" ", text)
    return text


def _found(text: str, stems: list[str]) -> str:
    text = re.sub(r"\{[^}]*\}", " ", text.replace("\u00ad", ""))
    return next((match[0] for stem in stems if (match := _pattern(stem).search(text))), "")


@cache
def _pattern(stem: str) -> re.Pattern[str]:
    """`stem` begins a word or the denial of one (ne-), `*stem` is anywhere in one, `word!` ends with it;
    several words stand one after the other.
    """
    words = []
    for word in stem.split():
        end = r"\b" if word.endswith("!") else r"\w*"
        start = r"\w*" if word.startswith("*") else r"\b(?:ne)?"
        words.append(start + re.escape(word.strip("*!")) + end)
    return re.compile(r"[\s-]+".join(words), re.IGNORECASE)


def collect() -> Texts:
    """All texts of the house with their places: `alarm.list`, `crane.help.what`, `plants/demo/plant.toml areas.0.label`."""
    texts: Texts = {}
    for language in LANGUAGES:
        files = [(file, "") for file in sorted((ROOT / "app/locale" / language).glob("*.toml"))]
        files += [
            (file, f"{file.parent.name}.") for file in sorted((ROOT / "app/equipment").glob(f"*/texts.{language}.toml"))
        ]
        for file, prefix in files:
            for key, text in _flat(tomllib.loads(file.read_text("utf-8")), prefix):
                texts.setdefault(key, {})[language] = text
    of_plants = ("app/equipment/*/device.toml", "app/equipment/*/lessons/*.toml", "plants/**/*.toml")
    for file in sorted(path for one in of_plants for path in ROOT.glob(one)):
        for key, labels in _labels(tomllib.loads(file.read_text("utf-8")), ""):
            texts[f"{file.relative_to(ROOT)} {key}"] = labels
    return texts


def _flat(table: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, str]]:
    for key, value in table.items():
        if not isinstance(value, dict):
            yield f"{prefix}{key}", str(value)
        elif "other" in value and set(value) <= PLURAL:
            yield f"{prefix}{key}", " / ".join(value.values())
        else:
            yield from _flat(value, f"{prefix}{key}.")


def _labels(value: object, place: str) -> Iterator[tuple[str, dict[str, str]]]:
    """Texts in several languages, wherever they stand in a file."""
    if isinstance(value, list):
        for n, one in enumerate(value):
            yield from _labels(one, f"{place}.{n}" if place else str(n))
    elif isinstance(value, dict):
        if {"en", "hr"} <= set(value) and all(isinstance(text, str) for text in value.values()):
            yield place, {language: text for language, text in value.items() if language in LANGUAGES}
            return
        for key, one in value.items():
            yield from _labels(one, f"{place}.{key}" if place else key)


if __name__ == "__main__":
    sys.exit(main())
