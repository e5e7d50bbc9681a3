"""Modbus RTU on a serial line: our own telegrams over a port that pyserial opens.

pymodbus' serial client sends without the silence between frames, takes an answer that comes late for the answer to the next request, does
not look at its length (reference/modbus.md section 5), and what it gave up it has forgotten: nothing could be put right around it. So the
bytes go through the loop's own reader here, answers are cut by length and check sum (`registers.rtu.AnswerFramer`), and
`late_answers.LateAnswers` remembers what may still be answered.

One telegram at a time. Before each the line has been silent for 3.5 characters, and what was heard meanwhile is not an answer to anything.
A repeater that says every answer twice is told by time: a former answer once more, sooner than the wire allows, is not believed unless it
comes again. A line that has shown to take no time (a pseudo-terminal, a tunnel) tells nothing that way: there all is believed.
Unit 0 (broadcast) is refused: nobody confirms one.
"""

import asyncio
import contextlib
import logging
import os
import termios
from collections.abc import Sequence
from dataclasses import dataclass, field

import serial  # type: ignore[import-untyped]

from app.errors import BadAnswer, DeviceException, LinkError, NoAnswer, NotConnected
from app.links.contract import Block, Counts, Exchange, LateAnswerDue
from app.links.late_answers import LateAnswers, Pattern, Piece, pattern_of_answer, pattern_of_request
from app.links.line_diagnosis import LineDiagnosis
from app.links.patience import more
from app.links.repeats import Repeats
from app.links.serial_port import close_port, leads_elsewhere, open_port, parity_of, reason_of
from app.plant.definitions import Link
from app.registers.pdu import READS, Request, build_answer, build_request, parse_answer
from app.registers.rtu import SLAVES, AnswerFramer, build_frame, character_time, silence

log = logging.getLogger(__name__)

GAP = 0.02
"""Longest pause within one answer [s]: a USB adapter hands it over in pieces up to its latency timer (FTDI 16 ms) apart."""
RESTLESS = 1.0
"""A line that is not silent for so long cannot be used [s]."""
SOONER = 0.9
"""Part of the time that a request and its answer take on the wire: what is complete before that answers something else."""
TURN = 0.002
"""A loop that comes to a deadline later than that [s] was held up."""
NOISE = 5
"""Fewer bytes that are no frame are the click of a driver that switches; from here on it was an answer, damaged."""
TEMPORARY = (4, 5, 6)
"""Refusals from which nothing lasting is learnt: harmless also when meant for an earlier request."""


@dataclass(slots=True)
class _Telegram:
    """The request that is on its way."""

    unit: int
    request: Request
    pattern: Pattern
    answer: asyncio.Future[bytes]
    again: bool = False
    """`Block.again`."""
    older: tuple[bytes, float] | None = None
    """An answer that counts as the one to an earlier read of the same registers, and until when that was owed [s]."""
    earliest: float = 0.0
    """Before that no answer to it can be complete on a wire of this speed [s]."""
    held: list[bytes] = field(default_factory=list)
    """Answers that may be former ones, said twice."""
    deadline: float = 0.0
    was_late: bool = False
    """Whether the loop has come to the deadline: what it was late is given once."""
    timer: asyncio.TimerHandle | None = None


class RtuTransport:
    """One serial line with its slaves."""

    parallel = False

    def __init__(self, link: Link, exchange: Exchange | None = None) -> None:
        """`exchange` is of the memory transport; not used here."""
        self.counts = Counts()
        self._link = link
        self._character = character_time(link.baud)
        self._silence = silence(link.baud)
        self._late_answers = LateAnswers()
        self._framer = AnswerFramer()
        self._port: serial.Serial | None = None
        self._telegram: _Telegram | None = None
        self._turn = asyncio.Lock()
        self._lost: str = ""
        self._heard = 0.0
        """When the last byte was heard, or the last one sent will have left [s]."""
        self._quiet: asyncio.TimerHandle | None = None
        self._repeats = Repeats(self._character)
        self._diagnosis = LineDiagnosis(link, lambda: self.counts)

    @property
    def connected(self) -> bool:
        """Whether the port is open, as far as anybody knows."""
        return self._port is not None

    @property
    def parity(self) -> str:
        """That of the open port, empty while there is none; some ports pass over what they are asked for."""
        return parity_of(self._port) if self._port is not None else ""

    async def connect(self) -> None:
        """Open the port for us alone.

        Raises:
            NotConnected: names the port and why.
        """
        await self.close()
        self._port = open_port(self._link)
        loop = asyncio.get_running_loop()
        self._lost, self._heard = "", loop.time()
        self._framer = AnswerFramer(echo=self._framer.echo)
        self._repeats = Repeats(self._character)
        self._diagnosis.opened(self._port)
        loop.add_reader(self._port.fileno(), self._readable)

    async def read(self, unit: int, block: Block, patience: float) -> list[int]:
        """Exactly `block.count` words. While an earlier answer may still come, perhaps by another telegram or by two.

        Raises:
            LateAnswerDue: no telegram could be told apart from an earlier one.
        """
        self._check(unit)
        async with self._turn:
            now = asyncio.get_running_loop().time()
            pieces, wait = self._late_answers.pieces(unit, block, now)
            if not pieces and block.again and self._late_answers.only(unit, block, now):
                pieces = [Piece(block, 0, block.count)]
            if not pieces:
                raise LateAnswerDue(f"{self._link.port} unit {unit}", wait)
            words: list[int] = []
            for piece in pieces:
                words += await self._read(unit, piece, patience)
            return words

    async def write(self, unit: int, address: int, words: Sequence[int], patience: float, function: int = 6) -> None:
        """Write `words`; returns when the echo equals the request, and is not the echo of an earlier one like it."""
        self._check(unit)
        async with self._turn:
            await self._ask(unit, Request(function, write_address=address, words=tuple(words)), patience)

    async def close(self) -> None:
        """Give the port back."""
        self._drop("closed")

    # one telegram

    async def _read(self, unit: int, piece: Piece, patience: float) -> list[int]:
        block = piece.block
        try:
            request = Request(block.function, block.address, block.count)
            words = await self._ask(unit, request, patience, again=block.again)
        except DeviceException:
            self._late_answers.refused(unit, block)
            raise
        self._late_answers.proven(unit, block)
        return words[piece.skip : piece.skip + piece.count]

    async def _ask(self, unit: int, request: Request, patience: float, *, again: bool = False) -> list[int]:
        try:
            frame = build_frame(unit, build_request(request))
        except ValueError as error:
            raise BadAnswer(f"unit {unit}: {error}") from error
        await self._wait_for_silence()
        loop = asyncio.get_running_loop()
        telegram = _Telegram(unit, request, pattern_of_request(unit, request), loop.create_future(), again)
        self._telegram = telegram
        answered = False
        answer = len(build_answer(request, [0] * request.count)) + 3
        telegram.earliest = loop.time() + SOONER * (len(frame) + answer) * self._character
        try:
            self._send(frame)
            sent = loop.time() + len(frame) * self._character
            self._heard = sent
            telegram.deadline = sent + self._silence + patience + answer * self._character
            telegram.timer = loop.call_at(telegram.deadline, self._time_is_up, telegram, patience)
            pdu = await telegram.answer
            words = parse_answer(request, pdu)
            answered = True
            return words
        except DeviceException:
            answered = True
            raise
        finally:
            self._telegram = None
            if telegram.timer is not None:
                telegram.timer.cancel()
            if not telegram.answer.done():
                telegram.answer.cancel()
            elif not telegram.answer.cancelled():
                telegram.answer.exception()  # nobody waits for it when the task was ended at that moment
            if not answered:
                self._late_answers.unanswered(telegram.pattern, loop.time(), request.address)

    async def _wait_for_silence(self) -> None:
        """Until nothing has been heard for 3.5 characters, and for longer behind half a frame."""
        loop = asyncio.get_running_loop()
        limit = loop.time() + RESTLESS
        while True:
            if self._port is None:
                raise NotConnected(f"{self._link.port}: {self._lost or 'not connected'}")
            now = loop.time()
            due = self._heard + self._silence
            if self._framer.pending:
                due = max(due, self._heard + GAP)
            if now >= due:
                if self._framer.pending:
                    self._fell_silent()
                return
            if now > limit:
                raise NoAnswer(
                    f"{self._link.port}: never silent for {1000 * self._silence:.1f} ms, somebody talks all the time"
                )
            await asyncio.sleep(due - now)

    def _send(self, frame: bytes) -> None:
        port = self._port
        if port is None:
            raise NotConnected(f"{self._link.port}: {self._lost or 'not connected'}")
        self._framer.asked(frame)
        try:
            sent = os.write(port.fileno(), frame)
        except BlockingIOError:
            sent = 0
        except OSError as error:
            self._drop(reason_of(error))
            raise NotConnected(f"{self._link.port}: {self._lost}") from error
        if sent != len(frame):
            # the rest would go out in the middle of something else: away with all of it
            with contextlib.suppress(OSError, termios.error):
                termios.tcflush(port.fileno(), termios.TCOFLUSH)
            raise NoAnswer(f"{self._link.port}: took {sent} of {len(frame)} bytes, the other end does not listen")

    def _time_is_up(self, telegram: _Telegram, patience: float) -> None:
        loop = asyncio.get_running_loop()
        longer, telegram.was_late = 0.0 if telegram.was_late else more(telegram.deadline, patience), True
        if longer > TURN:
            telegram.timer = loop.call_later(longer, self._time_is_up, telegram, patience)
        elif self._framer.pending and loop.time() < self._heard + GAP:
            telegram.timer = loop.call_at(self._heard + GAP, self._time_is_up, telegram, patience)
        elif telegram.older is not None and not telegram.answer.done():
            pdu, until = telegram.older  # one answer to two reads of the same registers: it stands, the other is owed
            self.counts.late -= 1
            self._late_answers.unanswered(telegram.pattern, loop.time(), telegram.request.address, until=until)
            telegram.answer.set_result(pdu)
        elif self._port is not None and leads_elsewhere(self._link.port, self._port):
            self._drop("another device has this name now")
        else:
            if telegram.held:
                self._repeats.doubles = False  # nothing was said twice here
            hint = self._diagnosis.hint if self.counts.strange else ""
            self._fail(telegram, NoAnswer(f"{self._link.port} unit {telegram.unit}: no answer in {patience:g} s{hint}"))

    # what is heard

    def _readable(self) -> None:
        loop = asyncio.get_running_loop()
        port = self._port
        if port is None:
            return
        try:
            data = os.read(port.fileno(), 4096)
        except BlockingIOError:
            return
        except OSError as error:
            self._drop(reason_of(error))
            return
        if not data:
            self._drop("the device is gone")
            return
        self._heard = max(self._heard, loop.time())
        damaged = self._framer.damaged
        for unit, pdu in self._framer.feed(data):
            self._take(unit, pdu)
        self.counts.damaged += self._framer.damaged - damaged
        if self._quiet is not None:
            self._quiet.cancel()
        self._quiet = loop.call_later(max(GAP, self._silence), self._fell_silent) if self._framer.pending else None

    def _fell_silent(self) -> None:
        """What was begun is not going to be finished."""
        if self._quiet is not None:
            self._quiet.cancel()
            self._quiet = None
        damaged = self._framer.damaged
        frames, skipped = self._framer.silent()
        for unit, pdu in frames:
            self._take(unit, pdu)
        self.counts.damaged += self._framer.damaged - damaged
        if skipped >= NOISE:
            self._diagnosis.noise(self._port)
            if self._telegram is not None:
                where, hint = f"{self._link.port} unit {self._telegram.unit}", self._diagnosis.hint
                error = BadAnswer(f"{where}: {skipped} bytes that are no telegram (check sum){hint}")
                self._fail(self._telegram, error)

    def _take(self, unit: int, pdu: bytes) -> None:
        """An answer with a good check sum: to what is on its way, or to something given up."""
        self._diagnosis.understood()
        telegram, now = self._telegram, asyncio.get_running_loop().time()
        if telegram is None or unit != telegram.unit or telegram.answer.done():
            self._late(unit, pdu)
            return
        function = telegram.request.function
        if pdu[0] == function | 0x80:
            if self._late_answers.owes(unit, function, now) and (function not in READS or pdu[1] not in TEMPORARY):
                self._fail(
                    telegram,
                    BadAnswer(f"{self._link.port} unit {unit}: refused this request or an earlier one ({pdu[1]:02d})"),
                )
            else:
                telegram.answer.set_result(pdu)
        elif pattern_of_answer(unit, pdu) == telegram.pattern:
            if self._is_doubtful(telegram, pdu, now):
                telegram.held.append(pdu)
            elif until := self._late_answers.settled(telegram.pattern, now):
                self.counts.late += 1  # one answer for each telegram like this one: ours is the last
                if telegram.again:
                    telegram.older = pdu, until
            else:
                self._repeats.taken(unit, pdu, now, twice=bool(telegram.held))
                telegram.answer.set_result(pdu)
        elif self._late_answers.settle(pattern_of_answer(unit, pdu), now):
            self.counts.late += 1
        elif self._repeats.was_said(unit, pdu, now):
            self._repeats.doubles = True
        elif pdu[0] == function:
            self._fail(telegram, _wrong(f"{self._link.port} unit {unit}", telegram.request, pdu))

    def _is_doubtful(self, telegram: _Telegram, pdu: bytes, now: float) -> bool:
        """Whether an answer that would fit may be a former one, said again. One that comes twice now is not."""
        if self._late_answers.expects(telegram.pattern, now):
            return False
        expected = self._late_answers.owes(telegram.unit, telegram.request.function, now)
        doubtful = self._repeats.doubtful(telegram.unit, pdu, now, soon=now < telegram.earliest, expected=expected)
        return doubtful and pdu not in telegram.held

    def _late(self, unit: int, pdu: bytes) -> None:
        now = asyncio.get_running_loop().time()
        if pdu[0] & 0x80:
            return
        if self._late_answers.settle(pattern_of_answer(unit, pdu), now):
            self.counts.late += 1
        elif self._repeats.was_said(unit, pdu, now):
            self._repeats.doubles = True

    def _fail(self, telegram: _Telegram, error: LinkError) -> None:
        if not telegram.answer.done():
            telegram.answer.set_exception(error)

    def _drop(self, reason: str) -> None:
        """The port is gone, or not wanted any more."""
        port, self._port = self._port, None
        if self._quiet is not None:
            self._quiet.cancel()
            self._quiet = None
        if port is None:
            return
        self._lost = reason
        with contextlib.suppress(RuntimeError):  # the loop may be gone
            asyncio.get_running_loop().remove_reader(port.fileno())
        close_port(port)
        if self._telegram is not None:
            self._fail(self._telegram, NotConnected(f"{self._link.port}: {reason}"))

    def _check(self, unit: int) -> None:
        if unit not in SLAVES:
            raise BadAnswer(f"{self._link.port} unit {unit}: expected 1 to 247; nobody answers a broadcast")


def _wrong(where: str, request: Request, pdu: bytes) -> BadAnswer:
    try:
        parse_answer(request, pdu)
    except LinkError as error:
        return BadAnswer(f"{where}: {error}")
    return BadAnswer(f"{where}: {pdu.hex(' ')} is no answer to {request}")
