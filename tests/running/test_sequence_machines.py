"""A sequence orders every kind of machine: what its action means, when it is done, how it stands still and ends."""

import asyncio
from dataclasses import replace
from pathlib import Path

import pytest

from app.blocks.sequence import Cause, SequenceState
from app.sim.epos.training import REG_INTERLOCK
from app.sim.sequence.program import VirtualSequence
from tests.running.test_sequence_orders import ANA, Hall, by_ana, hall

LINKS = '[plant]\nname = "Yard"\ntimezone = "UTC"\n[links.all]\ntransport = "memory"\n'
SEQUENCE = '[equipment.seq1]\ntype = "sequence"\nlink = "all"\nunit = 21\ndefinition = "work"\n'
CRANE = '[equipment.cr1]\ntype = "crane"\nlink = "all"\nunit = 30\n'
DRIVE = '[equipment.d1]\ntype = "sinamics"\nlink = "all"\nunit = 5\n'
COIL = '[equipment.cc1]\ntype = "coil_car"\nlink = "all"\nunit = 20\nsimulation = { growth = 300, automatic_winding = 0 }\n'
AXIS = '[equipment.a1]\ntype = "epos"\nlink = "all"\nunit = 40\n'
CHILD = '[equipment.seq2]\ntype = "sequence"\nlink = "all"\nunit = 22\ndefinition = "child"\n'


def step(key: str, *orders: str, minimum: float = 0.1, maximum: float = 900) -> str:
    """A step with orders `machine.action(name = value, …)`."""
    text = f'[[steps]]\nkey = "{key}"\nlabel = "{key}"\nminimum = {minimum}\nmaximum = {maximum}\n'
    for order in orders:
        name, _, values = order.rstrip(")").partition("(")
        machine, _, action = name.partition(".")
        text += f'[[steps.orders]]\nmachine = "{machine}"\naction = "{action}"\nvalues = {{ {values} }}\n'
    return text


def file(*steps: str, head: str = "") -> str:
    return f'[sequence]\nlabel = "Work"\nstall_after = 5\n{head}' + "".join(steps)


def child(plant: Hall) -> VirtualSequence:
    found = plant.runtime.sim.devices["seq2"] if plant.runtime.sim else None
    assert isinstance(found, VirtualSequence)
    return found


def commands(plant: Hall, machine: str) -> list[tuple[str, str]]:
    return [one[:2] for one in plant.outcomes(machine)]


@pytest.mark.sweep(8)
async def test_a_drive_turns_both_ways_and_stops(tmp_path: Path) -> None:
    work = file(
        step("out", "d1.run_forward(setpoint = 50)", minimum=20),
        step("back", "d1.run_reverse(setpoint = 20)", minimum=20),
        step("rest", "d1.stop"),
    )
    async with hall(tmp_path, work, LINKS + DRIVE + SEQUENCE) as plant:
        await plant.started()
        await plant.until(lambda: (plant.value("d1.speed") or 0) > 740)
        await plant.until(lambda: (plant.value("d1.speed") or 0) < -290)
        await plant.until(lambda: plant.state is SequenceState.DONE)
        assert abs(plant.value("d1.speed")) <= 30
        assert {state for _, state in commands(plant, "d1")} == {"confirmed"}


@pytest.mark.sweep(8)
async def test_an_axis_stands_at_its_target_before_the_next_step_begins(tmp_path: Path) -> None:
    work = file(
        step("power", "a1.enable"),
        step("there", "a1.move_to(target = 300, velocity = 6000)"),
        step("back", "a1.move_to(target = 20, velocity = 6000)"),
        step("rest", "a1.stop"),
    )
    async with hall(tmp_path, work, LINKS + AXIS + SEQUENCE) as plant:
        await plant.started()
        await plant.until(lambda: plant.device.block.step == 3)
        assert plant.value("a1.position") == pytest.approx(300, abs=0.5)
        await plant.until(lambda: plant.state is SequenceState.DONE)
        assert plant.value("a1.position") == pytest.approx(20, abs=0.5)
        assert plant.value("a1.zsw1_operation_enabled") == 0


@pytest.mark.sweep(8)
async def test_a_move_that_is_suspended_goes_on_to_its_target_and_is_not_given_again(tmp_path: Path) -> None:
    work = file(step("power", "a1.enable"), step("there", "a1.move_to(target = 790, velocity = 3000)"))
    async with hall(tmp_path, work, LINKS + AXIS + SEQUENCE) as plant:
        await plant.started()
        await plant.until(lambda: (plant.value("a1.position") or 0) > 450)
        plant.ask(2)
        await plant.until(lambda: plant.value("a1.zsw1_drive_stopped") == 1 and plant.value("a1.speed") == 0)
        stood = plant.value("a1.position")
        await asyncio.sleep(5)
        assert 450 < stood < 780 and plant.value("a1.position") == pytest.approx(stood, abs=0.5)
        plant.ask(3)
        await plant.until(lambda: plant.state is SequenceState.DONE)
        assert plant.value("a1.position") == pytest.approx(790, abs=0.5)
        given = [key for key, _ in commands(plant, "a1")]
        assert given.count("move_absolute") == 1 and given[-2:] == ["intermediate_stop", "resume"]


@pytest.mark.sweep(8)
async def test_a_suspend_that_is_taken_back_before_the_machine_stands_is_followed_by_its_resume(tmp_path: Path) -> None:
    work = file(step("power", "a1.enable"), step("there", "a1.move_to(target = 790, velocity = 3000)"))
    async with hall(tmp_path, work, LINKS + AXIS + SEQUENCE) as plant:
        await plant.started()
        await plant.until(lambda: (plant.value("a1.position") or 0) > 450)
        plant.ask(2)
        await plant.until(lambda: plant.state is SequenceState.SUSPENDED)
        plant.ask(3)
        await plant.until(lambda: plant.state is SequenceState.DONE)
        assert plant.value("a1.position") == pytest.approx(790, abs=0.5)
        given = [key for key, _ in commands(plant, "a1")]
        assert given.count("move_absolute") == 1 and given[-2:] == ["intermediate_stop", "resume"]


@pytest.mark.sweep(8)
async def test_an_abort_while_suspended_forgets_what_stood_so_that_a_safe_step_can_be_suspended(tmp_path: Path) -> None:
    work = file(
        step("power", "a1.enable"),
        step("there", "a1.move_to(target = 790, velocity = 3000)"),
        step("park", "a1.enable", "a1.move_to(target = 20, velocity = 1500)"),
        head='abort_to = "park"\n',
    )
    async with hall(tmp_path, work, LINKS + AXIS + SEQUENCE) as plant:
        await plant.started()
        await plant.until(lambda: (plant.value("a1.position") or 0) > 450)
        plant.ask(2)
        await plant.until(lambda: plant.value("a1.zsw1_drive_stopped") == 1 and plant.value("a1.speed") == 0)
        stood = plant.value("a1.position")
        plant.ask(4)
        await plant.until(lambda: plant.device.block.safe and plant.state is SequenceState.SUSPENDED)
        plant.ask(3)
        await plant.until(lambda: plant.device.block.safe and (plant.value("a1.position") or 999) < stood - 20)
        plant.ask(2)
        await plant.until(lambda: plant.state is SequenceState.SUSPENDED)
        await asyncio.sleep(3)
        stood = plant.value("a1.position")
        await asyncio.sleep(5)
        assert stood > 30 and plant.value("a1.position") == pytest.approx(stood, abs=0.5), "it stands as the run does"
        plant.ask(3)
        await plant.until(lambda: plant.state is SequenceState.ABORTED)
        assert plant.value("a1.position") == pytest.approx(20, abs=0.5)


@pytest.mark.sweep(8)
async def test_a_suspended_machine_that_never_stands_is_stopped_and_its_order_given_again(tmp_path: Path) -> None:
    work = file(step("power", "a1.enable"), step("there", "a1.move_to(target = 790, velocity = 3000)"))
    async with hall(tmp_path, work, LINKS + AXIS + SEQUENCE) as plant:
        desk = plant.runtime.desks.of("seq1")
        assert desk
        axis = desk._plant.equipment["a1"]
        move = replace(axis.type.orders["move_to"], stands="zsw1_operation_enabled > 1")
        axis = replace(axis, type=replace(axis.type, orders={**axis.type.orders, "move_to": move}))
        desk._plant = replace(desk._plant, equipment={**desk._plant.equipment, "a1": axis})
        await plant.started()
        await plant.until(lambda: (plant.value("a1.position") or 0) > 450)
        plant.ask(2)
        await plant.until(lambda: ("stop", "confirmed") in commands(plant, "a1"), 70)
        plant.ask(3)
        await plant.until(lambda: plant.state is SequenceState.DONE)
        assert plant.value("a1.position") == pytest.approx(790, abs=0.5)
        assert [key for key, _ in commands(plant, "a1")].count("move_absolute") == 2


@pytest.mark.sweep(8)
async def test_a_suspend_right_after_the_end_of_a_run_does_not_take_its_stop_back(tmp_path: Path) -> None:
    work = file(step("turn", "d1.run_forward(setpoint = 50)", minimum=600))
    async with hall(tmp_path, work, LINKS + DRIVE + SEQUENCE) as plant:
        await plant.started()
        await plant.until(lambda: (plant.value("d1.speed") or 0) > 700)
        desk = plant.runtime.desks.of("seq1")
        assert desk
        stop, stopped = desk._stop, list[str]()

        async def slow(machine: str) -> None:
            await asyncio.sleep(0.5)
            await stop(machine)
            stopped.append(machine)

        desk._stop = slow
        desk.stop()
        desk.give(plant.device.definition.steps[0].orders)
        await asyncio.sleep(0.1)
        desk.suspend()
        await asyncio.sleep(30)
        assert stopped == ["d1"] and abs(plant.value("d1.speed")) <= 30


@pytest.mark.sweep(8)
async def test_an_axis_that_loses_its_enable_ends_the_order_and_the_sequence_says_so(tmp_path: Path) -> None:
    work = file(step("power", "a1.enable"), step("there", "a1.move_to(target = 790, velocity = 3000)"))
    async with hall(tmp_path, work, LINKS + AXIS + SEQUENCE) as plant:
        await plant.started()
        await plant.until(lambda: (plant.value("a1.position") or 0) > 450)
        await plant.until(lambda: ("move_absolute", "confirmed") in commands(plant, "a1"))
        assert plant.runtime.sim
        plant.runtime.sim.devices["a1"].write(16, REG_INTERLOCK, [1])
        await plant.until(lambda: plant.state is SequenceState.ABORTED)
        assert plant.failure and plant.failure[:2] == (1, "why.order_ended")


async def taken_by_ana(plant: Hall, machine: str) -> None:
    """Ana asks for the control of a machine, and nobody refuses in time."""
    gate = plant.runtime.gate
    assert gate
    gate.control._rights = lambda person: person
    gate.control.request(ANA, machine)
    await asyncio.sleep(11)


@pytest.mark.sweep(8)
async def test_an_axis_that_a_person_sends_elsewhere_meanwhile_is_not_where_the_run_wanted_it(tmp_path: Path) -> None:
    work = file(step("power", "a1.enable"), step("there", "a1.move_to(target = 790, velocity = 600)"))
    async with hall(tmp_path, work, LINKS + AXIS + SEQUENCE) as plant:
        await plant.started()
        await plant.until(lambda: ("move_absolute", "confirmed") in commands(plant, "a1"))
        await taken_by_ana(plant, "a1")
        await by_ana(plant, "a1", "set_target", argument=550.0)
        await by_ana(plant, "a1", "set_velocity", argument=6000.0)
        await by_ana(plant, "a1", "move_absolute")
        await asyncio.sleep(10)
        assert plant.state is SequenceState.ABORTED
        assert plant.failure and plant.failure[1] == "why.superseded" and plant.failure[2]["display"] == "Ana Kos"
        assert plant.value("a1.position") == pytest.approx(550, abs=0.5)
        assert plant.value("a1.zsw1_operation_enabled") == 1, "it is hers, and nobody stopped it"


@pytest.mark.sweep(8)
@pytest.mark.parametrize("command", ["move_relative", "run_blocks", "reject_task"])
async def test_an_axis_that_a_person_gives_another_task_has_not_done_that_of_the_run(
    tmp_path: Path, command: str
) -> None:
    work = file(
        step("power", "a1.enable"), step("there", "a1.move_to(target = 790, velocity = 600)"), step("next", "a1.enable")
    )
    async with hall(tmp_path, work, LINKS + AXIS + SEQUENCE) as plant:
        await plant.started()
        await plant.until(lambda: ("move_absolute", "confirmed") in commands(plant, "a1"))
        await taken_by_ana(plant, "a1")
        await by_ana(plant, "a1", "set_target", argument=-5.0)
        await by_ana(plant, "a1", command)
        await asyncio.sleep(10)
        assert plant.state is SequenceState.ABORTED and plant.failure and plant.failure[1] == "why.order_ended"
        assert commands(plant, "a1")[-1] == (command, "confirmed"), "it is hers, and nobody stopped it"


@pytest.mark.sweep(20)
async def test_a_crane_carries_a_ladle_and_stands_while_the_sequence_does(tmp_path: Path) -> None:
    work = file(
        step("ready", "cr1.select_automatic"),
        step("carry", "cr1.carry(from = 1, to = 2, planned = 250)", maximum=3600),
    )
    async with hall(tmp_path, work, LINKS + CRANE + "simulation = { ladle = 250 }\n" + SEQUENCE) as plant:
        await plant.started()
        await plant.until(lambda: plant.value("cr1.moving") == 1)
        await asyncio.sleep(5)
        plant.ask(2)
        await plant.until(lambda: plant.value("cr1.step_state") == 3 and plant.value("cr1.moving") == 0)
        plant.ask(3)
        await plant.until(lambda: plant.state is SequenceState.RUNNING)
        await plant.until(lambda: plant.value("cr1.step_state") == 2 or plant.state is not SequenceState.RUNNING, 600)
        gate = plant.runtime.gate
        desk = plant.runtime.desks.of("seq1")
        assert gate and desk and plant.state is SequenceState.RUNNING, plant.failure
        nonce = gate.nonces.issue(desk.person.session)
        await gate.ask(desk.person, "cr1", "confirm_weight", arguments={"weight": 250.0}, nonce=nonce, confirmed=True)
        await plant.until(lambda: plant.state is not SequenceState.RUNNING, 900)
        assert (plant.state, plant.value("cr1.ladle_stand")) == (SequenceState.DONE, 2), plant.failure
        assert [key for key, _ in commands(plant, "cr1")].count("start_cycle") == 1


@pytest.mark.sweep(8)
async def test_a_stopped_sequence_stops_the_crane_and_leaves_its_cycle_to_a_person(tmp_path: Path) -> None:
    work = file(step("ready", "cr1.select_automatic"), step("carry", "cr1.carry(from = 1, to = 2, planned = 250)"))
    async with hall(tmp_path, work, LINKS + CRANE + SEQUENCE) as plant:
        await plant.started()
        await plant.until(lambda: plant.value("cr1.moving") == 1)
        plant.ask(4)
        await plant.until(lambda: plant.value("cr1.moving") == 0 and plant.value("cr1.mode") == 0)
        assert plant.state is SequenceState.ABORTED and plant.value("cr1.cycle_open") == 1


async def test_a_coil_is_wound_to_its_end_before_the_next_step(tmp_path: Path) -> None:
    work = file(
        step("ready", "cc1.select_automatic", "cc1.select_target(saddle = 2)"),
        step("wind", "cc1.wind", maximum=600),
        step("rest", "cc1.stop"),
    )
    async with hall(tmp_path, work, LINKS + COIL + SEQUENCE) as plant:
        await plant.started()
        await plant.until(lambda: plant.value("cc1.winding") == 1)
        assert plant.device.block.step == 2 and plant.value("cc1.target_saddle") == 2
        await plant.until(lambda: plant.device.block.step == 3 or plant.state is not SequenceState.RUNNING, 300)
        assert plant.value("cc1.coil_ready") == 1
        await plant.until(lambda: plant.state is SequenceState.DONE)


@pytest.mark.sweep(8)
async def test_a_sequence_runs_another_and_waits_for_its_end(tmp_path: Path) -> None:
    work = file(step("call", "seq2.run"), step("after"))
    other = file(step("a", "d1.run_forward(setpoint = 50)", minimum=5), step("b", "d1.stop"))
    async with hall(tmp_path, work, LINKS + DRIVE + SEQUENCE + CHILD, {"child": other}) as plant:
        for runs in (1, 2):  # the second one begins where the state of the first still says done
            await plant.started()
            await plant.until(lambda: child(plant).block.running)
            await plant.until(lambda: plant.device.block.step == 2 or plant.state is SequenceState.DONE)
            assert child(plant).state is SequenceState.DONE and child(plant).runs.done == runs
            await plant.until(lambda: plant.state is SequenceState.DONE)
            assert plant.device.runs.last > 5


@pytest.mark.sweep(8)
async def test_suspend_resume_and_abort_are_passed_on_and_the_end_of_the_other_comes_back(tmp_path: Path) -> None:
    work = file(step("call", "seq2.run"), step("after"))
    other = file(step("a", "d1.run_forward(setpoint = 50)", minimum=60), step("b", "d1.stop"))
    async with hall(tmp_path, work, LINKS + DRIVE + SEQUENCE + CHILD, {"child": other}) as plant:
        await plant.started()
        await plant.until(lambda: (plant.value("d1.speed") or 0) > 700)
        plant.ask(2)
        await plant.until(lambda: child(plant).state is SequenceState.SUSPENDED and abs(plant.value("d1.speed")) < 31)
        plant.ask(3)
        await plant.until(lambda: child(plant).state is SequenceState.RUNNING and plant.value("d1.speed") > 700)
        assert child(plant).runs.aborted == 0
        plant.ask(4)
        await plant.until(lambda: child(plant).state is SequenceState.ABORTED and abs(plant.value("d1.speed")) < 31)
        assert commands(plant, "seq2")[-1] == ("abort", "confirmed")

        child(plant).operator.ask("acknowledge")
        plant.ask(5)
        await plant.until(lambda: plant.state is SequenceState.IDLE and child(plant).state is SequenceState.IDLE)
        await asyncio.sleep(2)
        await plant.started()
        await plant.until(lambda: child(plant).block.running)
        child(plant).operator.ask("abort")
        await plant.until(lambda: plant.state is SequenceState.ABORTED)
        out = plant.device.block.first_out
        assert out and out.cause is Cause.COMMAND and plant.failure and plant.failure[1] == "why.order_ended"


@pytest.mark.sweep(8)
async def test_machines_work_in_paths_side_by_side_in_a_loop_and_an_abort_leads_to_the_safe_step(
    tmp_path: Path,
) -> None:
    steps = (
        step("begin"),
        step("turn", "d1.run_forward(setpoint = 40)", minimum=3),
        step("rest", "d1.stop"),
        step("move", "a1.enable", "a1.move_to(target = 500, velocity = 6000)"),
        step("meet", minimum=0.5),
        step("park", "a1.enable", "a1.move_to(target = 100, velocity = 6000)"),
    )
    ways = '[[branches]]\nafter = "begin"\ntake = "all"\npaths = ["turn", "move"]\nthen = "meet"\n'
    ways += '[[loops]]\nfrom = "begin"\nto = "meet"\ntimes = 2\n'
    work = file(*steps, ways, head='abort_to = "park"\n')
    async with hall(tmp_path, work, LINKS + DRIVE + AXIS + SEQUENCE) as plant:
        await plant.started()
        await plant.until(lambda: plant.device.block.active == (2, 4))
        await plant.until(lambda: plant.state is SequenceState.DONE, 120)
        given = [key for key, _ in commands(plant, "d1")]
        assert given.count("forward") == given.count("stop") == 2, "two passages, each order once"
        assert plant.value("a1.position") == pytest.approx(500, abs=0.5), "no safe step without an abort"

        await plant.started()
        await plant.until(lambda: plant.device.block.active == (2, 4) and (plant.value("d1.speed") or 0) > 500)
        plant.ask(4)
        await plant.until(lambda: plant.device.block.safe)
        await plant.until(lambda: plant.value("seq1.aborting") == 1)
        await plant.until(lambda: plant.state is SequenceState.ABORTED)
        assert plant.value("a1.position") == pytest.approx(100, abs=0.5), plant.failure
        assert abs(plant.value("d1.speed")) < 31
        assert (plant.device.runs.done, plant.device.runs.aborted) == (1, 1)


VALUES = (
    '[[recipe]]\nkey = "hold"\nlabel = "Hold"\nunit = "s"\nminimum = 1\nmaximum = 20\ndefault = 5\n'
    '[[recipe]]\nkey = "count"\nlabel = "Count"\ndecimals = 0\nminimum = 1\nmaximum = 9\ndefault = 2\n'
)
COUNTED = '[[loops]]\nfrom = "a"\nto = "a"\ntimes = "recipe.count"\n'


@pytest.mark.sweep(8)
async def test_a_sequence_that_is_started_by_another_one_gets_the_values_that_it_is_given(tmp_path: Path) -> None:
    work = file(
        step("call", 'seq2.run(hold = "recipe.long", count = 3)'), step("again", "seq2.run(count = 1)"),
        VALUES.replace("hold", "long"),
    )  # fmt: skip
    other = file(step("a"), VALUES + COUNTED).replace("minimum = 0.1", 'minimum = "recipe.hold"')
    async with hall(tmp_path, work, LINKS + SEQUENCE + CHILD, {"child": other}) as plant:
        await plant.started(1.3, 4)
        await plant.until(lambda: child(plant).block.running)
        assert child(plant).recipe.values == (1.3, 3.0), "its own value, and a number; not its last ones"
        await plant.until(lambda: plant.device.block.step == 2)
        assert child(plant).block.times[0].runs == 3
        await plant.until(lambda: child(plant).recipe.values == (1.3, 1.0), 5)
        await plant.until(lambda: plant.state is SequenceState.DONE)
        assert child(plant).block.times[0].runs == 4


async def test_what_the_other_one_does_not_take_any_more_is_refused_at_its_start(tmp_path: Path) -> None:
    """The plant is read before it runs; what a device was taught since is the gate's and its own affair."""
    work = file(step("call", "seq2.run(hold = 18)"))
    other = file(step("a"), VALUES)
    async with hall(tmp_path, work, LINKS + SEQUENCE + CHILD, {"child": other}) as plant:
        declared = child(plant).recipe._declared
        child(plant).recipe._declared = (replace(declared[0], high=10.0), declared[1])
        await plant.started()
        await plant.until(lambda: plant.state is SequenceState.ABORTED)
        assert not child(plant).block.running and child(plant).recipe.values == (5.0, 2.0)
        assert plant.failure and plant.failure[0] == 1
