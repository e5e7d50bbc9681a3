"""Tests that a plant folder holds for machines of a type: `sim/<type>/tests.py` runs them, for types that have such."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec

from app.plant.definitions import Equipment, Plant


@dataclass(frozen=True, slots=True)
class TestResult:
    """What came of one test."""

    __test__ = False  # not one of pytest's

    name: str
    ok: bool
    happened: str
    """What was expected and what happened instead; of a test that passed: how it ended."""
    simulated: float
    """[s]"""
    took: float
    """Computing time [s]; the only part that differs from run to run."""


RunTests = Callable[[Plant, Equipment], Sequence[TestResult]]


def tests_of(kind: str) -> RunTests | None:
    """What runs the tests of machines of the type `kind`; None when it has none."""
    name = f"{__package__}.{kind}"
    found = find_spec(name)
    # a type that a plant brings may be called as a module here is
    if found is None or not found.submodule_search_locations or find_spec(f"{name}.tests") is None:
        return None
    run: RunTests = import_module(f"{name}.tests").run_tests
    return run


def begun(machine: object, given: Mapping[str, float]) -> Mapping[str, float]:
    """The presets with which a test begins: as it says; a machine with a signal `mode` is in automatic unless it says otherwise."""
    return {"mode": 1.0, **given} if "mode" in getattr(machine, "signals", ()) else given
