"""The gate over every transport to the virtual positioning axis: real telegrams, tasks, read-back, faults."""

import asyncio
from collections.abc import Mapping

import pytest

from app.commands.lifecycle import ProgressState
from app.errors import Refused
from app.profidrive.state_machine import State
from app.sim import training
from app.sim.epos import training as own
from app.sim.epos.drive import VirtualPositioningAxis
from app.sim.epos.messages import FOLLOWING
from app.sim.epos.positioner import Task
from app.tags.quality import is_good
from tests.commands.stand import ANA, EVA
from tests.commands.test_gate_sinamics import TRANSPORTS, Pump, pump


class Axis(Pump):
    """Axis a1 of its own plant, standing, behind a link."""

    folder, id, first = "plants/epos", "a1", "enable"
    usual: Mapping[str, object] = {}
    drive: VirtualPositioningAxis  # type: ignore[assignment]

    async def moved(self, command: str, target: str) -> None:
        """A task from its target to the end."""
        await self.done("set_target", argument=target, language="en", confirmed=True)
        await self.done(command, confirmed=True)
        await self.until(lambda: self.value("zsw1_target_position_reached") == 1 and self.value("running") == 0)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("transport", TRANSPORTS)
async def test_a_day_of_the_axis_over_every_transport(transport: str) -> None:
    async with pump(transport, Axis, p2585=-6000, p2586=6000) as it:
        await it.done("enable")
        assert it.drive.state is State.OPERATION and it.value("task") == 0
        await it.done("set_velocity", argument="20000", language="en", confirmed=True)
        await it.moved("move_absolute", "550.25")
        assert it.drive.actual == pytest.approx(550_250, abs=40) and it.value("position") == pytest.approx(
            550.25, abs=0.1
        )
        await it.moved("move_relative", "-50")
        assert it.drive.actual == pytest.approx(500_250, abs=40)
        await it.done("run_blocks", confirmed=True)
        await it.until(lambda: it.value("running") == 1)
        await it.done("intermediate_stop")
        assert it.drive.positioner.task is Task.BLOCKS and not it.drive.positioner.speed
        await it.done("resume", confirmed=True)
        await it.until(lambda: it.value("running") == 1)
        await it.done("reject_task")
        assert it.drive.positioner.task is Task.NONE and it.drive.state is State.OPERATION
        await it.moved("move_absolute", "10")
        await it.done("stop")
        assert it.drive.state is State.READY_TO_SWITCH_ON and it.value("running") == 0
        for command in ("quick_stop", "coast"):
            await it.done("enable")
            await it.done(command)
            assert it.drive.state is State.INHIBITED
        assert {result for _, result in it.lines} == {"confirmed"}


@pytest.mark.parametrize("transport", TRANSPORTS)
async def test_every_point_is_read_and_good(transport: str) -> None:
    async with pump(transport, Axis) as it:
        names = [p.name for s in it.link.stations.values() for block in s.blocks for p in block.points]
        assert not [p.name for s in it.link.stations.values() for p in s.unreadable]
        it.link.demand("page", names)
        await it.until(lambda: all(is_good(it.tags.sample(name).quality) for name in names))
        assert len(names) > 80


async def test_what_the_axis_would_not_take_is_refused_with_its_reason_before_a_word_is_sent() -> None:
    async with pump("memory", Axis) as it:
        with pytest.raises(Refused):
            await it.ask("move_absolute", confirmed=True)  # not enabled
        await it.done("enable")
        await it.done("set_target", argument="-100", language="en", confirmed=True)
        it.words.clear()
        with pytest.raises(Refused):
            await it.ask("move_absolute", confirmed=True)  # below the travel
        assert not it.words and it.drive.positioner.task is Task.NONE
        await it.done("move_relative", confirmed=True)
        await it.until(lambda: it.value("zsw1_target_position_reached") == 1)
        assert it.drive.actual == pytest.approx(300_000, abs=40)


async def test_an_axis_that_is_not_adjusted_takes_no_absolute_task_but_jogs() -> None:
    async with pump("memory", Axis, adjusted=0) as it:
        await it.done("enable")
        with pytest.raises(Refused):
            await it.ask("move_absolute", confirmed=True)
        it.drive.write(16, 0x63, [0x43F, 0x8100])
        await it.until(lambda: it.value("pstw1_absolute") == 1)
        it.drive.write(6, 0x63, [0x47F])
        await it.until(lambda: it.value("alarm_number") == 7461)
        assert it.value("zsw1_task_acknowledged") == 0
        it.drive.write(16, 0x63, [0x43F, 0])
        it.drive.write(6, 0x63, [0x63F])
        await it.until(lambda: it.value("task") == 1)


async def test_a_jammed_slide_trips_for_its_following_error_and_is_reset_once_it_is_free() -> None:
    async with pump("memory", Axis) as it:
        await it.done("enable")
        await it.done("set_target", argument="700", language="en", confirmed=True)
        await it.done("move_absolute", confirmed=True)
        await it.cause(own.REG_JAMMED, 1)
        await it.until(lambda: it.value("fault_1") == FOLLOWING)
        await it.cause(own.REG_JAMMED, 0)
        await it.until(lambda: it.value("zsw1_operation_enabled") == 0)
        await it.done("reset")
        assert not it.drive.faults


async def test_a_task_whose_acknowledgement_does_not_come_is_not_confirmed() -> None:
    async with pump("memory", Axis) as it:
        await it.done("enable")
        it.drive.write(16, 0x6A, [0, 0])  # no velocity: the axis does not take it
        await it.done("move_absolute", ProgressState.UNCONFIRMED, confirmed=True)
        assert not it.drive.positioner.speed


async def test_a_panel_that_has_the_control_refuses_what_is_asked_from_here() -> None:
    async with pump("memory", Axis) as it:
        await it.cause(own.REG_LOCAL, 1)
        await it.until(lambda: it.value("zsw1_control_requested") == 0)
        with pytest.raises(Refused):
            await it.ask("enable")
        await it.cause(own.REG_LOCAL, 0)
        await it.until(lambda: it.value("zsw1_control_requested") == 1)
        await it.done("stop")
        await it.done("enable")


@pytest.mark.parametrize("register", [own.REG_INTERLOCK, own.REG_EMERGENCY])
async def test_a_second_source_stops_it_and_holds_it(register: int) -> None:
    async with pump("memory", Axis) as it:
        await it.done("enable")
        await it.done("run_blocks", confirmed=True)
        await it.cause(register, 1)
        await it.until(lambda: it.drive.state is State.INHIBITED)
        await it.until(lambda: it.value("running") == 0)
        with pytest.raises(Refused):
            await it.ask("enable")
        await it.cause(register, 0)
        await it.cause(training.REG_MACHINE_FAULT, 0)
        await it.done("stop")
        await it.done("enable")


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("trouble", "cause", "left"),
    [(0, "", 3), (1, "why.enc_not_adjusted", 1), (2, "why.enc_error", 0), (3, "why.enc_timeout", 1)],
)
async def test_its_encoder_is_adjusted_where_it_stands_or_the_cause_is_told(
    trouble: int, cause: str, left: int
) -> None:
    async with pump("memory", Axis, adjusted=0) as it:
        it.gate.control.release(ANA, "a1")
        it.gate.control.take(EVA, "a1")
        await it.cause(own.REG_ADJUSTMENT, trouble)
        before = it.drive.actual
        nonce, proof = it.gate.nonces.issue(EVA.session), {"confirmed": True, "proven": True, "reason": "new encoder"}
        progress = await it.gate.encoders.adjust(EVA, "a1", 123_000, object=2, nonce=nonce, **proof)  # type: ignore[arg-type]
        assert progress.params.get("cause", "") == cause, progress
        assert it.drive.model.values("p2507") == [left]
        assert it.drive.actual == pytest.approx(before if cause else 123_000, abs=1)
        assert it.drive.model.values("p2599") == [0 if cause else 123_000]
        assert (progress.state is ProgressState.CONFIRMED) is (not cause)


def over(it: Axis) -> bool:
    progress = it.gate.progress("a1")
    return progress is not None and progress.over


@pytest.mark.sweep(8)
@pytest.mark.parametrize("transport", TRANSPORTS)
async def test_a_jog_that_is_let_go_is_over_when_the_axis_stands_and_the_drive_stays_enabled(transport: str) -> None:
    """The Stop of the machine is confirmed by a drive that is switched off; a jog leaves it on."""
    async with pump(transport, Axis, p2585=-6000, p2586=6000) as it:
        await it.done("enable")
        for command, way in (("jog_plus", 1), ("jog_minus", -1)):
            began, hold = it.drive.actual, it.gate.hold
            lease = await hold.arm(ANA, "a1", command, nonce=it.gate.nonces.issue(ANA.session))
            for counter in range(1, 8):
                hold.keep_alive(lease, counter, ANA.session)
                await asyncio.sleep(0.15)
            hold.release(lease, ANA.session)
            await it.until(lambda: over(it))
            progress = it.gate.progress("a1")
            assert progress is not None and progress.command == command
            assert (progress.state, progress.reason) == (ProgressState.CONFIRMED, "hold.cause.released"), progress
            assert way * (it.drive.actual - began) > 1000 and not it.drive.positioner.speed
            assert it.drive.state is State.OPERATION and it.value("zsw1_operation_enabled") == 1


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("command", "way"),
    [("move_absolute", -1), ("move_relative", -1), ("jog_minus", -1), ("jog_plus", 1), ("enable", 0)],
)
@pytest.mark.parametrize("paused", [True, False], ids=["paused", "on its way"])
async def test_what_is_asked_anew_has_nothing_left_of_the_task_before(command: str, way: int, paused: bool) -> None:
    """An intermediate stop keeps its task: with the bit back the axis went on to the former target, under a hand that held it back."""
    async with pump("memory", Axis, p2585=-6000, p2586=6000) as it:
        await it.done("enable")
        await it.moved("move_absolute", "300")
        await it.done("set_target", argument="700", language="en", confirmed=True)
        await it.done("move_absolute", confirmed=True)
        await it.until(lambda: it.drive.actual > 400_000)
        if paused:
            await it.done("intermediate_stop")
        if command.startswith("move"):
            target = "100" if command == "move_absolute" else "-50"
            await it.done("set_target", argument=target, language="en", confirmed=True)
        began, seen = it.drive.actual, [it.drive.actual]
        if command.startswith("jog"):
            await jogged(it, command, 1.5, seen)
        else:
            await it.done(command, confirmed=True)
            await watched(it, 2, seen)
        if paused:  # on its way it brakes first
            assert (way <= 0) == (max(seen) - began < 100) and (way >= 0) == (began - min(seen) < 100), (began, seen)
        if command.startswith("jog"):
            assert way * (seen[-1] - began) > 5_000, "it went where it was held"
            await it.until(lambda: over(it))
            let_go = it.drive.actual
            await asyncio.sleep(3)
            assert it.drive.actual == pytest.approx(let_go, abs=40) and it.drive.positioner.task is Task.NONE
        elif command == "enable":
            assert it.drive.positioner.task is Task.MDI and (it.drive.actual > began + 5_000) == (not paused)


async def test_an_axis_that_has_arrived_jogs() -> None:
    async with pump("memory", Axis, p2585=-6000, p2586=6000) as it:
        await it.done("enable")
        await it.moved("move_absolute", "300")
        seen = [it.drive.actual]
        await jogged(it, "jog_minus", 1.0, seen)
        assert it.drive.actual < 295_000
        await it.until(lambda: over(it))


async def jogged(it: Axis, command: str, seconds: float, seen: list[float]) -> None:
    """A button held for so long; where the axis was meanwhile [LU]."""
    lease = await it.gate.hold.arm(ANA, "a1", command, nonce=it.gate.nonces.issue(ANA.session))
    for counter in range(1, round(10 * seconds) + 1):
        it.gate.hold.keep_alive(lease, counter, ANA.session)
        await watched(it, 0.1, seen)
    it.gate.hold.release(lease, ANA.session)


async def watched(it: Axis, seconds: float, seen: list[float]) -> None:
    """Where the axis is for so long [LU]."""
    for _ in range(round(100 * seconds)):
        await asyncio.sleep(0.01)
        seen.append(it.drive.actual)
