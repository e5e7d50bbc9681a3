"""Settings: one that cannot be is told in one line by every command, a mistyped one is named."""

from pathlib import Path

import pytest

from app.settings import unknown_settings
from tests.test_cli import pogon


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"serve_modbus": "nonsense"}, "POGON_SERVE_MODBUS=nonsense: expected HOST:PORT"),
        ({"serve_modbus": "127.0.0.1:66000"}, "POGON_SERVE_MODBUS=127.0.0.1:66000: expected HOST:PORT"),
        ({"behind_proxy": "nginx"}, "expected IP addresses or networks, such as 172.30.80.1, not nginx"),
        ({"tls_cert": "/none.pem", "tls_key": "/none.key"}, "POGON_TLS_CERT=/none.pem"),
        ({"host": "203.0.113.9", "behind_proxy": "127.0.0.1"}, "POGON_HOST=203.0.113.9"),
        ({"host": "0.0.0.0"}, "listens beyond this machine"),
        ({"serve_modbus": "0.0.0.0:5020"}, "listens beyond this machine: expected 127.0.0.1"),
        ({"serve_modbus": "[::]:5020"}, "POGON_MODBUS_BEYOND=true allows that"),
        ({"serve_modbus": "hall.example:5020"}, "listens beyond this machine"),
        ({"syslog": "dev/log"}, "POGON_SYSLOG=dev/log: expected a path such as /dev/log"),
        ({"log": "xml"}, "POGON_LOG=xml: Input should be 'text' or 'json'"),
        ({"port": "http"}, "POGON_PORT=http: Input should be a valid integer"),
    ],
)
def test_a_setting_that_cannot_be_is_one_line(tmp_path: Path, settings: dict[str, str], said: str) -> None:
    refused = pogon(tmp_path / "data", "run", **settings)
    assert refused.returncode == 2
    assert said in refused.stderr and refused.stderr.count("\n") == 1


@pytest.mark.parametrize(
    "command", [["export", "--tags", "m1.speed"], ["user", "list"], ["backup", "b.tar"], ["check"]]
)
def test_every_command_tells_every_wrong_setting(tmp_path: Path, command: list[str]) -> None:
    refused = pogon(tmp_path, *command, port="x", push_period=9)
    assert refused.returncode == 2
    assert [line.split("=")[0] for line in refused.stderr.splitlines()] == [
        "pogon: POGON_PORT",
        "pogon: POGON_PUSH_PERIOD",
    ]


def test_a_mistyped_setting_is_named() -> None:
    assert unknown_settings(["POGON_PROT", "POGON_PORT", "pogon_data", "POGON_CHROMIUM", "PATH"]) == ["POGON_PROT"]
