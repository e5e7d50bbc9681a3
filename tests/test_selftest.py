"""`pogon selftest` says of each part of a machine whether Pogon can run there, and its exit code says it of all."""

import json
import os
import pty
import socket
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.access.access import lock, prepare
from app.cli import cli
from app.clock import ManualClock
from app.db import Database
from app.plant.texts import Texts, terminal_language
from app.selftest import Finding, run_checks
from app.settings import Settings
from app.sim.plant import clashes_of, read_simulated
from tests.conftest import find_port
from tests.test_cli import self_signed

CLASH = """
[plant]
name = "Two halls"
timezone = "Europe/Zagreb"
languages = ["en"]
[links.a]
transport = "memory"
[links.b]
transport = "memory"
[equipment.m1]
type = "eura_e800"
link = "a"
unit = 1
[equipment.m2]
type = "eura_e800"
link = "b"
unit = 1
"""
SERIAL = """
[plant]
name = "Hall"
timezone = "Europe/Zagreb"
languages = ["en"]
[links.line]
transport = "rtu"
port = "{port}"
[equipment.m1]
type = "eura_e800"
link = "line"
unit = 1
"""
SECOND = """
[links.other]
transport = "rtu"
port = "{port}"
"""
ANA = "1, 'ana', 'Ana', '', 0, NULL, 0, 'en', 'light', 1, NULL"
"""Without an account the mark of the audit would be of a plant that has lost its database."""


@pytest.fixture
def data(tmp_path: Path) -> Path:
    folder = tmp_path / "data"
    prepare(folder)
    for name in ("pogon", "history"):
        database = Database(folder / f"{name}.db", name)  # type: ignore[arg-type]
        database.migrate()
        database.close()
    with closing(sqlite3.connect(folder / "pogon.db")) as people, people:
        people.execute(f"INSERT INTO person VALUES ({ANA})")
    (folder / "audit.key").write_text("ab" * 32 + "\na mark of the audit in a line of its own\n")
    (folder / "audit.key").chmod(0o600)
    return folder


def findings(data: Path, clock: ManualClock | None = None, **settings: object) -> dict[str, Finding]:
    given = {"data": data, "port": find_port()} | settings
    clock = clock or ManualClock()
    clock.step_wall(86_400 * 365)  # files of a test are of today
    found = list(run_checks(Settings(**given), clock, read_simulated, clashes_of))  # type: ignore[arg-type]
    by_check = {f"{one.check}.{one.params.get('name', '')}".rstrip("."): one for one in found}
    texts = Texts.read()
    for one in found:
        for lang in ("hr", "en", "de", "cs"):
            said = texts.text(lang, one.key, **one.params)
            assert not said.startswith("[") and "{" not in said, said
    return by_check


def test_a_good_machine_has_no_failures(data: Path) -> None:
    found = findings(data)
    assert [one.key for one in found.values() if one.state == "failed"] == []
    assert {"data", "keys", "port", "clock", "time_sync", "space", "speed", "tls", "plant"} <= set(found)
    assert found["database.pogon.db"].outcome == found["database.history.db"].outcome == "good"


@pytest.mark.parametrize("name", ["data?mode=rw", "data#2", "50%25 %2e"])
def test_a_folder_of_any_name_is_looked_at_itself_and_nothing_is_left_beside_it(
    data: Path, tmp_path: Path, name: str
) -> None:
    odd = data.rename(tmp_path / name)
    (odd / "history.db").write_bytes(b"no database" * 400)
    found = findings(odd)
    assert found["database.pogon.db"].outcome == "good" and found["database.history.db"].outcome == "broken"
    assert [one.name for one in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize("left", [None, b""])
def test_a_lost_database_that_the_start_would_refuse_is_a_failure(data: Path, left: bytes | None) -> None:
    (data / "audit.head").write_text("of an older plant")
    (data / "pogon.db").unlink()
    if left is not None:
        (data / "pogon.db").write_bytes(left)
        (data / "pogon.db").chmod(0o600)
    found = findings(data)["database.pogon.db"]
    assert found.state == "failed" and "pogon restore" in str(found.params["reason"])


def test_a_new_machine_has_no_failures_and_stays_new(tmp_path: Path) -> None:
    found = findings(tmp_path / "new")
    assert [one.key for one in found.values() if one.state == "failed"] == []
    assert not (tmp_path / "new").exists()


Break = Callable[[Path, Path], dict[str, object]]


def others_read(data: Path, _tmp: Path) -> dict[str, object]:
    (data / "pogon.db").chmod(0o644)
    return {}


def others_write(data: Path, _tmp: Path) -> dict[str, object]:
    data.chmod(0o777)
    return {}


def no_key(data: Path, _tmp: Path) -> dict[str, object]:
    (data / "audit.key").write_text("none")
    return {}


def no_identity(data: Path, _tmp: Path) -> dict[str, object]:
    (data / "factor.identity").write_text("none")
    (data / "factor.identity").chmod(0o600)
    return {}


def piped_key(data: Path, _tmp: Path) -> dict[str, object]:
    os.mkfifo(data / "secret.key", 0o600)
    return {}


def piped_audit_key(data: Path, _tmp: Path) -> dict[str, object]:
    (data / "audit.key").unlink()
    os.mkfifo(data / "audit.key", 0o600)
    return {}


def lost_key(data: Path, _tmp: Path) -> dict[str, object]:
    (data / "audit.key").unlink()
    (data / "audit.head").write_text("1 x y")
    return {}


def no_database(data: Path, _tmp: Path) -> dict[str, object]:
    (data / "history.db").write_bytes(b"none" * 5000)
    return {}


def torn_database(data: Path, _tmp: Path) -> dict[str, object]:
    with closing(sqlite3.connect(data / "history.db")) as connection, connection:
        connection.execute("PRAGMA journal_mode=DELETE")
    connection.close()
    content = bytearray((data / "history.db").read_bytes())
    content[4096:] = b"\x55" * (len(content) - 4096)
    (data / "history.db").write_bytes(content)
    return {}


def open_tls_key(_data: Path, tmp: Path) -> dict[str, object]:
    cert, key = self_signed(tmp)
    key.chmod(0o644)
    return {"tls_cert": cert, "tls_key": key}


def old_certificate(_data: Path, tmp: Path) -> dict[str, object]:
    cert, key = self_signed(tmp)
    key.chmod(0o600)
    return {"tls_cert": cert, "tls_key": key}


def no_certificate(_data: Path, tmp: Path) -> dict[str, object]:
    for name in ("cert.pem", "key.pem"):
        (tmp / name).write_text("none")
        (tmp / name).chmod(0o600)
    return {"tls_cert": tmp / "cert.pem", "tls_key": tmp / "key.pem"}


def no_plant(_data: Path, tmp: Path) -> dict[str, object]:
    os.mkfifo(tmp / "plant.toml")
    return {"plant": tmp}


def no_line(_data: Path, tmp: Path) -> dict[str, object]:
    (tmp / "plant.toml").write_text(SERIAL.format(port=tmp / "ttyUSB0"))
    return {"plant": tmp}


def no_device(_data: Path, tmp: Path) -> dict[str, object]:
    (tmp / "ttyUSB0").touch()
    return no_line(_data, tmp)


@pytest.mark.sweep(8)
@pytest.mark.timeout(60)  # nothing keeps it waiting
@pytest.mark.parametrize(
    ("break_it", "key"),
    [
        (others_read, "selftest.data.wrong"),
        (others_write, "selftest.data.wrong"),
        (no_key, "selftest.keys.wrong"),
        (no_identity, "selftest.keys.identity"),
        (piped_key, "selftest.keys.wrong"),
        (piped_audit_key, "selftest.keys.wrong"),
        (lost_key, "selftest.keys.lost"),
        (no_database, "selftest.database.broken"),
        (torn_database, "selftest.database.broken"),
        (open_tls_key, "selftest.tls.open_key"),
        (old_certificate, "selftest.tls.expired"),
        (no_certificate, "selftest.tls.wrong"),
        (no_plant, "selftest.plant.wrong"),
        (no_line, "selftest.serial.missing"),
        (no_device, "selftest.serial.no_device"),
    ],
)
def test_what_is_broken_is_found_and_the_rest_still_checked(
    data: Path, tmp_path: Path, break_it: Break, key: str
) -> None:
    found = findings(data, **break_it(data, tmp_path))
    assert [one.key for one in found.values() if one.state == "failed"] == [key]
    assert len(found) >= 10


def test_a_serial_device_that_can_be_opened_is_good(data: Path, tmp_path: Path) -> None:
    main, side = pty.openpty()
    (tmp_path / "plant.toml").write_text(SERIAL.format(port=os.ttyname(side)))
    assert findings(data, plant=tmp_path)["serial"].state == "ok"
    os.close(main)
    os.close(side)


def test_a_serial_device_that_two_links_call_by_two_names_is_a_failure(data: Path, tmp_path: Path) -> None:
    main, side = pty.openpty()
    lasting = tmp_path / "usb-FTDI_A1-if00-port0"
    lasting.symlink_to(os.ttyname(side))
    (tmp_path / "plant.toml").write_text(SERIAL.format(port=os.ttyname(side)) + SECOND.format(port=lasting))
    found = findings(data, plant=tmp_path)["serial"]
    assert (found.state, found.key) == ("failed", "selftest.serial.same")
    assert found.params == {"link": "other", "port": str(lasting), "other": "line", "other_port": os.ttyname(side)}
    os.close(main)
    os.close(side)


def test_machines_that_cannot_be_served_on_one_port_are_told_before_the_start(data: Path, tmp_path: Path) -> None:
    (tmp_path / "plant.toml").write_text(CLASH)
    assert findings(data, plant=tmp_path)["plant"].state == "ok"
    found = findings(data, plant=tmp_path, serve_modbus=f"127.0.0.1:{find_port()}")["plant"]
    assert (found.state, found.key) == ("failed", "selftest.plant.clash")
    assert found.params["clash"] == "unit 1 is m1 on link a and m2 on link b"


def test_a_taken_port_is_a_failure_unless_our_server_has_it(data: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        found = findings(data, port=port, serve_modbus=f"127.0.0.1:{port}")
        assert (found["port"].key, found["modbus"].key) == ("selftest.port.taken", "selftest.modbus.taken")
        held = lock(data)
        assert findings(data, port=port)["port"].key == "selftest.port.running"
        os.close(held)


@pytest.mark.parametrize(
    ("days", "outcome"), [(-400 * 365, "wrong"), (-366, "back"), (100 * 365, "wrong"), (0, "good")]
)
def test_a_clock_that_cannot_be_right_is_told(data: Path, days: int, outcome: str) -> None:
    clock = ManualClock()
    clock.step_wall(max(days, -50 * 365) * 86_400)
    if outcome == "back":
        os.utime(data / "pogon.db", (1.9e9, 1.9e9))
    assert [one.outcome for one in findings(data, clock).values() if one.check == "clock"] == [outcome]


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("free", "state"), [(10**7, "failed"), (2 * 10**8, "warning"), (10**9, "warning"), (10**10, "ok")]
)
def test_little_room_is_told(data: Path, monkeypatch: pytest.MonkeyPatch, free: int, state: str) -> None:
    monkeypatch.setattr("shutil.disk_usage", lambda _: type("Usage", (), {"free": free}))
    assert findings(data)["space"].state == state


@pytest.mark.parametrize(
    ("language", "good"), [("hr", "u redu"), ("en", "ok"), ("de", "in Ordnung"), ("cs", "v pořádku")]
)
def test_the_command_speaks_the_language_of_the_terminal(
    data: Path, monkeypatch: pytest.MonkeyPatch, language: str, good: str
) -> None:
    monkeypatch.setenv("POGON_DATA", str(data))
    monkeypatch.setenv("POGON_PORT", str(find_port()))
    done = CliRunner().invoke(cli, ["selftest"], env={"LC_ALL": f"{language}_XX.UTF-8"})
    assert done.exit_code == 0, done.output
    assert done.stdout.splitlines()[0].startswith(f"{good}: ")


def test_the_command_is_json_for_programs_and_fails_with_1(data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("POGON_DATA", str(data))
    monkeypatch.setenv("POGON_PORT", str(find_port()))
    good = CliRunner().invoke(cli, ["selftest", "--json"])
    assert (good.exit_code, json.loads(good.stdout)["ok"]) == (0, True)
    no_key(data, data)
    bad = CliRunner().invoke(cli, ["selftest", "--json", "--language", "en"])
    said = json.loads(bad.stdout)
    assert (bad.exit_code, said["ok"]) == (1, False)
    assert [one["check"] for one in said["checks"] if one["state"] == "failed"] == ["keys"]
    assert CliRunner().invoke(cli, ["selftest", "--language", "xx"]).exit_code == 2


def test_an_unknown_language_of_the_terminal_is_english() -> None:
    assert terminal_language({"LANG": "fr_FR.UTF-8"}, ("en", "de")) == "en"
    assert terminal_language({"LANG": "de_AT.UTF-8"}, ("en", "de")) == "de"
    assert terminal_language({}, ("en", "de")) == "en"
