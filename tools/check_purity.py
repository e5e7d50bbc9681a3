"""The thinking is pure: blocks, codecs, physics, alarm states and interlocks import no web, SQL, socket or task library.

Follows imports inside `app`, so a pure module cannot borrow one through a neighbour either.

Time belongs to the house: the machine's clock is read in `app/clock.py`, its chance in `app/chance.py`, and nowhere else; in tests only
where a socket, a terminal, a process or a browser is the subject (marked `real_time`, `soak` or `browser`).
"""

import ast
import sys
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FORBIDDEN = {"fastapi", "starlette", "sqlalchemy", "pymodbus", "asyncio", "jinja2", "sqlite3", "socket", "threading"}
PURE = (
    "app/blocks/**/*.py",
    "app/profidrive/**/*.py",
    "app/equipment/**/*.py",
    "app/records/**/*.py",
    "app/registers/**/*.py",
    "app/sim/**/*.py",
    "app/alarms/conditions.py",
    "app/alarms/lifecycle.py",
    "app/commands/interlocks.py",
)
DOING = ("app/sim/plant.py", "app/sim/sequence/tests.py", "app/sim/server.py")
"""The few files of `sim` that run the virtual devices and open the port; everything else there is physics and programs."""
SOURCES = ("app/clock.py", "app/chance.py")
"""Who asks the machine for time and chance."""
REAL = ("tests/conftest.py", "tests/browser/**/*.py", "tests/soak/**/*.py", "tests/test_virtual.py")
"""Tests and their helpers whose subject is real."""
REAL_MARKS = {"real_time", "soak", "browser"}
TIMES = {"monotonic", "monotonic_ns", "sleep", "time", "time_ns", "perf_counter", "perf_counter_ns"}
OF_THE_MACHINE = {f"time.{name}" for name in TIMES} | {
    "datetime.now", "datetime.utcnow", "datetime.today", "date.today", "os.urandom", "random.SystemRandom",
}  # fmt: skip
HARMLESS = {"random.Random", "secrets.compare_digest"}


def main() -> int:
    problems = [*impure_times("app", SOURCES), *impure_times("tests", REAL)]
    for path in sorted({path for pattern in PURE for path in ROOT.glob(pattern)}):
        if str(path.relative_to(ROOT)) not in DOING:
            problems += [
                f"{path.relative_to(ROOT)} imports {' → '.join(road)}" for road in forbidden_roads(path, set())
            ]
    print(*problems, sep="\n", end="\n" if problems else "")
    return 1 if problems else 0


def impure_times(folder: str, allowed: Sequence[str]) -> Iterator[str]:
    """Every place below `folder` that takes time or chance from the machine."""
    real = {path for pattern in allowed for path in ROOT.glob(pattern)}
    for path in sorted(set(ROOT.glob(f"{folder}/**/*.py")) - real):
        tree = ast.parse(path.read_bytes(), str(path))
        nodes = [*ast.walk(tree)]
        known = names_of(nodes)
        excused = {id(inner) for node in real_parts(tree) for inner in ast.walk(node)} if folder == "tests" else set()
        for node in nodes:
            if not isinstance(node, ast.Attribute | ast.Name | ast.Call) or id(node) in excused:
                continue
            name = full_name(node.func if isinstance(node, ast.Call) else node, known)
            seedless = isinstance(node, ast.Call) and name == "random.Random" and not node.args
            chance = name.startswith(("random.", "secrets.", "uuid.")) and name not in HARMLESS
            if seedless or (not isinstance(node, ast.Call) and (chance or name in OF_THE_MACHINE)):
                yield f"{path.relative_to(ROOT)}:{node.lineno}: {name}, expected the injected clock, the loop or app.chance"


def names_of(nodes: Sequence[ast.AST]) -> dict[str, str]:
    """What imported names stand for: `now` → `time.time` after `from time import time as now`."""
    known = dict[str, str]()
    for node in nodes:
        if isinstance(node, ast.Import):
            known |= {alias.asname or alias.name: alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            known |= {alias.asname or alias.name: f"{node.module}.{alias.name}" for alias in node.names}
    return known


def full_name(node: ast.expr, known: dict[str, str]) -> str:
    """`time.monotonic` for whatever it is called here; the class `datetime` without its module."""
    if isinstance(node, ast.Name):
        return known.get(node.id, "").removeprefix("datetime.")
    if isinstance(node, ast.Attribute):
        name = f"{full_name(node.value, known)}.{node.attr}"
        return name.removeprefix("datetime.") if name.startswith(("datetime.datetime.", "datetime.date.")) else name
    return ""


def real_parts(tree: ast.Module) -> list[ast.stmt]:
    """Tests, or the whole module, that say that their subject is real; the helpers of such a module with them."""
    functions = [one for one in tree.body if isinstance(one, ast.FunctionDef | ast.AsyncFunctionDef)]
    marked = {id(one) for one in functions if any(_marks(mark) for mark in one.decorator_list)}
    if any(isinstance(one, ast.Assign) and _marks(one.value) for one in tree.body):
        return tree.body
    plain = {id(one) for one in functions if one.name.startswith("test_")} - marked
    return [one for one in tree.body if id(one) not in plain] if marked else []


def _marks(node: ast.expr) -> bool:
    return any(isinstance(one, ast.Attribute) and one.attr in REAL_MARKS for one in ast.walk(node))


def forbidden_roads(path: Path, seen: set[Path]) -> Iterator[list[str]]:
    """Every chain of imports from `path` that ends in a forbidden package."""
    seen.add(path)
    for name in imported(path):
        if name.split(".")[0] in FORBIDDEN:
            yield [name]
        elif (inner := source_of(name)) and inner not in seen:
            for road in forbidden_roads(inner, seen):
                yield [name, *road]


def imported(path: Path) -> tuple[str, ...]:
    """What a file names in its imports."""
    return _imported(path.relative_to(ROOT), path.read_bytes())


@cache
def _imported(path: Path, text: bytes) -> tuple[str, ...]:
    """Of each file once: hundreds of roads lead through some."""
    found: list[str] = []
    for node in ast.walk(ast.parse(text, str(path))):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            package = path.with_suffix("").parts[: -node.level] if node.level else ()
            base = ".".join((*package, *([node.module] if node.module else [])))
            found += [base, *(f"{base}.{alias.name}" for alias in node.names if base.startswith("app"))]
    return tuple(found)


def source_of(name: str) -> Path | None:
    if name.split(".")[0] != "app":
        return None
    path = ROOT.joinpath(*name.split("."))
    return next((file for file in (path.with_suffix(".py"), path / "__init__.py") if file.is_file()), None)


if __name__ == "__main__":
    sys.exit(main())
