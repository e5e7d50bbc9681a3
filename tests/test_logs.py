"""The log says when, as lines or as JSON, and sends the same elsewhere without waiting."""

import io
import json
import logging
import queue
import re
import socket
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from app import logs
from app.access.access import Access, prepare
from app.access.passwords import Cost
from app.access.roles import SYSTEM
from app.cli import cli
from app.clock import ManualClock
from app.db import Database
from app.errors import ConfigurationError

TIME = r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z"
log = logging.getLogger("app.links.runner")


@pytest.fixture
def started() -> Iterator[Callable[..., io.StringIO]]:
    """Start the log as the server does; afterwards it is as it was."""
    root = logging.getLogger()
    uvicorn, voice = logging.getLogger("uvicorn"), logging.getLogger("uvicorn.error")
    kept, loud = (uvicorn.propagate, uvicorn.handlers[:]), voice.level
    uvicorn.propagate, uvicorn.handlers[:] = True, []  # a test that ran a server may have left its own
    voice.setLevel(logging.NOTSET)
    before, level, own = root.handlers[:], root.level, logging.getLogger("app").level
    ends: list[Callable[[], None]] = []

    def start(level: str = "info", form: logs.Form = "text", syslog: str = "") -> io.StringIO:
        for handler in root.handlers[:]:
            root.removeHandler(handler)  # those of pytest are not closed
        out = io.StringIO()
        ends.append(logs.start(level, form, syslog, out))
        return out

    yield start
    for end in ends:
        end()
    root.handlers[:] = before
    uvicorn.propagate, uvicorn.handlers[:] = kept
    voice.setLevel(loud)
    root.setLevel(level)
    logging.getLogger("app").setLevel(own)


def fails() -> None:
    try:
        raise ValueError("no such thing\nat all")
    except ValueError:
        log.exception("task failed task=%s", "poll")


def test_a_line_has_its_time(started: Callable[..., io.StringIO]) -> None:
    out = started()
    log.info("link up link=%s", "hall")
    log.debug("not told")
    logging.getLogger("library").info("not told")
    logging.getLogger("uvicorn.error").warning("slow")
    lines = out.getvalue().splitlines()
    assert re.fullmatch(rf"{TIME} INFO app\.links\.runner: link up link=hall", lines[0])
    assert re.fullmatch(rf"{TIME} WARNING uvicorn: slow", lines[1])
    assert len(lines) == 2


def test_a_line_is_one_line_whatever_is_in_it(started: Callable[..., io.StringIO]) -> None:
    out = started()
    log.info("link down reason=%s", "x\n2026-01-01T00:00:00.000Z INFO forged: y\x1b[2J")
    assert out.getvalue().count("\n") == 1 and "\x1b" not in out.getvalue()


def test_json_is_one_object_a_line(started: Callable[..., io.StringIO]) -> None:
    out = started(form="json")
    log.warning("link down link=%s", "tvornička\nhala")
    fails()
    logs.security("signin.locked", account="eve", address="192.0.2.7")
    down, failed, locked = map(json.loads, out.getvalue().splitlines())
    assert re.fullmatch(TIME, down.pop("time"))
    assert down == {"level": "warning", "logger": "app.links.runner", "message": "link down link=tvornička\nhala"}
    assert "ValueError: no such thing" in failed["trace"]
    assert (locked["event"], locked["fields"]) == ("signin.locked", {"account": "eve", "address": "192.0.2.7"})


@pytest.fixture(params=["udp", "unix"])
def collector(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[str, socket.socket]]:
    """A syslog server and how it is named."""
    if request.param == "udp":
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
            line.bind(("127.0.0.1", 0))
            line.settimeout(30)
            yield f"127.0.0.1:{line.getsockname()[1]}", line
    else:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as line:
            line.bind(str(tmp_path / "log"))
            line.settimeout(30)
            yield str(tmp_path / "log"), line


def test_syslog_is_rfc_5424(started: Callable[..., io.StringIO], collector: tuple[str, socket.socket]) -> None:
    started(syslog=collector[0])
    log.info("link up link=%s", "tvornička hala")
    fails()
    logs.security("signin.locked", account="eve")
    found = [collector[1].recv(65536).decode() for _ in range(3)]
    head = rf"1 {TIME} [!-~]+ pogon \d+ "
    assert re.fullmatch(rf"<30>{head}- - INFO app\.links\.runner: link up link=tvornička hala", found[0])
    assert re.fullmatch(rf"<27>{head}- - ERROR .* task=poll \(ValueError: no such thing\\x0aat all\)", found[1])
    assert re.fullmatch(rf"<84>{head}signin\.locked - WARNING app\.security: signin\.locked account=eve", found[2])


def test_security_events_go_out_whatever_the_level(
    started: Callable[..., io.StringIO], collector: tuple[str, socket.socket]
) -> None:
    started(level="error", syslog=collector[0])
    log.warning("not told")
    logs.security("account.role", account="eve", roles="admin")
    assert "account.role" in collector[1].recv(65536).decode()


def test_what_is_about_rights_is_an_event_and_the_rest_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, collector: tuple[str, socket.socket]
) -> None:
    monkeypatch.setenv("POGON_DATA", str(tmp_path / "data"))
    monkeypatch.setenv("POGON_SYSLOG", collector[0])
    added = CliRunner().invoke(cli, ["user", "add", "eve", "--role", "admin"])
    assert (added.exit_code, added.stderr) == (0, "")
    found = []
    while not found or "person.added" not in found[-1]:
        found.append(collector[1].recv(65536).decode())
    assert re.search(r"^<84>1 .* person\.added - WARNING .* object=eve .*admin", found[-1])
    assert added.stdout.split()[-1] not in "".join(found), "never a password"


def test_lines_of_the_audit_are_told_by_their_kind(caplog: pytest.LogCaptureFixture, tmp_path: Path) -> None:
    prepare(tmp_path)
    database = Database(tmp_path / "pogon.db", "pogon")
    database.migrate()
    access = Access(database, ManualClock(), tmp_path, Cost(1, 64, 1))
    lines = [
        access.audit.entry(kind, SYSTEM, "m1", result=result)
        for kind, result in (("signin.failed", "refused"), ("m1.forward", "confirmed"), ("token.revoked", "ok"),
                             ("factor.enrolled", "ok"), ("factor.reset", "ok"), ("backup.restoring", "sent"))
    ]  # fmt: skip
    with caplog.at_level("INFO", logs.SECURITY):
        access.audit.run(lambda _: (None, lines))
        access.close()
    database.close()
    told = {record.event: record.levelname for record in caplog.records if record.name == logs.SECURITY}  # type: ignore[attr-defined]
    assert told.pop("audit.anchor", "INFO") == "INFO"
    assert told == {
        "signin.failed": "WARNING",
        "token.revoked": "INFO",
        "factor.enrolled": "INFO",
        "factor.reset": "WARNING",
        "backup.restoring": "WARNING",
    }


@pytest.mark.sweep(8)
@pytest.mark.parametrize("address", ["/none/log", "127.0.0.1:9", "name.invalid:514"])
def test_a_syslog_that_is_not_there_holds_up_nothing(started: Callable[..., io.StringIO], address: str) -> None:
    out = started(syslog=address)
    for number in range(logs.MOST_WAITING + 100):
        log.info("n=%d", number)
    assert out.getvalue().count("\n") == logs.MOST_WAITING + 100


def test_what_sends_ends_although_its_queue_is_full() -> None:
    sent: list[int] = []

    class Slow(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            begun.set()
            go_on.wait(30)
            sent.append(record.levelno)

    begun, go_on = threading.Event(), threading.Event()
    waiting: queue.Queue[Any] = queue.Queue(2)
    listener = logs._Listener(waiting, Slow())
    listener.start()
    waiting.put(logging.LogRecord("", 1, "", 0, "", (), None))
    begun.wait(30)
    for level in (2, 3):
        waiting.put(logging.LogRecord("", level, "", 0, "", (), None))
    listener.enqueue_sentinel()
    go_on.set()
    assert listener._thread
    listener._thread.join(30)
    assert sent == [1, 3], "the oldest that waited made room"


def test_what_was_lost_is_counted_as_soon_as_there_is_room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(logs, "MOST_WAITING", 3)
    said: list[str] = []

    class Held(logging.NullHandler):
        def handle(self, record: logging.LogRecord) -> bool:
            begun.set()
            go_on.wait(30)
            said.append(record.getMessage())
            told.release()
            return True

    begun, go_on, told = threading.Event(), threading.Event(), threading.Semaphore(0)
    feeder = logs._Feeder(Held())
    feeder.handle(logging.LogRecord("", 1, "", 0, "0", (), None))
    begun.wait(30)
    for number in range(1, 6):
        feeder.handle(logging.LogRecord("", 1, "", 0, str(number), (), None))
    go_on.set()
    assert all(told.acquire(timeout=30) for _ in range(4))
    feeder.handle(logging.LogRecord("", 1, "", 0, "6", (), None))
    feeder.close()
    assert said == ["0", "1", "2", "3", "log lines lost count=2", "6"]


@pytest.mark.parametrize("text", ["dev/log", "host", "host:", ":514", "host:70000", "host:x"])
def test_an_address_that_cannot_be_is_told(text: str) -> None:
    with pytest.raises(ConfigurationError, match="expected a path such as /dev/log, or HOST:PORT"):
        logs.syslog_address(text)
