"""A PLC whose whole program is the structured text of docs/plc: its registers are one block of memory, as of MB_SERVER."""

import asyncio
from collections.abc import Callable
from functools import cache
from pathlib import Path
from struct import pack, unpack
from typing import Any

from app.plant.type_files.data import TypeData
from tests.links.conformance.servers import data_of
from tests.plc_text.st import Instance, Program
from tools import plc_text

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "plc"
SOURCES = sorted((FOLDER / "codesys").glob("*.st"))
CYCLE = 20_000
"""Scan [µs]."""
WORDS = 16896


@cache
def program() -> Program:
    return Program(*SOURCES)


class TextPlc:
    """One unit; `work` is called in each scan, between the command and the ring."""

    def __init__(self, kind: str) -> None:
        self.data: TypeData = data_of(kind)
        assert self.data.type.device.plc
        self.map = self.data.type.device.plc
        self.regs = program().initial("PogonRegisters")
        new = program().new
        self.header, self.ring, self.command, self.hold = (
            new("PogonHeader"),
            new("PogonRing"),
            new("PogonCommand"),
            new("PogonHold"),
        )
        self.settings = new("PogonSettings")
        self.images = {
            image.address: new(plc_text.block_name(self.data.type, f"{image.address:04X}")) for image in self.map.images
        }
        self.tables = {key: new("PogonTable") for key in self.data.type.tables}
        self.events: list[dict[str, Any]] = []
        self.taken: list[tuple[int, list[int], int]] = []
        self.work: Callable[[], None] = lambda: None
        low, high, default = {}, {}, {}
        points = plc_text.written(self.data.type.points.values(), self.map.settings.address, self.map.settings.words)  # type: ignore[union-attr]
        for n, (key, _) in enumerate(points, 1):
            setpoint = self.data.type.setpoints[key]
            default[n] = float(setpoint.default or 0.0)
            low[n], high[n] = (_number(text, default[n]) for text in (setpoint.low, setpoint.high))
        self.count = len(points)
        self._set = {"Low": low, "High": high, "Default": default}

    def scan(self) -> None:
        """One scan, in the order of docs/plc/README.md."""
        regs = self.regs
        self.header(
            TypeCode=self.map.type_code, Configuration=0x1234ABCD, Flags=2, TimeQuality=1, CycleMicros=CYCLE, ScanMicros=1500,
            HostTimeout=0, Regs=regs,
        )  # fmt: skip
        when = {"TimeHigh": self.header.TimeHigh, "TimeLow": self.header.TimeLow}
        self.command(Status=self.images[0x0100].p_state, **when, Regs=regs)
        commit = self.command.New and self.command.Code == 0x00F0
        settings = self.map.settings
        assert settings
        self.settings(
            Address=settings.address, Staging=self.map.staging, Count=self.count, Spare=settings.words - 3 - 2 * self.count,
            Commit=commit, Argument1=self.command.Argument[1], Argument2=self.command.Argument[2], Regs=regs, **self._set,
        )  # fmt: skip
        if self.command.New:
            state, reason, detail = 4, 1, 0
            if commit:
                state, reason, detail = self.settings.State, self.settings.Reason, self.settings.Detail
            elif self.command.Code in {command.code for command in self.data.type.commands.values()}:
                state, reason = 3, 0
                self.taken.append((self.command.Code, list(self.command.Argument.values()), self.command.Id))
            program().call(
                "PogonAnswer",
                {"Id": self.command.Id, "State": state, "Reason": reason, "Detail": detail, **when, "Regs": regs},
            )
        self.hold(CycleMicros=CYCLE, Regs=regs)
        self.work()
        for image in self.images.values():
            image(Regs=regs)
        for key, table in self.tables.items():
            found = self.data.type.tables[key]
            table(Address=found.address, Capacity=8, Count=0, RowWords=found.row, Changed=False, Regs=regs)
        for event in self.events:
            self.ring(Event=True, **when, **event, Regs=regs)
        self.events = []
        self.ring(Event=False, Regs=regs)

    async def run(self) -> None:
        while True:
            await asyncio.sleep(CYCLE / 1e6)
            self.scan()

    def answer(self, pdu: bytes) -> bytes:
        """As MB_SERVER: any register of the block may be read and written."""
        if pdu[0] not in (3, 6, 16):
            return bytes((pdu[0] | 0x80, 1))
        address, count = unpack(">HH", pdu[1:5])
        words = () if pdu[0] == 3 else (count,) if pdu[0] == 6 else unpack(f">{count}H", pdu[6:])
        size = len(words) or count
        if not 1 <= size <= 125:
            return bytes((pdu[0] | 0x80, 3))
        if address + size > WORDS:
            return bytes((pdu[0] | 0x80, 2))
        if pdu[0] == 3:
            return bytes((3, 2 * count)) + pack(f">{count}H", *self.regs.W[address : address + count])
        self.regs.W[address : address + size] = words
        return pdu[:5]

    def ask(self, code: int, id: int, *arguments: int, expected: int = 0) -> list[int]:
        """The first of the answers after a command."""
        given = [word for argument in (*arguments, 0, 0, 0, 0)[:4] for word in (argument >> 16, argument & 0xFFFF)]
        self.regs.W[0x0300:0x0310] = [code, 0, expected, *given, 0, 0, 0, 0, id]
        self.scan()
        return list(self.regs.W[0x0321:0x0329])


def _number(text: str, default: float) -> float:
    """A limit; one that follows from other settings is the default here."""
    try:
        return float(text)
    except ValueError:
        return default


def block(name: str) -> Instance:
    return program().new(name)
