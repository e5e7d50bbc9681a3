"""Runs of sequences from event rings: what is kept, once, in order, whatever breaks in between."""

import random
from dataclasses import replace

import pytest
from sqlalchemy import Connection

from app.blocks.sequence import Cause
from app.clock import ManualClock
from app.db import Database
from app.errors import StorageError
from app.historian import passages, run_query, runs, store
from app.historian.events import Events, Told, oldest
from app.historian.passages import tracks_products
from app.historian.run_query import Run, Wanted
from app.historian.runs import runs_sequence
from tests.historian.books import Runs, caused
from tests.historian.rings import BEGIN, SECOND, Event, Ring, conveyor
from tests.historian.sequence_rings import Device, definition, sequences
from tests.sim.coil_car.line import TRANSPORT, Line
from tests.virtual import inline


@pytest.fixture
def kept(history: Database) -> Runs:
    clock = ManualClock()
    clock.step_wall((BEGIN - clock.micros()) / 1e6 + 3600)
    made = Runs(history, clock)
    made.configure(sequences("seq1", "seq2"))
    return made


@pytest.fixture
def device() -> Device:
    return Device()


def ask(history: Database, limit: int = 1000, **wanted: object) -> list[Run]:
    return history.run(lambda connection: run_query.find(connection, Wanted(**wanted), limit))  # type: ignore[arg-type]


def steps(history: Database, run: Run) -> list[run_query.RunStep]:
    return history.run(lambda connection: run_query.steps(connection, [run.id]))[run.id]


def events(history: Database, run: Run) -> list[run_query.RunEvent]:
    return history.run(lambda connection: run_query.events(connection, [run.id]))[run.id]


def forces(history: Database, run: Run) -> list[run_query.Forced]:
    return history.run(lambda connection: run_query.forces(connection, run))


def everything(history: Database) -> list[list[tuple[object, ...]]]:
    """All rows, without the numbers that SQLite gives."""
    columns = run_query.RUN.removeprefix("id, ")

    def look(connection: Connection) -> list[list[tuple[object, ...]]]:
        return [
            [tuple(row) for row in connection.exec_driver_sql(sentence)]
            for sentence in (
                f"SELECT {columns} FROM sequence_run ORDER BY equipment, started, sequence",
                "SELECT e.* FROM sequence_event e ORDER BY boot, sequence",
                "SELECT r.sequence, s.step, s.key, s.state, s.entered, s.ended, s.seconds, s.suspended FROM sequence_run r "
                "JOIN sequence_step s ON s.run = r.id ORDER BY 1, 2",
                "SELECT * FROM sequence_force ORDER BY 1, 2, 3",
                "SELECT * FROM event_gap ORDER BY 1, 2, 3",
                "SELECT * FROM event_mark ORDER BY 1",
            )
        ]

    return history.run(look)


async def test_a_run_has_start_end_run_time_and_all_its_steps(kept: Runs, history: Database, device: Device) -> None:
    device.run()
    told = device.drain()
    await kept.take("seq1", told)
    (one,) = ask(history)
    assert (one.outcome, one.seen, one.step, one.cause, one.first_out) == ("done", True, 3, 0, "")
    assert (one.started, one.ended) == (told[0].time, told[-1].time)
    assert one.seconds == pytest.approx(1.5, abs=0.05)
    assert one.seconds == told[-1].value, "the device's own"
    taken = steps(history, one)
    assert [(step.step, step.key, step.state) for step in taken] == [
        (1, "lower", "done"),
        (2, "lift", "done"),
        (3, "drive", "done"),
    ]
    assert [step.seconds for step in taken] == [event.value for event in told if event.code == 4]
    assert taken[1].entered == taken[0].ended
    assert [event.code for event in events(history, one)] == [1, 3, 4, 3, 4, 3, 4, 13]


async def test_a_lost_permissive_aborts_and_says_what_fell_first_when_and_how_much_it_was(
    kept: Runs, history: Database, device: Device
) -> None:
    device.start()
    device.scan(60)
    device.lose(3)
    device.scan(3)
    fell = device.time + 10_000
    device.lose(2, pressure=59.5)
    device.scan()
    await kept.take("seq1", device.drain())
    (one,) = ask(history)
    assert (one.outcome, one.step, one.cause) == ("aborted", 2, Cause.PERMISSIVE_LOST)
    assert (one.first_out, one.first_step, one.first_bit, one.first_time) == ("lift.pressure_ok", 2, 3, fell)
    assert (one.first_value, one.first_together, one.losses) == (59.5, 1, 2)
    lost = [event for event in events(history, one) if event.code == 9]
    assert [(event.step, event.bit, event.signal) for event in lost] == [(3, 3, 61.5), (2, 3, 59.5)]
    assert lost[0].time < lost[1].time, "in the order in which they fell, to the scan"
    last = steps(history, one)[-1]
    assert (last.key, last.state) == ("lift", "aborted")
    assert last.seconds == pytest.approx((device.time - (last.entered or 0)) / 1e6)
    assert one.seconds == ((one.ended or 0) - one.started) / 1e6


async def test_an_abort_condition_and_the_operator(kept: Runs, history: Database, device: Device) -> None:
    device.start()
    device.scan(10)
    device.lose(0, 0)
    device.scan()
    device.give()
    device.start()
    device.scan(10)
    device.scan(abort_request=True)
    await kept.take("seq1", device.drain())
    operator, condition = ask(history)
    assert (condition.cause, condition.first_out, condition.first_value) == (1, "abort.guards", None)
    assert (operator.cause, operator.first_out, operator.first_bit) == (Cause.OPERATOR, "", None)
    assert condition.acknowledged is not None
    assert operator.acknowledged is None


async def test_a_step_that_waits_times_out_and_what_was_missing_before_has_no_time(
    kept: Runs, history: Database, device: Device
) -> None:
    device.lose(3)
    device.start()
    device.scan(700)
    await kept.take("seq1", device.drain())
    (one,) = ask(history)
    assert (one.outcome, one.cause, one.stalls) == ("timed_out", Cause.TIME, 1)
    assert (one.first_out, one.first_time, one.first_value) == ("drive.pressure_ok", None, 61.5)
    assert [step.state for step in steps(history, one)] == ["done", "timed_out"]
    assert ask(history, outcome="timed_out", first_out="any") == [one]


async def test_a_permissive_that_comes_back_is_no_first_out(kept: Runs, history: Database, device: Device) -> None:
    device.start()
    device.lose(2)
    device.scan(5)
    device.give()
    device.scan(5)
    device.scan(abort_request=True)
    await kept.take("seq1", device.drain())
    (one,) = ask(history)
    assert (one.losses, one.first_out) == (1, "")
    assert [event.code for event in events(history, one)] == [1, 3, 9, 10, 12]


async def test_suspended_time_is_no_step_time(kept: Runs, history: Database, device: Device) -> None:
    device.start()
    device.scan(20)
    device.scan(100, suspend=True)
    device.scan(10)
    device.scan(50, suspend=True)
    while device.block.running:
        device.scan()
    device.start()
    device.scan(20)
    device.scan(30, suspend=True)
    device.scan(suspend=True, abort_request=True)
    await kept.take("seq1", device.drain())
    aborted, done = ask(history)
    assert (done.suspensions, done.suspended, done.outcome) == (2, 1_500_000, "done")
    first = steps(history, done)[0]
    assert first.suspended == 1_500_000
    assert first.seconds == pytest.approx(0.5, abs=0.02)
    assert done.seconds == pytest.approx(3.0, abs=0.1), "the run includes it"
    assert (aborted.suspensions, aborted.suspended) == (1, 300_000)
    assert steps(history, aborted)[0].seconds == pytest.approx(0.2, abs=0.03)


async def test_forces_that_were_active_belong_to_the_run(kept: Runs, history: Database, device: Device) -> None:
    device.tell(device.block.force(2, 3, 2.0, device.time))
    device.run()  # 1.5 s
    device.tell(device.block.force(3, 3, 60.0, device.time))
    device.tell(device.block.force(3, 3, 90.0, device.time))
    device.scan(100)
    release = device.block.release(3, 3)
    assert release
    device.tell(release)
    device.run()
    device.scan(100)
    device.run()
    await kept.take("seq1", device.drain())
    third, second, first = ask(history)
    assert [one.forces for one in (first, second, third)] == [1, 0, 0]
    assert [(force.step, force.bit, force.asked, force.ending) for force in forces(history, first)] == [
        (2, 3, 2.0, "over")
    ]
    assert forces(history, second) == []
    device.start()
    device.scan(2)
    device.tell(device.block.force(3, 3, 60.0, device.time))
    device.scan(2)
    device.tell(device.block.force(3, 3, 90.0, device.time))
    device.power_cycle()
    await kept.take("seq1", device.drain())
    (newest, *_) = ask(history)
    assert newest.forces == 1, "renewed is not another one"
    assert [(force.asked, force.ending) for force in forces(history, newest)][-2:] == [
        (60.0, "renewed"),
        (90.0, "restart"),
    ]
    assert ask(history, forced=True) == [newest, first]


async def test_a_force_whose_end_was_lost_ends_when_it_was_to(kept: Runs, history: Database, device: Device) -> None:
    device.tell(device.block.force(2, 3, 2.0, device.time))
    await kept.take("seq1", device.drain())
    device.scan(300)
    assert [event.code for event in device.drain()] == [16]
    device.run()
    await kept.take("seq1", device.drain(), 1)
    (one,) = ask(history)
    assert (one.forces, forces(history, one)) == (0, [])


async def test_a_run_that_a_power_up_ended_is_aborted_once(kept: Runs, history: Database, device: Device) -> None:
    device.start()
    device.scan(80)
    await kept.take("seq1", device.drain())
    assert ask(history)[0].outcome == "open"
    device.power_cycle()
    told = device.drain()
    assert [event.code for event in told] == [18, 12]
    await kept.take("seq1", told[:1])
    await kept.take("seq1", told[1:])
    (one,) = ask(history)
    assert (one.outcome, one.cause, one.seconds) == ("aborted", Cause.POWER_UP, None)
    assert (one.ended, one.first_out) == (device.time, "")
    assert [step.state for step in steps(history, one)] == ["done", "aborted"]
    assert [event.code for event in events(history, one)][-2:] == [18, 12]
    device.run()
    await kept.take("seq1", device.drain())
    assert [run.outcome for run in ask(history)] == ["done", "aborted"]
    assert ask(history)[1].acknowledged is not None


async def test_a_device_that_lost_everything_interrupts_what_ran(kept: Runs, history: Database, device: Device) -> None:
    device.start()
    await kept.take("seq1", device.drain())
    other = Device(time=device.time + 600 * SECOND, boot=1)
    other.put(18, value=1)
    other.run()
    await kept.take("seq1", other.drain())
    assert [(one.outcome, one.cause) for one in ask(history)] == [("done", 0), ("aborted", Cause.POWER_UP)]
    other = Device(time=other.time + 600 * SECOND, boot=1)
    other.start()
    await kept.take("seq1", other.drain())
    again = Device(time=other.time + 600 * SECOND, boot=1)
    again.run()
    await kept.take("seq1", again.drain())
    assert [one.outcome for one in ask(history)][:2] == ["done", "unknown"]


async def test_restart_of_the_server_in_mid_run_goes_on_with_the_same_run(
    kept: Runs, history: Database, device: Device
) -> None:
    device.start()
    device.scan(60)
    device.scan(20, suspend=True)
    await kept.take("seq1", device.drain())
    again = Runs(history, ManualClock())
    again.configure(sequences("seq1"))
    await again.load()
    mark = again.last("seq1")
    assert mark is not None
    assert mark.seen == (1, device.sequence)
    while device.block.running:
        device.scan()
    await again.take("seq1", device.drain())
    (one,) = ask(history)
    assert (one.outcome, one.suspended) == ("done", 200_000)
    assert len(steps(history, one)) == 3


def story() -> list[Event]:
    """Runs of every kind, one after the other."""
    device = Device()
    for number in range(8):
        if number % 3 == 1:
            device.tell(device.block.force(2, 3, 1.0, device.time))
        device.start()
        device.scan(30)
        device.scan(20, suspend=True)
        device.scan(40)
        match number % 4:
            case 1:
                device.lose(2)
            case 2:
                device.power_cycle()
            case 3:
                device.lose(0, 0)
        while device.block.running:
            device.scan()
        device.give()
        device.scan(10)
    return device.drain()


async def test_redelivery_after_a_crash_changes_nothing(kept: Runs, history: Database) -> None:
    """Killed between the commit and the acknowledgement, at every place, with portions cut anywhere: as if nothing had happened."""
    source = random.Random(7)
    told = story()
    await kept.take("seq1", told)
    wanted = everything(history)
    assert [run[5] for run in wanted[0]] == ["done", "aborted", "aborted", "aborted"] * 2
    for number in range(20):
        database = Database(history.path.with_name(f"again-{number}.db"), "history", inline)
        database.migrate()
        at = 0
        while at < len(told):
            server = Runs(database, ManualClock())  # a new process every time
            server.configure(sequences("seq1"))
            await server.load()
            size, back = source.randrange(1, 12), source.randrange(0, 6)
            await server.take("seq1", told[max(0, at - back) : at + size])
            at += size
        assert everything(database) == wanted
        database.close()


async def test_lost_events_are_counted_and_no_run_swallows_the_next(
    kept: Runs, history: Database, device: Device
) -> None:
    device.start()
    device.scan(60)
    await kept.take("seq1", device.drain())
    while device.block.running:
        device.scan()
    gone = len(device.drain())
    device.start()
    gone += len(device.drain())
    device.scan(60)  # the end of step 1 is what comes first
    while device.block.running:
        device.scan()
    await kept.take("seq1", device.drain(), gone)
    new, old = ask(history)
    assert (old.outcome, old.missed, old.step) == ("unknown", gone, 2)
    assert [step.state for step in steps(history, old)] == ["done", "unknown"]
    assert (new.outcome, new.seen, new.step, new.missed) == ("done", False, 3, 0)
    assert steps(history, new)[0].entered is None
    assert steps(history, new)[0].seconds == pytest.approx(0.5, abs=0.02)


async def test_a_gap_within_a_run_leaves_the_step_unknown(kept: Runs, history: Database, device: Device) -> None:
    device.run()
    told = device.drain()
    await kept.take("seq1", told[:2])
    await kept.take("seq1", told[5:], 3)
    (one,) = ask(history)
    assert (one.outcome, one.missed) == ("done", 3)
    assert [(step.step, step.state) for step in steps(history, one)] == [(1, "unknown"), (3, "done")]


async def test_a_start_whose_predecessor_has_no_end(kept: Runs, history: Database, device: Device) -> None:
    device.start()
    await kept.take("seq1", device.drain())
    device.scan(10)
    device.put(1)
    device.put(3, 1)
    await kept.take("seq1", device.drain())
    new, old = ask(history)
    assert (old.outcome, old.ended, new.outcome, new.step) == ("unknown", new.started, "open", 1)


async def test_what_is_of_no_run_makes_none(kept: Runs, history: Database, device: Device) -> None:
    device.lose(1)
    device.start()
    for code in (14, 15, 16, 17, 18, 19, 20, 21, 22, 99):
        device.put(code)
    await kept.take("seq1", device.drain())
    assert ask(history) == []
    assert kept.last("seq1") is not None


async def test_each_machine_is_in_what_its_events_mean(history: Database, device: Device) -> None:
    kept = Events(history, ManualClock(), folds=(passages.Passages(), runs.Runs()))
    machines = [*sequences("seq1"), *conveyor("c1")]
    kept.configure(machines)
    assert [(runs_sequence(one), tracks_products(one)) for one in machines] == [(True, False), (False, True)]
    ring = Ring()
    ring.passage(1)
    device.run()
    for equipment, one in {"c1": ring.drain(), "seq1": device.drain()}.items():
        await kept.take(equipment, one)
    assert [one.equipment for one in ask(history)] == ["seq1"]
    assert history.run(lambda c: c.exec_driver_sql("SELECT count(*) FROM passage").scalar_one()) == 1


async def test_who_started_forced_and_acknowledged_it(kept: Runs, history: Database) -> None:
    device = Device(time=kept._clock.micros())
    began = device.time
    device.tell(device.block.force(2, 3, 30.0, device.time))
    device.start()
    device.scan(30)
    device.scan(abort_request=True)
    device.scan(10)
    device.scan(acknowledge=True)
    told = device.drain()
    for request, code, why in ((11, 15, "sensor broken"), (12, 1, ""), (13, 12, "wrong coil"), (14, 14, "")):
        kept.told(Told("seq1", (request,), "Ana Kos", why, began, began + SECOND))
        told = caused(told, code, request)
    kept.told(Told("seq1", (15,), "Ivo Ban", "another command", began, began + SECOND))
    await kept.take("seq1", told)
    (one,) = ask(history)
    assert (one.person, one.acknowledged_by) == ("Ana Kos", "Ana Kos")
    assert [(force.person, force.reason) for force in forces(history, one)] == [("Ana Kos", "sensor broken")]
    by = {event.code: (event.person, event.reason) for event in events(history, one)}
    assert by[12] == ("Ana Kos", "wrong coil")
    assert by[3] == ("", "")
    assert [told.person for told in kept._told] == ["Ivo Ban"]


async def test_a_definition_that_changes_does_not_change_what_happened(
    kept: Runs, history: Database, device: Device
) -> None:
    device.start()
    device.lose(1)
    device.scan()
    await kept.take("seq1", device.drain())
    device.give()
    kept.configure(sequences("seq1", of=definition("other", ("lower", "turn", "drive"))))
    device.run()
    await kept.take("seq1", device.drain())
    new, old = ask(history)
    known = history.run(lambda c: run_query.definitions(c, [new.definition, old.definition, "none"]))
    assert known[old.definition].step(2)["de"] == "Lift de"
    assert known[new.definition].step(2)["de"] == "Turn de"
    assert known[old.definition].permissive(old.first_step or 0, 3)["hr"] == "Pressure hr"
    assert known[old.definition].value(2, 3) == "pressure"
    assert known["none"].step(1) == {}
    assert known[old.definition].key(2, 3) == "lift.pressure_ok"
    times = history.run(lambda c: run_query.step_times(c, Wanted()))
    assert [(one.key, one.count) for one in times] == [("lower", 1), ("turn", 1), ("drive", 1)]


async def test_runs_are_cut_with_the_rest_of_the_history(kept: Runs, history: Database, device: Device) -> None:
    device.time = BEGIN - BEGIN % store.HOUR
    border = device.time + 2 * store.HOUR
    for _ in range(40):
        device.time += 360 * SECOND
        device.tell(device.block.force(2, 3, 1.0, device.time))
        device.run()
    await kept.take("seq1", device.drain())
    before = ask(history)
    assert history.run(lambda c: store.size(c, history.path, device.time)).oldest == history.run(oldest)
    assert history.run(oldest) < before[-1].started, "what was forced before it"
    removed, done = history.run(lambda connection: store.cut(connection, border + 5, 7))
    assert (removed, done) == (14, False), "seven runs and seven events"
    while not done:
        removed, done = history.run(lambda connection: store.cut(connection, border + 5, 7))
    after = ask(history)
    assert after == [one for one in before if one.started >= border]
    for table in ("sequence_event", "sequence_step"):
        sentence = f"SELECT count(DISTINCT run) FROM {table}"
        assert history.run(lambda c, sentence=sentence: c.exec_driver_sql(sentence).scalar_one()) == len(after)  # type: ignore[misc]
    assert history.run(lambda c: c.exec_driver_sql("SELECT min(until) FROM sequence_force").scalar_one()) >= border


async def test_filters_pages_and_times_are_those_of_brute_force(kept: Runs, history: Database) -> None:
    source = random.Random(11)
    devices = {"seq1": Device(dt=0.1), "seq2": Device(time=BEGIN + 17, dt=0.1)}
    for _ in range(90):
        for equipment, device in devices.items():
            if source.random() < 0.2:
                device.tell(device.block.force(source.randrange(1, 4), 3, 1.0, device.time))
            device.start()
            device.scan(source.randrange(1, 12))
            if source.random() < 0.3:
                device.scan(source.randrange(1, 9), suspend=True)
            kind = source.random()
            if kind < 0.2:
                device.lose(source.randrange(0, 4), source.choice([0, 3]))
            elif kind < 0.25:
                device.power_cycle()
            elif kind < 0.3:
                device.scan(abort_request=True)
            if source.random() < 0.97:
                while device.block.running:
                    device.scan()
            device.give()
            device.scan(2)
            await kept.take(equipment, device.drain(), source.choice([0] * 9 + [3]))
    rows = sorted(ask(history), key=lambda one: (-one.started, -one.id))
    assert len(rows) >= 170
    assert ask(history) == rows
    by_run = history.run(lambda c: run_query.steps(c, [one.id for one in rows]))
    keys = sorted({one.first_out for one in rows if one.first_out})
    assert len(keys) > 3
    for equipment in devices:
        found = history.run(lambda c, equipment=equipment: run_query.fallen(c, equipment))  # type: ignore[misc]
        assert sorted(one.first_out for one in found) == sorted(
            {one.first_out for one in rows if one.first_out and one.equipment == equipment}
        )
    for _ in range(300):
        begin = source.choice([None, BEGIN + source.randrange(0, 400) * SECOND])
        end = source.choice([None, BEGIN + source.randrange(0, 400) * SECOND])
        wanted = Wanted(
            equipment=source.choice(["", "seq1", "seq2", "seq9"]),
            begin=begin,
            end=end,
            outcome=source.choice(["", "", *run_query.OUTCOMES]),
            first_out=source.choice(["", "", "", "any", "no.such", *keys]),
            longer=source.choice([None, None, 1.0, 2.5]),
            forced=source.random() < 0.2,
        )
        fitting = [
            one
            for one in rows
            if (not wanted.equipment or one.equipment == wanted.equipment)
            and (begin is None or one.started >= begin)
            and (end is None or one.started < end)
            and (not wanted.outcome or one.outcome == wanted.outcome)
            and (
                not wanted.first_out
                or (wanted.first_out == "any" and one.first_out)
                or wanted.first_out == one.first_out
            )
            and (wanted.longer is None or (one.seconds is not None and one.seconds > wanted.longer))
            and (not wanted.forced or one.forces > 0)
        ]
        paged: list[Run] = []
        page = wanted
        while found := history.run(lambda connection, page=page: run_query.find(connection, page, 23)):  # type: ignore[misc]
            paged += found
            page = replace(page, before=(found[-1].started, found[-1].id))
        assert paged == fitting
        assert history.run(lambda c, wanted=wanted: run_query.count(c, wanted, 10_000)) == len(fitting)  # type: ignore[misc]
        taken: dict[str, list[float]] = {}
        for one in fitting:  # the newest first
            for step in by_run[one.id]:
                if step.state == "done" and step.seconds is not None:
                    taken.setdefault(step.key, []).append(step.seconds)
        times = history.run(lambda c, wanted=wanted: run_query.step_times(c, wanted))  # type: ignore[misc]
        assert [one.key for one in times] == [key for key in ("lower", "lift", "drive") if key in taken]
        for row in times:
            values = taken[row.key]
            assert (row.count, row.least, row.most) == (len(values), min(values), max(values))
            assert row.mean == pytest.approx(sum(values) / len(values))
            assert row.last == values[0]
        whole = history.run(lambda c, wanted=wanted: run_query.run_times(c, wanted))  # type: ignore[misc]
        assert whole.outcomes == {o: n for o in run_query.OUTCOMES if (n := sum(one.outcome == o for one in fitting))}
        done = [one.seconds for one in fitting if one.outcome == "done" and one.seconds is not None]
        assert (whole.least, whole.most, whole.last) == (
            (min(done), max(done), done[0]) if done else (None, None, None)
        )


def test_50_000_runs_are_asked_by_an_index(history: Database) -> None:
    """No page of the list sorts: SQLite walks an index, newest first."""

    def plan(connection: Connection, **wanted: object) -> str:
        where, given = run_query._where(Wanted(**wanted))  # type: ignore[arg-type]
        rows = connection.exec_driver_sql(
            f"EXPLAIN QUERY PLAN SELECT * FROM sequence_run {where} ORDER BY started DESC, id DESC LIMIT 50",
            tuple(given),
        )
        return " ".join(str(row[3]) for row in rows)

    with history.engine.connect() as connection:
        for wanted in (
            {},
            {"equipment": "s"},
            {"begin": 5, "end": 9},
            {"equipment": "s", "begin": 5},
            {"before": (5, 1)},
        ):
            assert "ix_sequence_run" in plan(connection, **wanted)
            assert "TEMP B-TREE" not in plan(connection, **wanted)


async def test_a_full_disk_stops_nothing_and_nothing_is_missing_afterwards(
    kept: Runs, history: Database, device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    original = history.write

    async def full(work: object) -> object:
        raise StorageError("history.db: database or disk is full")

    history.write = full  # type: ignore[method-assign, assignment]
    for _ in range(3):
        device.run()
        with pytest.raises(StorageError):
            await kept.take("seq1", device.drain())
    assert kept.failed
    history.write = original  # type: ignore[method-assign]
    kept._clock.advance(10)  # type: ignore[attr-defined]
    await kept.close()
    assert not kept.failed
    assert [one.outcome for one in ask(history)] == ["done"] * 3


def test_a_definition_is_kept_by_what_it_says() -> None:
    one, other = runs.kept(definition()), runs.kept(definition(steps=("lower", "lift")))
    assert one == runs.kept(definition())
    assert one.id != other.id
    assert (other.step(2), other.step(3), other.permissive(2, 3)) == ("lift", "3", "lift.pressure_ok")
    assert (other.permissive(0, 0), other.permissive(2, 9)) == ("abort.guards", "lift.bit_9")


async def test_the_virtual_coil_line_tells_its_runs(kept: Runs, history: Database) -> None:
    """The same words as the virtual device really puts into its ring: a transport, and one that a lost pressure ends."""
    kept.configure(sequences("seq1", "seq2", of=TRANSPORT))
    for equipment, fault in (("seq1", 0), ("seq2", 31)):
        line = Line()
        line.sequence.events()
        line.start()
        line.to_step(2)
        line.machine.fault(fault)
        line.until(lambda line=line: not line.plc.block.running, 200)  # type: ignore[misc]
        told = line.sequence.events()
        await kept.take(
            equipment,
            [Event(e.sequence, BEGIN + e.time, e.code, e.source, e.value, tuple(e.snapshot)) for e in told],
        )
    ((done,), (lost,)) = ask(history, equipment="seq1"), ask(history, equipment="seq2")
    assert (done.outcome, done.step) == ("done", 8)
    assert [step.state for step in steps(history, done)] == ["done"] * 8
    assert done.seconds == pytest.approx(sum(step.seconds or 0.0 for step in steps(history, done)), abs=0.2)
    assert (lost.outcome, lost.first_out, lost.step) == ("aborted", "drive_in.pressure_ok", 2)
    out = line.plc.block.first_out
    assert out is not None
    assert (lost.first_step, lost.first_bit, lost.first_time) == (out.step, out.bit, BEGIN + out.time)
    assert lost.first_value == pytest.approx(out.value)
