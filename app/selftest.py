"""Whether this machine can run Pogon with these settings: ports, rights, keys, clock, disk, databases, TLS, serial lines, plant.

Each check gives one finding; none starts anything, keeps anything or changes a file that was there.
"""

import ctypes
import os
import shutil
import socket
import sqlite3
import ssl
import stat
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from app.access.factors import IDENTITY, Seal
from app.access.former import check_former
from app.access.keys import PRIVATE, check_files, lock
from app.access.private import check_entered
from app.access.restoring import is_interrupted
from app.addresses import host_and_port
from app.certificate import end_of
from app.clock import Clock, to_datetime
from app.db import open_to_read
from app.errors import ConfigurationError
from app.files import open_ordinary, read_text
from app.plant.definitions import Plant
from app.plant.plant_files.links import same_devices
from app.plant.problems import Problem
from app.settings import Settings, check_places

State = Literal["ok", "warning", "failed"]

EARLIEST = 1_767_225_600_000_000
"""No clock of a running Pogon says less: 2026-01-01 [µs since 1970 UTC]."""
LATEST = 4_102_444_800_000_000
"""2100-01-01."""
STEPPED_BACK = 60_000_000
"""A file of ours may be so much younger than now [µs]."""
LOW_SPACE = 500_000_000
"""Free space below which it is a warning; a tenth of it is a failure [bytes]."""
PROBE_SIZE = 8 << 20
"""Written to measure the disk [bytes]."""
SLOW_DISK = 2_000_000
"""[bytes/s]"""
SLOW_COMMIT = 0.25
"""A line of the audit takes one of these [s]."""
SOON = 30
"""Days before its end from which a certificate is a warning."""
TIME_ERROR = 5
"""What Linux answers when nothing keeps its clock right."""


@dataclass(frozen=True, slots=True)
class Finding:
    """What one check found: the product text `selftest.<check>.<outcome>` with its placeholders."""

    check: str
    state: State
    outcome: str
    params: Mapping[str, object] = field(default_factory=dict)

    @property
    def key(self) -> str:
        """Of the product text."""
        return f"selftest.{self.check}.{self.outcome}"


ReadPlant = Callable[[Path], tuple[Plant | None, list[Problem]]]


def run_checks(
    settings: Settings, clock: Clock, read_plant: ReadPlant, clashes_of: Callable[[Plant], str]
) -> Iterator[Finding]:
    """Every finding, in the order in which a start would meet it. `clashes_of`: machines that cannot be served on one port, in words."""
    yield from _settings(settings)
    yield _data(settings.data)
    closed = _is_closed(settings.data)
    if not closed:
        yield _keys(settings.data)
    running = not closed and _is_running(settings.data)
    yield _port("port", settings.host, settings.port, running=running)
    if settings.serve_modbus:
        yield _port("modbus", *host_and_port(settings.serve_modbus), running=running)
    if not closed:
        yield _clock(settings.data, clock)
    yield _synchronised()
    if not closed:
        yield _space(settings)
        yield _speed(settings.data, clock)
        for name in ("pogon.db", "history.db"):
            yield _database(settings.data / name)
    yield _tls(settings, clock)
    plant, problems = read_plant(settings.plant)
    yield _plant(settings.plant, plant, problems)
    if plant and settings.serve_modbus and (clash := clashes_of(plant)):
        yield Finding("plant", "failed", "clash", {"path": settings.plant, "clash": clash})
    for name, link in sorted(plant.links.items()) if plant else ():
        if link.transport == "rtu":
            yield _serial(name, link.port)
    for link, other in same_devices(plant.links) if plant else ():
        params = {"link": link.name, "port": link.port, "other": other.name, "other_port": other.port}
        yield Finding("serial", "failed", "same", params)


def _settings(settings: Settings) -> Iterator[Finding]:
    """What is told of each place that a setting names, as the start tells it."""
    try:
        absent = check_places(settings)
    except ConfigurationError as error:
        for line in str(error).splitlines():
            yield Finding("settings", "failed", "wrong", {"reason": line})
    else:
        for line in absent:
            yield Finding("settings", "warning", "wrong", {"reason": line})
        if not absent:
            yield Finding("settings", "ok", "good")


def _is_closed(data: Path) -> bool:
    """Whether one may not look into the data folder, so that nothing can be said of what is in it."""
    try:
        check_entered(data)
    except ConfigurationError:
        return True
    return False


def _data(data: Path) -> Finding:
    try:
        check_files(data)
    except ConfigurationError as error:
        return Finding("data", "failed", "wrong", {"reason": error})
    if os.path.lexists(data) and not data.is_dir():
        return Finding("data", "failed", "wrong", {"reason": f"{data}: expected a folder"})
    if not data.is_dir():
        above = next((path for path in data.absolute().parents if path.exists()), Path("/"))
        good = above.is_dir() and os.access(above, os.W_OK | os.X_OK)
        return Finding("data", "ok" if good else "failed", "new" if good else "not_writable", {"path": data})
    if not os.access(data, os.R_OK | os.W_OK | os.X_OK):
        return Finding("data", "failed", "not_writable", {"path": data})
    return Finding("data", "ok", "good", {"path": data, "mode": f"{stat.S_IMODE(data.stat().st_mode):04o}"})


def _keys(data: Path) -> Finding:
    there = [name for name in PRIVATE if name.endswith(".key") and (data / name).exists()]
    for name in there:
        try:
            good = len(bytes.fromhex(read_text(data / name, 10_000).partition("\n")[0])) == 32
        except (ValueError, ConfigurationError):
            good = False
        if not good:
            return Finding("keys", "failed", "wrong", {"path": data / name})
    if (data / IDENTITY).exists():
        if not Seal(data / IDENTITY).usable:
            return Finding("keys", "failed", "identity", {"path": data / IDENTITY})
        there.append(IDENTITY)
    if "audit.key" not in there and (data / "audit.head").exists():
        return Finding("keys", "failed", "lost", {"path": data / "audit.key"})
    return Finding("keys", "ok", "good" if there else "none", {"names": ", ".join(there)})


def _is_running(data: Path) -> bool:
    """Whether a server runs on this folder."""
    if not (data / "server.lock").exists():
        return False
    try:
        os.close(lock(data))
    except (ConfigurationError, OSError):
        return True
    return False


def _port(check: str, host: str, port: int, *, running: bool) -> Finding:
    address = f"{host}:{port}"
    try:
        family, _, _, _, where = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
        with socket.socket(family, socket.SOCK_STREAM) as one:
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            one.bind(where)
    except OSError as error:
        if running:
            return Finding(check, "ok", "running", {"address": address})
        return Finding(check, "failed", "taken", {"address": address, "reason": error.strerror or str(error)})
    return Finding(check, "ok", "free", {"address": address})


def _clock(data: Path, clock: Clock) -> Finding:
    now = clock.micros()
    shown = f"{to_datetime(now):%Y-%m-%d %H:%M:%S} UTC"
    if not EARLIEST <= now <= LATEST:
        return Finding("clock", "failed", "wrong", {"now": shown})
    for name in ("pogon.db", "history.db", "audit.head"):
        with suppress(OSError):
            if (data / name).stat().st_mtime_ns // 1000 > now + STEPPED_BACK:
                return Finding("clock", "failed", "back", {"now": shown, "name": name})
    return Finding("clock", "ok", "good", {"now": shown})


def _synchronised() -> Finding:
    """Asks the kernel, which knows of every program that keeps its time."""
    try:
        asked = ctypes.create_string_buffer(512)  # a struct timex that changes nothing
        answer = int(ctypes.CDLL(None, use_errno=True).adjtimex(asked))
    except (OSError, AttributeError):
        answer = -1
    if answer < 0:
        return Finding("time_sync", "warning", "unknown")
    good = answer != TIME_ERROR
    return Finding("time_sync", "ok" if good else "warning", "good" if good else "none")


def _space(settings: Settings) -> Finding:
    where = next((path for path in (settings.data, *settings.data.absolute().parents) if path.exists()), Path("/"))
    free = shutil.disk_usage(where).free
    params = {"free": round(free / 1e6), "quota": round(settings.history_quota_mb)}
    if free < LOW_SPACE:
        return Finding("space", "warning" if free >= LOW_SPACE / 10 else "failed", "low", params)
    used = (settings.data / "history.db").stat().st_size if (settings.data / "history.db").exists() else 0
    if free + used < settings.history_quota_mb * 1e6:
        return Finding("space", "warning", "below_quota", params)
    return Finding("space", "ok", "good", params)


def _speed(data: Path, clock: Clock) -> Finding:
    where = data if data.is_dir() else Path(tempfile.gettempdir())
    try:
        with tempfile.TemporaryFile(dir=where) as file:
            begin = clock.monotonic()
            file.write(bytes(PROBE_SIZE))
            file.flush()
            os.fsync(file.fileno())
            speed = PROBE_SIZE / max(clock.monotonic() - begin, 1e-6)
            begin = clock.monotonic()
            for _ in range(5):
                file.write(bytes(4096))
                file.flush()
                os.fsync(file.fileno())
            commit = (clock.monotonic() - begin) / 5
    except OSError as error:
        return Finding("speed", "failed", "wrong", {"reason": error.strerror or str(error)})
    params = {"speed": round(speed / 1e6), "commit": round(commit * 1000)}
    slow = speed < SLOW_DISK or commit > SLOW_COMMIT
    return Finding("speed", "warning" if slow else "ok", "slow" if slow else "good", params)


def _database(path: Path) -> Finding:
    params: dict[str, object] = {"name": path.name}
    if path.name == "pogon.db":
        try:
            if is_interrupted(path.parent):
                return Finding("database", "warning", "restore", params)  # between its moves there may be none
            check_former(path.parent)
        except ConfigurationError as error:
            return Finding("database", "failed", "broken", {**params, "reason": error})
    if not path.exists() or not path.stat().st_size:
        return Finding("database", "ok", "new", params)
    try:
        with closing(open_to_read(path)) as connection:
            sound = str(connection.execute("PRAGMA quick_check(1)").fetchone()[0])
    except sqlite3.Error as error:
        sound = str(error)
    if sound != "ok":
        return Finding("database", "failed", "broken", {**params, "reason": sound[:200]})
    return Finding("database", "ok", "good", {**params, "size": round(path.stat().st_size / 1e6)})


def _tls(settings: Settings, clock: Clock) -> Finding:
    cert, key = settings.tls_cert, settings.tls_key
    if cert is None or key is None:
        return Finding("tls", "ok", "proxy" if settings.behind_proxy else "none")
    try:
        for path in (cert, key):
            open_ordinary(path).close()
        if key.stat().st_mode & 0o077:
            return Finding("tls", "failed", "open_key", {"path": key})
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(cert, key)
        days = (end_of(cert) - clock.micros() / 1e6) / 86400
    except (OSError, ssl.SSLError, ValueError, ConfigurationError) as error:
        return Finding("tls", "failed", "wrong", {"reason": getattr(error, "strerror", None) or str(error)})
    params = {"days": int(days)}
    if days <= 0:
        return Finding("tls", "failed", "expired", params)
    return Finding("tls", "warning" if days < SOON else "ok", "soon" if days < SOON else "good", params)


def _serial(link: str, port: str) -> Finding:
    params = {"link": link, "port": port}
    try:
        mode = Path(port).stat().st_mode
    except OSError as error:
        return Finding("serial", "failed", "missing", {**params, "reason": error.strerror or str(error)})
    if not stat.S_ISCHR(mode):
        return Finding("serial", "failed", "no_device", params)
    good = os.access(port, os.R_OK | os.W_OK)
    return Finding("serial", "ok" if good else "failed", "good" if good else "refused", params)


def _plant(folder: Path, plant: Plant | None, problems: list[Problem]) -> Finding:
    if plant is None:
        params = {"path": folder, "n": len(problems), "first": problems[0] if problems else ""}
        return Finding("plant", "failed", "wrong", params)
    return Finding("plant", "ok", "good", {"path": folder, "machines": len(plant.equipment), "links": len(plant.links)})
