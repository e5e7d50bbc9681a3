"""`make storm`: play many scripts on all cores; the first that fails is made as short as it can be.

python -m tools.storm [--seeds N] [--seed S] [--minutes M] [--jobs N] [--plant m1,c1]
"""

import argparse
import os
import sys
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack
from multiprocessing import get_context

from tests.light import light
from tests.storm.script import draw
from tests.storm.trial import run, shortened

_house = ExitStack()


def _begin() -> None:
    """A process that plays is light until it ends."""
    _house.enter_context(light())


def _number(text: str) -> int | None:
    """What make hands over: a number, or nothing."""
    return int(text) if text else None


def main(arguments: Sequence[str]) -> int:
    with light():
        return _play(arguments)


def _play(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=20, help="how many, from 1 on")
    parser.add_argument("--seed", type=_number, help="this one alone")
    parser.add_argument("--minutes", type=float, default=1.0, help="of the plant, each")
    parser.add_argument("--jobs", type=_number, help="processes; as many as cores")
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--plant", default="", help="machines, such as m1,c1; else the seed chooses")
    parser.add_argument("--quick", action="store_true", help="do not shorten")
    options = parser.parse_args(arguments)
    machines = tuple(options.plant.split(",")) if options.plant else ()
    seeds = [options.seed] if options.seed is not None else range(options.first, options.first + options.seeds)
    scripts = {seed: draw(seed, options.minutes, machines) for seed in seeds}
    began, failed, spent, ends = time.monotonic(), [], 0.0, Counter[str]()
    jobs = options.jobs or len(os.sched_getaffinity(0))
    # not concurrent.futures: in Python 3.11 its pool stands still when workers are replaced (cpython issue 115634)
    with get_context("spawn").Pool(jobs, _begin, maxtasksperchild=50) as pool:
        for number, verdict in enumerate(pool.imap_unordered(run, scripts.values()), 1):
            spent += verdict.seconds
            ends.update(dict(verdict.counts))
            if verdict.name:
                failed.append(verdict)
                print(f"\nseed {verdict.seed} fell: {verdict.what}", flush=True)
            if number % 10 == 0 or number == len(scripts):
                print(
                    f"{number} of {len(scripts)} seeds, {len(failed)} fell, {time.monotonic() - began:.0f} s",
                    flush=True,
                )
            elif len(scripts) == 1:
                print(f"trace {verdict.digest}", flush=True)
    if failed and not options.quick:
        first = min(failed, key=lambda verdict: len(scripts[verdict.seed].actions))
        short = shortened(scripts[first.seed], first.name)
        print(f"\nThe shortest script that fails so:\n{short}\n{run(short).what}")
    for name, count in Counter(verdict.name for verdict in failed).most_common():
        print(f"{count:5} {name}: seeds {' '.join(str(v.seed) for v in failed if v.name == name)[:200]}")
    for verdict in failed[:3]:
        print(f"To replay: make storm SEED={verdict.seed} MINUTES={options.minutes:g}")
    told = ", ".join(f"{count} {state}" for state, count in ends.most_common())
    print(
        f"{len(scripts)} seeds of {options.minutes:g} min: {len(failed)} fell; {spent:.0f} s of processor; commands: {told}"
    )
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
