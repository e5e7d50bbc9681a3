"""Speed of what an encoder counts, from whole pulses: over as long a time as the speed was the same, so that one pulse is not news."""

from collections.abc import Sequence

LONGEST = 100
"""Cycles that are looked back at most."""
SHORTEST = 12
"""Cycles that are averaged while the speed changes."""
EACH = 4
"""Only every so many cycles are compared: the bound stays, the work is a quarter."""


def pulse_speed(counts: Sequence[int]) -> float:
    """Speed now [pulses per cycle], signed; `counts`: what the encoder had counted, a cycle apart, newest first, at least `SHORTEST` + 1.

    At an even speed s every count lies less than one pulse beside the line of that slope: |n(0) − n(k) − s·k| < 1. Going back, each
    cycle leaves fewer slopes that can be, until none is left (the speed was another one) or `LONGEST` is reached; the middle of those left
    is the speed. Its error at an even speed is less than one pulse in all the cycles looked at: 1/`LONGEST`, and 0 while it stands.
    Where the speed changes so much that none is left within `SHORTEST`, it is the mean over these.

    Raises:
        ValueError: fewer counts than that.

    Source: adaptive windowing of Janabi-Sharifi, Hayward and Chen, "Discrete-time adaptive windowing for velocity estimation", IEEE
    Transactions on Control Systems Technology 8 (2000): the longest window whose counts a line can explain; here by its slopes.
    """
    if len(counts) <= SHORTEST:
        raise ValueError(f"{len(counts)} counts, at least {SHORTEST + 1} expected")
    now = counts[0]
    low, high = float("-inf"), float("inf")
    for cycles in range(EACH, min(LONGEST, len(counts) - 1) + 1, EACH):
        way = now - counts[cycles]
        lower, upper = max(low, (way - 1) / cycles), min(high, (way + 1) / cycles)
        if lower >= upper:
            if cycles <= SHORTEST:
                return (now - counts[SHORTEST]) / SHORTEST
            break
        low, high = lower, upper
    return (low + high) / 2
