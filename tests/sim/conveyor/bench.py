"""A conveyor line, as its tests operate it."""

from app.registers.plc_map import AnswerState, real
from app.sim.conveyor.machine import Geometry
from app.sim.conveyor.program import VirtualConveyor
from app.sim.conveyor.register_map import (
    ConveyorCommand,
)
from tests.sim.conveyor.line import TestLine

QUICK = {"automatic_speed": 60.0, "unload_dwell": 0.2, "restart_delay": 0.2, "acceleration": 200.0, "jerk": 1000.0}


SIMULATION = Geometry(sensors=(150.0, 215.0, 445.0, 560.0), rated_speed=60.0, resolution=1024, intact_is_one=False)


TOLERANCE = 5.0


def line(**options: object) -> TestLine:
    """A quick line; without arrivals unless asked for."""
    given: dict[str, object] = {"arrivals": False, "interval": 2.5, "settings": QUICK, **options}
    return TestLine(VirtualConveyor(**given))  # type: ignore[arg-type]


def running(**options: object) -> TestLine:
    """A line in automatic with products arriving."""
    return line(start="automatic", arrivals=True, **options)


async def put(on: TestLine, head: float, length: float = 30.0) -> int:
    """A product and its record, as an operator puts them; the id."""
    assert on.device.machine.place(head, length)
    answer = await on.order(ConveyorCommand.INSERT, real(head), real(length))
    assert answer.state is AnswerState.DONE, answer
    return answer.detail
