"""Measure the numbers that the design must not lose (`make bench`), each with the bare loop beside it.

    tools/bench.py [--write] [NAME ...]

The load generator, the devices and the browsers run on the same cores as what is measured. `--write` puts what was measured into
docs/performance.md. A measurement that fails is shown as failed, and the exit code is 1; a missed target is only shown.
"""

import argparse
import asyncio
import importlib
import json
import os
import platform
import subprocess
import sys
import time
from dataclasses import asdict
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tools")]

from benchmarks.common import Row  # noqa: E402

MEASUREMENTS = (
    "values",
    "push",
    "commands",
    "line",
    "parameters",
    "history",
    "browsers",
    "start",
    "costs",
    "turns",
    "conveyors",
    "passage_records",
    "run_records",
    "arc",
)
LIMIT = 180.0
"""Longest time of one measurement [s]."""
HEAD = ("what", "measured", "target", "bare loop", "ratio", "")


def measure(name: str) -> list[Row]:
    """Run one measurement in a process of its own; a failure is a row too."""
    command = [sys.executable, __file__, "--alone", name]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, cwd=ROOT)
    except subprocess.TimeoutExpired:
        return [Row(f"{name}: FAILED", f"not done in {LIMIT:.0f} s", met=False)]
    if done.returncode:
        reason = (done.stderr.strip() or f"ended with {done.returncode}").splitlines()[-1]
        sys.stderr.write(done.stderr)
        return [Row(f"{name}: FAILED", reason[:200], met=False)]
    return [Row(**row) for row in json.loads(done.stdout.strip().splitlines()[-1])]


def cells(row: Row) -> tuple[str, ...]:
    ratio = "" if row.ratio is None else f"{row.ratio:.2f}" if row.ratio >= 0.01 else f"{row.ratio:.4f}"
    met = {True: "yes", False: "NO", None: ""}[row.met]
    return row.what, row.measured, row.target, row.bare, ratio, met


def table(rows: list[Row]) -> str:
    """The rows as a Markdown table, with their notes below."""
    lines = [
        "| what | measured | target | bare loop of the same run | measured / bare | target met |",
        "|---|---|---|---|---|---|",
    ]
    notes = list[str]()
    for row in rows:
        what, *rest = cells(row)
        if row.note:
            notes.append(f"{len(notes) + 1}. {row.note}.")
            what += f" [{len(notes)}]"
        lines.append("| " + " | ".join((what, *rest)) + " |")
    return "\n".join([*lines, "", *notes])


def machine() -> str:
    """What it was measured on."""
    model = next(
        (
            line.partition(":")[2].strip()
            for line in Path("/proc/cpuinfo").read_text().splitlines()
            if "model name" in line
        ),
        platform.processor() or "unknown CPU",
    )
    load = f"load average before it {os.getloadavg()[0]:.1f}"
    return f"{model}, {os.cpu_count()} cores, Linux {platform.release()}, Python {platform.python_version()}, {load}"


PAGE = """# Performance

Measured {date} on {machine}, in {seconds:.0f} s, by

    {command}

The load generators (Modbus devices, browsers) ran on the same cores as what they loaded. Beside each figure stands the bare loop that does
the least one could do, measured in the same run. What the figures are made of is in `tools/benchmarks/`; this page is written by the
command above and by nobody's hand.

{table}
"""


def main() -> int:
    """Run the measurements that were named, or all."""
    if len(sys.argv) > 2 and sys.argv[1] == "--helper":
        module = sys.argv[2]
        del sys.argv[1:3]
        importlib.import_module(f"benchmarks.{module}").main()
        return 0
    if len(sys.argv) == 3 and sys.argv[1] == "--alone":
        rows = asyncio.run(importlib.import_module(f"benchmarks.{sys.argv[2]}").measure())
        print(json.dumps([asdict(row) for row in rows]))
        return 0
    parser = argparse.ArgumentParser(description="Measure the numbers that the design must not lose.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(MEASUREMENTS)}; none = all")
    parser.add_argument("--write", action="store_true", help="write docs/performance.md")
    asked = parser.parse_args()
    unknown = set(asked.names) - set(MEASUREMENTS)
    if unknown:
        parser.error(f"{', '.join(sorted(unknown))}: expected some of {', '.join(MEASUREMENTS)}")
    began, rows, where = time.monotonic(), list[Row](), machine()
    for name in asked.names or MEASUREMENTS:
        print(f"{name} …", file=sys.stderr, flush=True)
        rows += measure(name)
    text = table(rows)
    seconds = time.monotonic() - began
    print(f"{where}; load generators on the same cores; {seconds:.0f} s\n\n{text}")
    if asked.write:
        command = "make bench ARGS=" + repr(" ".join(sys.argv[1:])) if len(sys.argv) > 2 else "make bench ARGS=--write"
        page = PAGE.format(date=time.strftime("%Y-%m-%d"), machine=where, seconds=seconds, command=command, table=text)
        (ROOT / "docs" / "performance.md").write_text(page, "utf-8")
    return int(any("FAILED" in row.what for row in rows))


if __name__ == "__main__":
    sys.exit(main())
