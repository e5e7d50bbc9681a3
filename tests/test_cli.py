"""pogon run and its neighbours with settings that cannot be: one line names the setting, and nothing is half started."""

import os
import re
import socket
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
import typer
from pymodbus.client import ModbusTcpClient
from typer.testing import CliRunner

from app.cli import cli
from app.cli_access import user_cli
from app.db import Database
from app.historian import store
from app.settings import read_settings
from tests.conftest import ROOT, PogonServer, find_port
from tests.historian.conftest import point

F113 = 0x010D
"""Register of the digital frequency setting [0.01 Hz]."""
Start = Callable[..., PogonServer]


def pogon(data: Path, *arguments: str, **settings: object) -> subprocess.CompletedProcess[str]:
    """A command in a process of its own, as one types it."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith("POGON_")}
    named = {f"POGON_{name.upper()}": str(value) for name, value in ({"port": find_port()} | settings).items()}
    return subprocess.run(
        [sys.executable, "-m", "app.cli", *arguments],
        cwd=ROOT,
        env=clean | {"POGON_DATA": str(data)} | named,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def self_signed(folder: Path) -> tuple[Path, Path]:
    """A certificate for localhost and its key, as `openssl` makes them."""
    cert, key = folder / "cert.pem", folder / "key.pem"
    made = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-keyout", key, "-out", cert, "-days", "2"]
    subprocess.run([*made, "-subj", "/CN=localhost"], capture_output=True, check=True)
    return cert, key


@pytest.mark.sweep(8)
def test_a_port_in_use_is_one_line_and_nothing_is_started(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        refused = pogon(tmp_path / "data", "run", port=port)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert refused.stderr.count("\n") == 1
    assert f"POGON_PORT={port}: expected a free port" in refused.stderr
    assert not (tmp_path / "data" / "first-code").exists()


@pytest.mark.sweep(8)
@pytest.mark.parametrize("setting", [{"port": 99999}, {"log": "xml"}, {"host": "0.0.0.0"}])
def test_settings_that_stay_wrong_are_not_tried_for_ever(tmp_path: Path, setting: dict[str, object]) -> None:
    refused = pogon(tmp_path / "data", "run", **setting)
    unit = (ROOT / "packaging" / "pogon.service").read_text("utf-8")
    assert (
        re.search(rf"^RestartPreventExitStatus=.*\b{refused.returncode}$", unit, re.MULTILINE)
        and "\nRestart=on-failure\n" in unit
    )
    assert refused.returncode == 78 and f"POGON_{next(iter(setting)).upper()}" in refused.stderr
    assert f"The exit code is {refused.returncode}\n" in (ROOT / "docs" / "operations.md").read_text("utf-8")


def test_a_plant_folder_that_is_not_there_is_named_with_its_path(tmp_path: Path) -> None:
    refused = CliRunner().invoke(cli, ["check", str(tmp_path / "none")])
    assert refused.exit_code == 2
    assert refused.stderr == f"pogon: {tmp_path / 'none'}/plant.toml: (file) = no such file: expected a TOML file\n"


def test_help_loses_nothing_to_markup() -> None:
    """Rich takes a word in square brackets for a style and leaves it out."""
    texts = [
        text
        for command in [*typer.main.get_group(cli).commands.values(), *typer.main.get_group(user_cli).commands.values()]
        for text in [command.help, *(getattr(one, "help", None) for one in command.params)]
        if text
    ]
    assert len(texts) > 40
    assert [text for text in texts if re.search(r"\[[a-z/]+\]", text)] == []


@pytest.mark.parametrize(("parity", "said"), [("foo", "expected one of none, even, odd"), ("even", "has no parity")])
def test_a_parity_that_cannot_be_is_refused_before_anything_is_served(parity: str, said: str) -> None:
    refused = CliRunner().invoke(cli, ["simulate", "plants/demo", "--pty", "--parity", parity])
    assert (refused.exit_code, refused.stdout) == (2, "")
    assert said in refused.stderr


@pytest.mark.parametrize("address", ["0.0.0.0:0", "[::]:0", "hall.example:5020"])
def test_a_simulator_stays_on_this_machine_unless_told(address: str) -> None:
    refused = CliRunner().invoke(cli, ["simulate", "plants/demo", "--tcp", address])
    assert (refused.exit_code, refused.stdout) == (2, "")
    assert f"--tcp {address} listens beyond this machine" in refused.stderr


def test_the_port_of_the_simulated_plant_may_be_opened_knowingly() -> None:
    assert read_settings(serve_modbus="0.0.0.0:5020", modbus_beyond="true").modbus_beyond


@pytest.mark.sweep(8)
def test_an_export_into_a_folder_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    history = Database(tmp_path / "history.db", "history")
    history.migrate()
    history.run(lambda connection: store.register(connection, [point()]))
    history.close()
    refused = pogon(tmp_path, "export", "--tags", "m1.speed", "-o", "/none/x.csv")
    assert refused.returncode == 2
    assert refused.stderr == (
        "pogon: /none/x.csv: expected a new file in a folder that can be written (No such file or directory)\n"
    )


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("encoding", "shown"), [("ascii", "Đuro Čavić"), ("latin-1", "?uro ?avi?")]
)  # no terminal is ASCII
def test_a_terminal_that_lacks_our_letters_is_told_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, encoding: str, shown: str
) -> None:
    monkeypatch.setenv("PYTHONIOENCODING", encoding)
    helped = pogon(tmp_path / "none", "--help")
    assert helped.returncode == 0 and "selftest" in helped.stdout, helped.stderr
    made = pogon(tmp_path / "data", "user", "add", "djuro", "--display", "Đuro Čavić", "--role", "admin")
    assert made.returncode == 0 and "initial password" in made.stdout, made.stderr
    listed = pogon(tmp_path / "data", "user", "list")
    assert (listed.returncode, listed.stderr) == (0, "")
    assert shown in listed.stdout


@pytest.mark.slow
@pytest.mark.real_time
def test_a_foreign_master_and_the_screen_see_the_same_motor(pogon_server: Start, free_port: int) -> None:
    server = pogon_server("--serve-modbus", f"127.0.0.1:{free_port}")
    until = time.monotonic() + 60
    while f"Modbus TCP at 127.0.0.1:{free_port}" not in server.log():
        assert time.monotonic() < until, server.log()
        time.sleep(0.05)
    master = ModbusTcpClient("127.0.0.1", port=free_port)
    assert master.connect()
    assert not master.write_register(F113, 3500, device_id=1).isError()

    def shown() -> float | None:
        history = sqlite3.connect(f"file:{server.data / 'history.db'}?mode=ro", uri=True)
        row = history.execute(
            "SELECT v FROM sample JOIN point ON point.id = sample.point WHERE name = 'm1.frequency' ORDER BY t DESC LIMIT 1"
        ).fetchone()
        history.close()
        return row[0] if row else None

    until = time.monotonic() + 60
    while shown() != pytest.approx(35.0, abs=0.2):
        assert time.monotonic() < until, shown()
        time.sleep(0.3)
    assert master.read_holding_registers(0x1000, count=1, device_id=1).registers == [3500]
    master.close()


@pytest.mark.sweep(8)
def test_a_modbus_port_in_use_refuses_the_start_in_one_line(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        address = f"127.0.0.1:{other.getsockname()[1]}"
        refused = pogon(tmp_path / "data", "run", "--serve-modbus", address)
    assert refused.returncode == 2
    assert refused.stderr.splitlines()[-1].startswith(f"pogon: POGON_SERVE_MODBUS={address}: ")
    assert "Traceback" not in refused.stderr
    assert "Pogon is at" not in refused.stdout
