"""One unit of a line: what is read of it, which blocks hold which points, and what stays over a new plan."""

from itertools import count
from math import inf

from app.links.station import Station, spans_of
from app.plant.definitions import Device, Equipment, Link, Scan
from app.tags.quality import HALTED, Origin
from tests.links.devices import QUICK, machine, point, row


def station(*equipment: Equipment, **link: object) -> Station:
    numbers = count()
    made = Station(Link("hall", "tcp", **link), 1, equipment, "link.hall", lambda: next(numbers))  # type: ignore[arg-type]
    made.plan()
    return made


def test_the_blocks_of_a_point_and_those_around_a_register() -> None:
    points = [point("m", "a", 0), point("m", "b", 200, Scan.SLOW), point("m", "c", 201, Scan.ONCE)]
    unit = station(machine("m", 1, points, QUICK))
    assert [block.block.address for block in unit.covering(["m.a", "m.nothing"])] == [0]
    assert unit.covering(["m.b", "m.b"]) == unit.around(3, 200, 200)
    assert unit.around(3, 5, 100) == unit.around(4, 0, 300) == []
    assert spans_of(points[1:]) == [(200, 200), (201, 201)]


def test_a_plan_that_is_made_anew_keeps_the_blocks_that_stay() -> None:
    unit = station(row("m", 1, 3, QUICK))
    (before,) = unit.blocks
    assert unit.plan() == [] and unit.blocks == [before]
    unit.equipment = [row("m", 1, 3, QUICK), machine("n", 1, [point("n", "a", 300)], QUICK)]
    assert unit.plan() == [] and unit.blocks[0] is before and len(unit.blocks) == 2
    unit.equipment = unit.equipment[1:]
    assert unit.plan() == [before]


def test_each_kind_of_scan_has_its_period() -> None:
    points = [point("m", scan.name.lower(), 200 * n, scan) for n, scan in enumerate(Scan)]
    for link, fast, slow in ({}, 0.02, 0.1), ({"fast": 0.5, "slow": 3.0}, 0.5, 3.0):  # type: ignore[var-annotated]
        unit = station(machine("m", 1, points, QUICK), **link)
        periods = {block.scan: block.period for block in unit.blocks}
        assert periods == {Scan.FAST: fast, Scan.SLOW: slow, Scan.PAGE: slow, Scan.ONCE: inf}


def test_it_waits_as_long_as_its_slowest_machine_needs_or_the_link_says() -> None:
    items = [row("a", 1, 1, Device(timeout=0.2)), row("b", 1, 1, Device(timeout=0.7))]
    assert station(*items).timeout == 0.7
    assert station(*items, timeout=0.1).timeout == 0.1


def test_what_says_that_it_is_simulated_shows_it_and_counts_only_where_the_plant_file_believes_it() -> None:
    for believe in (False, True):
        unit = station(row("m", 1, 1), believe_simulated=believe)
        assert not unit.simulated and unit.origin == 0
        unit.marked = True
        assert unit.simulated is believe and unit.origin == Origin.SIMULATED
    unit.halted = True
    assert unit.basis == HALTED | Origin.SIMULATED


def test_it_is_asked_for_a_register_that_it_has() -> None:
    assert station(row("m", 1, 3)).probe().address == 0
    assert station(machine("m", 1, [point("m", "a", 0x1000)])).probe().address == 0x1000
    assert station(machine("m", 1, [])).probe().address == 0
