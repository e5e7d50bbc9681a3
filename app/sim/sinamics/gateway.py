"""A PLC between the mailbox and the drive: `simulation = { gateway = 1 }`, and what an instructor does to its fieldbus.

The window is the one of a drive (mailbox.py); behind it the PLC's block (blocks/parameter_gateway.py) sends records over a fieldbus, which
takes its time, and the drive takes its own.
"""

from collections.abc import Sequence

from app.blocks.parameter_gateway import Bus, ParameterGateway, Records
from app.errors import TelegramError
from app.profidrive.parameter_access.mailbox import words_of
from app.profidrive.parameter_access.messages import answered, decode_request, encode_answer
from app.sim.sinamics.mailbox import DELAY, LATE, MailboxFault, Serve, fitting, refused

RECORD_TIME = 0.02
"""Of one record on the fieldbus, either way [s]; assumed."""


class GatewayMailbox:
    """The window of the PLC, the fieldbus and the drive's own parameter channel."""

    def __init__(self, serve: Serve) -> None:
        self._serve = serve
        self._plc = ParameterGateway()
        self._bus = Bus()
        self._ran = Records()
        self._left = 0.0
        """Until the record that is on its way has arrived [s]."""
        self._request = b""
        """What the drive works on."""
        self._answer: bytes | None = None
        self._ready = 0.0
        """Until the drive has its answer [s]."""

    @property
    def words(self) -> list[int]:
        """The window as it is read."""
        return self._plc.window

    def write(self, offset: int, words: Sequence[int]) -> None:
        """Registers of the window are written."""
        self._plc.window[offset : offset + len(words)] = words

    def step(self, dt: float, fault: int) -> None:
        """One scan of the PLC and one step of the drive, `dt` [s]."""
        if fault == MailboxFault.RESTART and (self._ran.write or self._ran.read):
            window, self._plc = self._plc.window, ParameterGateway()
            self._plc.window[:] = window  # registers are retained, its blocks are not
            self._ran, self._left, self._answer, self._request = Records(), 0.0, None, b""
        self._drive(dt, fault)
        bus, self._bus = self._bus, Bus()
        now = self._plc.scan(bus)
        if now != self._ran and (now.write or now.read):
            self._left = RECORD_TIME
        self._ran = now
        if now.write or now.read:
            self._left -= dt
            if self._left <= dt / 2:
                self._bus = self._sent(fault) if now.write else self._fetched(fault)
                self._left = RECORD_TIME

    def _drive(self, dt: float, fault: int) -> None:
        """The drive works on what it was sent."""
        if not self._request or fault == MailboxFault.NEVER:
            return
        self._ready -= dt
        if self._ready > dt / 2:
            return
        data, self._request = self._request, b""
        try:
            request = decode_request(data)
        except TelegramError as error:
            self._answer = None if error.refusal is None else refused(data, error.refusal)
        else:
            self._answer = encode_answer(answered(request, fitting(self._serve(request))))
        if fault == MailboxFault.FOREIGN and self._answer:
            self._answer = bytes((self._answer[0] % 255 + 1,)) + self._answer[1:]

    def _sent(self, fault: int) -> Bus:
        if fault in (MailboxFault.UNREACHED, MailboxFault.BUSY):
            return Bus(write_error=True, write_refused=fault == MailboxFault.BUSY)
        self._request = b"".join(word.to_bytes(2, "big") for word in self._plc.record)[: self._plc.length]
        self._answer, self._ready = None, LATE if fault == MailboxFault.LATE else DELAY
        return Bus(write_done=True)

    def _fetched(self, fault: int) -> Bus:
        if fault in (MailboxFault.UNANSWERED, MailboxFault.UNREACHED, MailboxFault.INTERNAL):
            return Bus(read_error=True)
        if self._answer is None:
            return Bus(read_error=True, not_ready=bool(self._request))
        data, self._answer = self._answer, None
        longer = 2 if fault == MailboxFault.WRONG_LENGTH else 0
        return Bus(read_done=True, answer=words_of(data), length=len(data) + longer)
