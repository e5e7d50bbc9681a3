"""All parameters of a drive through its mailbox, over TCP and over a line of 19 200 baud, against what line and drive can do at most."""

import asyncio
import time
from collections.abc import Sequence
from dataclasses import replace

from pymodbus.client import AsyncModbusSerialClient, AsyncModbusTcpClient
from pymodbus.client.base import ModbusBaseClient

from app.clock import SystemClock
from app.links.mailbox import Missed
from app.links.register_link import RegisterLink, statistic_names
from app.plant.definitions import Equipment, Link, MailboxMap
from app.plant.loader import read_plant
from app.profidrive.parameter_access import mailbox
from app.profidrive.parameter_access.messages import Address, Request, Values, decode_answer, encode_request
from app.profidrive.parameter_access.parameter import DriveParameter
from app.profidrive.parameter_access.split import read_parts
from app.registers.pdu import WRITE_MULTIPLE
from app.registers.rtu import read_time, write_time
from app.sim.sinamics.mailbox import DELAY
from app.tags.database import Tag, TagDatabase
from benchmarks.common import ROOT, Row, helper

BAUD = 19_200
SECONDS = 8.0
OBJECT = 2


def _machine() -> tuple[Equipment, list[DriveParameter]]:
    """The drive, which is hardly scanned beside its mailbox, and the parameters that its drive object has."""
    plant, problems = read_plant(ROOT / "plants" / "sinamics")
    assert plant is not None, problems
    item = plant.equipment["d1"]
    device = replace(item.type.device, fast=60.0, slow=60.0, turnaround=0.0)
    points = {key: item.points[key] for key in ("zsw1_ready", "state") if key in item.points}
    item = replace(item, type=replace(item.type, device=device), link="drives", points=points)
    return item, [one for one in item.type.drive_parameters.values() if OBJECT in one.objects]


async def _ours(link: Link) -> tuple[float, int]:
    """Parameters per second, and how many there are."""
    item, wanted = _machine()
    clock = SystemClock()
    tags = TagDatabase(clock)
    tags.configure(
        [Tag(p.name, p.id, "link.drives") for p in item.points.values()]
        + [Tag(n, n, "sys") for n in statistic_names(link, [1])]
    )
    road = RegisterLink(link, [item], tags, clock)
    running = asyncio.create_task(road.run())
    while not road.up:  # noqa: ASYNC110
        await asyncio.sleep(0.1)
    await asyncio.sleep(0.5)
    access = road.parameters(item.id)
    addresses, formats = [Address(one.number, 0, one.count) for one in wanted], [one.format for one in wanted]
    done, began = 0, time.perf_counter()
    while time.perf_counter() - began < SECONDS:
        told = await access.read(OBJECT, addresses, formats)
        assert not any(isinstance(one, Missed) for one in told)
        assert sum(isinstance(one, Values) for one in told) > 0.9 * len(told)
        done += len(told)
    rate = done / (time.perf_counter() - began)
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
    return rate, len(wanted)


def _requests(item: Equipment, wanted: Sequence[DriveParameter]) -> list[Request]:
    parts = read_parts([Address(one.number, 0, one.count) for one in wanted], [one.format for one in wanted])
    return [Request(n % 255 + 1, OBJECT, tuple(part.address for part in one), None) for n, one in enumerate(parts)]


async def _bare(client: ModbusBaseClient) -> tuple[float, float]:
    """Parameters per second of a loop that writes a request, asks every 20 ms whether it is done and then for the whole window, and how
    long the line alone takes for the same on average [s a parameter] at `BAUD`, the drive's own time included."""
    item, wanted = _machine()
    at = next(one for one in item.type.device.services if isinstance(one, MailboxMap)).address
    requests = _requests(item, wanted)
    await client.connect()
    done, least, began = 0, 0.0, time.perf_counter()
    while time.perf_counter() - began < SECONDS / 2:
        for request in requests:
            words = list(mailbox.request_words(encode_request(request)))
            assert not (await client.write_registers(at, words, device_id=1)).isError()
            await asyncio.sleep(DELAY)
            while True:
                head = (await client.read_holding_registers(at, count=mailbox.LOOK, device_id=1)).registers
                if (said := mailbox.look(head)).done:
                    break
                await asyncio.sleep(0.02)
            count = mailbox.HEAD + said.length // 2
            whole = (await client.read_holding_registers(at, count=count, device_id=1)).registers
            answer = decode_answer(mailbox.data_of(whole, said.length))
            assert answer.reference == request.reference
            done += len(request.addresses)
            least += write_time(BAUD, len(words), WRITE_MULTIPLE) + DELAY + read_time(BAUD, count)
    rate = done / (time.perf_counter() - began)
    client.close()
    return rate, least / done


async def measure() -> list[Row]:
    async with helper("mailbox_drive", "tcp") as drive:
        port = int(str(await drive.ask()))
        bare, _ = await _bare(AsyncModbusTcpClient("127.0.0.1", port=port))
        ours, count = await _ours(Link("drives", "tcp", host="127.0.0.1", tcp_port=port, writes=True))
    rows = [
        Row(
            "drive parameters through the mailbox over TCP",
            f"{ours:.0f} parameters/s",
            "90 % of a loop of pymodbus that knows when to look",
            f"{bare:.0f} parameters/s, pymodbus in a loop",
            ours / bare,
            ours / bare >= 0.9,
            f"all {count} parameters of a simulated drive that makes up each answer for {1000 * DELAY:.0f} ms; an array is one "
            "parameter; several a request, as many as 240 bytes hold",
        )
    ]
    async with helper("mailbox_drive", BAUD) as drive:
        path = str(await drive.ask())
        bare, least = await _bare(AsyncModbusSerialClient(path, baudrate=BAUD, parity="N", timeout=1, retries=0))
        ours, _ = await _ours(Link("drives", "rtu", port=path, baud=BAUD, parity="none", writes=True))
    limit = 1 / least
    rows.append(
        Row(
            f"the same over a line of {BAUD} baud",
            f"{ours:.1f} parameters/s, {100 * ours / limit:.1f} % of the arithmetic {limit:.1f}",
            "80 %",
            f"{bare:.1f} parameters/s, pymodbus in a loop",
            ours / bare,
            ours / limit >= 0.8,
            "the arithmetic: one telegram with the request, the drive's time, one telegram with the answer, nothing to see whether "
            "it is there; a pseudo-terminal paced to 11 bits per character",
        )
    )
    return rows
