"""Every text that a person sees, in the person's language.

The product's own texts are `app/locale/<lang>/*.toml`, tables inside joined with dots; an equipment type has its own in
`texts.<lang>.toml`, and its pages ask for them by `<type>.<key>`; a plant file has labels and alarm rows, the definition of a sequence has
labels of its steps and permissives. A text that a language lacks is shown in the plant's first language, else in English, with the mark of
that language: `[en] Fan 2`.

A table of plural forms is written as its categories: `rows.one`, `rows.few`, `rows.many`, `rows.other` (CLDR, by Babel). The parameter
`n` chooses the form.
"""

import string
from collections.abc import Mapping, Sequence
from functools import cached_property, lru_cache
from pathlib import Path

import tomli

from app.errors import ConfigurationError
from app.plant.cldr import conventions
from app.plant.definitions import Equipment, EquipmentType, Plant
from app.plant.definitions import Texts as Label
from app.plant.plant_files.languages import LOCALE, languages
from app.plant.type_files.texts import flatten

FALLBACK = "en"
COUNT = "n"
"""Name of the parameter that chooses a plural form."""

Catalogue = Mapping[str, Mapping[str, str]]
"""Language → key → text."""


class Texts:
    """The texts of the product, of a plant and of its equipment types."""

    def __init__(self, product: Catalogue, plant: Plant | None = None) -> None:
        self._product = product
        self._plant = plant
        self.languages = tuple(plant.languages) if plant else tuple(product)
        """Languages that a person may choose; the first is the default."""
        self.default = self.languages[0] if self.languages else FALLBACK

    @cached_property
    def _types(self) -> Catalogue:
        """Texts of equipment types; who asks for names of the plant only goes without."""
        return _by_type(self._plant) if self._plant else {}

    @classmethod
    def read(cls, plant: Plant | None = None, folder: Path = LOCALE) -> "Texts":
        """The product's texts from disk, with those of `plant`.

        Raises:
            ConfigurationError: a file of texts cannot be read; names file and mistake.
        """
        texts = cls(read_product(folder), plant)
        texts._types  # noqa: B018 - here and now: this may be a thread, where nobody waits for it
        return texts

    def text(self, lang: str, key: str, /, **params: object) -> str:
        """The product's (or the plant file's) text `key` in `lang`, its placeholders filled; `<type>.<key>` is that of an equipment type.

        A missing text comes in another language with that language's mark; a key that exists nowhere comes as `[key]`.
        """
        return self._find(lang, key, params, self._product, self._plant.texts if self._plant else {}, self._types)

    def of_type(self, lang: str, kind: EquipmentType | str, key: str, /, **params: object) -> str:
        """The text `key` of an equipment type, else the plant's, else the product's."""
        if isinstance(kind, str):
            found = self._plant.types.get(kind) if self._plant else None
            own: Catalogue = found.texts if found else {}
        else:
            own = kind.texts
        return self._find(lang, key, params, own, self._plant.texts if self._plant else {}, self._product)

    def of_former(self, lang: str, kind: EquipmentType | str, key: str, /, **params: object) -> str:
        """`of_type` for a key that was written down some time ago: the machine may be of another type now, or gone, and a key that exists
        nowhere comes as its last part (`sp` of `point.sp`)."""
        found = self.of_type(lang, kind, key, **params)
        return key.rpartition(".")[2] if found == f"[{key}]" else found

    def label(self, lang: str, label: Label) -> str:
        """A label of the plant file in `lang`, with a language mark when it is in another one."""
        if lang in label:
            return label[lang]
        for other in (self.default, FALLBACK, *label):
            if other in label:
                return f"[{other}] {label[other]}"
        return ""

    def step(self, lang: str, item: Equipment, number: int) -> str:
        """The label of step `number` (from 1) of a machine that runs a sequence, with a language mark when it is in another language.

        Empty for 0 (the abort conditions), and for a number that the sequence does not have.
        """
        steps = item.sequence.steps if item.sequence else ()
        return self.label(lang, steps[number - 1].label) if 0 < number <= len(steps) else ""

    def permissive(self, lang: str, item: Equipment, step: int, bit: int) -> str:
        """The label of a permissive of step `step` (0 = abort conditions), likewise; empty when the definition does not name the bit."""
        found = item.sequence.permissive(step, bit) if item.sequence else None
        return self.label(lang, found.label) if found else ""

    def has(self, lang: str, key: str, kind: EquipmentType | None = None) -> bool:
        """Whether `lang` itself has the text."""
        return any(
            key in own.get(lang, {}) or f"{key}.other" in own.get(lang, {})
            for own in (kind.texts if kind else {}, self._product)
        )

    def key_of(self, english: str, under: str) -> str:
        """The key, which begins with `under`, of the product's text that is `english` in English; empty when there is none."""
        return next(
            (key for key, text in self._product[FALLBACK].items() if text == english and key.startswith(under)), ""
        )

    def _find(self, lang: str, key: str, params: Mapping[str, object], *catalogues: Catalogue) -> str:
        for language in dict.fromkeys((lang, self.default, FALLBACK)):
            for catalogue in catalogues:
                own = catalogue.get(language)
                text = None if own is None else _form(own, language, key, params)
                if text is not None:
                    filled = fill(text, params)
                    return filled if language == lang else f"[{language}] {filled}"
        return f"[{key}]"


def terminal_language(environment: Mapping[str, str], known: Sequence[str]) -> str:
    """The language that the terminal asks for, if it is one of `known`, else English."""
    wanted = next((environment[name] for name in ("LC_ALL", "LC_MESSAGES", "LANG") if environment.get(name)), "")
    return wanted[:2] if wanted[:2] in known else "en"


def _by_type(plant: Plant) -> dict[str, dict[str, str]]:
    """The texts of the plant's equipment types, the name of the type before each key."""
    texts: dict[str, dict[str, str]] = {}
    for name, kind in plant.types.items():
        for language, own in kind.texts.items():
            texts.setdefault(language, {}).update({f"{name}.{key}": text for key, text in own.items()})
    return texts


@lru_cache(maxsize=256)
def _parsed(text: str) -> tuple[tuple[str, str], ...]:
    """Keys and texts of a file: what starts reads them for its pages, its alarms and its commands."""
    return tuple(flatten(tomli.loads(text)))


def read_product(folder: Path = LOCALE) -> dict[str, dict[str, str]]:
    """Language → key → text of all files of `folder`/<lang>; a language without files is there and empty.

    Raises:
        ConfigurationError: a file is no TOML or no UTF-8, or a key stands in two files of one language.
    """
    product: dict[str, dict[str, str]] = {}
    for language in languages():
        own: dict[str, str] = {}
        for file in sorted((folder / language).glob("*.toml")):
            try:
                table = _parsed(file.read_text("utf-8"))
            except (OSError, ValueError) as error:
                raise ConfigurationError(f"{language}/{file.name}: {error}, expected a TOML file of texts") from error
            for key, text in table:
                if key in own:
                    raise ConfigurationError(
                        f"{language}/{file.name}: text {key} is there twice, expected each key once"
                    )
                own[key] = text
        product[language] = own
    return product


def plural_category(lang: str, number: float) -> str:
    """CLDR category of a number: `one`, `few`, `many`, `other`. A language that Babel does not know has `other` only."""
    return str(conventions(lang).plural(abs(number)))


def fill(text: str, params: Mapping[str, object]) -> str:
    """`text` with its `{names}` replaced. A placeholder without a value stays as it is: a text must never fail at its reader.

    Only plain names are replaced: no attributes, no indices, no format codes.
    """
    if "{" not in text and "}" not in text:
        return text
    parts: list[str] = []
    try:
        for literal, name, _, _ in string.Formatter().parse(text):
            parts.append(literal)
            if name is not None:
                parts.append(str(params[name]) if name in params else f"{{{name}}}")
    except ValueError:
        return text
    return "".join(parts)


def _form(own: Mapping[str, str], lang: str, key: str, params: Mapping[str, object]) -> str | None:
    text = own.get(key)
    if text is not None:
        return text
    number = params.get(COUNT)
    if isinstance(number, int | float):
        chosen = own.get(f"{key}.{plural_category(lang, number)}")
        if chosen is not None:
            return chosen
    return own.get(f"{key}.other")
