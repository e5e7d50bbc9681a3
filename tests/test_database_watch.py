"""A history or a `pogon.db` that is lost, while the server runs or while it is stopped, is an alarm, and recording goes on."""

import os
import shutil
import sqlite3
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, closing
from datetime import UTC, datetime
from pathlib import Path
from random import Random

import pytest

from app import db
from app.access.access import prepare
from app.access.roles import SYSTEM
from app.clock import ManualClock
from app.db import Database
from app.runtime import Runtime
from app.settings import Settings
from app.tags.batch import Batch
from tests.virtual import inline

LANGUAGES = ("hr", "en", "de", "cs")
NOISE = Random(1)


@asynccontextmanager
async def running(data: Path, clock: ManualClock) -> AsyncIterator[Runtime]:
    """A server without a plant: it records what it knows of itself. The test does what its tasks do."""
    runtime = Runtime(Settings(plant=data.parent / "no-plant", data=data), clock, inline)
    await runtime.start()
    for task in ("databases", "recorder", "sweep"):
        await runtime.supervisor.end(task)
    try:
        yield runtime
    finally:
        await runtime.stop()


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data folder with both databases as they are made."""
    folder = tmp_path_factory.mktemp("made")
    for name in ("pogon", "history"):
        database = Database(folder / f"{name}.db", name)  # type: ignore[arg-type]
        database.migrate()
        database.close()
    return folder


@pytest.fixture
def data(tmp_path: Path, made: Path) -> Path:
    prepare(tmp_path / "data")
    for name in ("pogon.db", "history.db"):
        shutil.copyfile(made / name, tmp_path / "data" / name)
        (tmp_path / "data" / name).chmod(0o600)
    return tmp_path / "data"


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


def alarms(runtime: Runtime, key: str) -> list[dict[str, object]]:
    """What stands of a system alarm: its parameters."""
    return [dict(one.params) for one in runtime.alarms.list.active() if one.key == key]


async def record(runtime: Runtime, clock: ManualClock, value: float) -> None:
    """Have the loop lag at `value` stored, a minute later."""
    clock.advance(60)
    now = clock.micros()
    runtime.tags.publish(Batch("sys", 0, now, now, [runtime.tags.handle("sys.loop_lag")], [value]))
    clock.advance(1)
    now = clock.micros()
    runtime.tags.publish(Batch("sys", 0, now, now, [runtime.tags.handle("sys.loop_lag")], [value + 50]))
    await runtime.recorder.flush()


def stored(data: Path) -> list[float]:
    """Loop lags in the file, as another program reads them."""
    with closing(sqlite3.connect(f"file:{data / 'history.db'}?mode=ro", uri=True)) as connection:
        return [
            row[0]
            for row in connection.execute(
                "SELECT v FROM sample JOIN point ON point.id = sample.point WHERE name = 'sys.loop_lag' AND v >= 100 ORDER BY t"
            )
        ]


def removed(data: Path) -> None:
    for path in data.glob("history.db*"):
        path.unlink()


def emptied(data: Path) -> None:
    os.truncate(data / "history.db", 0)


def cut_short(data: Path) -> None:
    os.truncate(data / "history.db", 4096 * 3)


def garbage(data: Path) -> None:
    (data / "history.db").write_bytes(b"\0garbage" * 4096)


def another(data: Path) -> None:
    with closing(sqlite3.connect(data / "history.db")) as old, closing(sqlite3.connect(data / "another")) as new:
        old.backup(new)
        new.execute("PRAGMA application_id = 4711")
        new.execute("UPDATE point SET id = id + 1000")
        new.execute("DELETE FROM sample")
        new.commit()
    (data / "another").replace(data / "history.db")


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("fault", "loss", "kept"),
    [
        (removed, "removed", True),
        (emptied, "emptied", False),
        (cut_short, "truncated", False),
        (garbage, "overwritten", False),
        (another, "replaced", False),
    ],
)
async def test_a_history_lost_under_a_running_server_is_an_alarm_and_recording_goes_on(
    data: Path,
    clock: ManualClock,
    fault: Callable[[Path], None],
    loss: str,
    kept: bool,
    caplog: pytest.LogCaptureFixture,
) -> None:
    async with running(data, clock) as runtime:
        await record(runtime, clock, 100)
        await runtime.files.look()
        fault(data)
        await runtime.files.look()
        await record(runtime, clock, 200)
        await record(runtime, clock, 300)
        assert not runtime.recorder.full
        key = "database_restored" if kept else "history_lost"
        (params,) = alarms(runtime, key)
        assert (params["file"], params["loss"]) == ("history.db", f"@alarm.loss.{loss}")
        assert "time" in params or kept
        assert f"database lost file=history.db what={loss}" in caplog.text
        for lang in LANGUAGES:
            said = runtime.texts.text(lang, f"alarm.system.{key}.label", **params)
            assert "history.db" in said
            assert "{" not in said
        assert stored(data) == ([100, 150] if kept else []) + [200, 250, 300, 350]
    assert stored(data)[-4:] == [200, 250, 300, 350]  # what is written at the end is in the file, too
    async with running(data, clock) as runtime:  # told once, and not again at the next start
        assert len(alarms(runtime, key)) == 1
        await runtime.alarms.acknowledge(
            [one.occurrence for one in runtime.alarms.list.active() if one.key == key], SYSTEM
        )
        assert not alarms(runtime, key)
    async with running(data, clock) as runtime:
        assert not alarms(runtime, key)


def nothing(data: Path) -> None:
    """All is well."""


def older(data: Path) -> None:
    shutil.copyfile(data / "earlier", data / "history.db")


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("fault", "loss"),
    [(nothing, ""), (removed, "removed"), (emptied, "removed"), (another, "replaced"), (older, "older")],
)
async def test_a_history_lost_while_the_server_was_stopped_is_an_alarm_with_the_time_of_the_loss(
    data: Path, clock: ManualClock, fault: Callable[[Path], None], loss: str
) -> None:
    async with running(data, clock) as runtime:
        await record(runtime, clock, 100)
    shutil.copyfile(data / "history.db", data / "earlier")
    clock.advance(3600)
    async with running(data, clock) as runtime:
        await record(runtime, clock, 100)
        clock.advance(60)
        await runtime.files.look()
        last = datetime.fromtimestamp(clock.micros() / 1e6, UTC)
    fault(data)
    clock.advance(7200)
    async with running(data, clock) as runtime:
        told = alarms(runtime, "history_lost")
        assert [one["loss"] for one in told] == [f"@alarm.loss.{loss}" for _ in range(bool(loss))]
        for one in told:
            assert abs((last - datetime.fromisoformat(f"{one['time']}+00:00")).total_seconds()) <= 120


def contents(data: Path) -> dict[str, bytes]:
    """Every file of the history."""
    return {path.name: path.read_bytes() for path in data.glob("history.db*")}


def rubbish_beside_a_journal(data: Path) -> None:
    garbage(data)
    (data / "history.db-wal").write_bytes(b"journal" * 100)


def a_line_of_text(data: Path) -> None:
    (data / "history.db").write_text("history\n")


def damaged_inside(data: Path) -> None:
    """The header and its size are good; the first table is not."""
    with (data / "history.db").open("r+b") as file:
        file.seek(100)
        file.write(b"\xff" * 800)


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("fault", "loss"),
    [
        (garbage, "overwritten"),
        (rubbish_beside_a_journal, "overwritten"),
        (a_line_of_text, "overwritten"),
        (cut_short, "truncated"),
        (damaged_inside, "truncated"),
    ],
)
@pytest.mark.parametrize("known", [True, False])
async def test_a_history_that_is_rubbish_at_the_start_is_put_aside_and_recorded_anew(
    data: Path, clock: ManualClock, fault: Callable[[Path], None], loss: str, known: bool
) -> None:
    if known:
        async with running(data, clock) as runtime:
            await record(runtime, clock, 100)
            await runtime.files.look()
            last = datetime.fromtimestamp(clock.micros() / 1e6, UTC)
    fault(data)
    found = contents(data)
    clock.advance(7200)
    async with running(data, clock) as runtime:
        (params,) = alarms(runtime, "history_lost")
        assert (params["file"], params["loss"]) == ("history.db", f"@alarm.loss.{loss}")
        told = datetime.fromisoformat(f"{params['time']}+00:00")
        begun = datetime.fromtimestamp(clock.micros() / 1e6, UTC)
        assert abs(((last if known else begun) - told).total_seconds()) <= 120
        await runtime.files.look()
        await record(runtime, clock, 200)
        assert not runtime.recorder.full
        assert stored(data) == [200, 250]
        assert len(alarms(runtime, "history_lost")) == 1
    for name, content in found.items():  # nothing that lay there is gone
        assert contents(data)[name.replace("history.db", "history.db.damaged-1")] == content
    async with running(data, clock) as runtime:
        await runtime.files.look()
        assert len(alarms(runtime, "history_lost")) == 1


@pytest.mark.parametrize("message", ["unable to open database file", "database is locked", "disk I/O error"])
async def test_a_history_that_cannot_be_opened_now_is_not_put_aside(
    data: Path, clock: ManualClock, monkeypatch: pytest.MonkeyPatch, message: str
) -> None:
    def refuse(_path: Path) -> sqlite3.Connection:
        raise sqlite3.OperationalError(message)

    connect = db._connect
    with monkeypatch.context() as patch:
        patch.setattr(db, "_connect", lambda path: refuse(path) if path.name == "history.db" else connect(path))
        async with running(data, clock) as runtime:
            await runtime.files.look()
            assert runtime.recorder.full
            assert not alarms(runtime, "history_lost")
    assert not [name for name in contents(data) if name.startswith("history.db.")]


@pytest.mark.sweep(8)
@pytest.mark.parametrize("tails", [("",), ("", "-wal", "-shm"), ("-wal",), ("-shm",)])
async def test_people_stay_signed_in_and_the_audit_whole_when_pogon_db_is_removed(
    data: Path, clock: ManualClock, tails: tuple[str, ...]
) -> None:
    async with running(data, clock) as runtime:
        await runtime.files.look()
        await runtime.access.audit.record("server.started", None, "before")
        for tail in tails:
            (data / f"pogon.db{tail}").unlink()
        await runtime.files.look()
        (params,) = alarms(runtime, "database_restored")
        assert params["file"] == "pogon.db"
        await runtime.access.audit.record("server.started", None, "after")
    async with running(data, clock) as runtime:
        assert len(alarms(runtime, "database_restored")) == 1
        with closing(sqlite3.connect(data / "pogon.db")) as connection:
            named = {row[0] for row in connection.execute("SELECT object FROM audit")}
        assert {"before", "after"} <= named


async def test_what_cannot_be_mended_stands_until_it_is(data: Path, clock: ManualClock) -> None:
    async with running(data, clock) as runtime:
        await runtime.files.look()
        kept = (data / "pogon.db").read_bytes()
        (data / "pogon.db").write_bytes(b"\0" * len(kept))
        for _ in range(2):
            await runtime.files.look()
            (params,) = alarms(runtime, "database_lost")
            assert params["loss"] == "@alarm.loss.overwritten"
        with (data / "pogon.db").open("r+b") as file:
            file.write(kept)
        await runtime.files.look()
        assert not runtime.files._told


def cut_journal(path: Path) -> None:
    os.truncate(path, 0)


def noise_in_journal(path: Path) -> None:
    with path.open("r+b") as file:
        file.write(NOISE.randbytes(path.stat().st_size))


def noise_in_its_place(path: Path) -> None:
    path.write_bytes(NOISE.randbytes(path.stat().st_size))


JOURNAL_FAULTS = [cut_journal, noise_in_journal, noise_in_its_place, Path.unlink]


@pytest.mark.sweep(8)
@pytest.mark.parametrize("fault", JOURNAL_FAULTS)
@pytest.mark.parametrize("tail", ["-wal", "-shm"])
async def test_a_journal_of_the_history_lost_is_one_alarm_and_recording_goes_on(
    data: Path, clock: ManualClock, fault: Callable[[Path], None], tail: str, caplog: pytest.LogCaptureFixture
) -> None:
    async with running(data, clock) as runtime:
        await record(runtime, clock, 100)
        await runtime.files.look()  # a checkpoint
        await record(runtime, clock, 200)
        fault(data / f"history.db{tail}")
        await runtime.files.look()
        await record(runtime, clock, 300)
        await runtime.files.look()
        assert not runtime.recorder.full
        lost = tail == "-wal" and fault is not Path.unlink
        told = alarms(runtime, "database_shortened") + alarms(runtime, "database_restored")
        assert told == [
            {"file": "history.db", "loss": "@alarm.loss.journal" + ("" if fault is Path.unlink else "_damaged")}
        ]
        assert bool(alarms(runtime, "database_shortened")) is lost
        assert not alarms(runtime, "history_lost")
        assert stored(data) == [100, 150, *([] if lost else [200, 250]), 300, 350]
        assert caplog.text.count("database lost file=history.db") == 1
        for lang in LANGUAGES:
            said = runtime.texts.text(lang, "alarm.system.database_shortened.label", **told[0])
            assert "history.db" in said
            assert "{" not in said
    assert stored(data)[-2:] == [300, 350]


async def test_points_that_were_new_when_the_journal_was_lost_are_recorded(data: Path, clock: ManualClock) -> None:
    """Nothing of this history had reached its file: neither points nor the run."""
    async with running(data, clock) as runtime:
        await record(runtime, clock, 100)
        cut_journal(data / "history.db-wal")
        await record(runtime, clock, 200)  # before anybody looked
        await record(runtime, clock, 300)
        await runtime.files.look()
        assert len(alarms(runtime, "database_shortened")) == 1
        assert not runtime.recorder.full
        assert stored(data)[-2:] == [300, 350]
        assert 250 in stored(data)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("fault", JOURNAL_FAULTS)
@pytest.mark.parametrize("tail", ["-wal", "-shm"])
async def test_people_and_audit_stay_when_the_journal_of_pogon_db_is_lost(
    data: Path, clock: ManualClock, fault: Callable[[Path], None], tail: str
) -> None:
    async with running(data, clock) as runtime:
        await runtime.access.audit.record("server.started", None, "before")
        await runtime.files.look()
        fault(data / f"pogon.db{tail}")
        await runtime.access.audit.record("server.started", None, "during")
        await runtime.files.look()
        await runtime.access.audit.record("server.started", None, "after")
        assert runtime.access.audit.healthy
        told = alarms(runtime, "database_shortened") + alarms(runtime, "database_restored")
        assert [one["file"] for one in told] == ["pogon.db"]
        assert (await runtime.access.audit.check()).ok
    async with running(data, clock):
        with closing(sqlite3.connect(data / "pogon.db")) as connection:
            named = [row[0] for row in connection.execute("SELECT object FROM audit ORDER BY seq") if row[0]]
            assert [one for one in named if one in ("before", "during", "after")] == ["before", "during", "after"]
            assert connection.execute("PRAGMA integrity_check").fetchall() == [("ok",)]


async def test_while_the_disk_is_slow_no_journal_is_carried_into_its_file(data: Path, clock: ManualClock) -> None:
    async with running(data, clock) as runtime:
        carried: list[str] = []
        for database in (runtime.db, runtime.history):
            database.checkpoint = lambda name=database.name: carried.append(name)  # type: ignore[method-assign, misc]
        runtime.files._disk_slow = lambda: True
        await runtime.files.look()
        assert carried == []
        runtime.files._disk_slow = lambda: False
        await runtime.files.look()
        assert carried == ["pogon", "history"]
