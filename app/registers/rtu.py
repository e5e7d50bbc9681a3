"""Modbus RTU frames and their time on the wire: unit, PDU, check sum, and the silence that ends them.

Arithmetic and limits: Modbus over serial line 1.02, reference/modbus.md section 1.
"""

from dataclasses import dataclass, field

from app.registers.crc import crc_holds, with_crc
from app.registers.pdu import (
    BITS,
    MASK_WRITE,
    READ_HOLDING,
    READ_WRITE,
    READS,
    WRITE_COIL,
    WRITE_COILS,
    WRITE_MULTIPLE,
    WRITE_SINGLE,
    WRITES,
    size_of,
)

BITS_PER_CHARACTER = 11
"""Start, 8 data, parity or a second stop, stop."""
MIN_FRAME = 4
MAX_FRAME = 256
SHORT = (*(function for function in READS if function != READ_WRITE), WRITE_COIL, WRITE_SINGLE)
"""Functions whose requests are 8 bytes long: address and count, or address and value."""
SLAVES = range(1, 248)
"""Addresses of slaves: 0 is for all, who do not answer, those behind are reserved."""


def character_time(baud: int) -> float:
    """One character on the wire [s]."""
    return BITS_PER_CHARACTER / baud


def silence(baud: int) -> float:
    """Silence that separates two frames [s]: 3.5 characters, fixed 1.75 ms above 19 200 baud."""
    return 1.75e-3 if baud > 19200 else 3.5 * character_time(baud)


def read_time(baud: int, count: int, function: int = READ_HOLDING) -> float:
    """Wire time of one poll of `count` registers, or bits, with both silences, without the slave's turnaround [s]."""
    return character_time(baud) * (8 + 5 + size_of(function, count)) + 2 * silence(baud)


def build_frame(unit: int, pdu: bytes) -> bytes:
    """The frame that carries `pdu` to or from `unit`."""
    return with_crc(bytes((unit,)) + pdu)


def parse_frame(frame: bytes) -> tuple[int, bytes] | None:
    """Unit and PDU of `frame`, or None when its length or its check sum is wrong."""
    if not MIN_FRAME <= len(frame) <= MAX_FRAME or not crc_holds(frame):
        return None
    return frame[0], frame[1:-2]


def request_length(frame: bytes | bytearray) -> int | None:
    """Length of the request frame that begins with `frame`; None while it cannot be told, or for an unknown function."""
    function = frame[1] if len(frame) > 1 else 0
    if function in SHORT:
        return 8
    if function == MASK_WRITE:
        return 10
    if function in (WRITE_MULTIPLE, WRITE_COILS) and len(frame) > 6:
        return 9 + frame[6]
    if function == READ_WRITE and len(frame) > 10:
        return 13 + frame[10]
    return None


@dataclass(slots=True)
class Framer:
    """Cuts what a slave hears into frames, by silence alone: a damaged telegram never shifts into the next one."""

    silence: float
    """Pause that ends a frame [s]."""
    patience: float = 0.0
    """Pause that ends a frame whose announced length is not there yet [s]: an adapter hands bytes over in pieces."""
    began: float = 0.0
    """When the first byte of the frame was heard [s]."""
    _heard: bytearray = field(default_factory=bytearray)
    _last: float = 0.0

    def feed(self, data: bytes, now: float) -> None:
        """Bytes that arrived at `now` [s]. What is longer than any frame is noise and is not kept."""
        if not self._heard:
            self.began = now
        self._last = now
        self._heard += data[: max(0, MAX_FRAME + 1 - len(self._heard))]

    @property
    def due(self) -> float | None:
        """When the frame is over if nothing else is heard [s]; None while nothing was heard."""
        if not self._heard:
            return None
        length = request_length(self._heard)
        partial = len(self._heard) < MIN_FRAME if length is None else len(self._heard) < length
        return self._last + (max(self.silence, self.patience) if partial else self.silence)

    def take(self) -> tuple[int, bytes] | None:
        """Unit and PDU of the frame that is over, or None for a damaged one; either way the next byte begins a new one."""
        frame = bytes(self._heard)
        self._heard.clear()
        return parse_frame(frame)


def write_time(baud: int, count: int = 1, function: int = WRITE_SINGLE) -> float:
    """Wire time of one write of `count` registers, or bits, and its echo with both silences, without the slave's turnaround [s]."""
    request, echo = 8 if function in SHORT else 9 + size_of(function, count), 8
    if function == MASK_WRITE:
        request = echo = 10
    return character_time(baud) * (request + echo) + 2 * silence(baud)


def answer_length(frame: bytes | bytearray) -> int | None:
    """Length of the answer frame that begins with `frame`; None while it cannot be told, 0 when no answer begins so."""
    if len(frame) < 2:
        return None
    function = frame[1]
    if function & 0x80:
        return 5
    if function in READS:
        if len(frame) < 3:
            return None
        whole = frame[2] and (function in BITS or frame[2] % 2 == 0)
        return 5 + frame[2] if whole and 5 + frame[2] <= MAX_FRAME else 0
    if function == MASK_WRITE:
        return 10  # the echo has both masks
    return 8 if function in WRITES else 0


def _never_answered(request: bytes) -> bool:
    """Whether no answer looks like `request`: a read, unless it is one of 17 to 24 bits from 0x0300 on, whose answer is as long."""
    if len(request) < 6 or request[1] not in READS:
        return False
    return request[1] not in BITS or size_of(request[1], int.from_bytes(request[4:6])) != request[2]


@dataclass(slots=True)
class AnswerFramer:
    """Cuts what a master hears into answers, by length and check sum: two answers may come in one piece, one in several.

    Silence alone would not do: a late answer can be followed by the next one without any, as far as this computer can tell.
    """

    damaged: int = 0
    """Runs of bytes that were no frame: noise, wrong check sums."""
    skipped: int = 0
    """Bytes thrown away since the last good frame or silence."""
    echo: bool = False
    """Whether the adapter hears what it sends. A read shows it: no slave ever sends one. The echo of a write would pass for its answer."""
    _request: bytes = b""
    _heard: bytearray = field(default_factory=bytearray)

    @property
    def pending(self) -> bool:
        """Whether something was heard whose end is not known yet."""
        return bool(self._heard) or self.skipped > 0

    def feed(self, data: bytes) -> list[tuple[int, bytes]]:
        """Units and PDUs of the answers that `data` completes."""
        self._heard += data
        frames = []
        while (frame := self._cut()) is not None:
            frames.append(frame)
        return frames

    def silent(self) -> tuple[list[tuple[int, bytes]], int]:
        """The line is silent: answers behind a wrong beginning, and the number of bytes that were none."""
        frames = []
        self._request = b""
        while self._heard:
            self._skip()
            while (frame := self._cut()) is not None:
                frames.append(frame)
        skipped = self.skipped
        self._forget()
        return frames, skipped

    def asked(self, request: bytes) -> None:
        """The frame `request` is being sent; what an adapter hears of it itself comes before the answer."""
        self._request = request if self.echo or _never_answered(request) else b""

    def _cut(self) -> tuple[int, bytes] | None:
        """The answer that begins now, or None while it is not complete."""
        heard = self._heard
        while heard:
            if self._request:
                if len(heard) < len(self._request) and self._request.startswith(heard):
                    return None
                if heard.startswith(self._request):
                    self.echo = True
                    del heard[: len(self._request)]
                self._request = b""
                continue
            length = answer_length(heard)
            if length is None or len(heard) < length:
                return None
            frame = parse_frame(bytes(heard[:length])) if length else None
            if frame is not None and frame[0] in SLAVES:  # ff ff 00 00 00 within a damaged answer has a right check sum
                del heard[:length]
                self._forget()
                return frame
            self._skip()
        return None

    def _skip(self) -> None:
        del self._heard[0]
        self.skipped += 1

    def _forget(self) -> None:
        if self.skipped:
            self.damaged += 1
        self.skipped = 0
