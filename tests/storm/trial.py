"""One script played in a folder of its own, what became of it, and the shortest that ends the same way."""

import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from tests.shortest import shortest
from tests.storm.invariants import Checker
from tests.storm.script import Action, Script
from tests.storm.web import WebWorld
from tests.storm.world import Fell, World, play

TRIES = 120
"""Scripts that are tried to shorten one."""


@dataclass(frozen=True)
class Verdict:
    """What became of a script."""

    seed: int
    name: str = ""
    """Of the invariant that does not hold, or of the error; nothing: all is well."""
    what: str = ""
    digest: str = ""
    seconds: float = 0.0
    """Of a processor [s]."""
    counts: tuple[tuple[str, int], ...] = ()


def run(script: Script) -> Verdict:
    """Play `script` in a folder of its own."""
    began, name, what, digest, counts = time.process_time(), "", "", "", Counter[str]()
    with tempfile.TemporaryDirectory(prefix="storm-") as folder:
        checkers: list[Checker] = []

        async def check(world: World, last: bool) -> None:
            if not checkers:
                checkers.append(Checker(world))
            await checkers[0](world, last)

        try:
            world = play(script, Path(folder), check, WebWorld if script.web else World)
            digest = world.digest
            counts.update(str(progress.state) for _, progress in world.ended)
        except Fell as fell:
            name, what = fell.name, str(fell)
        except Exception as error:
            place = traceback.extract_tb(error.__traceback__)[-1]
            name = f"{type(error).__name__} {Path(place.filename).name}:{place.lineno}"
            what = traceback.format_exc()
    return Verdict(script.seed, name, what, digest, time.process_time() - began, tuple(counts.items()))


def shortened(script: Script, name: str, tries: int = TRIES) -> Script:
    """The shortest script found that fails as `script` does: delta debugging over its actions."""

    def fails(actions: Sequence[Action]) -> bool:
        return run(replace(script, actions=tuple(actions))).name == name

    return replace(script, actions=tuple(shortest(script.actions, fails, tries)))
