"""Corners, colours, sizes of type and spaces come from tokens.css alone: a sheet that says its own is another house."""

import re
from collections.abc import Iterator

from tests.conftest import ROOT

OWN = re.compile(r"border-radius:[^;}]*?\d(?:px|rem)|:[^;{}]*#[0-9a-fA-F]{3,8}\b")
ALLOWED = {
    "overlays.css": 1,  # paper is white whatever the theme
    "access.css": 2,  # a code for a camera is dark on white, or it is not read
    "alarms.css": 1,  # the count of a first-out is a pill, as round as it is high
}
"""Sheet → places that say their own, with the reason."""
OWN_TYPE = re.compile(r"(?<![\w-])font(?:-size)?\s*:\s*(?:[^;}]*[\s(,])?[\d.]*\d(?:px|pt|r?em|ch|v[wh]|%)")
DRAWN = {
    "coil_car.css": 2,
    "coil_car.tile.css": 1,
    "conveyor.css": 5,
    "crane.css": 2,
    "crane.tile.css": 1,
    "epos.css": 1,
    "indicators.css": 2,
    "mimic.css": 7,
    "overview.css": 1,
    "plot.css": 2,
}
"""Sheet → sizes of text inside a drawing: their unit is the drawing's, which is scaled to its frame, not the reader's."""

OWN_SPACE = re.compile(
    r"(?<![\w-])(?:(?:scroll-)?(?:padding|margin)(?:-(?:block|inline))?(?:-(?:start|end|left|right|top|bottom))?|(?:row-|column-)?gap)"
    r"\s*:\s*(?:[^;}]*[\s(,])?[-+]?[\d.]*\d(?:px|pt|rem|ch|v[wh]|%)"
)
KEPT = {
    "access.css": 1,  # beside a switch
    "coil_car.css": 1,  # beside the key that makes the picture larger
    "faceplate.css": 2,  # above the bar of commands at the bottom of a phone
    "frame.css": 1,  # the same
    "operation.css": 1,  # above Stop, which a dialog leaves in sight
    "palette.css": 1,  # above the bar
    "sequence.css": 1,  # below the tabs
    "trends.css": 2,  # beside the live switch
}
"""Sheet → room kept for a thing, as large as the thing. Spaces in em grow with the text that they stand in and are no steps."""


def sheets() -> Iterator[tuple[str, str]]:
    """Every sheet but the tokens, without its comments."""
    for sheet in sorted([*(ROOT / "static" / "css").rglob("*.css"), *(ROOT / "static" / "screens").glob("*.css")]):
        if sheet.name != "tokens.css":
            yield sheet.name, re.sub(r"/\*.*?\*/", "", sheet.read_text("utf-8"), flags=re.DOTALL)


def own(pattern: re.Pattern[str]) -> dict[str, int]:
    """Sheet → how often it says something of its own."""
    return {name: len(found) for name, text in sheets() if (found := pattern.findall(text))}


def test_corners_and_colours_come_from_tokens() -> None:
    assert own(OWN) == ALLOWED


def test_sizes_of_type_come_from_tokens() -> None:
    assert own(OWN_TYPE) == DRAWN


def test_spaces_come_from_tokens() -> None:
    assert own(OWN_SPACE) == KEPT


def test_a_size_of_its_own_is_found() -> None:
    for said in (
        "a { font-size: 13px; }",
        "a{font-size:.8rem}",
        "a { font: 600 14px/1.2 var(--font); }",
        "a { font-size: max(var(--t-body), 15px); }",
        "a { font-size: 90%; }",
    ):
        assert OWN_TYPE.search(said), said
    for said in (
        "a { font: var(--w) var(--t-body)/20px var(--font); }",
        "a { font-size: min(var(--t-hero), 18.5cqi); }",
        "a { font-size: 0; }",
        "a { font: inherit; padding: 3px }",
    ):
        assert not OWN_TYPE.search(said), said


def test_a_space_of_its_own_is_found() -> None:
    for said in (
        "a { padding: 3px; }",
        "a { padding: 0 var(--s1) .4rem; }",
        "a{margin-inline-start:-8px}",
        "a { gap: var(--s2) 5px; }",
        "a { row-gap: max(1px, var(--s1)); }",
        "a { margin: calc(2px + var(--s1)); }",
    ):
        assert OWN_SPACE.search(said), said
    for said in (
        "a { padding: 0; }",
        "a { gap: .35em; }",
        "a { margin: 0 auto; width: 3px; }",
        "a { margin: calc(-1 * var(--s1)); }",
    ):
        assert not OWN_SPACE.search(said), said
