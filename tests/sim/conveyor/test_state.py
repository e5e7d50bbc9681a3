"""The state word of the conveyor: what is worse hides what is better."""

import pytest

from app.blocks.mode_control import Mode
from app.blocks.product_tracking import Code, TrackingEvent
from app.sim.conveyor.register_map import ConveyorState
from tests.sim.conveyor.bench import line

WORST_FIRST = [
    ("held", ConveyorState.EMERGENCY_STOP),
    ("faulty", ConveyorState.FAULT),
    ("gap_stop", ConveyorState.GAP),
    ("stopping", ConveyorState.STOPPING),
]


@pytest.mark.parametrize("first", range(len(WORST_FIRST)))
@pytest.mark.parametrize("mode", list(Mode))
def test_the_worst_of_what_holds_the_line_is_its_state(first: int, mode: Mode) -> None:
    device = line().device
    device.modes.mode = mode
    for name, _ in WORST_FIRST[first:]:
        setattr(device.tracking if name == "gap_stop" else device, name, True)
    assert device.state == WORST_FIRST[first][1]
    assert device.stop_active == any(name != "gap_stop" for name, _ in WORST_FIRST[first:])


@pytest.mark.parametrize(
    ("moving", "direction", "state"),
    [
        (False, 0, ConveyorState.STOPPED),
        (False, 1, ConveyorState.STOPPED),
        (True, 0, ConveyorState.STOPPING),
        (True, -1, ConveyorState.MANUAL),
    ],
)
def test_in_manual_only_who_drives_it_makes_it_manual(moving: bool, direction: int, state: ConveyorState) -> None:
    device = line().device
    device.modes.mode, device.moving, device.direction = Mode.MANUAL, moving, direction
    assert device.state == state


def test_in_automatic_a_belt_that_waits_makes_it_wait() -> None:
    device = line().device
    device.modes.mode = Mode.AUTOMATIC
    assert device.state == ConveyorState.STOPPED, "it is not started"
    device.modes.running = True
    for belt in device.belts:
        belt.target = 40.0
    assert device.state == ConveyorState.AUTOMATIC
    device.belts[1].target = 0.0
    assert device.state == ConveyorState.WAITING


async def test_what_tracking_tells_is_in_the_ring_as_it_was_told() -> None:
    on = line()
    await on.fetch()
    event = TrackingEvent(Code.HEAD_AT_SENSOR, id=7, source=2, value=1.5, second=9, value2=2.5)
    for told in (event, event._replace(id=8)):
        on.device.report(told)
    on.step()
    assert [(one.code, one.source, one.value, one.snapshot[1]) for one in await on.fetch()] == [
        (3, 2, 1.5, 7),
        (3, 2, 1.5, 8),
    ]


def test_the_table_gets_another_generation_only_when_its_slots_are_others() -> None:
    device = line().device
    before = device.table.generation
    device.renew_table()
    assert device.table.generation == before
    device.machine.place(300.0, 40.0)
    device.tracking.insert(300.0, 40.0, 0)
    device.renew_table()
    assert device.table.generation == before + 2 and device.table.ids[0] == 1
