"""The shape of the house: no import circles, inside a folder neither; general rooms name no machine; nothing is too long; SQL is Core;
migrations are one row.

A new machine is folders of its own. So no equipment type, none of its tables and no kind of its records is named in the rooms that serve
all of them: in Python as a string or an imported module, in templates, scripts and sheets anywhere.
"""

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ROOMS = (
    *(f"app/{room}/**/*.py" for room in ("web", "historian", "alarms", "commands", "links", "live", "running")),
    *("app/runtime.py", "app/main.py", "app/cli*.py"),
    *(f"templates/{folder}/**/*.html" for folder in ("layouts", "macros", "fragments", "pages")),
    *("static/js/*.js", "static/css/**/*.css"),
)
"""Where no machine is named."""
COMMON = {"fall", "run", "sequence", "step"}
"""Machine words that mean something elsewhere, too: only their keys (`run.state`), folders and modules are names of a machine."""
PACKAGES = ("app.blocks", "app.sim", "app.web.screens")
"""Of which a machine has modules."""
LONGEST_LINE = 160
"""Of a template [characters]."""
LONGEST_MODULE, LONGEST_CLASS = 600, 300
"""Of the house's Python [lines]: what is longer has more than one owner's work in it."""
MOST_SCRIPT, LONGEST_SCRIPT = 3_702, 513
"""Of the house's own scripts [lines], all together and each: htmx and the browser do the rest. Both only ever go down."""

SQL = re.compile(
    r"\s*(PRAGMA \w|BEGIN( IMMEDIATE)?$|VACUUM|SELECT .+|WITH \w+ .*AS|(INSERT|REPLACE)( OR \w+)? INTO |UPDATE( OR \w+)? \w+ SET |"
    r"DELETE FROM |(CREATE|DROP|ALTER) (TABLE|INDEX|VIEW|TRIGGER) )",
    re.S,
)
"""How a statement begins."""
SQLITE = (
    *("app/db.py", "app/historian/dialect.py"),
    *("app/backup/archive.py", "app/backup/making.py", "app/backup/restoring.py"),
    *("app/selftest.py", "app/access/former.py", "app/access/kept.py", "app/access/audit/chain.py"),
)
"""Where SQLite is spoken: its connections, what the history needs of it, copies of its files, whether they are sound and whose they are,
what replaces what people keep, and the lock of the audit's chain. Everywhere else statements are SQLAlchemy Core."""


def main() -> int:
    problems = [
        *import_circles(ROOT),
        *named_machines(ROOT),
        *long_lines(ROOT),
        *large_parts(ROOT),
        *much_script(ROOT),
        *raw_sql(ROOT),
        *forks(ROOT),
    ]
    print(*problems, sep="\n", end="\n" if problems else "")
    return 1 if problems else 0


def import_circles(root: Path) -> Iterator[str]:
    """One circle of imports below `app`, if there is any; one that only types need counts, too."""
    modules = {_module(path.relative_to(root)): path for path in sorted(root.glob("app/**/*.py"))}
    graph = {name: {one for one in imports_of(path, modules) if one != name} for name, path in modules.items()}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        yield f"imports go round: {' → '.join(reversed(error.args[1]))}"


def imports_of(path: Path, modules: dict[str, Path]) -> Iterator[str]:
    """The modules of `app` that `path` names in its imports, wherever they stand."""
    for node in ast.walk(ast.parse(path.read_bytes(), str(path))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in modules)
        elif isinstance(node, ast.ImportFrom):
            if node.level:
                raise SystemExit(f"{path}:{node.lineno}: a relative import, expected the full name")
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                if full in modules or node.module in modules:
                    yield full if full in modules else str(node.module)


def machine_words(root: Path) -> set[str]:
    """The names of equipment types, of their tables and of the kinds of their records."""
    words = set()
    for folder in (path.parent for path in root.glob("app/equipment/*/device.toml")):
        words.add(folder.name)
        for file in ("tables.toml", "records.toml"):
            if (folder / file).is_file():
                words |= set(tomllib.loads((folder / file).read_text("utf-8")))
    return words


def named_machines(root: Path) -> Iterator[str]:
    """Every place of a general room that names a machine."""
    words = machine_words(root)
    of_types = {root / "app" / "web" / "screens" / f"{word}.py" for word in words}
    for path in sorted({path for pattern in ROOMS for path in root.glob(pattern)} - of_types):
        found = in_python(path, words) if path.suffix == ".py" else in_text(path, words)
        name = path.relative_to(root).as_posix()
        yield from (f"{name}:{line}: names the machine word {word!r}" for line, word in found)


def in_python(path: Path, words: set[str]) -> Iterator[tuple[int, str]]:
    """Strings that are such a word, begin with it as a key (`conveyor.state`) or have it as a folder; imports of its modules."""
    tree = ast.parse(path.read_bytes(), str(path))
    said = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}  # docstrings explain
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in said:
            yield from ((node.lineno, word) for word in words if re.search(f"(^|/){word}{_after(word)}", node.value))
        elif isinstance(node, ast.ImportFrom):
            parts = {*(node.module or "").split(".")}
            parts |= {alias.name for alias in node.names if node.module in PACKAGES}
            yield from ((node.lineno, word) for word in words & parts)


def in_text(path: Path, words: set[str]) -> Iterator[tuple[int, str]]:
    """Quoted words, keys and folders in a template, a script or a sheet."""
    text = re.sub(
        r"\{#.*?#\}|/\*.*?\*/", lambda match: "\n" * match[0].count("\n"), path.read_text("utf-8"), flags=re.S
    )
    for number, line in enumerate(text.split("\n"), 1):
        yield from ((number, word) for word in words if re.search(f"[\"'/#-]{word}{_after(word)}", line))


def long_lines(root: Path) -> Iterator[str]:
    """Lines of templates that nobody reads, nor sees in a comparison what changed in them.

    They are broken inside a tag, inside braces, beside a tag that is a block, and at column 0 behind `%}`: a page stays what it was.
    """
    for path in sorted(root.glob("templates/**/*.html")):
        for number, line in enumerate(path.read_text("utf-8").split("\n"), 1):
            if len(line) > LONGEST_LINE:
                name = path.relative_to(root).as_posix()
                yield f"{name}:{number}: {len(line)} characters, expected at most {LONGEST_LINE}"


def large_parts(root: Path) -> Iterator[str]:
    """Modules and classes that nobody can hold in his head."""
    for path in sorted(root.glob("app/**/*.py")):
        name, text = path.relative_to(root).as_posix(), path.read_text("utf-8")
        if (lines := len(text.splitlines())) > LONGEST_MODULE:
            yield f"{name}: {lines} lines, expected at most {LONGEST_MODULE}"
        if lines <= LONGEST_CLASS:
            continue  # nor has it a longer class
        for node in ast.walk(ast.parse(text, str(path))):
            if isinstance(node, ast.ClassDef) and (lines := (node.end_lineno or 0) - node.lineno + 1) > LONGEST_CLASS:
                yield f"{name}:{node.lineno}: class {node.name} has {lines} lines, expected at most {LONGEST_CLASS}"


def much_script(root: Path) -> Iterator[str]:
    """Scripts of the house beyond what they may be: attributes in templates are asked first."""
    scripts = {path: len(path.read_text("utf-8").splitlines()) for path in sorted(root.glob("static/**/*.js"))}
    own = {path: lines for path, lines in scripts.items() if "vendor" not in path.parts}
    for path, lines in own.items():
        if lines > LONGEST_SCRIPT:
            yield f"{path.relative_to(root).as_posix()}: {lines} lines, expected at most {LONGEST_SCRIPT}"
    if (together := sum(own.values())) > MOST_SCRIPT:
        yield f"static: {together} lines of script, expected at most {MOST_SCRIPT}"


def raw_sql(root: Path) -> Iterator[str]:
    """Statements written as text, or for SQLite alone, outside the files that speak it; tables say there how it keeps them."""
    for path in sorted(root.glob("app/**/*.py")):
        name = path.relative_to(root).as_posix()
        if name in SQLITE:
            continue
        tree = ast.parse(path.read_bytes(), str(path))
        said = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and node.attr == "exec_driver_sql":
                yield f"{name}:{node.lineno}: exec_driver_sql, expected a statement of SQLAlchemy Core"
            elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in said:
                if SQL.match(node.value):
                    yield f"{name}:{node.lineno}: {' '.join(node.value.split())[:40]!r}, expected a statement of SQLAlchemy Core"
            elif isinstance(node, ast.Import | ast.ImportFrom) and (module := _of_sqlite(node)):
                yield f"{name}:{node.lineno}: imports {module}, expected it in {SQLITE[0]} or {SQLITE[1]}"


def forks(root: Path) -> Iterator[str]:
    """Migrations that come after the same one, or after none that is there: two people made the next one, and no database can be begun."""
    for folder in sorted(root.glob("migrations/*/versions")):
        row: dict[str, str] = {}
        before: dict[str, str] = {}
        for path in sorted(folder.glob("*.py")):
            said = {
                node.targets[0].id: node.value.value
                for node in ast.parse(path.read_bytes(), str(path)).body
                if isinstance(node, ast.Assign)
                and isinstance(node.targets[0], ast.Name)
                and isinstance(node.value, ast.Constant)
            }
            name, number, last = (
                path.relative_to(root).as_posix(),
                str(said.get("revision")),
                str(said.get("down_revision")),
            )
            if number in row:
                yield f"{name}: revision {number} is also that of {row[number]}"
            elif last in before:
                yield f"{name}: comes after {last}, as {before[last]} does"
            elif last not in ("None", *row):
                yield f"{name}: comes after {last}, which is not there"
            row[number], before[last] = path.name, path.name


def _of_sqlite(node: ast.Import | ast.ImportFrom) -> str:
    names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
    names += [alias.name if isinstance(node, ast.Import) else f"{node.module}.{alias.name}" for alias in node.names]
    return next(
        (one for one in names if one.split(".")[0] == "sqlite3" or one.startswith("sqlalchemy.dialects.sqlite")), ""
    )


def _after(word: str) -> str:
    return "[./][a-z{]" if word in COMMON else "([\"'./]|$)"


def _module(path: Path) -> str:
    parts = path.with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


if __name__ == "__main__":
    sys.exit(main())
