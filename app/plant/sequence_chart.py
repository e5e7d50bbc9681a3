"""Branches, loops and safe steps of a sequence file: `[[branches]]`, `[[loops]]`, `abort_to`; what they say of steps by their keys.

    [sequence]
    abort_to = "park"                                   a run that stops before its end goes on here; else it ends at once

    [[branches]]
    after = "weigh"
    take = "first"                                      the first path that can be entered; "all": side by side
    paths = ["small", "big"]                            first steps, in the order of the file; each goes up to the next one
    then = "empty"                                      where they meet

    [[loops]]
    from = "fill"
    to = "settle"
    times = 3                                           how often it is passed, or a value of the run ("recipe.count"), whole from 1

The steps of a branch stand together in the file, behind the step after which it divides and before the one in which it meets, so that
whatever is nested meets again.
"""

from collections.abc import Iterator, Sequence

from app.blocks.sequence import Branch, Chart, Loop
from app.plant.said import said
from app.plant.sequence_definition import PREFIX, RecipeValue, SequenceStep
from app.plant.sequence_recipe import check_count, named, refers
from app.plant.tables import MISSING, Table

MOST_TIMES = 10_000
TAKES = ("first", "all")


def read_chart(root: Table, head: Table, steps: Sequence[SequenceStep], recipe: Sequence[RecipeValue] = ()) -> Chart:
    """The structure that the file gives to its `steps`, `recipe` the values of its runs; notes everything that cannot be."""
    keys = [step.key for step in steps]
    branches: list[Branch] = []
    for row in root.rows("branches"):
        branch = _branch(row, keys)
        if branch is not None and _fits(row, branch, branches, keys) and _commands_apart(row, branch, steps):
            branches.append(branch)
    loops: list[Loop] = []
    for row in root.rows("loops"):
        loop = _loop(row, keys, recipe)
        if loop is not None and _is_whole(row, loop, branches, loops, keys):
            loops.append(loop)
    return Chart(tuple(branches), tuple(loops), _safe(head, keys, branches, loops))


def _step(row: Table, key: str, keys: Sequence[str]) -> int:
    """Number of the step that `key` names; 0 = none, and noted."""
    name = row.text(key, choices=keys)
    return keys.index(name) + 1 if name in keys else 0


def _branch(row: Table, keys: Sequence[str]) -> Branch | None:
    after, then = _step(row, "after", keys), _step(row, "then", keys)
    take = row.text("take", choices=TAKES)
    names = list(row.items("paths", [], said("mistake.first_steps")))
    paths: list[int] = []
    for index, name in enumerate(names):
        if name in keys:
            paths.append(keys.index(name) + 1)
        else:
            row.note(f"paths.{index}", name, said("mistake.step_of_file", keys=", ".join(keys)))
    row.done()
    if not (after and then and take in TAKES) or len(paths) != len(names):
        return None
    if len(paths) < 2:
        row.note("paths", names or MISSING, said("mistake.two_paths"))
    elif paths[0] != after + 1:
        row.note("paths.0", names[0], said("mistake.first_path", step=keys[after - 1]))
    elif sorted(set(paths)) != paths:
        row.note("paths", names, said("mistake.paths_once"))
    elif then <= paths[-1]:
        row.note("then", keys[then - 1], said("mistake.behind_paths", step=names[-1]))
    else:
        return Branch(after, tuple(paths), then, take == "all")
    return None


def _fits(row: Table, branch: Branch, others: Sequence[Branch], keys: Sequence[str]) -> bool:
    """Whether it stands within one path of each of the `others`, or beside it."""
    for other in others:
        if other.after == branch.after:
            row.note("after", keys[branch.after - 1], said("mistake.divides_once"))
            return False
        if not (_lies(branch.after, branch.then, other) or _lies(other.after, other.then, branch)):
            expected = said("mistake.branch_within", step=keys[other.after - 1])
            row.note("after", keys[branch.after - 1], expected)
            return False
    return True


def _lies(first: int, last: int, branch: Branch) -> bool:
    """Whether the steps `first` to `last` are in one path of `branch`, or none of them is in any."""
    if last < branch.paths[0] or first >= branch.then:
        return True
    return any(start <= first and last <= end for start, end in branch.spans)


def _commands_apart(row: Table, branch: Branch, steps: Sequence[SequenceStep]) -> bool:
    """Whether no two paths that run side by side command the same machine."""
    owner: dict[str, int] = {}
    for number, (first, last) in enumerate(branch.spans if branch.together else ()):
        for machine in dict.fromkeys(order.machine for step in steps[first - 1 : last] for order in step.orders):
            if owner.setdefault(machine, number) != number:
                row.note("take", "all", said("mistake.side_by_side", machine=machine))
                return False
    return True


def _loop(row: Table, keys: Sequence[str], recipe: Sequence[RecipeValue]) -> Loop | None:
    first, last = _step(row, "from", keys), _step(row, "to", keys)
    value, times = named(row, "times", recipe), 0
    if value is not None:
        check_count(row, "times", value, MOST_TIMES)
        times = round(value.default)
    elif not refers(row.data.get("times")):
        times = row.whole("times", low=2, high=MOST_TIMES)
    row.done()
    if first and last and last < first:
        row.note("to", keys[last - 1], said("mistake.or_behind", step=keys[first - 1]))
        return None
    return Loop(first, last, times, value.key if value else "") if first and last and (times or value) else None


def _is_whole(row: Table, loop: Loop, branches: Sequence[Branch], others: Sequence[Loop], keys: Sequence[str]) -> bool:
    """Whether both its ends are in the same path, and it crosses no other loop."""
    for branch in branches:
        if _path(loop.first, branch) != _path(loop.last, branch):
            row.note("to", keys[loop.last - 1], said("mistake.same_path", step=keys[loop.first - 1]))
            return False
    for other in others:
        apart = loop.last < other.first or other.last < loop.first
        inside = other.first <= loop.first and loop.last < other.last
        around = loop.first <= other.first and other.last < loop.last
        if not (apart or inside or around):
            row.note("to", keys[loop.last - 1], said("mistake.loop_within"))
            return False
    return True


def _path(step: int, branch: Branch) -> int:
    """The path of `branch` in which `step` is; -1 = none."""
    return next((n for n, (first, last) in enumerate(branch.spans) if first <= step <= last), -1)


def _safe(head: Table, keys: Sequence[str], branches: Sequence[Branch], loops: Sequence[Loop]) -> int:
    if not head.has("abort_to"):
        return 0
    safe = _step(head, "abort_to", keys)
    crossed = [keys[branch.after - 1] for branch in branches if branch.after < safe <= branch.then]
    crossed += [keys[loop.first - 1] for loop in loops if loop.first < safe <= loop.last]
    if safe == 1:
        head.note("abort_to", keys[0], said("mistake.safe_steps"))
    elif crossed:
        head.note("abort_to", keys[safe - 1], said("mistake.safe_outside", step=crossed[0]))
    else:
        return safe
    return 0


def chart_lines(chart: Chart) -> Iterator[str]:
    """What of it makes the program of a device, one line each."""
    for branch in chart.branches:
        paths = ",".join(map(str, branch.paths))
        yield f"branch {branch.after} {'all' if branch.together else 'first'} {paths} then {branch.then}"
    for loop in chart.loops:
        yield f"loop {loop.first} {loop.last} {PREFIX + loop.recipe if loop.recipe else loop.times}"
    if chart.safe:
        yield f"abort_to {chart.safe}"
