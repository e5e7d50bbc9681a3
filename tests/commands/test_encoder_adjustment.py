"""Adjusting an absolute encoder through the gate: adjusted and verified, or what the drive holds is told."""

import asyncio

import pytest

from app.access.roles import Person
from app.commands.encoder_adjustment import ENCODER
from app.commands.encoder_story import COORDINATE, READ, VERIFY, WAIT, StepState, Story
from app.commands.gate import Question
from app.commands.lifecycle import Progress, ProgressState
from app.commands.parameter_sets import CANCELLED
from app.errors import LinkError, Refused
from app.sim.bus import Answer
from app.sim.sinamics.adjustment import Adjustment, Encoder
from tests.commands.stand import ANA, EVA
from tests.commands.test_gate_sinamics import Pump
from tests.commands.test_parameter_sets import MAILBOX_AT, drive, held

CONFIRMED, FAILED, UNCONFIRMED = ProgressState.CONFIRMED, ProgressState.FAILED, ProgressState.UNCONFIRMED
HERE = 12_000.0


def axis(transport: str = "memory", **simulation: object):  # type: ignore[no-untyped-def]
    return drive(transport, positioning=1, **simulation)


async def adjust(it: Pump, coordinate: float = HERE, who: Person = EVA, **asked: object) -> Progress:
    given = {"confirmed": True, "proven": True, "reason": "new encoder", "object": 2, **asked}
    nonce = it.gate.nonces.issue(who.session)
    return await it.gate.encoders.adjust(who, "d1", coordinate, nonce=nonce, **given)  # type: ignore[arg-type]


def now(it: Pump) -> tuple[float, float, float]:
    """p2507, p2599, r2521."""
    return held(it, "p2507"), held(it, "p2599"), it.drive.model.values("r2521")[0]


class Falls(Adjustment):
    """Ends every adjustment in one state; 2 = never."""

    end = 0

    def step(self, encoder: Encoder, dt: float) -> None:
        if self.values["p2507"] == 2:
            self.values["p2507"] = self.end


def falls(it: Pump, state: int) -> None:
    it.drive._adjustment = Falls(it.drive._value)
    it.drive._adjustment.end = state


def story(it: Pump) -> Story:
    found = it.gate.encoders.story("d1")
    assert found is not None
    return found


def broken_at(it: Pump) -> str:
    failed = story(it).failed
    assert failed is not None
    return failed.key


@pytest.mark.parametrize("transport", ["memory", "tcp", "rtu"])
async def test_the_axis_is_where_found_told_to_be_and_every_step_is_told(transport: str) -> None:
    async with axis(transport) as it:
        _, _, before = now(it)
        progress = await adjust(it)
        assert progress.state is CONFIRMED, progress
        assert now(it) == (3, HERE, HERE)
        found = story(it)
        assert found.succeeded and found.person == EVA.display
        assert found.former == {"p2599": 0, "p2507": 1, "r2521": before}
        assert [one.value for one in found.steps] == [before, HERE, 2, 3, HERE]
        times = [time for one in found.steps for time in (one.began, one.ended)]
        assert times == sorted(times) and found.step(WAIT).ended - found.step(WAIT).began > 250_000
        assert [(one.code, one.old, one.new, one.found) for one in progress.changes] == [
            ("p2599", 0, HERE, HERE),
            ("p2507", 1, 3, 3),
        ]
        await it.until(lambda: (f"d1.{ENCODER}", "confirmed") in it.lines)
        assert (await adjust(it, -700)).state is CONFIRMED and now(it) == (3, -700, -700)  # and once more


@pytest.mark.sweep(8)
@pytest.mark.parametrize("former", [1, 3])
@pytest.mark.parametrize(
    ("state", "cause"), [(0, "why.enc_error"), (1, "why.enc_not_adjusted"), (2, "why.enc_timeout")]
)
async def test_what_the_drive_does_not_adjust_ends_with_its_cause_and_the_former_coordinate(
    former: int, state: int, cause: str
) -> None:
    async with axis() as it:
        if former == 3:
            await adjust(it, 500)
        before = now(it)
        falls(it, state)
        began = it.clock.monotonic()
        progress = await adjust(it)
        assert progress.params["cause"] == cause and broken_at(it) == WAIT
        assert (it.clock.monotonic() - began >= 10) is (state == 2)
        left = 1.0 if state else 0.0  # what was started is withdrawn
        assert now(it) == (left, before[1], before[2])
        whole = former == left
        assert (progress.state, progress.reason) == (FAILED, "why.set_restored" if whole else "why.enc_failed"), (
            progress
        )
        assert [str(one.stands) for one in progress.changes] == ["old", "old" if whole else "other"]
        assert progress.changes[1].found == left


async def test_a_position_that_is_another_is_no_success() -> None:
    async with axis() as it:
        falls(it, 3)  # says adjusted, and has not moved the position
        progress = await adjust(it)
        assert progress.state is FAILED and progress.params["cause"] == "why.enc_position" and broken_at(it) == VERIFY
        assert progress.reason == "why.enc_failed" and now(it)[:2] == (3, HERE)
        assert [str(one.stands) for one in progress.changes] == ["new", "new"]


@pytest.mark.parametrize("why", ["cancel", "stop", "rights", "moved"])
async def test_whoever_ends_it_while_it_waits_has_it_withdrawn(why: str) -> None:
    async with axis() as it:
        falls(it, 2)
        before, tasks = now(it), []

        async def end() -> None:
            await it.until(lambda: story(it).step(WAIT).state is StepState.ACTIVE)
            if why == "cancel":
                assert it.gate.encoders.cancel("d1")
            elif why == "stop":
                tasks.append(asyncio.create_task(it.ask("stop")))
            elif why == "rights":
                it.gate._state.rights = it.gate._state.checks._rights = lambda person: None
            else:
                it.drive.power.shaft.speed = 40.0  # pushed from outside

        it.gate.encoders._stories._found.clear()
        running = asyncio.create_task(adjust(it))
        await asyncio.sleep(0)
        await it.until(lambda: it.gate.encoders.story("d1"))
        await end()
        progress = await running
        cause = {"cancel": CANCELLED, "stop": "why.set_stopped", "rights": "why.signed_out", "moved": "why.condition"}[
            why
        ]
        assert progress.state is FAILED and progress.params["cause"] == cause, progress
        assert now(it)[:2] == before[:2] and not it.gate.encoders.cancel("d1")


async def test_only_who_may_starts_it_only_at_standstill_and_once() -> None:
    async with axis() as it:
        for who, asked, says in (
            (EVA, {"proven": False}, r"why\.password"), (EVA, {"reason": ""}, r"why\.reason"), (ANA, {}, r"why\.(role|held)"),
        ):  # fmt: skip
            with pytest.raises((Refused, Question), match=says):
                await adjust(it, who=who, **asked)
        for wrong in (0.5, 3e9, float("nan")):
            with pytest.raises(Refused) as refused:
                await adjust(it, wrong)
            assert refused.value.status == 422
        assert now(it)[:2] == (1, 0) and it.gate.encoders.story("d1") is None
        first = asyncio.create_task(adjust(it, id="press"))
        await it.until(lambda: it.gate.encoders.story("d1"))
        with pytest.raises(Refused, match=r"why\.busy"):
            await adjust(it, 99)
        again = asyncio.create_task(adjust(it, id="press"))
        assert (await first).state is CONFIRMED and (await again) == await first and now(it) == (3, HERE, HERE)
        await it.done("forward", who=EVA)
        assert [one.key for one in it.gate.encoders.why_not(EVA, "d1")] == ["why.condition"]
        with pytest.raises(Refused, match=r"why\.condition"):
            await adjust(it)


async def test_what_cannot_be_read_first_is_not_begun() -> None:
    async with drive() as it:  # without the basic positioner
        with pytest.raises(Refused, match=r"why\.par_refused") as refused:
            await adjust(it)
        assert refused.value.params["cause"] == "profidrive.error.x00" and broken_at(it) == READ
    async with axis() as it:
        falls(it, 2)
        it.drive._value["p2507"] = 2  # somebody at the drive
        with pytest.raises(Refused, match=r"why\.enc_running"):
            await adjust(it)
        assert now(it)[:2] == (2, 0)


async def test_what_the_drive_holds_is_looked_at_without_writing_anything() -> None:
    async with axis() as it:
        looks = [it.gate.encoders.look("d1", 2) for _ in range(2)]
        await asyncio.gather(*looks)  # the second one adds nothing
        held_now = it.gate.encoders.held("d1")
        assert held_now is not None and not it.gate.encoders.looking("d1")
        assert held_now.values == {"p2507": 1, "p2599": 0, "p2544": 40, "r2521": now(it)[2]}
        it.sim.buses["drives"].answer = lambda unit, pdu: Answer(unit, None)  # type: ignore[method-assign]
        with pytest.raises((LinkError, Refused)):
            await it.gate.encoders.look("d1", 2)
        assert it.gate.encoders.held("d1") == held_now
        with pytest.raises(Refused, match=r"no_such_command"):
            await it.gate.encoders.look("d9", 2)
    async with drive() as it:
        await it.gate.encoders.look("d1", 2)
        without = it.gate.encoders.held("d1")
        assert without is not None and without.values == {}


async def test_a_dry_run_changes_nothing_and_a_full_disk_neither() -> None:
    async with axis() as it:
        it.gate._state.dry_run = True
        assert (await adjust(it)).state is ProgressState.DRY_RUN
        it.gate._state.dry_run = False
        it.gate._state.audit_lines._foretell = _nothing  # type: ignore[assignment]
        with pytest.raises(Refused, match=r"why\.no_audit"):
            await adjust(it)
        assert now(it)[:2] == (1, 0) and broken_at(it) == COORDINATE


async def _nothing(line: object) -> bool:
    return False


@pytest.mark.sweep(8)
async def test_saving_after_it_is_its_last_step_and_a_save_before_is_not() -> None:
    async with axis() as it:

        async def save() -> Progress:
            nonce = it.gate.nonces.issue(EVA.session)
            return await it.gate.parameters.save(EVA, "d1", nonce=nonce, confirmed=True, proven=True, reason="kept")

        await save()
        await adjust(it)
        found = story(it)
        assert found.save.state is StepState.WAITING
        it.drive.model.power_up()
        assert now(it)[0] == 1
        await adjust(it)
        step, it.drive.model.step = it.drive.model.step, lambda dt: None  # type: ignore[method-assign]
        await save()
        assert story(it).save.state is StepState.FAILED
        it.drive.model.step = step  # type: ignore[method-assign]
        await it.until(lambda: not it.drive.model.saving)
        assert (await save()).state is CONFIRMED and story(it).save.state is StepState.DONE
        it.drive.model.power_up()
        assert now(it) == (3, HERE, HERE)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("former", [1, 3])
@pytest.mark.parametrize("seconds", [3.0, 40.0])
async def test_the_line_is_cut_at_every_telegram(former: int, seconds: float) -> None:
    """Adjusted and verified, all as before, or told what stands there; and what cannot be read is told when the drive is back."""
    cuts, telegrams = 0, 0
    while True:
        async with axis() as it:
            if former == 3:
                await adjust(it, 500)
            before = now(it)
            bus, seen, until = it.sim.buses["drives"], [0], [float("inf")]
            answer = bus.answer

            def cut(unit: int, pdu: bytes, *, answer=answer, seen=seen, until=until, at=cuts, it=it) -> Answer:  # type: ignore[no-untyped-def]
                if pdu[0] in (3, 16) and int.from_bytes(pdu[1:3], "big") == MAILBOX_AT:
                    seen[0] += 1
                    if seen[0] == at + 1:
                        until[0] = it.clock.monotonic() + seconds
                cut_off = seen[0] > at and it.clock.monotonic() < until[0]
                return Answer(unit, None) if cut_off else answer(unit, pdu)

            bus.answer = cut  # type: ignore[method-assign]
            ends: list[Progress] = []
            it.gate.subscribe_ends(ends.append)
            try:
                progress = await adjust(it)
            except Refused as refused:
                assert refused.status in (409, 503), refused.reason
                assert now(it) == before
            else:
                if progress.reason == "why.set_unread":
                    assert progress.state is UNCONFIRMED
                    await it.until(lambda: len(ends) > 1, limit=120)  # noqa: B023
                    progress = ends[-1]
                _check_true(it, progress, before)
            telegrams = seen[0]
        if cuts >= telegrams:
            assert progress.state is CONFIRMED and cuts > 8
            return
        cuts += 3 if seconds > 10 else 2


def _check_true(it: Pump, progress: Progress, before: tuple[float, float, float]) -> None:
    holds = now(it)
    for one, value in zip(progress.changes, (holds[1], holds[0]), strict=True):
        assert one.found == value, (progress, holds)
    if progress.state is CONFIRMED:
        assert holds == (3, HERE, HERE), progress
    elif progress.reason in ("why.set_restored", "why.set_found_old"):
        assert holds == before, (progress, holds)
