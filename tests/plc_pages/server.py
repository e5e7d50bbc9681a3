"""A PLC server that somebody wrote from docs/registers/<type>.md alone: plain memory, a scan, commands, a ring of events.

It imports nothing of the product. What it knows beyond the page is Modbus (application protocol 1.1b3) and CRC-32.
"""

import asyncio
from collections.abc import Callable, Mapping
from struct import pack, unpack
from zlib import crc32

from tests.plc_pages.page import Cell, Page

CAPACITY = 40
"""Rows of its ring: not those of the virtual PLC."""
SCAN = 0.02
SLOTS = 20


class PagePlc:
    """One unit."""

    def __init__(self, page: Page, slots: int = SLOTS) -> None:
        self.page = page
        self.memory: dict[int, int] = {at + n: 0 for at, words in page.covered() for n in range(words)}
        self.memory |= {page.rows_at + n: 0 for n in range(CAPACITY * page.row_words)}
        if page.hold_at:
            self.memory |= {page.hold_at + n: 0 for n in range(4)}
        self.places: dict[str, Cell] = {cell.name: cell for area in page.images for cell in area.cells}
        self.scans = 0
        self.newest = 0
        self.asked: list[tuple[int, list[int], int]] = []
        """Commands that were executed: code, argument words, id."""
        self.held: list[int] = []
        self.heartbeats: list[int] = []
        self.acknowledged = 0
        self.does: dict[str, Callable[[], str]] = {}
        """Command → what it does; returns the event that it causes."""
        self._answers: list[list[int]] = []
        head = page.header
        self._put(head["magic 0x5047"], 0x5047)
        self._put(head["map major 1"], 1)
        self._put(head["map minor 6"], 6)
        self._put(head[f"type {page.type_code}"], page.type_code)
        self._put(head["bit 0 simulated"], 2)
        self._put(head["boot count"], 1)
        if page.settings:
            self.memory[page.settings.address + 1] = len(page.settings.cells)
            for cell in page.settings.cells:
                self._store(cell, cell.default)
        for table in page.tables:
            self.memory |= {table.address + n: 0 for n in range(4 + slots * table.words)}
            self.memory[table.address + 1], self.memory[table.address + 3] = slots, table.words
        self.scan()

    # its own side

    @property
    def time(self) -> int:
        """Device time [µs]."""
        return round(self.scans * SCAN * 1e6)

    def set(self, **values: float) -> None:
        """Give named values of the images."""
        for name, value in values.items():
            self._store(self.places[name], value)

    def row(self, table: str, slot: int, values: Mapping[str, float]) -> None:
        """Fill a slot (from 1) of a table."""
        area = next(area for area in self.page.tables if area.name == table)
        begin = area.address + 4 + (slot - 1) * area.words
        for cell in area.cells:
            if cell.name in values:
                self._store(cell, values[cell.name] / cell.scale, begin)
        self.memory[begin + 2] = self.memory[begin + area.words - 1] = 2
        self.memory[area.address + 2] = max(self.memory[area.address + 2], slot)
        self.memory[area.address] += 2

    def tell(
        self, event: str, source: int = 0, value: float = 0.0, snapshot: bytes = bytes(12), cause: int = 0
    ) -> None:
        """Put an event into the ring."""
        self.newest += 1
        row = pack(">IQHHf12sH", self.newest, self.time, self.page.code_of(event), source, value, snapshot, cause)
        begin = self.page.rows_at + self.newest % CAPACITY * self.page.row_words
        for n, word in enumerate(unpack(f">{self.page.row_words}H", row)):
            self.memory[begin + n] = word
        self._head()

    def scan(self) -> None:
        """One pass of its program."""
        self.scans += 1
        head = self.page.header
        self._put(head["heartbeat out"], self.scans & 0xFFFF)
        self._put(head["device time [µs]"], self.time)
        self._put(head["step number"], self.scans)
        generation = 2 * self.scans & 0xFFFE
        for area in (*self.page.images, *([self.page.settings] if self.page.settings else [])):
            self.memory[area.address] = self.memory[area.address + area.words - 1] = generation
        begin = self.page.answers_at
        rows = [word for answer in self._answers for word in answer]
        for n, word in enumerate([generation, *rows, *[0] * (64 - len(rows)), generation]):
            self.memory[begin + n] = word
        self._head()

    async def run(self) -> None:
        while True:
            await asyncio.sleep(SCAN)
            self.scan()

    def _head(self) -> None:
        oldest = max(1, self.newest - CAPACITY + 1)
        generation = 2 * self.scans & 0xFFFE
        words = unpack(">8H", pack(">HHIII", CAPACITY, self.page.row_words, oldest, self.newest, self.acknowledged))
        for n, word in enumerate([generation, *words, generation]):
            self.memory[self.page.ring_at + n] = word

    def _put(self, place: tuple[int, int], value: int) -> None:
        first, words = place
        for n in range(words):
            self.memory[first + n] = value >> 16 * (words - 1 - n) & 0xFFFF

    def _store(self, cell: Cell, value: float, begin: int = 0) -> None:
        if cell.bit is not None:
            word = self.memory[begin + cell.at] & ~(1 << cell.bit)
            self.memory[begin + cell.at] = word | int(value) << cell.bit
            return
        for n, word in enumerate(cell.encoded(value)):
            self.memory[begin + cell.at + n] = word

    # the host's side

    def answer(self, pdu: bytes) -> bytes:
        """The answer to one request."""
        function = pdu[0]
        if function not in (3, 6, 16):
            return bytes((function | 0x80, 1))
        address = unpack(">H", pdu[1:3])[0]
        if function == 3:
            count = unpack(">H", pdu[3:5])[0]
            if not 1 <= count <= 125:
                return bytes((0x83, 3))
            if any(place not in self.memory for place in range(address, address + count)):
                return bytes((0x83, 2))
            return bytes((3, 2 * count)) + pack(f">{count}H", *(self.memory[address + n] for n in range(count)))
        words = list(unpack(">H", pdu[3:5]) if function == 6 else unpack(f">{pdu[5] // 2}H", pdu[6:]))
        refused = self._take(address, words)
        return bytes((function | 0x80, refused)) if refused else pdu[:5]

    def _take(self, address: int, words: list[int]) -> int:
        page = self.page
        heart = page.header["heartbeat in"][0]
        if address == heart and len(words) == 1:
            self.memory[heart] = words[0]
            self.heartbeats.append(words[0])
        elif address == page.command_at:
            if len(words) != 16 or not words[15]:
                return 3
            self._command(words)
        elif page.hold_at and address == page.hold_at and len(words) == 4:
            self.held.append(words[0])
            for n, word in enumerate(words):
                self.memory[address + n] = word
        elif address == page.ring_at + 7 and len(words) == 2:
            self.acknowledged = words[0] << 16 | words[1]
            self._head()
        elif (
            page.settings
            and address >= page.settings.cells[0].staged
            and all(address + n in self.memory for n in range(len(words)))
        ):
            for n, word in enumerate(words):
                self.memory[address + n] = word
        else:
            return 2
        return 0

    def _command(self, words: list[int]) -> None:
        code, expected, id = words[0], words[2], words[15]
        if any(answer[0] == id for answer in self._answers):
            return
        state, reason = 3, 0
        name = next((name for name, (number, _) in self.page.commands.items() if number == code), "")
        if not name:
            state, reason = 4, 1
        elif expected and expected != self.memory[self.places["state"].at]:
            state, reason = 4, 2
        elif name == "commit":
            state, reason = self._commit(words[3] << 16 | words[4], words[5] << 16 | words[6])
        if state == 3:
            self.asked.append((code, words[3:11], id))
            if name in self.does and (event := self.does[name]()):
                self.tell(event, cause=id)
        time = unpack(">4H", pack(">Q", self.time))
        self._answers = [[id, state, reason, 0, *time], *self._answers][:8]

    def _commit(self, count: int, check: int) -> tuple[int, int]:
        cells = self.page.settings.cells if self.page.settings else ()
        staged = [self.memory[cell.staged + n] for cell in cells for n in range(cell.words)]
        if count != len(staged):
            return 4, 20
        if check != crc32(pack(f">{count}H", *staged)):
            return 4, 22
        for cell in cells:
            words = [self.memory[cell.staged + n] for n in range(cell.words)]
            value = cell.number(words)
            if (cell.low is not None and value < cell.low) or (cell.high is not None and value > cell.high):
                return 4, 21
        for cell in cells:
            for n in range(cell.words):
                self.memory[cell.at + n] = self.memory[cell.staged + n]
        return 3, 0


class ModbusTcp(asyncio.Protocol):
    """Modbus TCP for some units, from the specification."""

    def __init__(self, units: Mapping[int, PagePlc]) -> None:
        self.units = units
        self.heard = b""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        self.heard += data
        while len(self.heard) >= 8:
            transaction, _, length, unit = unpack(">HHHB", self.heard[:7])
            if len(self.heard) < 6 + length:
                return
            pdu, self.heard = self.heard[7 : 6 + length], self.heard[6 + length :]
            if unit in self.units:
                answer = self.units[unit].answer(pdu)
                self.transport.write(pack(">HHHB", transaction, 0, len(answer) + 1, unit) + answer)  # type: ignore[attr-defined]
