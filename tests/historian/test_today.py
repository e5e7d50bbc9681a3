"""What a machine did in a day: what was seen counts, what was not is said."""

import random
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from zoneinfo import ZoneInfo

import pytest
from sqlalchemy import Connection

from app.clock import local_day, to_micros
from app.historian.store import GAP_AFTER, HOUR, MINUTE, Row, begin_run
from app.historian.today import Amount, counted, read_day
from app.plant.definitions import Derived, Device, Equipment, EquipmentType, Kind, Point
from app.plant.today import Figure, How
from app.registers.register import Register, Type
from app.tags.quality import COMM_FAILURE, GOOD
from tests.historian.conftest import fill
from tests.historian.test_store import fresh, roll_up_all

ZAGREB = ZoneInfo("Europe/Zagreb")
BEGIN, END = local_day(to_micros(datetime(2026, 3, 9, 12, tzinfo=UTC)), ZAGREB)
SECOND = 1_000_000


def points() -> dict[str, Point]:
    kinds = {
        "running": (Kind.BOOL, ""),
        "made": (Kind.STEP, ""),
        "starts": (Kind.STEP, ""),
        "power": (Kind.ANALOG, "kW"),
    }
    made = {
        key: Point(f"m1.{key}", f"m1.{key}", "m1", key, key, kind=kind, unit=unit)
        for key, (kind, unit) in kinds.items()
    }
    return made | {"starts": replace(made["starts"], derived=Derived("starts", "", "running == 1"))}


FIGURES = {
    "running": Figure("running", How.TIME, of="running"),
    "made": Figure("made", How.COUNT, of="made"),
    "starts": Figure("starts", How.COUNT, of="starts"),
    "energy": Figure("energy", How.ENERGY, of="power"),
}


def machine() -> Equipment:
    kind = EquipmentType(
        "press", Path(), "type", Device(), {}, {}, (), (), {}, (), {}, today=FIGURES
    )  # fmt: skip
    return Equipment("m1", kind, "hall", 1, {}, "", points(), ())


def every(number: int, begin: int, end: int, value: float, step: int = 5 * MINUTE) -> list[Row]:
    """A value that holds, as a recorder stores it."""
    return [(number, time, value, None, GOOD) for time in range(begin, end, step)]


def stored(connection: Connection, rows: list[Row], alive: int) -> None:
    fill(connection, rows, *points().values(), alive=alive)


def test_running_time_counts_and_energy_are_those_that_were_recorded() -> None:
    now = BEGIN + 6 * HOUR
    rows = every(1, BEGIN - MINUTE, BEGIN + 4 * HOUR, 0) + every(1, BEGIN + 4 * HOUR, now, 1)
    rows += every(2, BEGIN - MINUTE, BEGIN + 5 * HOUR, 100) + every(2, BEGIN + 5 * HOUR, now, 107)
    rows += every(3, BEGIN - MINUTE, BEGIN + 4 * HOUR, 3) + every(3, BEGIN + 4 * HOUR, now, 4)
    rows += every(4, BEGIN - MINUTE, BEGIN + 4 * HOUR, 0.0) + every(4, BEGIN + 4 * HOUR, now, 1.5)
    with fresh() as connection:
        stored(connection, rows, now)
        before = read_day(connection, [machine()], BEGIN, now)
        roll_up_all(connection, now)
        day = read_day(connection, [machine()], BEGIN, now)
    assert before.amounts == day.amounts
    assert day.amounts["m1"] == {
        "running": Amount(pytest.approx(7200, abs=1), whole=True),
        "made": Amount(7, whole=True),
        "starts": Amount(1, whole=True),
        "energy": Amount(pytest.approx(3.0, abs=0.01), whole=True),
    }
    assert (list(day.off), list(day.unknown["m1"])) == ([], [])


def test_a_recorder_that_was_off_says_when_and_a_device_counted_on() -> None:
    off, on, now = BEGIN + 2 * HOUR, BEGIN + 3 * HOUR, BEGIN + 4 * HOUR
    with fresh() as connection:
        first = [
            row for n, value in ((1, 1), (2, 50), (3, 9), (4, 2.0)) for row in every(n, BEGIN - MINUTE, off, value)
        ]
        stored(connection, first, off)
        begin_run(connection, on)
        stored(connection, [row for n, v in ((1, 1), (2, 65), (3, 9), (4, 2.0)) for row in every(n, on, now, v)], now)
        day = read_day(connection, [machine()], BEGIN, now)
    assert list(day.off) == [(off, on)] and list(day.unknown["m1"]) == []
    found = day.amounts["m1"]
    assert found["running"] == Amount(pytest.approx(3 * 3600, abs=1), whole=False)
    assert found["made"] == Amount(15, whole=True)
    assert found["starts"] == Amount(0, whole=False)
    assert found["energy"] == Amount(pytest.approx(6.0, abs=0.01), whole=False)


def test_a_machine_that_does_not_answer_is_not_known_since_then_and_the_others_are() -> None:
    lost, now = BEGIN + HOUR, BEGIN + 3 * HOUR
    rows = [row for n in (1, 2, 3, 4) for row in every(n, BEGIN - MINUTE, lost, 1)]
    rows += [(n, lost, None, None, COMM_FAILURE) for n in (1, 2, 3, 4)]
    with fresh() as connection:
        stored(connection, rows, now)
        day = read_day(connection, [machine()], BEGIN, now)
    assert list(day.off) == [] and list(day.unknown["m1"]) == [(lost, now)]
    assert [one.whole for one in day.amounts["m1"].values()] == [False] * 4
    assert day.amounts["m1"]["running"].value == pytest.approx(3600, abs=1)


def test_what_began_before_anybody_looked_is_the_least_that_it_can_be() -> None:
    seen, now = BEGIN + 9 * HOUR, BEGIN + 10 * HOUR
    with fresh() as connection:
        stored(connection, every(2, seen, seen + HOUR // 2, 200) + every(2, seen + HOUR // 2, now, 204), now)
        assert counted(connection, 2, BEGIN, now, goes_on=True) == Amount(4, whole=False)
        assert counted(connection, 2, seen, now, goes_on=True) == Amount(4, whole=True)
        day = read_day(connection, [machine()], BEGIN, now)
    assert list(day.off) == [(BEGIN, seen)]
    assert day.amounts["m1"]["running"] == Amount(None, whole=False)


def test_nothing_recorded_is_no_figure_and_a_restart_of_seconds_is_no_gap() -> None:
    with fresh() as connection:
        stored(connection, [], 0)
        day = read_day(connection, [machine()], BEGIN, BEGIN + HOUR)
        assert {one.value for one in day.amounts["m1"].values()} == {None}
        assert list(day.off) == [(BEGIN, BEGIN + HOUR)]
    with fresh() as connection:
        off = BEGIN + HOUR
        stored(connection, every(1, BEGIN - MINUTE, off, 1), off)
        begin_run(connection, off + 8 * SECOND)
        stored(connection, every(1, off + 9 * SECOND, BEGIN + 2 * HOUR, 1), BEGIN + 2 * HOUR)
        day = read_day(connection, [machine()], BEGIN, BEGIN + 2 * HOUR)
    assert day.amounts["m1"]["running"] == Amount(pytest.approx(7200, abs=10), whole=True)
    assert (list(day.off), list(day.unknown["m1"])) == ([], [])


@pytest.mark.parametrize("rolled", [False, True])
def test_a_counter_that_begins_again_takes_nothing_away(rolled: bool) -> None:
    """Also within a minute: 100 → 103, set back, 2."""
    at = BEGIN + HOUR
    seen = [(100, 0), (103, 10), (0, 20), (2, 30), (5, 90)]
    rows: list[Row] = [(2, BEGIN - MINUTE, 100.0, None, GOOD), *every(2, BEGIN, at, 100)]
    rows += [(2, at + s * SECOND, float(value), None, GOOD) for value, s in seen]
    with fresh() as connection:
        stored(connection, rows, at + 5 * MINUTE)
        if rolled:
            roll_up_all(connection, at + 5 * MINUTE)
        assert counted(connection, 2, BEGIN, at + 5 * MINUTE, goes_on=True) == Amount(8, whole=True)


@pytest.mark.parametrize("rolled", [False, True])
@pytest.mark.parametrize(
    ("register", "before", "whole"),
    [
        (Register(0), 65_530.0, False),
        (Register(0, scale=10.0), 655_300.0, False),
        (Register(0, scale=10.0), 65_530.0, True),
        (Register(0, mask=0xFF), 255.0, False),
        (Register(0, Type.U32, words=2), 65_530.0, True),
        (Register(0, Type.F32, words=2), 1e9, True),
        (None, 65_530.0, True),
    ],
)
def test_a_counter_that_may_have_run_over_is_the_least_that_it_can_be(
    register: Register | None, before: float, whole: bool, rolled: bool
) -> None:
    at, now = BEGIN + HOUR, BEGIN + 2 * HOUR
    rows = every(2, BEGIN - MINUTE, at, before) + every(2, at, now, 4)
    item = machine()
    item = replace(item, points={**item.points, "made": replace(item.points["made"], register=register)})
    with fresh() as connection:
        stored(connection, rows, now)
        if rolled:
            roll_up_all(connection, now)
        assert read_day(connection, [item], BEGIN, now).amounts["m1"]["made"] == Amount(4, whole=whole)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("seed", range(12))
def test_a_counter_is_counted_alike_from_minutes_and_from_samples(seed: int) -> None:
    """Also where it begins again twice in a minute, or a minute begins or ends badly: as adding every step up gives."""
    chance = random.Random(seed)
    rows: list[Row] = [(2, BEGIN - MINUTE, 5.0, None, GOOD)]
    value, counted_up, time, now = 5.0, 0.0, BEGIN, BEGIN + 3 * HOUR
    while (time := time + chance.choice((1, 5, 20, 45)) * SECOND) < now:
        if chance.random() < 0.2:
            rows.append((2, time, None, None, COMM_FAILURE))
            continue
        new = 0.0 if chance.random() < 0.1 else value + chance.choice((0, 1, 7))
        counted_up += new - value if new >= value else new
        value = new
        rows.append((2, time, value, None, GOOD))
    with fresh() as connection:
        stored(connection, rows, now)
        young = counted(connection, 2, BEGIN, now, goes_on=True)
        roll_up_all(connection, now)
        assert counted(connection, 2, BEGIN, now, goes_on=True) == young
    assert young.value == counted_up


def test_a_counter_that_began_again_while_nobody_looked_is_the_least_that_it_can_be() -> None:
    off, on, now = BEGIN + 2 * HOUR, BEGIN + 3 * HOUR, BEGIN + 4 * HOUR
    with fresh() as connection:
        stored(connection, every(2, BEGIN - MINUTE, off, 50), off)
        begin_run(connection, on)
        stored(connection, every(2, on, now, 3), now)
        assert counted(connection, 2, BEGIN, now, goes_on=True) == Amount(3, whole=False)


def test_what_was_yesterday_is_not_counted_and_a_value_of_yesterday_holds_no_longer_than_it_may() -> None:
    now = BEGIN + HOUR
    with fresh() as connection:
        stored(connection, every(2, BEGIN - 2 * HOUR, BEGIN, 10) + every(2, BEGIN + 1, now, 12), now)
        assert counted(connection, 2, BEGIN, now, goes_on=True) == Amount(2, whole=True)
    with fresh() as connection:
        long_ago = BEGIN - GAP_AFTER - MINUTE
        stored(connection, [(2, long_ago, 10.0, None, GOOD), *every(2, BEGIN + HOUR // 2, now, 12)], now)
        assert counted(connection, 2, BEGIN, now, goes_on=True) == Amount(0, whole=False)


@pytest.mark.parametrize(("date", "hours"), [((2026, 3, 29), 23), ((2026, 10, 25), 25), ((2026, 3, 9), 24)])
def test_a_day_is_from_midnight_to_midnight_of_the_plant_also_when_the_clock_changes(
    date: tuple[int, int, int], hours: int
) -> None:
    begin, end = local_day(to_micros(datetime(*date, 12, tzinfo=UTC)), ZAGREB)
    assert end - begin == hours * HOUR
    assert local_day(begin, ZAGREB) == local_day(end - 1, ZAGREB) == (begin, end)
    with fresh() as connection:
        stored(connection, every(1, begin - MINUTE, end + MINUTE, 1), end + MINUTE)
        day = read_day(connection, [machine()], begin, end)
    assert day.amounts["m1"]["running"] == Amount(pytest.approx(hours * 3600, abs=1), whole=True)
