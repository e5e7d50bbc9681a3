"""Corners and colours come from tokens.css alone: a sheet that says its own is another house."""

import re

from tests.conftest import ROOT

OWN = re.compile(r"border-radius:[^;}]*?\d(?:px|rem)|:[^;{}]*#[0-9a-fA-F]{3,8}\b")
ALLOWED = {
    "overlays.css": 1,  # paper is white whatever the theme
    "access.css": 2,  # a code for a camera is dark on white, or it is not read
    "alarms.css": 1,  # the count of a first-out is a pill, as round as it is high
}
"""Sheet → places that say their own, with the reason."""


def test_corners_and_colours_come_from_tokens() -> None:
    found: dict[str, int] = {}
    for sheet in sorted([*(ROOT / "static" / "css").rglob("*.css"), *(ROOT / "static" / "screens").glob("*.css")]):
        text = re.sub(r"/\*.*?\*/", "", sheet.read_text("utf-8"), flags=re.DOTALL)
        if sheet.name != "tokens.css" and (own := OWN.findall(text)):
            found[sheet.name] = len(own)
    assert found == ALLOWED
