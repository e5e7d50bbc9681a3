"""Events of a machine on their whole way: device, link, alarms, passages; a server that is killed misses nothing and doubles nothing."""

import asyncio
import json
import resource
import socket
import sqlite3
import struct
import time
import urllib.request
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from app.access.roles import Person, permissions_of
from app.commands.audit_lines import AuditLine
from app.errors import StorageError
from app.historian import record_query as query
from app.historian.record_query import RecordFilter
from app.links.ring_head import head_of
from app.registers import plc_map
from app.running.page_tags import page_tags
from app.runtime import Runtime
from app.settings import Settings
from tests.conftest import PogonServer, find_port
from tests.historian.books import PASSAGE
from tests.historian.rings import Ring
from tests.sim.test_simulate_process import simulating
from tests.virtual import inline, loop_clock

PLANT = """
[plant]
name = {{ en = "Hall" }}
timezone = "Europe/Zagreb"
languages = ["en"]

[links.line]
{link}
writes = true

[equipment.c1]
type = "conveyor"
link = "line"
unit = 1
preset = "model"
label = {{ en = "Conveyor 1" }}
{simulation}
"""
# the ring of 59 events must outlast the start of a server on a loaded machine
SIMULATED = PLANT.format(
    link='transport = "memory"', simulation='simulation = { start = "automatic", arrivals = 1, interval = 8 }'
)
START = Callable[..., PogonServer]
ARRIVED = "SELECT DISTINCT number FROM record WHERE kind = 'passage' AND entry = 1 ORDER BY number"


def folder(at: Path, text: str) -> Path:
    at.mkdir()
    (at / "plant.toml").write_text(text, "utf-8")
    return at


def read(data: Path, statement: str) -> list[Any]:
    with closing(sqlite3.connect(f"file:{data / 'history.db'}?mode=ro", uri=True)) as connection:
        return connection.execute(statement).fetchall()


async def until(found: Callable[[], Any], limit: float = 60.0) -> None:
    """Wait in the time of the loop until something is found."""
    async with asyncio.timeout(limit):
        while not found():  # noqa: ASYNC110
            await asyncio.sleep(0.2)


def wait(found: Callable[[], Any], limit: float = 60.0) -> Any:
    end = time.monotonic() + limit
    while time.monotonic() < end:
        if found():
            return found()
        time.sleep(0.2)
    pytest.fail(f"not within {limit} s")


@pytest.mark.slow
@pytest.mark.real_time
def test_a_killed_server_misses_no_event_and_doubles_none(pogon_server: START, tmp_path: Path) -> None:
    """kill -9 three times while products run; the machine itself goes on in another process."""
    modbus = find_port()
    pogon_server(
        data=tmp_path / "device", plant=folder(tmp_path / "line", SIMULATED), serve_modbus=f"127.0.0.1:{modbus}"
    )
    host = folder(
        tmp_path / "host",
        PLANT.format(
            link=f'transport = "tcp"\nhost = "127.0.0.1"\nport = {modbus}\nsimulated = true',
            simulation="",
        ),
    )
    data = tmp_path / "data"
    newest = "SELECT max(sequence) FROM event"
    before = 0
    for _ in range(3):
        server = pogon_server(data=data, plant=host)
        before = wait(lambda before=before: (read(data, newest)[0][0] or 0) > before + 4 and read(data, newest))[0][0]
        server.kill()
    server = pogon_server(data=data, plant=host)
    wait(lambda: read(data, "SELECT count(*) FROM event WHERE code = 1")[0][0] >= 3)
    told = read(
        data,
        "SELECT r.number, e.code, e.sequence, r.entry, r.id FROM record r JOIN record_event b ON b.record = r.id "
        "JOIN event e ON e.id = b.event WHERE r.kind = 'passage'",
    )
    assert read(data, "SELECT count(*) FROM event_gap") == [(0,)], read(data, "SELECT * FROM event_gap")
    assert len({(product, sequence) for product, _, sequence, *_ in told}) == len(told), "no event twice"
    arrived = sorted(product for product, code, *_ in told if code == 1)
    assert arrived == list(range(arrived[0], arrived[0] + len(arrived))), "no product missing, none twice"
    unseen = {product for product, _, _, entry, _ in told if entry != 1}
    assert all(product < arrived[0] for product in unseen), (
        "only who was on the line before the first contact has no entry"
    )
    assert read(data, "SELECT count(*) FROM event_gap") == [(0,)]
    assert len({number for *_, number in told}) == len(arrived) + len(unseen), "one passage each"
    with urllib.request.urlopen(f"{server.url}/healthz", timeout=5) as answer:
        assert json.loads(answer.read())["tasks_down"] == []
    assert "Traceback" not in server.log()


@pytest.mark.slow
@pytest.mark.real_time
@pytest.mark.parametrize("way", ["locked", "full"])
async def test_killed_while_the_history_takes_nothing_it_misses_no_event(
    pogon_server: START, tmp_path: Path, way: str
) -> None:
    """What the history did not take is not acknowledged: the ring of the machine still has it when the server comes back."""
    line = folder(tmp_path / "line", SIMULATED)
    async with simulating(str(line), "--tcp", "127.0.0.1:0") as (_, said):
        modbus = int(said["tcp"].rpartition(":")[2])
        await asyncio.to_thread(_kill_while_nothing_is_taken, pogon_server, tmp_path, modbus, way)


def _kill_while_nothing_is_taken(pogon_server: START, tmp_path: Path, modbus: int, way: str) -> None:
    host = folder(
        tmp_path / "host",
        PLANT.format(
            link=f'transport = "tcp"\nhost = "127.0.0.1"\nport = {modbus}\nsimulated = true',
            simulation="",
        ),
    )
    data = tmp_path / "data"
    newest = "SELECT sequence FROM event_mark"
    server = pogon_server(data=data, plant=host)
    wait(lambda: read(data, newest) and read(data, newest)[0][0] > 3)
    with closing(sqlite3.connect(data / "history.db", isolation_level=None, timeout=20)) as other:
        if way == "locked":
            other.execute("BEGIN IMMEDIATE")
        else:
            size = (data / "history.db-wal").stat().st_size
            resource.prlimit(server.process.pid, resource.RLIMIT_FSIZE, (size, size))
        before = read(data, newest)[0][0]
        wait(lambda: "events are not written" in server.log(), limit=30)
        wait(lambda: ring(modbus)[0] >= before + 10)
        _, told = ring(modbus)
        assert read(data, newest)[0][0] - before <= 3 and told <= read(data, newest)[0][0], "no more than is stored"
        server.kill()
    stored = read(data, newest)[0][0]
    assert ring(modbus)[0] > stored + 5
    pogon_server(data=data, plant=host)
    wait(lambda: read(data, newest)[0][0] > stored + 10)
    found = [number for (number,) in read(data, "SELECT DISTINCT sequence FROM event WHERE sequence > 0")]
    assert stored + 1 in range(min(found), max(found)) and read(data, "SELECT count(*) FROM event_gap") == [(0,)]
    arrived = [product for (product,) in read(data, ARRIVED)]
    assert arrived == list(range(arrived[0], arrived[0] + len(arrived))), "no product missing"
    doubled = "SELECT count(*) - count(DISTINCT number) FROM record WHERE kind = 'passage'"
    assert read(data, doubled) == [(0,)], "none twice"
    wait(lambda: ring(modbus)[1] > stored)


def ring(port: int) -> tuple[int, int]:
    """Newest and acknowledged sequence in the ring of the machine behind a port."""
    with socket.create_connection(("127.0.0.1", port), timeout=5) as line:
        line.sendall(struct.pack(">HHHBBHH", 1, 0, 6, 1, 3, plc_map.EVENTS, plc_map.EVENTS_WORDS))
        answer = b""
        while len(answer) < 9 + 2 * plc_map.EVENTS_WORDS:
            more = line.recv(256)
            assert more, answer
            answer += more
    words = struct.unpack(f">{plc_map.EVENTS_WORDS}H", answer[9:])
    head = head_of(words)
    assert head is not None
    return head.newest, head.acknowledged


@pytest.mark.sweep(8)
async def test_from_the_event_to_alarm_passage_page_and_person(tmp_path: Path) -> None:
    """One runtime: what its links hand over is in alarms and passages, in the log, and counted for the pages."""
    runtime = Runtime(
        Settings(plant=folder(tmp_path / "line", SIMULATED), data=tmp_path / "data"), loop_clock(), inline
    )
    await runtime.start()
    try:
        item = runtime.plant.equipment["c1"]  # type: ignore[union-attr]
        for link in runtime.links.values():
            link.events.take = None  # the virtual line tells nothing: these events are ours
        counted = runtime.tags.value(runtime.tags.handle("sys.events.c1")) or 0
        ring = Ring(time=runtime.clock.micros(), sequence=10_000)
        ring.tell(1, 500, source=1, after=0)
        ring.tell(10, 500, source=2, value=3.25, after=0)
        ring.tell(6, 500, after=0, request=41)
        await runtime.ring_events.take(item, ring.drain(), 4)
        assert sorted(one.key for one in runtime.alarms.list.active()) == ["events_lost", "tolerance_2"]
        assert [(mark.boot, mark.sequence) for mark in runtime.ring_events.last_seen(item)] == [(1, 10_003)] * 2
        assert runtime.tags.value(runtime.tags.handle("sys.events.c1")) > counted  # type: ignore[operator]
        now = runtime.clock.micros()
        ana = Person(7, "ana", "Ana Kos", frozenset({"engineer"}), permissions_of({"engineer"}), "")
        for result, who, requests in (("refused", "Ivo", []), ("unknown", "Eva", [40]), ("confirmed", "Ana Kos", [41])):
            params = {"why": "fell down", "requested": now, "ended": now, "id": "x", "requests": requests}
            person = Person(**{**_fields(ana), "display": who})
            await runtime.command_ends.write(
                AuditLine("command", person, "c1.delete_product", None, "product = 500", result, "", params)
            )
        await runtime.events.close()
        wanted = RecordFilter(given={"product": 500})
        (one,) = await runtime.history.read(lambda connection: query.find(connection, PASSAGE, wanted, 10))
        told = await runtime.history.read(lambda connection: query.events(connection, [one.id]))
        assert (one.outcome, one.alarms) == ("deleted", (10,))
        assert [(step.person, step.reason) for step in told[one.id]] == [("", ""), ("", ""), ("Ana Kos", "fell down")]
        assert "sys.events.c1" in page_tags("records/passage", runtime.plant, runtime.points)
    finally:
        await runtime.stop()


@pytest.mark.sweep(8)
async def test_products_follow_a_machine_that_is_renamed(tmp_path: Path) -> None:
    """While products run, and once more while the server is down: one list of passages, nothing missing, nothing twice."""
    plant = folder(tmp_path / "line", SIMULATED)
    data = tmp_path / "data"
    runtime = Runtime(Settings(plant=plant, data=data), loop_clock(), inline)
    await runtime.start()
    try:
        await until(lambda: len(arrivals(data, "c1")) >= 2)
        renamed = SIMULATED.replace("[equipment.c1]", '[equipment.line1]\nwas = "c1"')
        (plant / "plant.toml").write_text(renamed, "utf-8")
        assert (await runtime.plant_files.reload(None, (await runtime.plant_files.look()).digest)).done
        await until(lambda: len(arrivals(data, "line1")) >= 4)
        assert arrivals(data, "c1") == []
    finally:
        await runtime.stop()
    before = arrivals(data, "line1")
    assert before == list(range(before[0], before[0] + len(before)))
    (plant / "plant.toml").write_text(renamed.replace("equipment.line1", "equipment.belt"), "utf-8")
    runtime = Runtime(Settings(plant=plant, data=data), loop_clock(), inline)
    await runtime.start()
    try:
        await until(lambda: arrivals(data, "belt")[: len(before)] == before, 10)
        assert "sys.events.belt" in runtime.tags and runtime.events.last("belt") is not None
    finally:
        await runtime.stop()


def arrivals(data: Path, equipment: str) -> list[int]:
    statement = (
        "SELECT r.number FROM record r JOIN event_machine m ON m.id = r.machine "
        f"WHERE m.name = '{equipment}' AND r.entry = 1 ORDER BY r.id"
    )
    return [product for (product,) in read(data, statement)]


async def test_a_history_that_takes_nothing_holds_up_neither_alarms_nor_links(tmp_path: Path) -> None:
    async def full(work: object) -> object:
        raise StorageError("history.db: database or disk is full")

    runtime = Runtime(
        Settings(plant=folder(tmp_path / "line", SIMULATED), data=tmp_path / "data"), loop_clock(), inline
    )
    await runtime.start()
    try:
        item = runtime.plant.equipment["c1"]  # type: ignore[union-attr]
        for link in runtime.links.values():
            link.events.take = None
        runtime.history.write = full  # type: ignore[method-assign, assignment]
        ring = Ring(time=runtime.clock.micros(), sequence=10_000)
        ring.tell(10, 500, source=2, value=3.25, after=0)
        async with asyncio.timeout(5):
            await runtime.ring_events.take(item, ring.drain(), 0)
        runtime._tell_alarms()
        assert sorted(one.key for one in runtime.alarms.list.active()) == ["history_full", "tolerance_2"]
        assert runtime.events.waiting >= 1
    finally:
        await runtime.stop()


def _fields(person: Person) -> dict[str, Any]:
    return {name: getattr(person, name) for name in Person.__slots__}
