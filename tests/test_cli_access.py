"""pogon user and pogon audit, as one types them, also beside a running server."""

import csv
import errno
import io
import os
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from app.access.keys import read_key
from app.access.passwords import Passwords
from app.alarms import journal
from app.cli import cli
from app.cli_access import LARGEST_LIST, MOST_PEOPLE
from app.db import Database
from app.main import create_app
from app.settings import Settings
from app.web.serve import announcement
from tests.conftest import PogonServer, enroll

Pogon = Callable[..., Result]
ALARM = journal.Record(
    time=1,
    first_true=1,
    event="RAISED",
    detail="",
    alarm="m1.overcurrent",
    occurrence=1,
    equipment="m1",
    area="drives",
    alarm_class="process",
    priority=1,
    before="A",
    after="B",
    active=True,
    acked=False,
    latched=False,
    hidden="",
    silent=False,
    ordinal=0,
    value=None,
    unit="",
    quality="good",
    limit=None,
    person_id=0,
    person="",
    roles="",
    address="",
    session="",
    comment="",
    type="eura_e800",
    text_id="overcurrent",
    params="{}",
    text="Nadstruja",
    config="",
)


@pytest.fixture
def pogon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Pogon:
    """`pogon("user", "add", "ana")` in a data folder of its own."""
    monkeypatch.setenv("POGON_DATA", str(tmp_path / "data"))
    return lambda *arguments, input=None: CliRunner().invoke(cli, [*arguments], input=input)


def test_a_person_is_added_and_listed(pogon: Pogon) -> None:
    made = pogon("user", "add", "Ana.Kos", "--role", "engineer", "--role", "operator", "--display", "Ana Kos")
    assert made.exit_code == 0
    assert made.output.startswith("ana.kos (engineer, operator) initial password: ")
    listed = pogon("user", "list").output
    assert listed.split()[:3] == ["ana.kos", "initial", "password"]
    assert made.stdout.split()[-1] not in listed
    assert made.stderr.startswith("pogon: nobody is an administrator"), "the engineer cannot make one"


@pytest.mark.parametrize(
    "arguments", [["list"], ["passwd", "ana", "--initial"], ["role", "ana", "admin"], ["factor-reset", "ana"]]
)
def test_a_data_folder_that_is_mistyped_is_named_and_not_made(
    pogon: Pogon, tmp_path: Path, arguments: list[str]
) -> None:
    refused = pogon("user", *arguments, "--data", str(tmp_path / "dta"))
    assert refused.exit_code == 2
    assert (
        refused.stderr
        == f"pogon: {tmp_path / 'dta' / 'pogon.db'} is not there: start the server once, or give --data\n"
    )
    assert not (tmp_path / "dta").exists()


def test_a_second_factor_is_listed_and_reset(pogon: Pogon, tmp_path: Path) -> None:
    pogon("user", "add", "ana")
    assert pogon("user", "factor-reset", "ana").stderr == "pogon: There is no second factor.\n"
    assert pogon("user", "factor-reset", "nobody").exit_code == 2
    with closing(sqlite3.connect(tmp_path / "data" / "pogon.db")) as connection, connection:
        connection.execute("INSERT INTO factor VALUES (1, '', 0, 0)")
        connection.execute("INSERT INTO recovery_code VALUES (1, 'x')")
    connection.close()
    assert "2nd factor" in pogon("user", "list").output
    reset = pogon("user", "factor-reset", " ANA")
    assert (reset.exit_code, "is reset" in reset.output) == (0, True)
    assert "2nd factor" not in pogon("user", "list").output
    with closing(sqlite3.connect(tmp_path / "data" / "pogon.db")) as connection, connection:
        assert connection.execute("SELECT count(*) FROM recovery_code").fetchone() == (0,)
        line = connection.execute("SELECT person, object FROM audit WHERE kind = 'factor.reset'").fetchone()
    connection.close()
    assert line[0].startswith("terminal:") and line[1] == "ana"


def test_a_class_is_added_from_a_file_all_or_none(pogon: Pogon, tmp_path: Path) -> None:
    file = tmp_path / "class.csv"
    file.write_text("name;display;roles\nivo;Ivo Ivić;operator\nmaja;Maja;engineer operator\n", "utf-8")
    rows = list(csv.DictReader(io.StringIO(pogon("user", "add", "--file", str(file)).stdout)))
    assert [(row["name"], row["roles"]) for row in rows] == [("ivo", "operator"), ("maja", "engineer operator")]
    assert all(len(row["initial password"]) == 20 for row in rows)
    file.write_text("name,roles\nnova,operator\nivo,operator\n")
    failed = pogon("user", "add", "--file", str(file))
    assert (failed.exit_code, failed.stderr) == (2, "pogon: There is already an account ivo.\n")
    assert "nova" not in pogon("user", "list").output


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "a pipe, expected an ordinary file, in a CSV file of people"),
        (b"x" * (LARGEST_LIST + 1), f"expected at most {LARGEST_LIST} bytes"),
        (b"name\n" + b"".join(b"p%d\n" % i for i in range(MOST_PEOPLE + 1)), f"expected at most {MOST_PEOPLE} people"),
        (b"name\n\xff\xfe\n", "class.csv:2: byte 0xff, expected text in UTF-8"),
        (b"name\na\0b\n", "expected 1 columns of letters"),
        (b"name,display\nivo,\x1b[2J\n", "expected 2 columns of letters"),
        (b"name,roles\nivo,operator,admin\n", "expected 2 columns of letters"),
        (b'name\n"' + b"x" * 200_000, "field larger than field limit"),
        (b"\x1b[2J" * 1000 + b"\nivo\n", "class.csv:1: heading ?[2j"),
        (b"name,name,name\n", "nobody in it"),
        (b"", "heading is empty"),
    ],
    ids=range(11),
)
def test_a_file_that_is_no_class_is_one_line(tmp_path: Path, pogon: Pogon, content: bytes | None, said: str) -> None:
    file = tmp_path / "class.csv"
    if content is None:
        os.mkfifo(file)
    else:
        file.write_bytes(content)
    failed = pogon("user", "add", "--file", str(file))
    assert failed.exit_code == 2
    assert said in failed.stderr and failed.stderr.count("\n") == 1 and len(failed.stderr) < 600


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "heading is empty"),
        ("nme,roles\nx,operator\n", "expected name"),
        ("name\n\n", "nobody in it"),
        ("name,roles\nx1,boss\n", "Unknown role: boss"),
    ],
)
def test_a_wrong_file_is_told_in_one_line(pogon: Pogon, tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "class.csv"
    file.write_text(text)
    failed = pogon("user", "add", "--file", str(file))
    assert failed.exit_code == 2
    assert said in failed.stderr and failed.stderr.count("\n") == 1


def test_a_password_is_set_by_typing_by_pipe_or_anew(pogon: Pogon, tmp_path: Path) -> None:
    pogon("user", "add", "ana")
    passwords = Passwords()

    def kept() -> str:
        db = sqlite3.connect(tmp_path / "data" / "pogon.db")
        found: str = db.execute("select password from person").fetchone()[0]
        db.close()
        return found

    assert pogon("user", "passwd", "ana", input="tri plave ladice\ntri plave ladice\n").exit_code == 0
    assert passwords._hasher.verify("tri plave ladice", kept())
    assert pogon("user", "passwd", "ana", "--stdin", input="sedam zelenih bicikala\n").exit_code == 0
    assert passwords._hasher.verify("sedam zelenih bicikala", kept())
    initial = pogon("user", "passwd", "ana", "--initial").output.split()[-1]
    assert passwords._hasher.verify(initial, kept())
    assert "too short" in pogon("user", "passwd", "ana", "--stdin", input="short\n").stderr.lower()
    assert pogon("user", "passwd", "nobody", "--initial").exit_code == 2
    passwords.close()


def test_a_password_of_somebody_disabled_says_that_he_stays_so(pogon: Pogon, tmp_path: Path) -> None:
    pogon("user", "add", "ana")
    assert "disabled" not in pogon("user", "passwd", "ana", "--initial").output
    db = sqlite3.connect(tmp_path / "data" / "pogon.db")
    db.execute("update person set disabled = 1")
    db.commit()
    db.close()
    done = pogon("user", "passwd", "ana", "--initial")
    assert done.exit_code == 0 and "ana is disabled" in done.stderr


def test_roles_are_a_set(pogon: Pogon) -> None:
    pogon("user", "add", "ana", "--role", "admin")
    assert pogon("user", "role", "ana", "admin", "engineer").output == "ana: admin, engineer\n"
    assert "administrator must remain" in pogon("user", "role", "ana", "viewer").stderr
    assert "Unknown role: boss" in pogon("user", "role", "ana", "boss").stderr


def test_verify_says_ok_with_a_count_or_names_the_first_bad_line(pogon: Pogon, tmp_path: Path) -> None:
    assert pogon("audit", "verify").exit_code == 2
    for name in ("ana", "ivo", "maja"):
        pogon("user", "add", name)
    good = pogon("audit", "verify")
    assert (good.exit_code, good.output) == (0, "audit ok: 3 lines\nalarm journal ok: 0 lines\n")
    db = sqlite3.connect(tmp_path / "data" / "pogon.db")
    db.execute("update audit set new = 'admin' where seq = 2")
    db.commit()
    db.close()
    bad = pogon("audit", "verify")
    assert bad.exit_code == 1
    assert bad.stderr == "audit broken: line 2 was changed; 1 lines before it are in order\n"


def test_verify_names_the_file_of_anchors_that_does_not_agree(pogon: Pogon, tmp_path: Path) -> None:
    pogon("user", "add", "ana")
    copy = tmp_path / "of another plant"
    copy.write_text(f"1 1773036300000000 {'ab' * 32} - {'cd' * 32}\n")
    bad = pogon("audit", "verify", "--anchors", str(copy))
    assert bad.exit_code == 1
    assert (
        bad.stderr
        == f"audit broken: line 1 does not agree with the anchors in {copy}; 0 lines before it are in order\n"
    )


def test_verify_says_that_the_buffer_is_no_file(pogon: Pogon, tmp_path: Path) -> None:
    pogon("user", "add", "ana")
    (tmp_path / "data" / "audit.buffer").unlink(missing_ok=True)
    (tmp_path / "data" / "audit.buffer").mkdir(mode=0o700)
    bad = pogon("audit", "verify")
    assert bad.exit_code == 1
    assert "line 2 may be in audit.buffer, which is no file that can be read" in bad.stderr


def test_verify_looks_at_the_alarm_journal_too(pogon: Pogon, tmp_path: Path) -> None:
    data = tmp_path / "data"
    pogon("user", "add", "ana")
    key = journal.journal_key(read_key(data / "audit.key"))
    kept = Database(data / "pogon.db", "pogon")
    kept.run(lambda connection: journal.write(connection, key, [ALARM, ALARM, ALARM], [], []))
    kept.close()
    good = pogon("audit", "verify")
    assert (good.exit_code, good.output) == (0, "audit ok: 1 lines\nalarm journal ok: 3 lines\n")
    db = sqlite3.connect(data / "pogon.db")
    db.execute("update alarm_journal set person = 'ivo' where seq = 2")
    db.commit()
    db.close()
    bad = pogon("audit", "verify")
    assert (bad.exit_code, bad.stdout) == (1, "audit ok: 1 lines\n")
    assert bad.stderr == "alarm journal broken: line 2 was changed; 1 lines before it are in order\n"


def test_a_key_that_others_may_read_is_refused(pogon: Pogon, tmp_path: Path) -> None:
    pogon("user", "add", "ana")
    (tmp_path / "data" / "secret.key").chmod(0o644)
    for command in (["user", "list"], ["audit", "verify"], ["run"]):
        refused = pogon(*command)
        assert refused.exit_code == 2
        assert "secret.key may be read or written by others" in refused.stderr


@pytest.mark.sweep(8)
def test_beside_a_running_server_people_are_made_and_the_chain_is_verified(
    pogon: Pogon, pogon_server: Callable[..., PogonServer], tmp_path: Path
) -> None:
    server = pogon_server(data=tmp_path / "data")
    code = (tmp_path / "data" / "first-code").read_text().strip()
    assert f"    {code}\n" in server.log()
    assert f":{server.port}/first and type this code" in server.log()
    assert pogon("user", "add", "ana", "--role", "admin").exit_code == 0
    verified = pogon("audit", "verify")
    assert (verified.exit_code, verified.output) == (0, "audit ok: 2 lines\nalarm journal ok: 0 lines\n")
    second = pogon("run")
    assert second.exit_code == 2
    assert "another pogon runs on it" in second.stderr


def test_port_0_is_told_as_what_it_became(tmp_path: Path) -> None:
    settings = Settings(port=0, data=tmp_path)
    assert "http://localhost:43210/" in announcement(create_app(settings), settings, 43210)


@pytest.mark.parametrize(("terminal", "line"), [(True, "/ (Ctrl+C ends it)\n"), (False, "/\n")])
def test_only_at_a_terminal_keys_that_end_it_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, terminal: bool, line: str
) -> None:
    monkeypatch.setattr("sys.stdout.isatty", lambda: terminal)
    settings = Settings(data=tmp_path)
    assert f"Pogon is at http://localhost:8000{line}" in announcement(create_app(settings), settings, 8000)


def test_the_name_that_others_type_is_told_where_the_server_listens_for_them(tmp_path: Path) -> None:
    """A teacher read localhost alone, for which his certificate is not."""
    given = {"host": "0.0.0.0", "data": tmp_path, "allowed_hosts": "teacher.example"}
    own = Settings(**given, tls_cert=tmp_path / "cert.pem", tls_key=tmp_path / "key.pem")
    assert "Others reach it at https://teacher.example:8000/\n" in announcement(create_app(own), own, 8000)
    contained = Settings(**given, tls_cert=tmp_path / "cert.pem", tls_key=tmp_path / "key.pem", published_port=8443)
    assert "Others reach it at https://teacher.example:8443/\n" in announcement(create_app(contained), contained, 8000)
    assert "Pogon is at https://localhost:8443/\n" in announcement(create_app(contained), contained, 8000)
    proxied = Settings(**given, behind_proxy="192.0.2.1")
    assert "Others" not in announcement(create_app(proxied), proxied, 8000), "they come to the port of the proxy"
    near = Settings(data=tmp_path, allowed_hosts="teacher.example")
    assert "Others" not in announcement(create_app(near), near, 8000), "nobody else reaches it"


@pytest.mark.parametrize("arguments", [["run"], ["user", "add", "eve", "--role", "admin"], ["user", "list"]])
def test_a_plant_that_lost_its_database_is_not_taken_for_a_new_one(tmp_path: Path, arguments: list[str]) -> None:
    data = tmp_path / "data"
    enroll(data, {"ana": ["admin"]}, "tri plave ladice u kutu")
    for path in data.glob("pogon.db*"):
        path.unlink()
    result = CliRunner().invoke(cli, arguments, env={"POGON_DATA": str(data), "POGON_PORT": "0"})
    assert result.exit_code == 2
    (line,) = result.stderr.strip().splitlines()
    assert "pogon restore" in line
    assert "--begin-anew" in line
    assert not (data / "pogon.db").exists()


@pytest.mark.parametrize(
    "command",
    [
        ("user", "list"),
        ("user", "add", "bob"),
        ("audit", "verify"),
        ("export", "--tags", "m1.speed", "--from", "-1h"),
        ("backup", "kept.pogon"),
        ("restore", "archive"),
        ("selftest",),
        ("run",),
    ],
    ids=" ".join,
)
def test_a_data_folder_into_which_one_may_not_look_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]
) -> None:
    """As the service has it, and somebody types a command as himself; a test that is root may look everywhere."""
    data = tmp_path / "data"
    data.mkdir()
    (tmp_path / "archive").touch()
    monkeypatch.chdir(tmp_path)
    stat = Path.stat

    def closed(path: Path, **how: bool) -> os.stat_result:
        if data in path.parents:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return stat(path, **how)

    monkeypatch.setattr(Path, "stat", closed)
    result = CliRunner().invoke(cli, command, env={"POGON_DATA": str(data), "POGON_PORT": "0"})
    assert result.exit_code == (1 if command == ("selftest",) else 2), result.output
    assert f"POGON_DATA={data} cannot be used: Permission denied; expected to be run by its owner" in result.output
    assert not list(data.iterdir())


def test_a_folder_that_can_only_be_read_is_looked_at_and_stays_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A copy that was put away on a medium: no file is made beside it, not even those of SQLite."""
    data = tmp_path / "data"
    enroll(data, {"ana": ["admin"]}, "tri plave ladice u kutu")
    for path in data.iterdir():
        path.chmod(0o440)
    before = {path.name: (path.read_bytes(), path.stat().st_mtime_ns) for path in data.iterdir()}
    access = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: mode != os.W_OK and access(path, mode))

    def typed(*command: str) -> Result:
        return CliRunner().invoke(cli, command, env={"POGON_DATA": str(data)})

    listed, verified = typed("user", "list"), typed("audit", "verify")
    told = f"pogon: {data} can only be read: a copy of it is looked at\n"
    assert (listed.exit_code, listed.stderr, listed.stdout.split()[0]) == (0, told, "ana")
    assert (verified.exit_code, verified.stderr) == (0, told)
    assert verified.stdout.startswith("audit ok: ")
    assert {path.name: (path.read_bytes(), path.stat().st_mtime_ns) for path in data.iterdir()} == before
    (data / "audit.key").chmod(0o640)
    (data / "audit.key").write_text("5" * 64 + "\n")
    broken = typed("audit", "verify")
    assert broken.exit_code == 1 and "audit broken: line 2 does not agree with audit.anchors" in broken.stderr
