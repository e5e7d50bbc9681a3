"""The thinking is pure: blocks, codecs, physics, alarm states and interlocks import no web, SQL, socket or task library.

Follows imports inside `app`, so a pure module cannot borrow one through a neighbour either.
"""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FORBIDDEN = {"fastapi", "starlette", "sqlalchemy", "pymodbus", "asyncio", "jinja2", "sqlite3", "socket", "threading"}
PURE = (
    "app/blocks/**/*.py",
    "app/profidrive/**/*.py",
    "app/registers/**/*.py",
    "app/sim/**/*.py",
    "app/alarms/conditions.py",
    "app/alarms/lifecycle.py",
    "app/commands/interlocks.py",
)
DOING = ("app/sim/plant.py", "app/sim/sequence_tests.py", "app/sim/server.py")
"""The few files of `sim` that run the virtual devices and open the port; everything else there is physics and programs."""


def main() -> int:
    problems = []
    for path in sorted({path for pattern in PURE for path in ROOT.glob(pattern)}):
        if str(path.relative_to(ROOT)) not in DOING:
            problems += [
                f"{path.relative_to(ROOT)} imports {' → '.join(road)}" for road in forbidden_roads(path, set())
            ]
    print(*problems, sep="\n", end="\n" if problems else "")
    return 1 if problems else 0


def forbidden_roads(path: Path, seen: set[Path]) -> Iterator[list[str]]:
    """Every chain of imports from `path` that ends in a forbidden package."""
    seen.add(path)
    for name in imported(path):
        if name.split(".")[0] in FORBIDDEN:
            yield [name]
        elif (inner := source_of(name)) and inner not in seen:
            for road in forbidden_roads(inner, seen):
                yield [name, *road]


def imported(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_bytes(), str(path))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            package = path.relative_to(ROOT).with_suffix("").parts[: -node.level] if node.level else ()
            base = ".".join((*package, *([node.module] if node.module else [])))
            yield base
            yield from (f"{base}.{alias.name}" for alias in node.names if base.startswith("app"))


def source_of(name: str) -> Path | None:
    if name.split(".")[0] != "app":
        return None
    path = ROOT.joinpath(*name.split("."))
    return next((file for file in (path.with_suffix(".py"), path / "__init__.py") if file.is_file()), None)


if __name__ == "__main__":
    sys.exit(main())
