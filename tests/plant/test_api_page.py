"""docs/api.md, what others program by, against the types."""

import re
from pathlib import Path

from app.plant import types
from app.plant.plant_files.languages import LANGUAGES

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "api.md").read_text("utf-8")


def test_it_lists_the_commands_that_no_token_can_give() -> None:
    section = PAGE[PAGE.index("level C4") : PAGE.index("## The socket")]
    weighty, free = set(), set()
    for name in types.names():
        for key, command in types.read_type(name, LANGUAGES)[0].type.commands.items():
            levels = {command.level, command.level_when[1] if command.level_when else ""}
            (weighty if "C4" in levels else free).add((name, key))
    assert set(re.findall(r"^\| `(\w+)` \| `(\w+)` \|$", section, re.MULTILINE)) == weighty
    assert {("sequence", "release"), ("sequence", "release_all")} <= free
