"""pogon export, backup and restore as a person types them, beside a running server."""

import json
import os
import sqlite3
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

import pytest
from sqlalchemy import Connection
from typer.testing import CliRunner

from app.backup import table_counts
from app.cli import cli
from app.db import Database
from app.historian.export import verify_export
from app.historian.records import RecordFold
from app.plant.loader import read_plant
from tests.conftest import PogonServer
from tests.historian import books, stories
from tests.historian.former import plant as line_and_sequences
from tests.historian.rings import Ring, conveyor
from tests.web import sequence_plant


class Done(NamedTuple):
    returncode: int
    stdout: str
    stderr: str


def pogon(data: Path, *arguments: str) -> Done:
    """A command as one types it, within this process."""
    emptied = {name: None for name in os.environ if name.startswith("POGON_")}
    done = CliRunner().invoke(cli, arguments, env=emptied | {"POGON_DATA": str(data)})
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    return Done(done.exit_code, done.stdout, done.stderr)


def stored(data: Path, *names: str) -> int:
    """Rows of these points in the history."""
    if not (data / "history.db").exists() or not table_counts(data / "history.db").get("sample"):
        return 0
    statement = "SELECT count(*) FROM sample JOIN point ON point.id = sample.point WHERE name IN (SELECT value FROM json_each(?))"
    with closing(sqlite3.connect(f"file:{data / 'history.db'}?mode=ro", uri=True)) as history:
        (count,) = history.execute(statement, [json.dumps(names)]).fetchone()
    return int(count)


@pytest.mark.slow
@pytest.mark.real_time
def test_history_and_backup_beside_a_running_server(pogon_server: Callable[..., PogonServer], tmp_path: Path) -> None:
    server = pogon_server()
    data = server.data
    until = time.monotonic() + 60
    while stored(data, "m1.speed", "m1.current") <= 2:
        assert time.monotonic() < until, server.log()
        time.sleep(0.2)

    file = tmp_path / "speed.csv"
    done = pogon(data, "export", "--tags", "m1.speed,m1.current", "--from", "-1h", "--locale", "hr", "-o", str(file))
    assert done.returncode == 0, done.stderr
    assert "100%" in done.stderr
    assert "checksum verified" in done.stderr
    assert verify_export(file).rows > 2
    assert ";m1.speed;" in file.read_text()
    again = pogon(data, "export", "--tags", "m1.speed", "-o", str(file))
    assert again.returncode == 2
    assert "exists already" in again.stderr
    piped = pogon(data, "export", "--tags", "m1.speed", "--aggregate", "60")
    assert piped.returncode == 0
    assert piped.stdout.splitlines()[-1].startswith("# sha256: ")
    shifts = pogon(data, "export", "--tags", "m1.speed", "--by-shift")
    assert shifts.returncode == 0, shifts.stderr
    assert "\ntime_utc,time_local,end_local,shift,hours,tag," in shifts.stdout.replace("\r", "")
    for arguments, named in (
        (("--tags", "m9.speed"), "m9.speed"),
        (("--tags", "m1.speed", "--from", "monday"), "monday"),
        (("--tags", "m1.speed", "--locale", "fr"), "fr"),
        (("--tags", "m1.speed", "--timezone", "Mars"), "Mars"),
    ):
        wrong = pogon(data, "export", *arguments)
        assert wrong.returncode == 2
        assert named in wrong.stderr
        assert "Traceback" not in wrong.stderr

    archive = tmp_path / "b.tar"
    done = pogon(data, "backup", str(archive))
    assert done.returncode == 0, done.stderr
    assert "verified" in done.stdout
    refused = pogon(data, "restore", str(archive), "--yes")
    assert refused.returncode == 2
    assert "in use: another pogon runs on it" in refused.stderr
    assert pogon(data, "restore", str(archive), "--check").returncode == 0
    assert server.process.poll() is None

    other = tmp_path / "other"
    unknown = pogon(other, "restore", str(archive))
    assert unknown.returncode == 2 and "which is not here: give it with --key-file" in unknown.stderr
    done = pogon(other, "restore", str(archive), "--key-file", str(data / "backup.key"))
    assert done.returncode == 0, done.stderr
    assert (other / "plant" / "plant.toml").is_file()
    assert "do not write" in done.stdout
    assert "keys of its audit are not in it" in done.stdout
    with_keys = tmp_path / "keys.tar.gz"
    assert pogon(data, "backup", str(with_keys), "--with-keys", "--no-history").returncode == 0
    kept = pogon(tmp_path / "kept", "restore", str(with_keys), "--unsigned")
    assert "its signature was not checked" in kept.stderr
    assert (kept.returncode, "keys of its audit" in kept.stdout) == (0, False)
    verified = pogon(tmp_path / "kept", "audit", "verify")
    assert verified.returncode == 0, verified.stderr
    assert "audit ok" in verified.stdout and "alarm journal ok" in verified.stdout
    server.stop()
    assert pogon(data, "restore", str(archive), "--yes").returncode == 0
    assert "audit ok" in pogon(data, "audit", "verify").stdout
    pogon_server(data=data)


def lines_of(database: Path) -> list[tuple[str, str, str]]:
    """(kind, object, result) of the backups and restores in an audit."""
    with closing(sqlite3.connect(f"file:{database}?mode=ro", uri=True)) as found:
        query = "SELECT kind, object, result FROM audit WHERE kind LIKE 'backup.%' ORDER BY seq"
        return found.execute(query).fetchall()


def test_a_restore_is_written_down_before_it_begins_and_after(tmp_path: Path) -> None:
    data, archive = tmp_path / "data", tmp_path / "b.tar"
    assert pogon(data, "user", "add", "ana").returncode == 0
    assert pogon(data, "backup", str(archive)).returncode == 0
    done = pogon(data, "restore", str(archive), "--yes")
    assert done.returncode == 0, done.stderr
    (aside,) = data.glob("before-restore-*")
    made = ("backup.made", "b.tar", "ok")
    assert lines_of(aside / "pogon.db") == [made, ("backup.restoring", "b.tar", "sent")]
    assert lines_of(data / "pogon.db")[-1] == ("backup.restored", "b.tar", "ok")

    broken = tmp_path / "broken.tar"
    broken.write_bytes(archive.read_bytes()[:-9000])
    assert pogon(data, "restore", str(broken), "--yes").returncode == 2
    begun = [line for line in lines_of(data / "pogon.db") if line[1] == "broken.tar"]
    assert begun == [("backup.restoring", "broken.tar", "sent"), ("backup.restored", "broken.tar", "failed")]
    assert pogon(data, "audit", "verify").returncode == 0


def seen(database: Path) -> object:
    """Version and audit of a database, or what there is instead of one."""
    with closing(sqlite3.connect(f"file:{database}?mode=ro", uri=True)) as found:
        try:
            version = found.execute("SELECT version_num FROM alembic_version").fetchall()
        except sqlite3.DatabaseError:
            return database.read_bytes()
        return version, found.execute("SELECT * FROM audit").fetchall()


@pytest.mark.sweep(8)
@pytest.mark.parametrize("state", ["newer", "older", "torn"])
def test_what_takes_no_line_is_moved_aside_as_it_is(tmp_path: Path, state: str) -> None:
    data, archive = tmp_path / "data", tmp_path / "b.tar"
    assert pogon(data, "user", "add", "ana").returncode == 0
    assert pogon(data, "backup", str(archive)).returncode == 0
    if state == "torn":
        (data / "pogon.db").write_bytes(b"SQLite format 3\0" + b"x" * 5000)
    else:
        with closing(sqlite3.connect(data / "pogon.db")) as database:
            database.execute("UPDATE alembic_version SET version_num = ?", ("9999" if state == "newer" else "0003",))
            database.commit()
    before = seen(data / "pogon.db")
    done = pogon(data, "restore", str(archive), "--yes")
    assert done.returncode == 0, done.stderr
    assert "takes no line of this restore" in done.stderr
    (aside,) = data.glob("before-restore-*")
    assert seen(aside / "pogon.db") == before
    assert lines_of(data / "pogon.db")[-1] == ("backup.restored", "b.tar", "ok")


def test_a_backup_of_which_the_audit_takes_no_line_is_told_to_be_there(tmp_path: Path) -> None:
    data, archive = tmp_path / "data", tmp_path / "b.tar"
    assert pogon(data, "user", "add", "ana").returncode == 0
    with closing(sqlite3.connect(data / "pogon.db")) as database:
        database.execute("UPDATE alembic_version SET version_num = '9999'")
        database.commit()
    done = pogon(data, "backup", str(archive))
    assert done.returncode == 2 and archive.exists()
    assert (
        done.stderr.splitlines()[-1]
        == f"pogon: {archive} is written and verified all the same; the audit has no line of it"
    )


def test_without_history_there_is_one_clear_line(tmp_path: Path) -> None:
    done = pogon(tmp_path / "data", "export", "--tags", "m1.speed")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "nothing was recorded" in done.stderr


@pytest.mark.real_time
def test_products_go_home_without_a_server(tmp_path: Path) -> None:
    database = Database(tmp_path / "history.db", "history")
    database.migrate()
    ring = Ring(time=time.time_ns() // 1000 - 60_000_000)
    ring.passage(7)
    fold = RecordFold(conveyor("c1"))
    database.run(lambda connection: books.store(connection, fold, "c1", ring.drain()))
    database.close()
    done = pogon(tmp_path, "export", "--records", "passage:c1", "--locale", "de")
    assert done.returncode == 0, done.stderr
    assert "Eintritt UTC;Eintritt lokal;Maschine;Produkt;" in done.stdout
    assert ";c1;7;30,5;Abgegeben;" in done.stdout
    assert done.stdout.splitlines()[-1].startswith("# sha256: ")
    wrong = pogon(tmp_path, "export", "--records", "passage:m1")
    assert (wrong.returncode, "expected passage or passage:c1" in wrong.stderr, "Traceback" in wrong.stderr) == (
        2,
        True,
        False,
    )
    no_kind = pogon(tmp_path, "export", "--records", "products:c1")
    assert (no_kind.returncode, "--records products:c1: expected passage, " in no_kind.stderr) == (2, True)
    neither = pogon(tmp_path, "export")
    assert (neither.returncode, "either --tags" in neither.stderr) == (2, True)


@pytest.mark.real_time
def test_runs_go_home_without_a_server(tmp_path: Path) -> None:
    folder = sequence_plant.write(tmp_path / "plant")
    plant, problems = read_plant(folder)
    assert plant is not None, problems
    database = Database(tmp_path / "history.db", "history")
    database.migrate()
    begin = time.time_ns() // 1000 - 1_200_000_000
    database.run(lambda connection: sequence_plant.fill(connection, plant, 1, begin))
    database.close()
    done = pogon(tmp_path, "export", "--records", "run:seq1", "--locale", "de", "--plant", str(folder))
    assert done.returncode == 0, done.stderr
    assert "Beginn UTC;Beginn lokal;Maschine;Schrittkette;" in done.stdout
    assert ";Freigabe verloren;Hydraulikdruck in Ordnung;2;3;" in done.stdout
    assert done.stdout.splitlines()[-1].startswith("# sha256: ")
    wrong = pogon(tmp_path, "export", "--records", "run:cc1", "--plant", str(folder))
    assert (wrong.returncode, "expected run or run:seq1, run:seq2" in wrong.stderr, "Traceback" in wrong.stderr) == (
        2,
        True,
        False,
    )
    both = pogon(tmp_path, "export", "--records", "run:seq1", "--tags", "a.b")
    assert (both.returncode, "either --tags" in both.stderr) == (2, True)


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Data and plant folder of a plant whose conveyor moved a product and whose sequences ran, some twenty minutes ago."""
    data = tmp_path_factory.mktemp("told")
    folder = line_and_sequences.write(data / "plant")
    plant, problems = read_plant(folder)
    assert plant is not None, problems
    database = Database(data / "history.db", "history")
    database.migrate()
    begin = time.time_ns() // 1000 - 1_200_000_000
    fold = RecordFold(plant.equipment.values())

    def fill(connection: Connection) -> None:
        ring = Ring(time=begin)
        ring.passage(7)
        ring.tell(999)
        books.store(connection, fold, "c1", ring.drain())
        for number in (1, 2):
            for portion in stories.runs(number, 3, begin):
                books.store(connection, fold, f"seq{number}", portion.events, portion.lost)

    database.run(fill)
    database.close()
    return data, folder


def lines(done: Done) -> list[str]:
    """Head and rows of an export that is whole."""
    assert (done.returncode, "Traceback" in done.stderr) == (0, False), done.stderr
    assert done.stdout.splitlines()[-1].startswith("# sha256: ")
    return [line for line in done.stdout.splitlines() if not line.startswith("#")]


@pytest.mark.real_time
@pytest.mark.parametrize(
    ("locale", "head", "entered"),
    [
        ("machine", "time_utc,time_local,equipment,event,code,source,", ",c1,arrived,1,"),
        ("de", "Zeit UTC;Zeit lokal;Maschine;Ereignis;Code;Quelle;", ";c1;"),
        ("hr", "Vrijeme UTC;", ";c1;"),
    ],
)
def test_events_go_home_without_a_server(told: tuple[Path, Path], locale: str, head: str, entered: str) -> None:
    data, folder = told
    options = ("--plant", str(folder), "--locale", locale)
    first, *rows = lines(pogon(data, "export", "--events", "c1", *options))
    assert first.startswith(head)
    assert any(entered in row for row in rows) and all(entered[:4] in row for row in rows)
    assert sum(f"{entered[0]}999{entered[0]}" in row for row in rows) == 1  # and no time of day
    everything = lines(pogon(data, "export", "--events", "all", *options))
    assert len(everything) > len(rows) + 1
    assert {row for row in everything if entered[:4] in row} == set(rows)
    assert lines(pogon(data, "export", "--events", "c1", "--to", "-25m", "--from", "-30m", *options)) == [first]


@pytest.mark.real_time
def test_records_go_home_without_a_server(told: tuple[Path, Path]) -> None:
    data, folder = told
    options = ("--plant", str(folder))
    head, *products = lines(pogon(data, "export", "--records", "passage", *options))
    assert len(products) == 1 and ",c1," in products[0] and ",7," in products[0]
    of_shift, *in_shifts = lines(pogon(data, "export", "--records", "passage", "--by-shift", *options))
    assert of_shift == f"shift,{head}" and [row.partition(",")[2] for row in in_shifts] == products
    assert lines(pogon(data, "export", "--records", "passage:c1", *options)) == [head, *products]
    assert lines(pogon(data, "export", "--records", "passage:all", *options)) == [head, *products]
    _, *both = lines(pogon(data, "export", "--records", "run", *options))
    _, *one = lines(pogon(data, "export", "--records", "run:seq2", *options))
    of_both, of_one = ([row.split(",")[:6] for row in rows if ",seq2," in row] for rows in (both, one))
    assert (
        of_both == of_one and len(both) > len(of_one) == len(one) > 0
    )  # further columns are those of the steps that are asked for
    german, *_ = lines(pogon(data, "export", "--records", "passage:c1", "--locale", "de", *options))
    assert german.startswith("Eintritt UTC;Eintritt lokal;Maschine;Produkt;")


@pytest.mark.real_time
@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("--events", "m1"), "--events m1: expected "),
        (("--events", "c1", "--locale", "fr"), "locale: fr, expected one of hr, "),
        (("--events", "c1", "--records", "run"), "either --tags"),
        (("--events", "c1", "--aggregate", "60"), "either --tags"),
        (("--records", "coils"), "--records coils: expected "),
        (("--records", "run:c1"), "--records run:c1: expected run or run:seq1, run:seq2"),
        (("--records", "run:"), ""),
        (("--records", ":c1"), "--records :c1: expected "),
        (("--records", "run", "--locale", "fr"), "locale: fr, expected one of hr, "),
        (("--records", "run", "--aggregate", "60"), "either --tags"),
        (("--records", "run", "--from", "monday"), "monday"),
    ],
)
def test_what_cannot_go_home_is_named_in_one_line(
    told: tuple[Path, Path], arguments: tuple[str, ...], named: str
) -> None:
    done = pogon(told[0], "export", "--plant", str(told[1]), *arguments)
    assert (done.returncode, named in done.stderr, "Traceback" in done.stderr) == (2 if named else 0, True, False)
    assert not named or done.stderr.count("\n") == 1, done.stderr
