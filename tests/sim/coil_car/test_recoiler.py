"""The recoiler winds the next coil."""

import pytest

from app.sim.coil_car.register_map import (
    CoilCarCommand,
    CoilCarEvent,
)
from tests.sim.coil_car.bench import DONE, line, run, value


def test_the_recoiler_winds_the_next_coil_by_itself_in_automatic() -> None:
    car, talker = line(start="automatic")
    run(car, 40)
    assert value(car, "coil_ready") == 1 and value(car, "coil_diameter") == pytest.approx(1300, abs=0.5)
    assert value(car, "coils_wound") == 1
    assert [code for code, _ in talker.codes()] == [CoilCarEvent.WINDING, CoilCarEvent.COIL_READY]
    car, _ = line(start="automatic", settings={"automatic_winding": 0.0})
    run(car, 5)
    assert value(car, "coil_on_mandrel") == 0


def test_winding_on_command_stops_and_goes_on() -> None:
    car, talker = line()
    assert talker.ask(CoilCarCommand.WIND).state == DONE
    run(car, 5)
    assert talker.ask(CoilCarCommand.STOP_WINDING).state == DONE
    diameter = value(car, "coil_diameter")
    assert 600 < diameter < 1300 and value(car, "coil_ready") == 0
    run(car, 2)
    assert value(car, "coil_diameter") == diameter
    talker.ask(CoilCarCommand.WIND)
    run(car, 40)
    assert value(car, "coil_ready") == 1
    told = [code for code, _ in talker.codes()]
    assert told == [CoilCarEvent.WINDING, CoilCarEvent.WINDING_STOPPED, CoilCarEvent.WINDING, CoilCarEvent.COIL_READY]


def test_automatic_goes_on_with_a_coil_that_was_not_finished_unless_told_to_stop() -> None:
    car, talker = line(start="automatic")
    run(car, 2)
    talker.ask(CoilCarCommand.STOP_WINDING)
    run(car, 2)
    assert value(car, "winding") == 0
    talker.ask(CoilCarCommand.STOP)
    run(car, 1)
    talker.ask(CoilCarCommand.AUTOMATIC)
    run(car, 1)
    assert value(car, "winding") == 1 and value(car, "coil_diameter") > 640
    talker.ask(CoilCarCommand.STOP)
    assert value(car, "winding") == 0
