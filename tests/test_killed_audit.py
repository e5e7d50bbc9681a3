"""A server killed at any moment under commands: whatever was answered 202 has its line, and the chain is whole."""

import asyncio
import contextlib
import http.client
import json
import random
import sqlite3
import threading
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from app import chance
from app.access.access import Access, prepare
from app.access.roles import Person, permissions_of
from app.clock import SystemClock
from app.db import Database
from tests.conftest import PogonServer, enroll

KILLS = 3
LOAD = (0.5, 1.5)
"""How long commands come before the kill, at random [s]."""


@contextmanager
def opened(data: Path) -> Iterator[Access]:
    prepare(data)
    database = Database(data / "pogon.db", "pogon")
    database.migrate()
    access = Access(database, SystemClock(), data)
    try:
        yield access
    finally:
        access.close()
        database.close()


def tokens(data: Path) -> list[str]:
    """Secrets of tokens that may operate, of two persons."""
    made = []
    with opened(data) as access:
        for account in access.people.now():
            roles = frozenset({"engineer", "operator"})
            by = Person(account.id, account.name, account.name, roles, permissions_of(roles), "")
            made.append(asyncio.run(access.tokens.create(by, account.name, ["view", "operate", "stop"], 7))[1])
    return made


class Program(threading.Thread):
    """Writes setpoints and presses Stop as fast as it is let, until the server is gone; remembers what was taken."""

    def __init__(self, server: PogonServer, secret: str, machine: str) -> None:
        super().__init__(daemon=True)
        self.url = f"{server.url}/api/v1/equipment/{machine}"
        self.secret = secret
        self.taken: list[str] = []

    def run(self) -> None:
        with contextlib.suppress(OSError, ValueError, http.client.HTTPException):  # the kill may cut an answer in two
            self.ask("/control/take")
            for number in range(10_000):
                id = chance.token_hex(16)
                if number % 4 == 3:
                    status, _ = self.ask("/stop", id=id)
                else:
                    nonce = self.ask_get()
                    status, _ = self.ask(
                        "/setpoints/frequency_setpoint", id=id, nonce=nonce, value=40 + number % 2, confirmed=True
                    )
                if status in (200, 202):
                    self.taken.append(id)

    def ask_get(self) -> str:
        status, answer = self.ask(self.url.partition("/equipment")[0] + "/nonce", method="POST")
        if status >= 400:
            status, answer = self.ask(self.url.partition("/equipment")[0] + "/nonce", method="GET")
        return str(answer["nonce"])

    def ask(self, path: str, method: str = "POST", **fields: object) -> tuple[int, dict[str, object]]:
        url = path if path.startswith("http") else self.url + path
        data = json.dumps(fields).encode() if method == "POST" else None
        headers = {"Authorization": f"Bearer {self.secret}", "Content-Type": "application/json"}
        try:
            with urllib.request.urlopen(urllib.request.Request(url, data, headers, method=method), timeout=10) as got:
                return got.status, json.loads(got.read() or b"{}")
        except urllib.error.HTTPError as refused:
            with refused:
                return refused.code, {}


def ids(data: Path) -> set[str]:
    """Commands that have a line."""
    with closing(sqlite3.connect(data / "pogon.db")) as database:
        rows = database.execute("SELECT params FROM audit WHERE kind IN ('command', 'command.sent')").fetchall()
    return {str(json.loads(row[0]).get("id")) for row in rows}


@pytest.mark.slow
@pytest.mark.real_time
def test_what_was_answered_before_a_kill_has_its_line(tmp_path: Path, pogon_server: Callable[..., PogonServer]) -> None:
    data = tmp_path / "data"
    enroll(data, {"ana": ["operator", "engineer"], "ivo": ["operator", "engineer"]}, "tri plave ladice u kutu")
    secrets = tokens(data)
    taken: set[str] = set()
    moments = random.Random(20261122)
    for _ in range(KILLS):
        server = pogon_server(data=data)
        programs = [Program(server, *one) for one in zip(secrets, ("m1", "m2"), strict=True)]
        for program in programs:
            program.start()
        programs[0].join(moments.uniform(*LOAD))
        server.kill()
        for program in programs:
            program.join(20)
            taken |= set(program.taken)
    assert len(taken) > 3 * KILLS
    pogon_server(data=data).stop()
    assert taken - ids(data) == set()
    with opened(data) as access:
        verdict = access.audit.check_now()
    assert verdict.ok, verdict
