"""The shape of the house: no module of `app` imports itself over others, inside a folder neither."""

import ast
import sys
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def main() -> int:
    problems = [*import_circles(ROOT)]
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


def _module(path: Path) -> str:
    parts = path.with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


if __name__ == "__main__":
    sys.exit(main())
