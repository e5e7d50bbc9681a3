"""Every language says the same things, and every text that a template or the code asks for exists.

A language is a folder `app/locale/<lang>/` of TOML files and a `texts.<lang>.toml` per equipment type (`<type>.<key>`); English is the
one the others are compared with. Tables inside a file are joined with dots (`[alarm] high = …` is `alarm.high`); a
table of plural forms (one, few, many, other) counts as one text and holds exactly the forms of its language.
All problems are printed, then the exit code is 1. With --update, what a language lacks is put into its `new.toml`.
"""

import ast
import re
import string
import sys
import tomllib
import unicodedata
from collections.abc import Iterator
from pathlib import Path

import jinja2
from babel import Locale
from jinja2 import nodes

from app.plant import types

ROOT = Path(__file__).resolve().parent.parent
LANGUAGES = ("en", "hr", "de", "cs")
PLURAL = {"zero", "one", "two", "few", "many", "other"}
CALLS = {"_", "t", "text", "said"}
Texts = dict[str, str | dict[str, str]]


def main() -> int:
    problems: list[str] = []
    locale = ROOT / "app" / "locale"
    found = (
        sorted({*LANGUAGES, *(p.name for p in locale.iterdir() if p.is_dir())}) if locale.is_dir() else list(LANGUAGES)
    )
    own = {lang: load(sorted((locale / lang).glob("*.toml")), problems) for lang in found}
    problems += compare("app/locale", own)
    by_type: dict[str, set[str]] = {}
    for folder in sorted(p for p in (ROOT / "app" / "equipment").glob("*/") if any(p.glob("*.toml"))):
        texts = {lang: load([folder / f"texts.{lang}.toml"], problems) for lang in found}
        problems += compare(f"app/equipment/{folder.name}", texts)
        by_type[folder.name] = set(texts["en"])
        data, wrong = types.read_type(folder.name, LANGUAGES)
        problems += map(str, wrong)
        by_type[folder.name] |= set(data.type.texts["en"])  # those of its kin, too
        for key in sorted(set(types.text_keys(data))):
            if key not in by_type[folder.name] | set(own["en"]):
                problems.append(f'app/equipment/{folder.name}: text "{key}" is not in texts.en.toml')
    of_types = {f"{name}.{key}" for name, keys in by_type.items() for key in keys}
    for key in sorted(own["en"]):
        if key.split(".")[0] in by_type:
            problems.append(
                f'app/locale: text "{key}" is that of a type, expected in app/equipment/{key.split(".")[0]}'
            )
    wanted = [*in_templates(problems), *of_pages(), *in_code()]
    lacking = {}
    for where, key in wanted:
        if key not in of_types | set(own["en"]):
            problems.append(f'{where}: text "{key}" is not in app/locale/en')
            lacking[key] = where
    if "--update" in sys.argv:
        return update(locale, own, lacking)
    print(*problems, sep="\n", end="\n" if problems else "")
    return 1 if problems else 0


def load(files: list[Path], problems: list[str]) -> Texts:
    """The texts of one language; what is not a text is a problem."""
    texts: Texts = {}
    for file in files:
        if not file.is_file():
            problems.append(f"{short(file)} is missing")
            continue
        try:
            table = tomllib.loads(file.read_text("utf-8"))
        except ValueError as error:
            problems.append(f"{short(file)}: {error}")
            continue
        for key, value in flat(table):
            if key in texts:
                problems.append(f'{short(file)}: "{key}" is there twice')
            texts[key] = value if isinstance(value, dict) else str(value)
            for text in value.values() if isinstance(value, dict) else [value]:
                problems += [f'{short(file)}: "{key}" {fault}' for fault in faults(text)]
    return texts


def flat(table: dict[str, object], prefix: str = "") -> Iterator[tuple[str, object]]:
    for key, value in table.items():
        if isinstance(value, dict) and not ("other" in value and set(value) <= PLURAL):
            yield from flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def faults(text: object) -> Iterator[str]:
    if not isinstance(text, str):
        yield f"is not a text: {text!r}"
        return
    if not text.strip():
        yield "is empty"
    if not unicodedata.is_normalized("NFC", text):
        yield "is not in Unicode form NFC"
    if re.search(r"</?[A-Za-z][^>]*>", text):
        yield "has an HTML tag in it"
    try:
        placeholders(text)
    except ValueError as error:
        yield f"has a broken placeholder: {error}"


def placeholders(text: str) -> set[str]:
    return {name for _, name, _, _ in string.Formatter().parse(text) if name is not None}


def compare(where: str, texts: dict[str, Texts]) -> Iterator[str]:
    """What the languages do not have in common, compared with English."""
    for lang, own in texts.items():
        for key in sorted(set(texts["en"]) - set(own)):
            yield f'{where}: {lang} lacks "{key}"'
        for key in sorted(set(own) - set(texts["en"])):
            yield f'{where}: {lang} has "{key}", which en has not'
        forms = set(Locale.parse(lang).plural_form.tags) | {"other"}
        for key, value in own.items():
            if isinstance(value, dict) and set(value) != forms:
                yield f'{where}: {lang} "{key}" has the forms {sorted(value)}, the language needs {sorted(forms)}'
            if (english := texts["en"].get(key)) is not None and names(value) != names(english):
                yield f'{where}: {lang} "{key}" has {sorted(names(value))}, en has {sorted(names(english))}'


def names(value: str | dict[str, str]) -> set[str]:
    try:
        return placeholders(value if isinstance(value, str) else value["other"])
    except (ValueError, AttributeError):
        return set()  # told already, as a fault of the text


def in_templates(problems: list[str]) -> Iterator[tuple[str, str]]:
    environment = jinja2.Environment(extensions=["jinja2.ext.do"], autoescape=True)
    for file in sorted((ROOT / "templates").rglob("*")):
        if not file.is_file() or file.suffix not in (".html", ".svg", ".txt", ".jinja"):
            continue
        try:
            tree = environment.parse(file.read_text("utf-8"))
        except jinja2.TemplateSyntaxError as error:
            problems.append(f"{short(file)}:{error.lineno}: {error.message}")
            continue
        for call in tree.find_all(nodes.Call):
            if isinstance(call.node, nodes.Name) and call.node.name in CALLS and call.args:
                key = call.args[0]
                if isinstance(key, nodes.Const) and isinstance(key.value, str):
                    yield f"{short(file)}:{call.lineno}", key.value


def of_pages() -> Iterator[tuple[str, str]]:
    """A page that a type has by name stands under that name on its tab."""
    for file in sorted((ROOT / "templates" / "screens").glob("*/page_*.html")):
        yield short(file), f"{file.parent.name}.page.{file.stem.removeprefix('page_')}"


def in_code() -> Iterator[tuple[str, str]]:
    for file in sorted((ROOT / "app").rglob("*.py")):
        source = file.read_text("utf-8")
        if re.search(r"from sqlalchemy[.\w]* import .*\btext\b", source):
            continue  # its text() is SQL
        for call in ast.walk(ast.parse(source)):
            if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id in CALLS and call.args:
                key = call.args[0]
                if isinstance(key, ast.Constant) and isinstance(key.value, str):
                    yield f"{short(file)}:{call.lineno}", key.value


def update(locale: Path, own: dict[str, Texts], lacking: dict[str, str]) -> int:
    """Append what each language lacks to its new.toml, empty, so that the check goes on asking for it."""
    wanted = {**{key: where for key, where in lacking.items()}, **{key: str(own["en"][key]) for key in own["en"]}}
    for lang, texts in own.items():
        lines = [f'# {hint}\n"{quoted(key)}" = ""\n' for key, hint in sorted(wanted.items()) if key not in texts]
        if lines:
            file = locale / lang / "new.toml"
            file.parent.mkdir(parents=True, exist_ok=True)
            with file.open("a", encoding="utf-8") as out:
                out.writelines(lines)
            print(f"{short(file)}: {len(lines)} texts to translate")
    return 0


def quoted(key: str) -> str:
    return key.replace("\\", "\\\\").replace('"', '\\"')


def short(path: Path) -> str:
    return str(path.relative_to(ROOT))


if __name__ == "__main__":
    sys.exit(main())
