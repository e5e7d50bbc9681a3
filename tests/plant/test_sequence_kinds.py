"""A value of another kind in a definition is told, wherever it stands: in the draft, between two versions, in a form."""

import tomllib
from collections.abc import Iterator
from copy import deepcopy
from typing import Any

import pytest

from app import bundled
from app.errors import ConfigurationError
from app.plant.loader import read_plant
from app.plant.sequence_differences import differences
from app.plant.sequence_text import above, changes, free_bit, mask, table_of, unnamed
from app.plant.toml_text import literal

FEED = tomllib.loads((bundled("plants/feeding") / "sequences" / "feed.toml").read_text("utf-8"))
FULL: dict[str, Any] = {
    **FEED,
    "tests": [{"name": "runs", "when": [{"at": 0, "command": "start"}], "then": [{"state": "done", "within": 60}]}],
}
OTHERS = ("5", "true", '"²"', '[["x"]]', "2026-01-02", "[2026-01-02, 10:00:00]", "9" * 400)
PATHS = [
    *("sequence", "abort", "steps", "tests", "branches", "loops"),
    *(
        "sequence.label",
        "sequence.stall_after",
        "sequence.keep_forces",
        "sequence.longest_force",
        "sequence.start_when",
    ),
    *("sequence.label.hr", "sequence.abort_to", "sequence.output_while_suspended"),
    *("abort.0", "abort.²", "abort.0.key", "abort.0.label", "abort.0.when", "abort.0.value", "abort.0.forceable"),
    *("steps.0", "steps.0.key", "steps.0.label", "steps.0.minimum", "steps.0.maximum", "steps.0.loss_aborts"),
    *("steps.0.actions", "steps.0.orders", "steps.0.permissives", "steps.0.permissives.0", "steps.0.permissives.²"),
    *("steps.0.permissives.0.key", "steps.0.permissives.0.label", "steps.0.permissives.0.when"),
    *("steps.0.orders.0", "steps.0.orders.0.machine", "steps.0.orders.0.action", "steps.0.orders.0.values"),
    *("steps.0.orders.0.values.frequency", "steps.0.permissives.0.value", "steps.0.permissives.0.forceable"),
    *("tests.0", "tests.0.name", "tests.0.given", "tests.0.when", "tests.0.then", "tests.0.when.0", "tests.0.then.0"),
    *("tests.0.when.0.at", "tests.0.when.0.command", "tests.0.then.0.state", "tests.0.then.0.within"),
]


def with_other(path: str, value: object) -> dict[str, Any] | None:
    data = deepcopy(FULL)
    *way, last = path.split(".")
    at: Any = data
    for key in way:
        at = at[int(key)] if isinstance(at, list) else at.setdefault(key, {})
        if not isinstance(at, dict | list):
            return None
    if isinstance(at, list):
        at[int(last)] = value
    else:
        at[last] = value
    return data


def fields(path: str) -> Iterator[tuple[str, dict[str, str]]]:
    """A form over the section in which `path` stands."""
    common = {"label.hr": "Korak", "minimum": "2"}
    yield (
        "1",
        {
            **common,
            "actions.x": "1",
            "permissives.0.when": "1 == 1",
            "permissives.0.bit": "3",
            "orders.0.machine": "m1",
        },
    )
    yield "0", {"sequence.label.hr": "Niz", "sequence.stall_after": "3", "abort.0.when": "1 == 1", "abort.0.bit": "²"}


@pytest.mark.sweep(8)
@pytest.mark.parametrize("path", PATHS)
def test_a_value_of_another_kind_is_told_and_nothing_falls_over_it(path: str) -> None:
    for other in OTHERS:
        value = tomllib.loads(f"x = {other}")["x"]
        data = with_other(path, value)
        if data is None:
            continue
        text = "".join(f"{key} = {literal(one)}\n" for key, one in data.items())
        assert tomllib.loads(text) == data
        plant, problems = read_plant(bundled("plants/feeding"), drafts={"feed": text})
        assert plant is not None or problems
        for problem in problems:
            assert problem.key and problem.expected, (path, other, problem)
        list(differences(FULL, data))
        list(differences(data, FULL))
        for section, given in fields(path):
            try:
                table = table_of(data, section)
                above(section), free_bit(table, section), unnamed(table, section)
                mask(table.get("permissives")), mask(table.get("abort"))
                changes(data, section, given, ("loss_aborts",), ("hr", "en"))
            except (LookupError, ConfigurationError):
                continue  # there is no such section, or field
