"""A command at work has one writer: what happens to it is told to it, and its fields are changed nowhere else."""

import ast
from pathlib import Path

import pytest

from app.commands.hold import Lease
from app.commands.job import NEVER, Job
from app.commands.lifecycle import Progress, ProgressState
from app.commands.orders import Order
from tests.commands.stand import ANA, Stand

COMMANDS = Path(__file__).resolve().parents[2] / "app" / "commands"
FIELDS = frozenset(Job.__dataclass_fields__)
NAMES = frozenset({"job", "old", "new"})
"""What a command at work is called where it is used."""


@pytest.mark.parametrize("path", sorted(COMMANDS.glob("*.py")), ids=lambda path: path.stem)
def test_nobody_else_writes_a_field_of_it(path: Path) -> None:
    if path.stem in ("job", "machine"):  # where it is, and where the job of a set is
        return
    written = [
        f"{path.name}:{target.lineno} {ast.unparse(target)}"
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        for whole in (node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)])
        for target in (whole.elts if isinstance(whole, ast.Tuple) else [whole])
        if isinstance(target, ast.Attribute)
        and target.attr in FIELDS
        and (target.value.id if isinstance(target.value, ast.Name) else getattr(target.value, "attr", "")) in NAMES
    ]
    assert not written


def made(command: str = "forward", asked: float = 5.0) -> Job:
    stand = Stand()
    order = Order(ANA, "m1", command, None, "id", "", None, False, False, "", "", "en", 1)
    progress = Progress("id", "m1", command, "", "Ana", ProgressState.REQUESTED, 1)
    return Job(order, stand.gate._state.machines["m1"].commands[command], progress, None, (), (), asked)


def lease() -> Lease:
    return Lease("t", ANA, "m1", "jog_forward", "id", "", 0.0, 0)


def test_an_echo_counts_feedback_from_then_on() -> None:
    job = made()
    job.accepted(7.0, 70)
    assert (job.since, job.echoed, job.progress.state, job.progress.accepted) == (7.0, True, ProgressState.ACCEPTED, 70)


def test_doubt_is_settled_by_what_is_read_later_but_of_a_held_motion_by_its_end() -> None:
    plain, held = made(), made("jog_forward")
    held.lend(lease(), 6.0)
    for job in (plain, held):
        job.outcome_unknown(7.0, 70, "why.unknown", {})
        assert job.progress.state is ProgressState.UNKNOWN
    assert (plain.since, held.since) == (7.0, None)


def test_telegrams_that_break_are_on_their_way_no_more() -> None:
    job = made()
    with pytest.raises(ValueError), job.telegrams(), job.stop_telegrams(3.0), job.asked_again(4.0):
        assert (job.writing, job.stopping, job.asking) == (1, 1, True)
        raise ValueError
    assert (job.writing, job.stopping, job.asking) == (0, 0, False)
    assert (job.last_write, job.last_ask) == (3.0, 4.0)


def test_a_stop_after_a_stop_waits_since_the_first_and_for_what_is_on_its_way() -> None:
    start, first, second = made(asked=1.0), made("stop", 2.0), made("stop", 3.0)
    with start.telegrams():
        first.supersede(start)
        second.supersede(first)
        assert (second.asked, second.other) == (2.0, start)
        assert second.stop_echoed(4.0, 40) and second.since is None, "what is on its way may move the machine again"
    second.other_is_through()
    assert (second.other, second.since, second.last_write) == (None, None, NEVER)
    assert not second.stop_echoed(5.0, 50)
    assert (second.since, second.progress.accepted) == (5.0, 40)


def test_a_button_let_go_is_a_stop_that_counts_from_its_own_echo() -> None:
    job = made("jog_forward")
    job.lend(lease(), 1.0)
    job.accepted(2.0, 20)
    job.seen_moving(30)
    assert job.moved and job.progress.state is ProgressState.CONFIRMED and not job.progress.over
    job.let_go(4.0)
    assert (job.ending, job.since, job.echoed) == (4.0, None, False)
    assert not job.stop_echoed(5.0, 50)
    assert (job.since, job.echoed) == (5.0, True)
    job.end(ProgressState.CONFIRMED, 60, "hold.cause.released", {})
    assert job.progress.over
