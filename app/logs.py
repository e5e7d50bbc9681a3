"""The log: lines with the time for people, JSON for programs, and the same to a syslog elsewhere; nobody waits for either.

Text: `2026-03-09T06:05:00.123Z INFO app.links.runner: link up link=hall`. Syslog is RFC 5424 over UDP or the machine's own socket; security
events (`security`) go there whatever the level, as facility authpriv with the event as message id.
"""

import json
import logging
import os
import queue
import re
import socket
import sys
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime
from logging.handlers import QueueHandler, QueueListener, SysLogHandler
from typing import Any, Literal

from app.addresses import host_and_port
from app.errors import ConfigurationError

Form = Literal["text", "json"]

SECURITY = "app.security"
"""Logger of security events."""
MOST_WAITING = 10_000
"""Records that wait for standard error, or for the syslog; of more, the newest are lost there and counted."""
PAUSE = 5.0
"""After a failure nothing is sent for so long [s]."""
PATIENCE = 2.0
"""At the end what waits is written for so long [s]."""
LONGEST = 8_000
"""Of one syslog message [bytes]."""
NAMES = {"uvicorn.error": "uvicorn"}
"""Uvicorn says everything in its `error`, the start too."""

security_log = logging.getLogger(SECURITY)
security_log.addHandler(logging.NullHandler())  # a command without a log says nothing of its own lines


def security(event: str, /, *, grave: bool = True, **fields: object) -> None:
    """Log a security event: a word such as `signin.failed`, and what belongs to it. Never a password or a token."""
    said = " ".join(f"{name}={value}" for name, value in fields.items())
    level = logging.WARNING if grave else logging.INFO
    security_log.log(level, "%s %s", event, said, extra={"event": event, "fields": fields})


def start(level: str, form: Form = "text", syslog: str = "", sink: Any = None) -> Callable[[], None]:
    """Log to standard error, or to the text file `sink`, and to `syslog`; returns what ends it, which sends what still waits.

    Of the libraries only what is wrong is told.
    """
    file = _file_of(sys.stderr) if sink is None else None
    handler = logging.StreamHandler(sink) if file is None else _StandardError(file)
    handler.setFormatter(_Json() if form == "json" else _Text())
    own = handler if file is None else _Feeder(handler)
    logging.basicConfig(level=logging.WARNING, handlers=[own], force=True)
    logging.getLogger("app").setLevel(level.upper())
    end_forwarding = forward(syslog)

    def end() -> None:
        end_forwarding()
        own.close()

    return end


def forward(syslog: str) -> Callable[[], None]:
    """Send what is logged to `syslog`, if that is named; returns what ends it, which sends what still waits."""
    security_log.setLevel(logging.INFO)
    if not syslog:
        return lambda: None
    sender = _Syslog(syslog_address(syslog))
    sender.setFormatter(_Rfc5424())
    feeder = _Feeder(sender)
    logging.getLogger().addHandler(feeder)

    def end() -> None:
        logging.getLogger().removeHandler(feeder)
        feeder.close()
        sender.close()

    return end


def syslog_address(text: str) -> str | tuple[str, int]:
    """The path of a socket, or host and UDP port, that `text` names: `/dev/log`, `logs.plant.example:514`.

    Raises:
        ConfigurationError: it is neither.
    """
    if text.startswith("/"):
        return text
    try:
        return host_and_port(text)
    except ConfigurationError as error:
        raise ConfigurationError("expected a path such as /dev/log, or HOST:PORT such as 192.0.2.7:514") from error


class _Text(logging.Formatter):
    """One line, and below it the trace of an error; signs that a terminal would obey are numbers."""

    def format(self, record: logging.LogRecord) -> str:
        text = f"{_moment(record)} {record.levelname} {_name(record)}: {_printable(record.getMessage())}"
        return text + (f"\n{self.formatException(record.exc_info)}" if record.exc_info else "")


class _Json(logging.Formatter):
    """One object a line: time, level, logger, message; of a security event its name and fields, of an error its trace."""

    def format(self, record: logging.LogRecord) -> str:
        said: dict[str, object] = {
            "time": _moment(record),
            "level": record.levelname.lower(),
            "logger": _name(record),
            "message": record.getMessage(),
        }
        if event := getattr(record, "event", ""):
            said |= {"event": event, "fields": {name: str(one) for name, one in getattr(record, "fields", {}).items()}}
        if record.exc_info:
            said["trace"] = self.formatException(record.exc_info)
        return json.dumps(said, ensure_ascii=False)


class _Rfc5424(logging.Formatter):
    """What follows the priority: version, time, host, program, process, message id, structured data, text in UTF-8."""

    def __init__(self) -> None:
        super().__init__()
        self._host = re.sub(r"[^!-~]", "", socket.gethostname())[:255] or "-"

    def format(self, record: logging.LogRecord) -> str:
        event = re.sub(r"[^!-~]", "", str(getattr(record, "event", "")))[:32] or "-"
        text = f"{record.levelname} {_name(record)}: {_printable(record.getMessage())}"
        if record.exc_info and record.exc_info[0]:
            text += f" ({record.exc_info[0].__name__}: {_printable(str(record.exc_info[1]))})"
        text = text.encode("utf-8", "replace")[:LONGEST].decode("utf-8", "ignore")
        return f"1 {_moment(record)} {self._host} pogon {os.getpid()} {event} - {text}"


class _Syslog(SysLogHandler):
    """Sends, and when it cannot, drops the record and says nothing: the log itself is on standard error."""

    append_nul = False
    socket: Any

    def __init__(self, address: str | tuple[str, int]) -> None:
        self._since: float | None = None
        self._starting = True
        super().__init__(address, facility=SysLogHandler.LOG_DAEMON)
        self._starting = False

    def createSocket(self) -> None:
        if not self._starting:  # a name that is looked up may take seconds: not at the start
            super().createSocket()
            self.socket.settimeout(PATIENCE)  # a full `/dev/log` that nobody reads

    def emit(self, record: logging.LogRecord) -> None:
        if self._since is not None and record.created < self._since + PAUSE:
            return
        self._since = None
        self.facility = self.LOG_AUTHPRIV if record.name == SECURITY else self.LOG_DAEMON
        super().emit(record)
        if self._since is not None:
            self._since = record.created

    def handleError(self, record: logging.LogRecord) -> None:
        self._since = record.created


class _StandardError(logging.NullHandler):
    """Writes to the file behind standard error. It has one thread and no lock: it may wait there for ever (Ctrl+S, a pipe nobody reads)."""

    def __init__(self, file: int) -> None:
        super().__init__()
        self._file = file

    def handle(self, record: logging.LogRecord) -> bool:
        left = f"{self.format(record)}\n".encode(errors="replace")
        with suppress(OSError):  # the terminal was closed, the disk is full
            while left:
                left = left[os.write(self._file, left) :]
        return True


class _Feeder(QueueHandler):
    """Hands records to a thread in which a handler may wait; never waits itself, and says how many were lost as soon as there is room."""

    def __init__(self, handler: logging.Handler) -> None:
        super().__init__(queue.Queue(MOST_WAITING))
        self._lost = 0
        self._listener = _Listener(self.queue, handler)
        self._listener.start()

    def prepare(self, record: logging.LogRecord) -> logging.LogRecord:
        return record  # what is logged is not changed afterwards, and the trace is wanted

    def enqueue(self, record: logging.LogRecord) -> None:
        try:
            if self._lost:
                said = (logging.WARNING, "", 0, "log lines lost count=%d", (self._lost,), None)
                self.queue.put_nowait(logging.LogRecord(__name__, *said))
                self._lost = 0
            self.queue.put_nowait(record)
        except queue.Full:
            self._lost += 1

    def close(self) -> None:
        self._listener.stop()
        super().close()


class _Listener(QueueListener):
    """Can be ended also while its queue is full, as it is when nobody takes what is sent: the oldest record makes room."""

    queue: queue.Queue[Any]

    def stop(self) -> None:
        thread, self._thread = self._thread, None
        if thread is not None:
            self.enqueue_sentinel()
            thread.join(PATIENCE)

    def enqueue_sentinel(self) -> None:
        while True:
            with suppress(queue.Full):
                super().enqueue_sentinel()
                return
            with suppress(queue.Empty):
                self.queue.get_nowait()
                self.queue.task_done()


def _file_of(stream: Any) -> int | None:
    """The file behind a stream; None, it has none."""
    try:
        return int(stream.fileno())
    except (AttributeError, OSError, ValueError):
        return None


def _moment(record: logging.LogRecord) -> str:
    moment = datetime.fromtimestamp(record.created, UTC)
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _name(record: logging.LogRecord) -> str:
    return NAMES.get(record.name, record.name)


def _printable(text: str) -> str:
    """`text` on one line."""
    return "".join(sign if sign.isprintable() else f"\\x{ord(sign):02x}" for sign in text)
