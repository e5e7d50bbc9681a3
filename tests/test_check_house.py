"""The checks of the house's shape find what they are for."""

from pathlib import Path

import pytest

from tools.check_house import import_circles


def house(root: Path, **modules: str) -> Path:
    """A house of `folder__module` = its source."""
    for name, source in modules.items():
        path = root / "app" / f"{name.replace('__', '/')}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(source)
    return root


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("from app.a.two import x", "from app.a.one import y"),
        ("from app.a import two", "import app.a.one"),
        ("def late():\n    from app.a.two import x", "from app.a import one"),
        ("if TYPE_CHECKING:\n    from app.a.two import X", "from app.a.one import (\n    Y,\n)"),
    ],
)
def test_a_circle_is_named_however_it_is_closed(tmp_path: Path, one: str, other: str) -> None:
    found = list(import_circles(house(tmp_path, a__one=one, a__two=other)))
    assert len(found) == 1
    assert {"app.a.one", "app.a.two"} == set(found[0].removeprefix("imports go round: ").split(" → "))


def test_a_longer_circle_is_found_and_a_straight_road_is_not_one(tmp_path: Path) -> None:
    straight = house(tmp_path, a__one="from app.b import two", b__two="import app.c", c="import asyncio")
    assert not list(import_circles(straight))
    assert list(import_circles(house(tmp_path, c="from app.a.one import x")))


def test_the_house_has_none() -> None:
    assert not list(import_circles(Path(__file__).resolve().parent.parent))
