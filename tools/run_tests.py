"""Run every stage of the tests, also after one that failed, and close with one line of counts (`make test`, `make sweep`).

    tools/run_tests.py [--all] [--seed N] [--jobs N] [--browsers N] [--together | --apart] [T ...] [-- arguments for pytest]

Of the tests marked `sweep`, each of which is one of many and dear, a run without `--all` draws some by its seed, so that
it takes minutes; whoever names files, folders or tests gets all of theirs.
What lives in real time waits a lot: where nothing else runs it has more processes than there are cores, and behind
it, with less right to the processor, runs what lives in virtual time and does not mind. Browsers compute: they run
beside the others where there are several cores, after them where there are fewer. On a machine with something else
to do one stage is after the other. A stage that ran nothing, or did not come to its end, counts as one failure.
Nothing is tried twice.
What ran is kept in build/tests, as JUnit XML and, side by side, as it was told.
"""

import argparse
import os
import random
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from itertools import chain
from pathlib import Path
from typing import IO
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parent.parent
LIMIT = 3600.0
"""A stage has ended by then, or it is ended [s]."""
BEHIND = 10
"""How nice the lane behind is: in front the processor is there when something happens, and beside busy neighbours both get on."""
SPIN = """import time
began, used = time.monotonic(), time.process_time()
while time.monotonic() < began + 0.5:
    pass
print((time.process_time() - used) / (time.monotonic() - began))"""
"""Says how much of a core who wants all of it gets."""
ROOM = 0.85
"""So much of every core is free where nothing else runs."""
PATIENCE = 1500
"""A test that steps back for others has ended by then, or it hangs [s]."""
FAILED, INTERRUPTED, NOTHING = 1, 2, 5
"""What pytest ends with when tests failed, when it stopped before its end, and when no test was chosen."""


@dataclass(frozen=True)
class Stage:
    """One run of pytest over the tests with these marks."""

    name: str
    marks: str
    options: tuple[str, ...] = ()
    folder: str = "tests"
    """Its tests are below this one."""
    says: str = ""
    """Its tests are in files with this text."""
    needs: tuple[str, ...] = ()
    """What has to succeed before it."""
    nice: int = 0
    """How far it steps back for others, 0 to 19."""


@dataclass
class Result:
    """What became of a stage."""

    stage: str
    passed: int = 0
    failed: int = 0
    skipped: int = 0
    complaints: list[str] = field(default_factory=list)
    """The tests that failed, and what else went wrong."""

    @property
    def counts(self) -> tuple[int, int, int]:
        return self.passed, self.failed, self.skipped

    def went_wrong(self, why: str) -> None:
        """The stage itself failed, whatever became of its tests."""
        self.failed += 1
        self.complaints.append(why)


def stages(jobs: int, browsers: int, waiting: int) -> list[list[Stage]]:
    """What a run consists of: the lane in front and the one behind, each one stage after the other.

    `jobs` processes compute, `waiting` ones live in real time, `browsers` have a browser each.
    """
    make = os.environ.get("MAKE", "make")
    front = [
        Stage(
            "real time",
            "not soak and not browser and real_time",
            ("-n", str(waiting), "--dist", "worksteal"),
            says="mark.real_time",
        ),
        Stage(
            "browser",
            "not soak and browser",
            ("-n", str(browsers), "--dist", "loadfile", "--no-loadscope-reorder", "--randomly-dont-reorganize"),
            "tests/browser",
            needs=(make, "-s", ".browser"),
        ),
    ]
    behind = Stage(
        "in process",
        "not soak and not browser and not real_time",
        ("-n", str(jobs), "--dist", "worksteal"),
        nice=BEHIND,
    )
    return [front, [behind]]


def main(arguments: Sequence[str]) -> int:
    options = _options(arguments)
    seed = options.seed if options.seed is not None else random.SystemRandom().getrandbits(32)
    again = f"make {'sweep' if options.all else 'test'} SEED={seed}"
    print(f"The order of the tests: {again}", flush=True)
    began, extra = time.monotonic(), [f"--randomly-seed={seed}", f"--hypothesis-seed={seed}", *options.pytest]
    absent = [text for text in options.tests if not (ROOT / text.split("::")[0]).exists()]
    part = bool(options.tests) or any(text.startswith(("-k", "-m")) for text in options.pytest)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if not part and not options.all:
        extra.append(f"--draw={seed}")
    room = not absent and not part and has_room(cores)
    together = room and cores >= SEVERAL if options.together is None else options.together
    jobs, waiting, browsers = widths(cores, room or together, options.jobs, options.browsers)
    lanes: list[list[Callable[..., Result]]] = [
        [
            partial(run, stage, chosen, extra, part)
            for stage in lane
            if (chosen := within(stage, options.tests or ["tests"]))
        ]
        for lane in (stages(jobs, browsers, waiting) if not absent else ())
    ]
    apart = not together and (not room or options.together is False or cores < 2)
    results = [*chain(*map(side_by_side, phases(lanes, together, apart)))]
    if absent:
        results[0].went_wrong(f"there is no {' '.join(absent)}")
    if not any(any(result.counts) for result in results):
        results[0].went_wrong(f"no test matches {' '.join([*options.tests, *options.pytest])}")
    print(f"\nall: done in {time.monotonic() - began:.0f} s")
    print(*report(results, again), sep="\n", flush=True)
    return 1 if any(result.failed for result in results) else 0


def phases(
    lanes: Sequence[Sequence[Callable[..., Result]]], together: bool, apart: bool
) -> list[list[list[Callable[..., Result]]]]:
    """What runs side by side, one such group after the other: the check, the lane in front and the one behind."""
    filled = [[*lane] for lane in lanes if lane]
    if len(filled) < 2 or apart:
        return [[[_check, *chain(*filled)]]]
    front, behind = filled
    return [[[_check], front, behind]] if together else [[[_check], behind, front[:1]], [front[1:]]]


WAITING = 3
"""Tests in real time for each core that nobody else wants: all of them together compute for half a minute, and wait for ten."""
MOST_WAITING = 8
"""But no more than this, as they are a hundred, and each process has to read them all."""
SEVERAL = 4
"""Cores that browsers beside something else need: on two they wait for what computes, and all takes as long."""


def widths(cores: int, room: bool, jobs: int | None, browsers: int | None) -> tuple[int, int, int]:
    """How many processes compute, live in real time and have a browser, if nothing else is asked for: more where there is room."""
    return (
        jobs or cores,
        jobs or (min(WAITING * cores, max(MOST_WAITING, cores)) if room else cores),
        browsers or cores + room,
    )


def has_room(cores: int) -> bool:
    """Whether nothing else runs on the cores: who wants all of every core gets it."""
    spins = [subprocess.Popen([sys.executable, "-c", SPIN], stdout=subprocess.PIPE, text=True) for _ in range(cores)]
    return min(float(spin.communicate()[0]) for spin in spins) > ROOM


def side_by_side(lanes: Sequence[Sequence[Callable[..., Result]]]) -> list[Result]:
    """Run all lanes at once. One alone is told as it goes; of several each stage when it is done, as `aloud=False` says."""

    def follow(lane: Sequence[Callable[..., Result]]) -> list[Result]:
        return [stage(aloud=len(lanes) == 1) for stage in lane]

    with ThreadPoolExecutor(len(lanes)) as threads:
        return [*chain(*threads.map(follow, lanes))]


def within(stage: Stage, chosen: Sequence[str]) -> list[str]:
    """Which of the `chosen` files, folders and tests may hold tests of this stage, narrowed to its folder and files."""
    found: list[str] = []
    for text in chosen:
        path = os.path.relpath(ROOT / text.split("::")[0], ROOT)
        if Path(path).is_relative_to(stage.folder):
            found += _saying(stage.says, text, ROOT / path)
        elif Path(stage.folder).is_relative_to(path):
            found += _saying(stage.says, stage.folder, ROOT / stage.folder)
    return found


def _saying(what: str, text: str, path: Path) -> list[str]:
    """`text`, or the test files below its `path` in which `what` is written."""
    if not what:
        return [text]
    if path.is_file():
        return [text] if what in path.read_text("utf-8") else []
    files = sorted(file for file in path.rglob("test_*.py") if what in file.read_text("utf-8"))
    return [str(file.relative_to(ROOT)) for file in files]


def run(
    stage: Stage,
    chosen: Sequence[str],
    extra: Sequence[str],
    may_be_empty: bool,
    root: Path = ROOT,
    limit: float = LIMIT,
    aloud: bool = True,
) -> Result:
    """Run a stage to its end, or for `limit` seconds, and count what its tests did.

    What it tells is shown as it comes, or when it is done if others tell something meanwhile.
    """
    result, began = Result(stage.name), time.monotonic()
    head = f"\n{stage.name}: {' '.join(chosen)}\n"
    if stage.needs and subprocess.run(stage.needs, cwd=root).returncode:
        result.went_wrong(f"{' '.join(stage.needs)} failed, so no test ran")
        return result
    sheet = root / "build" / "tests" / f"{stage.name.replace(' ', '-')}.xml"
    sheet.parent.mkdir(parents=True, exist_ok=True)
    sheet.unlink(missing_ok=True)
    kept = ["-o", "junit_family=xunit1", f"--junit-xml={sheet}"]
    command = [sys.executable, "-m", "pytest", "-m", stage.marks, *stage.options, *kept, *chosen, *extra]
    if stage.nice and not aloud:
        command = [*stepping_back(stage.nice), *command, "--timeout", str(PATIENCE)]
    if aloud:
        tell(head, end="")
        code = _ended(command, root, limit)
    else:
        story = sheet.with_suffix(".log")
        tell(f"{stage.name}: begins, and is told when it is done; meanwhile in {story.relative_to(root)}")
        with story.open("wb") as told:
            code = _ended(command, root, limit, told)
        head += story.read_text("utf-8", errors="replace")
    trouble = count(sheet, result)
    if code is None:
        result.went_wrong(f"not done in {limit:.0f} s")
    elif code == NOTHING:
        if not may_be_empty:
            result.went_wrong("no test was found")
    elif trouble:
        result.went_wrong(f"ended with code {code}: {trouble}")
    elif code not in (0, FAILED, INTERRUPTED) or (code and not result.failed):
        result.went_wrong(f"ended with code {code}")
    elif not any(result.counts):
        result.went_wrong("no test ran")
    tell(f"{'' if aloud else head}{stage.name}: done in {time.monotonic() - began:.0f} s")
    return result


def stepping_back(nice: int) -> list[str]:
    """What a command begins with that has to be so nice."""
    return ["nice", "-n", str(nice)] if nice and shutil.which("nice") else []


def tell(text: str, end: str = "\n") -> None:
    """Say something in one piece."""
    with _telling:
        print(text, end=end, flush=True)


_telling = threading.Lock()


def _ended(command: Sequence[str], root: Path, limit: float, told: IO[bytes] | None = None) -> int | None:
    """With which code a command ended; none if it had to be ended."""
    try:
        return subprocess.run(command, cwd=root, timeout=limit, stdout=told, stderr=told).returncode
    except subprocess.TimeoutExpired:
        return None


def count(sheet: Path, result: Result) -> str:
    """Add what the JUnit XML tells to `result`; returns what is wrong with the sheet, or nothing."""
    try:
        cases = list(ElementTree.parse(sheet).iter("testcase"))
    except (OSError, ElementTree.ParseError) as problem:
        return str(problem)
    for case in cases:
        if bad := [kind for kind in ("failure", "error") if case.find(kind) is not None]:
            result.failed += 1
            result.complaints.append(f"{bad[0]}: {_name(case)}")
        elif case.find("skipped") is not None:
            result.skipped += 1
        else:
            result.passed += 1
    return ""


def report(results: Sequence[Result], again: str) -> list[str]:
    """What failed, the command that runs it `again` in the same order, and the closing line."""
    lines = [""]
    for result in results:
        if result.complaints:
            lines += [f"{result.stage}:", *(f"  {complaint}" for complaint in result.complaints)]
    if len(lines) > 1:
        lines += [f"In the same order: {again}", ""]
    return [*lines, total(results)]


def total(results: Sequence[Result]) -> str:
    """`4553 passed, 0 failed`, and how many were skipped if any."""
    passed, failed, skipped = (sum(counted) for counted in zip(*(r.counts for r in results), strict=True))
    return f"{passed} passed, {failed} failed" + (f", {skipped} skipped" if skipped else "")


def _check(aloud: bool = True) -> Result:
    """`make check`; beside others it says something only if something is wrong."""
    result, pipe = Result("check"), None if aloud else subprocess.PIPE
    tell("check")
    command = [*stepping_back(0 if aloud else BEHIND), os.environ.get("MAKE", "make"), "-s", "check"]
    done = subprocess.run(command, cwd=ROOT, stdout=pipe, stderr=subprocess.STDOUT, text=True)
    if done.returncode:
        tell(done.stdout or "", end="")
        result.went_wrong(f"make check ended with code {done.returncode}")
    return result


def _name(case: ElementTree.Element) -> str:
    """The test as pytest takes it."""
    place = case.get("file") or (case.get("classname") or "").replace(".", "/")
    return f"{place}::{case.get('name')}"


def _options(arguments: Sequence[str]) -> argparse.Namespace:
    split = list(arguments).index("--") if "--" in arguments else len(arguments)
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--all", action="store_true", help="also every test marked sweep, of which else some are drawn")
    parser.add_argument("--seed", type=_number, help="order of the tests, and what they draw; another one each time")
    parser.add_argument("--jobs", type=_number, help="processes for the tests without a browser; as many as cores")
    parser.add_argument("--browsers", type=_number, help="browsers at once; as many as cores")
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--together", action="store_true", default=None, help="two stages at once, also on a busy machine")
    how.add_argument("--apart", action="store_false", dest="together", help="one stage after the other")
    parser.add_argument("tests", nargs="*", help="files, folders, tests; all")
    options = parser.parse_args(arguments[:split])
    options.pytest = list(arguments[split + 1 :])
    return options


def _number(text: str) -> int | None:
    """What make hands over: a number, or nothing."""
    return int(text) if text else None


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
