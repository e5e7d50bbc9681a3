"""Records of sequences from event rings: what is kept, once, in order, whatever breaks in between."""

import random

import pytest

from app.clock import ManualClock
from app.db import Database
from app.errors import StorageError
from app.historian import record_query, store
from app.historian.events import EndedCommand, oldest
from app.historian.record_query import RecordFilter
from app.plant.kept import kept as kept_as
from app.records.record import Part
from tests.historian import books
from tests.historian.books import FORCE, PASSAGE, RUN, Records, Said, Told, asked, caused, everything, forces
from tests.historian.rings import BEGIN, SECOND, Event, Ring, conveyor
from tests.historian.sequence_rings import SEQUENCE, Device, definition, sequences
from tests.sim.coil_car.line import TRANSPORT, Line
from tests.virtual import inline


@pytest.fixture
def kept(history: Database) -> Records:
    clock = ManualClock()
    clock.step_wall((BEGIN - clock.micros()) / 1e6 + 3600)
    return Records(history, clock, machines=sequences("seq1", "seq2"))


@pytest.fixture
def device() -> Device:
    return Device()


def ask(history: Database, **wanted: object) -> list[Told]:
    return books.ask(history, RUN, **wanted)


def steps(history: Database, one: Told) -> list[Part]:
    return books.parts(history, one)


def events(history: Database, one: Told) -> list[Said]:
    return books.events(history, one, SEQUENCE)


async def test_a_run_has_start_end_run_time_and_all_its_steps(kept: Records, history: Database, device: Device) -> None:
    device.run()
    told = device.drain()
    await kept.take("seq1", told)
    (one,) = ask(history)
    assert (one.outcome, one.entry, one.step, one.cause, one.first_out) == ("done", 1, 3, None, None)
    assert (one.begun, one.ended) == (told[0].time, told[-1].time)
    assert one.seconds == pytest.approx(1.5, abs=0.05)
    assert one.seconds == told[-1].value, "the device's own"
    taken = steps(history, one)
    assert [(step.number, step.key, step.state) for step in taken] == [
        (1, "lower", "done"),
        (2, "lift", "done"),
        (3, "drive", "done"),
    ]
    assert [step.seconds for step in taken] == [event.value for event in told if event.code == 4]
    assert taken[1].begun == taken[0].ended
    assert [event.code for event in events(history, one)] == [1, 3, 4, 3, 4, 3, 4, 13]


async def test_a_lost_permissive_aborts_and_says_what_fell_first_when_and_how_much_it_was(
    kept: Records, history: Database, device: Device
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
    assert (one.outcome, one.step, one.cause) == ("aborted", 2, "permissive_lost")
    assert (one.first_out, one.first_step, one.first_bit, one.first_time) == ("lift.pressure_ok", 2, 3, fell)
    assert (one.first_value, one.first_together, one.losses) == (59.5, 1, 2)
    lost = [event for event in events(history, one) if event.code == 9]
    assert [(event.source, event.words["bit"], event.words["signal"]) for event in lost] == [(3, 3, 61.5), (2, 3, 59.5)]
    assert lost[0].time < lost[1].time, "in the order in which they fell, to the scan"
    last = steps(history, one)[-1]
    assert (last.key, last.state) == ("lift", "aborted")
    assert last.seconds == pytest.approx((device.time - (last.begun or 0)) / 1e6)
    assert one.seconds == ((one.ended or 0) - one.begun) / 1e6


async def test_an_abort_condition_and_the_operator(kept: Records, history: Database, device: Device) -> None:
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
    assert (condition.cause, condition.first_out, condition.first_value) == ("abort_condition", "abort.guards", None)
    assert (operator.cause, operator.first_out, operator.first_bit) == ("operator", None, None)
    assert condition.acknowledged is not None
    assert operator.acknowledged is None


async def test_a_step_that_waits_times_out_and_what_was_missing_before_has_no_time(
    kept: Records, history: Database, device: Device
) -> None:
    device.lose(3)
    device.start()
    device.scan(700)
    await kept.take("seq1", device.drain())
    (one,) = ask(history)
    assert (one.outcome, one.cause, one.stalls) == ("timed_out", "time", 1)
    assert (one.first_out, one.first_time, one.first_value) == ("drive.pressure_ok", None, 61.5)
    assert [step.state for step in steps(history, one)] == ["done", "timed_out"]
    assert ask(history, outcome="timed_out", given={"first_out": "any"}) == [one]


async def test_a_permissive_that_comes_back_is_no_first_out(kept: Records, history: Database, device: Device) -> None:
    device.start()
    device.lose(2)
    device.scan(5)
    device.give()
    device.scan(5)
    device.scan(abort_request=True)
    await kept.take("seq1", device.drain())
    (one,) = ask(history)
    assert (one.losses, one.first_out) == (1, None)
    assert [event.code for event in events(history, one)] == [1, 3, 9, 10, 12]


async def test_suspended_time_is_no_step_time(kept: Records, history: Database, device: Device) -> None:
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
    assert (done.suspensions, done.paused, done.outcome) == (2, 1_500_000, "done")
    first = steps(history, done)[0]
    assert first.paused == 1_500_000
    assert first.seconds == pytest.approx(0.5, abs=0.02)
    assert done.seconds == pytest.approx(3.0, abs=0.1), "the run includes it"
    assert (aborted.suspensions, aborted.paused) == (1, 300_000)
    assert steps(history, aborted)[0].seconds == pytest.approx(0.2, abs=0.03)


async def test_forces_that_were_active_belong_to_the_run(kept: Records, history: Database, device: Device) -> None:
    device.tell(device.block.force(2, 3, 2.0, device.time))
    device.run()  # 1.5 s
    device.tell(device.block.force(3, 3, 60.0, device.time))
    device.tell(device.block.force(3, 3, 90.0, device.time))
    device.scan(100)
    release = device.block.forces.release(3, 3)
    assert release
    device.tell(release)
    device.run()
    device.scan(100)
    device.run()
    await kept.take("seq1", device.drain())
    third, second, first = ask(history)
    assert [one.forces or 0 for one in (first, second, third)] == [1, 0, 0]
    assert [(force.permissive, force.asked, force.outcome) for force in forces(history, first)] == [
        ("lift.pressure_ok", 2.0, "over")
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
    assert [(force.asked, force.outcome) for force in forces(history, newest)][-2:] == [
        (60.0, "renewed"),
        (90.0, "restart"),
    ]
    assert ask(history, given={"forced": "any"}) == [newest, first]


async def test_a_force_does_not_stand_in_a_plc_that_has_lost_it(
    kept: Records, history: Database, device: Device
) -> None:
    """A server that is killed takes the simulated PLC in it along: nothing is forced in the next one."""
    device.start()
    device.scan(2)
    device.tell(device.block.force(3, 3, 600.0, device.time))
    await kept.take("seq1", device.drain())
    other = Device(time=device.time + 60 * SECOND, boot=1)
    other.start()
    other.scan(2)
    began = other.events[0].time
    await kept.take("seq1", other.drain())
    newest, first = ask(history)
    assert [(force.outcome, force.ended) for force in forces(history, first)] == [("restart", began)]
    assert (newest.forces or 0, forces(history, newest)) == (0, [])


async def test_a_force_whose_end_was_lost_ends_when_it_was_to(kept: Records, history: Database, device: Device) -> None:
    device.tell(device.block.force(2, 3, 2.0, device.time))
    await kept.take("seq1", device.drain())
    device.scan(300)
    assert [event.code for event in device.drain()] == [16]
    device.run()
    await kept.take("seq1", device.drain(), 1)
    (one,) = ask(history)
    assert (one.forces or 0, forces(history, one)) == (0, [])


async def test_a_run_that_a_power_up_ended_is_aborted_once(kept: Records, history: Database, device: Device) -> None:
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
    assert (one.outcome, one.cause, one.seconds) == ("aborted", "power_up", None)
    assert (one.ended, one.first_out) == (device.time, None)
    assert [step.state for step in steps(history, one)] == ["done", "aborted"]
    assert [event.code for event in events(history, one)][-2:] == [18, 12]
    device.run()
    await kept.take("seq1", device.drain())
    assert [run.outcome for run in ask(history)] == ["done", "aborted"]
    assert ask(history)[1].acknowledged is not None


async def test_a_device_that_lost_everything_interrupts_what_ran(
    kept: Records, history: Database, device: Device
) -> None:
    device.start()
    await kept.take("seq1", device.drain())
    other = Device(time=device.time + 600 * SECOND, boot=1)
    other.put(18, value=1)
    other.run()
    await kept.take("seq1", other.drain())
    assert [(one.outcome, one.cause) for one in ask(history)] == [("done", None), ("aborted", "power_up")]
    other = Device(time=other.time + 600 * SECOND, boot=1)
    other.start()
    await kept.take("seq1", other.drain())
    again = Device(time=other.time + 600 * SECOND, boot=1)
    again.run()
    await kept.take("seq1", again.drain())
    assert [one.outcome for one in ask(history)][:2] == ["done", "unknown"]


async def test_restart_of_the_server_in_mid_run_goes_on_with_the_same_run(
    kept: Records, history: Database, device: Device
) -> None:
    device.start()
    device.scan(60)
    device.scan(20, suspend=True)
    await kept.take("seq1", device.drain())
    again = Records(history, ManualClock())
    again.configure(sequences("seq1"))
    await again.load()
    mark = again.last("seq1")
    assert mark is not None
    assert (mark.boot, mark.sequence) == (1, device.sequence)
    while device.block.running:
        device.scan()
    await again.take("seq1", device.drain())
    (one,) = ask(history)
    assert (one.outcome, one.paused) == ("done", 200_000)
    assert len(steps(history, one)) == 3


def story() -> list[Event]:
    """Records of every kind, one after the other."""
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


@pytest.mark.sweep(8)
async def test_redelivery_after_a_crash_changes_nothing(kept: Records, history: Database) -> None:
    """Killed between the commit and the acknowledgement, at every place, with portions cut anywhere: as if nothing had happened."""
    source = random.Random(7)
    told = story()
    await kept.take("seq1", told)
    wanted = everything(history, RUN, FORCE)
    assert [run.outcome for run in reversed(ask(history))] == ["done", "aborted", "aborted", "aborted"] * 2
    for number in range(20):
        database = Database(history.path.with_name(f"again-{number}.db"), "history", inline)
        database.migrate()
        at = 0
        while at < len(told):
            server = Records(database, ManualClock())  # a new process every time
            server.configure(sequences("seq1"))
            await server.load()
            size, back = source.randrange(1, 12), source.randrange(0, 6)
            await server.take("seq1", told[max(0, at - back) : at + size])
            at += size
        assert everything(database, RUN, FORCE) == wanted
        database.close()


async def test_lost_events_are_counted_and_no_run_swallows_the_next(
    kept: Records, history: Database, device: Device
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
    assert (new.outcome, new.entry, new.step, new.missed) == ("done", 0, 3, 0)
    assert steps(history, new)[0].begun is None
    assert steps(history, new)[0].seconds == pytest.approx(0.5, abs=0.02)


async def test_a_gap_within_a_run_leaves_the_step_unknown(kept: Records, history: Database, device: Device) -> None:
    device.run()
    told = device.drain()
    await kept.take("seq1", told[:2])
    await kept.take("seq1", told[5:], 3)
    (one,) = ask(history)
    assert (one.outcome, one.missed) == ("done", 3)
    assert [(step.number, step.state) for step in steps(history, one)] == [(1, "unknown"), (3, "done")]


async def test_a_start_whose_predecessor_has_no_end(kept: Records, history: Database, device: Device) -> None:
    device.start()
    await kept.take("seq1", device.drain())
    device.scan(10)
    device.put(1)
    device.put(3, 1)
    await kept.take("seq1", device.drain())
    new, old = ask(history)
    assert (old.outcome, old.ended, new.outcome, new.step) == ("unknown", new.begun, "open", 1)


async def test_what_is_of_no_run_makes_none(kept: Records, history: Database, device: Device) -> None:
    device.lose(1)
    device.start()
    for code in (14, 15, 16, 17, 18, 19, 20, 21, 22, 99):
        device.put(code)
    await kept.take("seq1", device.drain())
    assert ask(history) == []
    assert kept.last("seq1") is not None


async def test_each_machine_is_in_what_its_events_mean(history: Database, device: Device) -> None:
    kept = Records(history, ManualClock(), machines=[*sequences("seq1"), *conveyor("c1")])
    ring = Ring()
    ring.passage(1)
    device.run()
    for equipment, one in {"c1": ring.drain(), "seq1": device.drain()}.items():
        await kept.take(equipment, one)
    assert [one.equipment for one in ask(history)] == ["seq1"]
    assert [one.equipment for one in books.ask(history, PASSAGE)] == ["c1"]


async def test_who_started_forced_and_acknowledged_it(kept: Records, history: Database) -> None:
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
        kept.command_ended(EndedCommand("seq1", (request,), "Ana Kos", why, began, began + SECOND))
        told = caused(told, code, request)
    kept.command_ended(EndedCommand("seq1", (15,), "Ivo Ban", "another command", began, began + SECOND))
    await kept.take("seq1", told)
    (one,) = ask(history)
    assert [asked(history, one, field)[0] for field in ("started_by", "acknowledged_by")] == ["Ana Kos", "Ana Kos"]
    assert [asked(history, force) for force in forces(history, one)] == [("Ana Kos", "sensor broken")]
    by = {event.code: (event.person, event.reason) for event in events(history, one)}
    assert by[12] == ("Ana Kos", "wrong coil")
    assert by[3] == ("", "")
    assert [told.person for told in kept._commands] == ["Ivo Ban"]


async def test_a_definition_that_changes_does_not_change_what_happened(
    kept: Records, history: Database, device: Device
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
    known = history.run(lambda c: record_query.definitions(c, [new.definition, old.definition, "none"]))
    assert known[old.definition].part(2)["de"] == "Lift de"
    assert known[new.definition].part(2)["de"] == "Turn de"
    assert known[old.definition].bit(old.first_step or 0, 3)["hr"] == "Pressure hr"
    assert known[old.definition].value(2, 3) == "pressure"
    assert known["none"].part(1) == {}
    assert known[old.definition].key(2, 3) == "lift.pressure_ok"
    times = history.run(lambda c: record_query.part_times(c, RUN, RecordFilter()))
    assert sorted((one.key, one.spread.count) for one in times) == [("drive", 1), ("lower", 1), ("turn", 1)]


async def test_runs_are_cut_with_the_rest_of_the_history(kept: Records, history: Database, device: Device) -> None:
    device.time = BEGIN - BEGIN % store.HOUR
    border = device.time + 2 * store.HOUR
    for _ in range(40):
        device.time += 360 * SECOND
        device.tell(device.block.force(2, 3, 1.0, device.time))
        device.run()
    await kept.take("seq1", device.drain())
    before = ask(history)
    assert history.run(lambda c: store.size(c, history.path, device.time)).oldest == history.run(oldest)
    assert history.run(oldest) < before[-1].begun, "what was forced before it"
    removed, done = history.run(lambda connection: store.cut(connection, border + 5, 7))
    assert (removed, done) == (21, False), "seven runs, seven forces and seven events"
    while not done:
        removed, done = history.run(lambda connection: store.cut(connection, border + 5, 7))
    after = ask(history)
    assert after == [one for one in before if one.begun >= border]
    for table in ("record_event", "record_part"):
        sentence = f"SELECT count(*) FROM {table} WHERE record NOT IN (SELECT id FROM record)"
        assert history.run(lambda c, sentence=sentence: c.exec_driver_sql(sentence).scalar_one()) == 0  # type: ignore[misc]
    assert min(one.begun for one in books.ask(history, FORCE)) >= border


async def test_a_full_disk_stops_nothing_and_nothing_is_missing_afterwards(
    kept: Records, history: Database, device: Device, monkeypatch: pytest.MonkeyPatch
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
    one, other = kept_as(definition()), kept_as(definition(steps=("lower", "lift")))
    assert one == kept_as(definition())
    assert one.id != other.id
    assert (other.part(2), other.part(3), other.bit(2, 3)) == ("lift", "3", "lift.pressure_ok")
    assert (other.bit(0, 0), other.bit(2, 9)) == ("abort.guards", "lift.bit_9")


@pytest.mark.sweep(8)
async def test_the_virtual_coil_line_tells_its_runs(kept: Records, history: Database) -> None:
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
