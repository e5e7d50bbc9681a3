"""Settings: one that cannot be is told in one line by every command, a mistyped one is named."""

import os
import socket
from contextlib import closing
from pathlib import Path

import pytest

from app.errors import ConfigurationError
from app.settings import check_places, read_settings, unknown_settings
from tests.test_cli import pogon

WRONG = (
    ({"serve_modbus": "nonsense"}, "POGON_SERVE_MODBUS=nonsense: expected HOST:PORT"),
    ({"serve_modbus": "127.0.0.1:66000"}, "POGON_SERVE_MODBUS=127.0.0.1:66000: expected HOST:PORT"),
    ({"behind_proxy": "nginx"}, "expected IP addresses or networks, such as 172.30.80.1, not nginx"),
    ({"host": "0.0.0.0"}, "listens beyond this machine"),
    ({"serve_modbus": "0.0.0.0:5020"}, "listens beyond this machine: expected 127.0.0.1"),
    ({"serve_modbus": "[::]:5020"}, "POGON_MODBUS_BEYOND=true allows that"),
    ({"serve_modbus": "hall.example:5020"}, "listens beyond this machine"),
    ({"syslog": "dev/log"}, "POGON_SYSLOG=dev/log: expected a path such as /dev/log"),
    ({"log": "xml"}, "POGON_LOG=xml: Input should be 'text' or 'json'"),
    ({"port": "http"}, "POGON_PORT=http: Input should be a valid integer"),
)
"""Settings, and what is said of them: whoever tries again is told the same."""
ABSENT = (
    ({"tls_cert": "/none.pem", "tls_key": "/none.key"}, "POGON_TLS_CERT=/none.pem"),
    ({"host": "203.0.113.9", "behind_proxy": "127.0.0.1"}, "POGON_HOST=203.0.113.9"),
    (
        {"plant": "/none/such"},
        "POGON_PLANT=/none/such: expected a folder with plant.toml (No such file or directory)",
    ),
    ({"plant": "/dev/null"}, "POGON_PLANT=/dev/null: expected a folder with plant.toml (it is something else)"),
    ({"audit_anchors": "/dev"}, "POGON_AUDIT_ANCHORS=/dev: expected a file that may be written"),
    ({"syslog": "/dev/null"}, "POGON_SYSLOG=/dev/null: expected the socket of a running syslog"),
)
"""The same of what is not there, and may come."""


@pytest.mark.sweep(8)
@pytest.mark.parametrize(("code", "settings", "said"), [*((78, *one) for one in WRONG), *((2, *one) for one in ABSENT)])
def test_what_keeps_it_from_starting_is_one_line_and_its_code_says_whether_it_may_pass(
    tmp_path: Path, code: int, settings: dict[str, str], said: str
) -> None:
    refused = pogon(tmp_path / "data", "run", **settings)
    assert refused.returncode == code
    assert said in refused.stderr and refused.stderr.count("\n") == 1


@pytest.mark.sweep(8)
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


WRONG = [
    ("host", "", "expected an address or name of this machine"),
    ("host", "http://127.0.0.1", "expected an address or name of this machine"),
    ("host", "localhost:8000", "without port"),
    ("host", "256.0.0.1", "expected an address"),
    ("data", "", "expected a path"),
    ("data", "  ", "expected a path"),
    ("data", "a" * 256, "expected a path of at most 4095 bytes, 255 in each"),
    ("plant", "č/" * 1400, "expected a path of at most 4095 bytes"),
    ("plant", "a\nb", "POGON_PLANT=a\\x0ab: expected a path"),
    ("allowed_hosts", "http://hall.example", "not http://hall.example"),
    ("allowed_hosts", "hall.example:8000", "without http://, port or path, not hall.example:8000"),
    ("allowed_hosts", "good.example,*", "not *"),
    ("allowed_hosts", "č.example", "expected host names as browsers send them"),
    ("behind_proxy", ",", "expected IP addresses or networks"),
    ("behind_proxy", " ", "expected IP addresses or networks"),
    ("behind_proxy", "0.0.0.0/0", "not everybody"),
    ("serve_modbus", "a\nb", "POGON_SERVE_MODBUS=a\\x0ab: expected HOST:PORT"),
    ("syslog", "č:514", "expected a path such as /dev/log, or HOST:PORT"),
    ("syslog", "127.0.0.1:0", "expected a path such as /dev/log, or HOST:PORT"),
    ("second_factor", ",", "expected roles of admin, engineer, operator, viewer"),
    ("second_factor", "x" * 5000, "(5000 characters)"),
    ("history_keep_days", "inf", "less than or equal to 36500"),
    ("history_keep_days", "1e400", "less than or equal to 36500"),
    ("history_keep_days", "nan", "Input should be less than"),
    ("history_keep_days", "-1", "greater than 0"),
    ("history_quota_mb", "inf", "less than or equal to"),
    ("history_quota_mb", "nan", "Input should be less than"),
    ("export_rows", "9" * 30, "less than or equal to"),
    ("push_period", "nan", "Input should be less than"),
]


@pytest.mark.parametrize(("name", "value", "said"), WRONG)
def test_an_absurd_value_is_one_short_line_with_its_setting_and_what_was_expected(
    name: str, value: str, said: str
) -> None:
    with pytest.raises(ConfigurationError) as refused:
        read_settings(**{name: value})
    line = str(refused.value)
    assert line.startswith(f"POGON_{name.upper()}={value[:5]}".partition("\n")[0]) and said in line
    assert "\n" not in line and len(line) < 400


def test_a_wrong_token_is_named_and_not_repeated() -> None:
    for token in ("č-geheim", "geheim 2", "geheim\n", "\x01geheim"):
        with pytest.raises(ConfigurationError, match="POGON_METRICS_TOKEN: expected letters") as refused:
            read_settings(metrics_token=token)
        assert "geheim" not in str(refused.value)


def test_proxies_that_are_none_open_nothing_to_the_world() -> None:
    """Whatever stands in POGON_BEHIND_PROXY lets the server listen beyond this machine without TLS."""
    with pytest.raises(ConfigurationError):
        read_settings(host="0.0.0.0", behind_proxy=",")


def test_what_is_not_said_of_a_file_is_not_set() -> None:
    settings = read_settings(
        tls_cert="", tls_key="", audit_anchors="", allowed_hosts="Hall.example, [2001:db8::7],10.0.0.7"
    )
    assert settings.tls_cert is settings.tls_key is settings.audit_anchors is None
    assert {"hall.example", "[2001:db8::7]", "10.0.0.7"} <= settings.hosts


@pytest.mark.parametrize("name", ["pipe", "loop", "folder"])
def test_places_that_are_something_else_are_all_told_before_anything_is_made(tmp_path: Path, name: str) -> None:
    """A pipe would keep the audit waiting for ever."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "folder").mkdir()
    place = tmp_path / name
    said = {"audit_anchors": str(place), "syslog": str(place)} | ({} if name == "folder" else {"data": str(place)})
    with pytest.raises(ConfigurationError) as refused:
        check_places(read_settings(**said))
    assert {line.partition("=")[0] for line in str(refused.value).splitlines()} == {
        f"POGON_{key.upper()}" for key in said
    }
    assert sorted(one.name for one in tmp_path.iterdir()) == ["folder", "loop", "pipe"]


@pytest.mark.sweep(8)
def test_where_copies_go_to_may_come_after_the_start(tmp_path: Path) -> None:
    """After a power cut a disk in the network, or the syslog, may be there later than the plant is needed."""
    said = {"audit_anchors": str(tmp_path / "disk" / "anchors"), "syslog": str(tmp_path / "log")}
    assert check_places(read_settings(data=str(tmp_path), **said)) == [
        f"POGON_AUDIT_ANCHORS={tmp_path}/disk/anchors: expected a file that may be written, in a folder that is there "
        "(No such file or directory): nothing goes there until it is",
        f"POGON_SYSLOG={tmp_path}/log: expected the socket of a running syslog such as /dev/log "
        "(No such file or directory): nothing goes there until it is",
    ]
    told = pogon(tmp_path / "data", "selftest", **said)
    assert [line for line in told.stdout.splitlines() if "until it is" in line] != []


@pytest.mark.sweep(8)
def test_the_selftest_tells_the_same(tmp_path: Path) -> None:
    told = pogon(tmp_path / "data", "selftest", plant=tmp_path / "none", audit_anchors=tmp_path / "none" / "anchors")
    assert told.returncode == 1 and "Traceback" not in told.stderr
    for name in ("POGON_PLANT", "POGON_AUDIT_ANCHORS"):
        assert f"{name}={tmp_path}/none" in told.stdout
    assert not (tmp_path / "data").exists()


def test_places_that_are_there_are_not_refused(tmp_path: Path) -> None:
    (tmp_path / "old").touch()
    with closing(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)) as syslog:
        syslog.bind(str(tmp_path / "log"))
        for anchors in ("old", "new"):
            check_places(
                read_settings(
                    data=str(tmp_path / "data"), audit_anchors=str(tmp_path / anchors), syslog=str(tmp_path / "log")
                )
            )
