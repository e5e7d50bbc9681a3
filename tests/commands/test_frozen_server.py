"""A command that was given while the server stood still is too old when it wakes up, and is not carried out."""

import asyncio
import http.cookiejar
import os
import re
import signal
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Callable
from pathlib import Path

import pytest

from app.links.contract import Block
from app.links.tcp import TcpTransport
from app.plant.definitions import Link
from tests.conftest import PogonServer, enroll
from tests.links.test_own_process import plant_at, ready, where_of
from tests.sim.test_simulate_process import simulating

PASSWORD = "tri plave ladice u kutu"
FREQUENCY = 0x010D
FROZEN = 11.0
"""Longer than a nonce lives [s]."""


class Browser:
    """Somebody with cookies."""

    def __init__(self, server: PogonServer) -> None:
        self.url = server.url
        cookies = urllib.request.HTTPCookieProcessor(http.cookiejar.CookieJar())
        self.opener = urllib.request.build_opener(cookies)
        self.csrf = ""

    def get(self, path: str) -> str:
        with self.opener.open(self.url + path, timeout=40) as answer:
            text: str = answer.read().decode()
        found = re.search(r'name="csrf" value="([^"]*)"', text)
        self.csrf = found[1] if found else self.csrf
        return text

    def post(self, path: str, **form: str) -> tuple[int, str]:
        data = urllib.parse.urlencode({"csrf": self.csrf, **form}).encode()
        request = urllib.request.Request(self.url + path, data, {"Origin": self.url, "HX-Request": "true"})
        try:
            with self.opener.open(request, timeout=40) as answer:
                return answer.status, answer.read().decode()
        except urllib.error.HTTPError as refusal:
            with refusal:
                return refusal.code, refusal.read().decode()

    def sign_in(self, name: str) -> None:
        self.get("/signin")
        self.post("/signin", name=name, password=PASSWORD)
        self.get("/equipment/m1")

    def nonce(self) -> str:
        found = re.search(r'"nonce":\s*"([^"]+)"', self.get("/nonce"))
        assert found
        return found[1]


async def frequency(said: dict[str, str]) -> int:
    """The setpoint in the drive [0.01 Hz], as another master reads it."""
    host, _, port = said["tcp"].rpartition(":")
    transport = TcpTransport(Link("hall", "tcp", host=host, tcp_port=int(port)))
    await transport.connect()
    try:
        return (await transport.read(1, Block(FREQUENCY, 1), 0.5))[0]
    finally:
        await transport.close()


@pytest.mark.slow
@pytest.mark.real_time
async def test_what_was_asked_of_a_frozen_server_is_refused_when_it_wakes_up(
    tmp_path: Path, pogon_server: Callable[..., PogonServer]
) -> None:
    async with simulating(str(plant_at(tmp_path / "drives", "memory")), "--tcp", "127.0.0.1:0") as (_, said):
        plant = plant_at(tmp_path / "plant", *where_of(said))
        server = await asyncio.to_thread(pogon_server, plant=plant)
        await ready(server)
        await asyncio.to_thread(enroll, server.data, {"ana": ("operator",)}, PASSWORD)
        ana = Browser(server)
        await asyncio.to_thread(ana.sign_in, "ana")
        await asyncio.to_thread(ana.post, "/equipment/m1/token/take")

        async def ask(value: str) -> tuple[int, str]:
            nonce = await asyncio.to_thread(ana.nonce)
            form = {"nonce": nonce, "argument": value, "confirmed": "1", "id": value}
            return await asyncio.to_thread(ana.post, "/equipment/m1/command/set_frequency", **form)

        status, text = await ask("31.50")
        assert status == 202, text
        await asyncio.sleep(0.3)
        assert await frequency(said) == 3150, "while it is awake it does what it is told"
        nonce = await asyncio.to_thread(ana.nonce)
        os.kill(server.process.pid, signal.SIGSTOP)
        form = {"nonce": nonce, "argument": "12.50", "confirmed": "1", "id": "late"}
        waiting = asyncio.create_task(asyncio.to_thread(ana.post, "/equipment/m1/command/set_frequency", **form))
        await asyncio.sleep(FROZEN)
        os.kill(server.process.pid, signal.SIGCONT)
        status, text = await waiting
        assert status == 410, text
        await asyncio.sleep(2)
        assert await frequency(said) == 3150
        assert (await ask("32.00"))[0] == 202, "and it serves again"
