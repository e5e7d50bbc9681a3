"""A sequence has a conveyor feed so many products to the end, or one to a sensor; then it stops, and what was read decides it all."""

import asyncio
import random
from contextlib import AsyncExitStack
from pathlib import Path

import pytest

from app.blocks.sequence import Cause, SequenceState
from app.sim.conveyor.program import VirtualConveyor
from app.sim.training import REG_LINE_FAULT, REG_MACHINE_FAULT
from tests.far import far
from tests.running.test_sequence_machines import LINKS, SEQUENCE, commands, file, step
from tests.running.test_sequence_orders import Hall, by_ana, hall

LINE = '[equipment.c1]\ntype = "conveyor"\nlink = "all"\nunit = 11\npreset = "model"\nsimulation = { arrivals = 1, interval = 6 }\n'
PLANT = LINKS + LINE + SEQUENCE


def feeding(*orders: str, maximum: float = 900, head: str = "") -> str:
    """Automatic, then what is to be tried."""
    return file(
        step("ready", "c1.select_automatic"), *(step(f"feed_{n}", one, maximum=maximum) for n, one in enumerate(orders)),
        head=head,
    )  # fmt: skip


def line(plant: Hall) -> VirtualConveyor:
    found = plant.runtime.sim.devices["c1"] if plant.runtime.sim else None
    assert isinstance(found, VirtualConveyor)
    return found


def given(plant: Hall) -> list[str]:
    return [key for key, _ in commands(plant, "c1")]


@pytest.mark.sweep(8)
async def test_so_many_products_leave_and_then_the_line_stands(tmp_path: Path) -> None:
    async with hall(tmp_path, feeding("c1.feed(count = 3)"), PLANT) as plant:
        await plant.started()
        await plant.until(lambda: plant.state is SequenceState.DONE, 600)
        assert line(plant).tracking.unloaded == 3
        assert (plant.value("c1.automatic"), plant.value("c1.moving"), plant.value("c1.mode")) == (0, 0, 1)
        assert commands(plant, "c1") == [(key, "confirmed") for key in ("select_automatic", "start_automatic", "stop")]
        await asyncio.sleep(30)
        assert line(plant).tracking.unloaded == 3, "it stands"


@pytest.mark.sweep(8)
async def test_it_counts_from_when_it_was_given_and_a_second_time_anew(tmp_path: Path) -> None:
    async with hall(tmp_path, feeding("c1.feed(count = 2)", "c1.feed(count = 1)"), PLANT) as plant:
        await plant.started()
        await plant.until(lambda: plant.device.block.step == 3, 600)
        assert line(plant).tracking.unloaded == 2
        await plant.until(lambda: plant.state is SequenceState.DONE, 600)
        assert line(plant).tracking.unloaded == 3


@pytest.mark.sweep(20)
async def test_suspended_the_line_stands_and_resumed_it_feeds_the_rest(tmp_path: Path) -> None:
    async with hall(tmp_path, feeding("c1.feed(count = 3)"), PLANT) as plant:
        await plant.started()
        await plant.until(lambda: line(plant).tracking.unloaded == 2, 600)
        plant.ask(2)
        await plant.until(lambda: plant.value("c1.moving") == 0 and plant.value("c1.automatic") == 0)
        await asyncio.sleep(20)
        assert line(plant).tracking.unloaded == 2 and plant.state is SequenceState.SUSPENDED
        plant.ask(3)
        await plant.until(lambda: plant.state is SequenceState.DONE, 600)
        assert line(plant).tracking.unloaded == 3
        assert given(plant) == ["select_automatic", "start_automatic", "stop", "start_automatic", "stop"]


@pytest.mark.sweep(8)
async def test_suspended_while_it_stops_by_itself_it_is_not_started_again(tmp_path: Path) -> None:
    async with hall(tmp_path, feeding("c1.feed(count = 1)"), PLANT) as plant:
        await plant.started()
        gate = plant.runtime.gate
        await plant.until(lambda: gate and (now := gate.progress("c1")) and now.command == "stop" and not now.over, 600)
        plant.ask(2)
        await plant.until(lambda: plant.state is SequenceState.SUSPENDED)
        await asyncio.sleep(5)
        plant.ask(3)
        await plant.until(lambda: plant.state is SequenceState.DONE)
        assert given(plant).count("start_automatic") == 1 and plant.value("c1.moving") == 0


@pytest.mark.sweep(20)
async def test_a_line_that_has_fed_is_not_started_again_by_a_later_resume(tmp_path: Path) -> None:
    work = feeding("c1.feed(count = 1)") + step("wait", minimum=60)
    async with hall(tmp_path, work, PLANT) as plant:
        await plant.started()
        await plant.until(lambda: plant.device.block.step == 3, 600)
        plant.ask(2)
        await plant.until(lambda: plant.state is SequenceState.SUSPENDED)
        plant.ask(3)
        await plant.until(lambda: plant.state is SequenceState.DONE, 120)
        assert given(plant) == ["select_automatic", "start_automatic", "stop"] and plant.value("c1.moving") == 0


@pytest.mark.sweep(8)
async def test_an_abort_in_the_middle_stops_the_line(tmp_path: Path) -> None:
    async with hall(tmp_path, feeding("c1.feed(count = 3)"), PLANT) as plant:
        await plant.started()
        await plant.until(lambda: line(plant).tracking.unloaded == 1, 600)
        plant.ask(4)
        await plant.until(lambda: plant.value("c1.moving") == 0 and plant.value("c1.automatic") == 0)
        assert plant.state is SequenceState.ABORTED and plant.runtime.gate
        assert plant.runtime.gate.control.holder("c1") is None


@pytest.mark.sweep(8)
async def test_without_products_the_greatest_time_of_the_step_ends_it_and_the_line_stands(tmp_path: Path) -> None:
    work = feeding("c1.feed(count = 1)", maximum=40)
    async with hall(tmp_path, work, PLANT.replace("arrivals = 1", "arrivals = 0")) as plant:
        await plant.started()
        await plant.until(lambda: plant.value("c1.automatic") == 1)
        await plant.until(lambda: plant.state is SequenceState.TIMED_OUT, 60)
        await plant.until(lambda: plant.value("c1.moving") == 0 and plant.value("c1.automatic") == 0)


@pytest.mark.sweep(8)
async def test_a_product_that_was_not_there_to_be_taken_is_not_counted(tmp_path: Path) -> None:
    """For one scan the counter says that it was discharged; then the PLC finds nothing and takes it back."""
    async with hall(tmp_path, feeding("c1.feed(count = 1)"), PLANT) as plant:
        await plant.started()
        await plant.until(lambda: plant.value("c1.area_4") == 1, 600)
        line(plant).write(16, 0xE025, [1])
        await plant.until(lambda: plant.state is SequenceState.DONE, 600)
        assert (line(plant).tracking.unloaded, line(plant).tracking.lost) == (1, 1)


@pytest.mark.sweep(8)
async def test_a_counter_that_is_right_for_one_reading_alone_ends_nothing(tmp_path: Path) -> None:
    async with hall(tmp_path, feeding("c1.feed(count = 5)"), PLANT) as plant:
        await plant.started()
        await plant.until(lambda: line(plant).tracking.unloaded == 1, 600)
        line(plant).tracking.unloaded = 5
        await plant.until(lambda: plant.value("c1.unloaded") == 5)
        line(plant).tracking.unloaded = 1
        await asyncio.sleep(1)
        assert plant.value("c1.unloaded") == 1 and plant.value("c1.automatic") == 1 and given(plant)[-1] != "stop"


@pytest.mark.sweep(8)
async def test_what_stops_the_line_otherwise_ends_the_order_with_its_reason(tmp_path: Path) -> None:
    async with hall(tmp_path, feeding("c1.feed(count = 3)"), PLANT) as plant:
        await plant.started()
        await plant.until(lambda: line(plant).tracking.unloaded == 1, 600)
        line(plant).write(6, REG_MACHINE_FAULT, [50])
        await plant.until(lambda: plant.state is SequenceState.ABORTED)
        out = plant.device.block.first_out
        assert out and (out.cause, out.at_step, out.value) == (Cause.COMMAND, 2, 1.0)
        assert plant.failure and plant.failure[1] == "why.order_ended"


@pytest.mark.sweep(8)
async def test_a_counter_that_goes_back_ends_it(tmp_path: Path) -> None:
    """The PLC was loaded anew: what it counts now says nothing of this order."""
    async with hall(tmp_path, feeding("c1.feed(count = 1)", "c1.feed(count = 3)"), PLANT) as plant:
        await plant.started()
        await plant.until(lambda: plant.device.block.step == 3 and plant.value("c1.automatic") == 1, 600)
        line(plant).tracking.unloaded = 0
        await plant.until(lambda: plant.state is SequenceState.ABORTED)
        assert plant.failure and plant.failure[1] == "why.order_ended"
        await plant.until(lambda: plant.value("c1.moving") == 0)


@pytest.mark.sweep(8)
async def test_a_person_who_stops_the_line_ends_the_run(tmp_path: Path) -> None:
    async with hall(tmp_path, feeding("c1.feed(count = 3)"), PLANT) as plant:
        await plant.started()
        await plant.until(lambda: line(plant).tracking.unloaded == 1, 600)
        await by_ana(plant, "c1", "stop")
        await plant.until(lambda: plant.state is SequenceState.ABORTED)
        assert plant.failure and plant.failure[1:] == (
            "why.superseded",
            {"label": "command.stop", "display": "Ana Kos"},
        )
        await asyncio.sleep(30)
        assert plant.value("c1.automatic") == 0 and line(plant).tracking.unloaded == 1


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("before", "order", "prepare", "reason", "label"),
    [
        ("", "c1.feed(count = 1)", "", "why.condition", "missing.permissive.automatic"),
        ("c1.start", "c1.feed(count = 1)", "", "why.condition", "missing.permissive.standstill"),
        ("", "c1.feed_to_2", "fault", "why.condition", "missing.need.sensor_2"),
        ("", "c1.feed_to_2", "fast", "why.condition", "missing.need.slow_enough"),
    ],
)
async def test_where_the_line_cannot_it_is_refused_with_the_reason(
    tmp_path: Path, before: str, order: str, prepare: str, reason: str, label: str
) -> None:
    ready = ["c1.select_automatic"] if before or prepare else []
    plc = PLANT.replace("interval = 6", "interval = 6, automatic_speed = 100") if prepare == "fast" else PLANT
    work = file(step("ready", *ready, *([before] if before else [])), step("feed", order))
    async with hall(tmp_path, work, plc) as plant:
        if prepare == "fault":
            line(plant).tracking.sensor_faults |= 1 << 1
        await plant.started()
        await plant.until(lambda: plant.state is SequenceState.ABORTED, 30)
        assert plant.failure and plant.failure[1] == reason and plant.failure[2]["label"] == label, plant.failure
        if not before:
            assert given(plant)[-1:] != ["start_automatic"] or commands(plant, "c1")[-1][1] == "refused"
        await plant.until(lambda: plant.value("c1.moving") == 0)


@pytest.mark.sweep(8)
async def test_a_product_is_fed_to_a_sensor_and_the_next_one_is_another(tmp_path: Path) -> None:
    async with hall(tmp_path, feeding("c1.feed_to_1", "c1.feed_to_1"), PLANT) as plant:
        await plant.started()
        await plant.until(lambda: plant.device.block.step == 3, 600)
        first = line(plant).tracking.entered
        assert first <= 1 and plant.value("c1.moving") == 0
        await plant.until(lambda: plant.state is SequenceState.DONE, 600)
        assert plant.value("c1.beam_1") == 1 or line(plant).tracking.entered == 2
        assert given(plant) == ["select_automatic", *["start_automatic", "stop"] * 2]
        assert (plant.value("c1.moving"), plant.value("c1.automatic")) == (0, 0)


@pytest.mark.sweep(8)
async def test_while_the_link_is_lost_nothing_is_believed_and_it_ends_by_what_is_read_again(tmp_path: Path) -> None:
    async with hall(tmp_path, feeding("c1.feed(count = 2)"), PLANT) as plant:
        await plant.started()
        await plant.until(lambda: line(plant).tracking.unloaded == 1, 600)
        line(plant).write(6, REG_LINE_FAULT, [1])
        await plant.until(lambda: line(plant).tracking.unloaded == 4, 600)
        assert plant.state is SequenceState.RUNNING and given(plant)[-1] == "start_automatic"
        line(plant).write(6, REG_LINE_FAULT, [0])
        await plant.until(lambda: plant.state is SequenceState.DONE, 60)
        assert plant.value("c1.unloaded") >= 4 and plant.value("c1.moving") == 0 and plant.value("c1.automatic") == 0


@pytest.mark.sweep(8)
async def test_a_link_that_is_lost_for_longer_than_the_step_may_take_times_it_out_and_the_stop_is_repeated(
    tmp_path: Path,
) -> None:
    async with hall(tmp_path, feeding("c1.feed(count = 5)", maximum=60), PLANT) as plant:
        await plant.started()
        await plant.until(lambda: given(plant)[-1:] == ["start_automatic"])
        line(plant).write(6, REG_LINE_FAULT, [1])
        await plant.until(lambda: plant.state is SequenceState.TIMED_OUT, 90)
        line(plant).write(6, REG_LINE_FAULT, [0])
        await plant.until(lambda: plant.value("c1.moving") == 0 and plant.value("c1.automatic") == 0, 30)


@pytest.mark.sweep(8)
async def test_a_stop_that_nobody_confirms_is_no_end(tmp_path: Path) -> None:
    async with hall(tmp_path, feeding("c1.feed(count = 1)"), PLANT) as plant:
        await plant.started()
        gate = plant.runtime.gate
        await plant.until(lambda: gate and (now := gate.progress("c1")) and now.command == "stop", 600)
        line(plant).write(6, REG_LINE_FAULT, [1])
        await plant.until(lambda: plant.state is SequenceState.ABORTED, 60)
        assert plant.failure and plant.failure[0] == 1


@pytest.mark.sweep(20)
@pytest.mark.parametrize("transport", ["tcp", "rtu"])
async def test_over_a_wire_it_is_the_same(tmp_path: Path, transport: str) -> None:
    away = LINE.replace('"all"', '"far"')
    head = '[plant]\nname = "Yard"\ntimezone = "UTC"\n'
    async with far(tmp_path / "far", transport, head, away) as (link, sim):
        work = feeding("c1.feed(count = 2)", "c1.feed_to_2")
        async with hall(tmp_path, work, LINKS + link + away + SEQUENCE) as plant:
            away_line = sim.devices["c1"]
            assert isinstance(away_line, VirtualConveyor)
            await plant.started()
            await plant.until(lambda: away_line.tracking.unloaded == 1, 600)
            plant.ask(2)
            await plant.until(lambda: plant.value("c1.moving") == 0 and plant.state is SequenceState.SUSPENDED)
            plant.ask(3)
            await plant.until(lambda: plant.device.block.step == 3, 600)
            assert away_line.tracking.unloaded == 2 and not away_line.moving
            await plant.until(lambda: plant.state is SequenceState.DONE, 600)
            assert not away_line.moving and given(plant)[-2:] == ["start_automatic", "stop"]


@pytest.mark.sweep(20)
@pytest.mark.parametrize(
    ("seed", "transport"), [*((seed, "memory") for seed in range(6)), (6, "tcp"), (7, "rtu"), (8, "tcp"), (9, "rtu")]
)
async def test_whatever_happens_it_never_says_that_it_fed_what_it_did_not_and_no_line_is_left_running(
    tmp_path: Path, seed: int, transport: str
) -> None:
    """Suspended, resumed, aborted, the cable pulled, the emergency stop pressed, products taken off, at random times."""
    story = random.Random(seed)
    head = '[plant]\nname = "Yard"\ntimezone = "UTC"\n'
    work = feeding("c1.feed(count = 2)", "c1.feed_to_2", "c1.feed(count = 1)", maximum=240)
    wired = transport != "memory"
    section = LINE.replace('"all"', '"far"') if wired else LINE
    async with AsyncExitStack() as stack:
        link, sim = (
            await stack.enter_async_context(far(tmp_path / "far", transport, head, section)) if wired else ("", None)
        )
        plant = await stack.enter_async_context(hall(tmp_path, work, LINKS + link + section + SEQUENCE))
        device = sim.devices["c1"] if sim else line(plant)
        assert isinstance(device, VirtualConveyor)
        await plant.started()
        wanted, entered = {2: 2, 4: 1}, dict[int, int]()
        step_before, after = 1, 0
        happens = asyncio.get_running_loop().time() + story.uniform(3, 40)
        end = asyncio.get_running_loop().time() + 900
        while plant.state in (SequenceState.RUNNING, SequenceState.SUSPENDED):
            now = asyncio.get_running_loop().time()
            assert now < end, plant.state
            if plant.device.block.step != step_before:
                if step_before in wanted:
                    fed = device.tracking.unloaded - entered[step_before]
                    assert fed >= wanted[step_before], "it says that it has"
                    assert not device.moving and not device.modes.running, "and it stands"
                step_before = plant.device.block.step
                entered[step_before] = device.tracking.unloaded
            if now > happens:
                happens, after = now + story.uniform(0.2, 40), after + 1
                match story.choice(("suspend", "resume", "resume", "cable", "take", "stop" if after > 4 else "resume")):
                    case "suspend":
                        plant.ask(2)
                    case "resume":
                        plant.ask(3)
                    case "cable":
                        device.write(6, REG_LINE_FAULT, [1])
                        await asyncio.sleep(story.uniform(0.2, 6))
                        device.write(6, REG_LINE_FAULT, [0])
                    case "take":
                        device.write(16, 0xE025, [1])
                    case "stop":
                        if story.random() < 0.5:
                            plant.ask(4)
                        else:
                            device.write(6, REG_MACHINE_FAULT, [50])
            await asyncio.sleep(0.05)
        if plant.state is SequenceState.DONE:
            assert device.tracking.unloaded - entered[4] >= 1
        await asyncio.sleep(30)
        assert not device.moving and not device.modes.running, (plant.state, plant.failure)


@pytest.mark.sweep(8)
async def test_the_number_of_products_is_a_value_of_the_run(tmp_path: Path) -> None:
    recipe = '[[recipe]]\nkey = "n"\nlabel = "n"\nminimum = 1\nmaximum = 9\ndefault = 1\ndecimals = 0\n'
    async with hall(tmp_path, feeding('c1.feed(count = "recipe.n")') + recipe, PLANT) as plant:
        await plant.started(2)
        await plant.until(lambda: plant.state is SequenceState.DONE, 600)
        assert line(plant).tracking.unloaded == 2
