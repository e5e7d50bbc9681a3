"""`make fuzz`: hostile values into everything that the web house takes, at every plant; what fails is told by few requests.

python -m tools.fuzz [--seeds N] [--seed S] [--first F] [--requests N] [--plant demo,own] [--about alarms,trends] [--jobs N]
"""

import argparse
import os
import sys
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack
from multiprocessing import get_context

from tests.fuzz.house import PLANTS
from tests.fuzz.trial import Verdict, explore, told
from tests.light import light

LONG = 0.05
"""Of one turn of the loop [s of a processor]: what takes more keeps others waiting."""
MOST_TOLD = 12

_house = ExitStack()


def _begin() -> None:
    """A process that plays is light until it ends."""
    _house.enter_context(light())


def _number(text: str) -> int | None:
    """What make hands over: a number, or nothing."""
    return int(text) if text else None


def _play(given: tuple[int, str, int, tuple[str, ...]]) -> tuple[Verdict, list[str]]:
    """One seed at one plant, and its faults with the requests that show them."""
    verdict = explore(*given)
    return verdict, [told(verdict, name) for name in list(verdict.faults)[:3]]


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=5, help="how many for each plant, from --first on")
    parser.add_argument("--seed", type=_number, help="this one alone")
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--requests", type=int, default=500, help="of each seed at each plant")
    parser.add_argument("--plant", default="", help=f"of {', '.join(PLANTS)}; else all")
    parser.add_argument("--jobs", type=_number, help="processes; as many as cores")
    parser.add_argument("--about", default="", help="only forms that lead to addresses with one of these in them")
    options = parser.parse_args(arguments)
    plants = options.plant.split(",") if options.plant else PLANTS
    if unknown := set(plants) - set(PLANTS):
        parser.error(f"no plant {', '.join(sorted(unknown))}: expected some of {', '.join(PLANTS)}")
    seeds = [options.seed] if options.seed is not None else range(options.first, options.first + options.seeds)
    about = tuple(filter(None, options.about.split(",")))
    work = [(seed, plant, options.requests, about) for plant in plants for seed in seeds]
    began, fell, spent, asked, statuses = time.monotonic(), Counter[str](), 0.0, 0, Counter[int]()
    longest: dict[str, tuple[float, str]] = {}
    with get_context("spawn").Pool(options.jobs or len(os.sched_getaffinity(0)), _begin, maxtasksperchild=20) as pool:
        for number, (verdict, faults) in enumerate(pool.imap(_play, work), 1):
            fell.update(verdict.faults.keys())
            spent, asked = spent + verdict.seconds, asked + verdict.statuses.total()
            for (_, status), count in verdict.statuses.items():
                statuses[status] += count
            for route, one in verdict.longest.items():
                longest[route] = max(longest.get(route, one), one)
            print(*faults, sep="\n\n", end="\n\n" if faults else "", flush=True)
            print(
                f"{number} of {len(work)}: seed {verdict.seed} at {verdict.plant}, {len(verdict.faults)} faults, "
                f"{verdict.seconds:.0f} s of processor, {time.monotonic() - began:.0f} s",
                flush=True,
            )
    slow = sorted(((one, route) for route, one in longest.items() if one[0] > LONG), reverse=True)
    print(
        f"\nTurns of more than {LONG * 1000:g} ms of a processor, on this machine and beside what else it does: {len(slow)}"
    )
    for (seconds, request), route in slow[:MOST_TOLD]:
        print(f"{seconds * 1000:6.0f} ms  {route}  ({request[:160]})")
    for name, count in fell.most_common():
        print(f"{count:5} {name}")
    told_statuses = ", ".join(f"{count} x {status}" for status, count in sorted(statuses.items()))
    print(
        f"{len(work)} seeds, {asked} requests, {spent:.0f} s of processor, {len(fell)} faults; answers: {told_statuses}"
    )
    return 1 if fell else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
