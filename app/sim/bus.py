"""A simulated line: which virtual device hears a telegram, what it answers, and how the line spoils that.

Pure: an answer is a value with its delay, and whoever carries it (memory, TCP, RTU) does the waiting.

Line faults live in each device's training registers (0xE011–0xE014), so the instructor sets them by the same telegrams as everything else.
Telegrams to training registers are outside the lesson: always answered, never counted, invisible to the watchdog.
"""

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from random import Random

from app.errors import DeviceException
from app.registers.pdu import (
    BITS,
    READS,
    SERVER_FAILURE,
    WRITES,
    Request,
    build_answer,
    exception_answer,
    parse_request,
)
from app.sim.device import VirtualDevice
from app.sim.training import LineFault, is_training

log = logging.getLogger(__name__)

BROADCAST = 0


class LineFaultMode(IntEnum):
    """What the instructor has done to the line of one device (`training.LINE_FAULT_MODES`)."""

    NONE = 0
    CABLE_PULLED = 1
    """Nothing arrives and nothing is answered: the device's own watchdog sees it."""
    SLOW = 2
    """Acts at once, answers `delay_ms` later, even when nobody waits any more."""
    SILENT = 3
    """Hears and acts, but the answer is lost."""
    WRONG_UNIT = 4
    WRONG_LENGTH = 5
    """A well-formed answer of another length: check sum and byte count hold."""
    GARBAGE = 6
    """`argument` 0: a damaged answer (RTU: wrong check sum); else noise instead of one."""
    EXCEPTION = 7
    """Refuses with exception `argument`, without acting."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What goes onto the line."""

    unit: int
    """Unit that the answer names."""
    pdu: bytes | None
    """None = silence."""
    delay: float = 0.0
    """From the end of the request to the begin of the answer [s]."""
    corrupt: str = ""
    """"" | crc | length | unit | garbage. Length, unit and garbage are already in `unit` and `pdu`; `crc` is up to the carrier,
    and a carrier without check sum sends `damaged(pdu)`."""


class Bus:
    """One line with its virtual devices by unit."""

    def __init__(self, devices: Mapping[int, VirtualDevice], *, turnaround: float = 0.0) -> None:
        """`turnaround`: time that every device takes for an answer [s]."""
        self.devices = dict(devices)
        self.turnaround = turnaround
        self.paused = False
        """Whether its devices are not stepped at present; they answer all the same, and what is written acts when they go on."""
        self._noise = Random(1)

    def answer(self, unit: int, pdu: bytes) -> Answer:
        """What the line answers to `pdu` for `unit`; never raises.

        Unit 0 is a broadcast, unless a device has it, as over TCP it may: writes reach every device, and nobody answers. A unit that
        is not there is silence, on TCP too: a gateway might say 0B, and a master has to live with both.
        """
        silence = Answer(unit, None)
        if not pdu:
            return silence
        if unit == BROADCAST and unit not in self.devices:
            for each in self.devices.values():
                self._broadcast(each, pdu)
            return silence
        device = self.devices.get(unit)
        if device is None:
            return silence
        try:
            request = parse_request(pdu)
        except DeviceException as refusal:
            return self._on_the_line(unit, device, pdu, refusal)
        if _is_training(request):
            return Answer(unit, self._ask(device, request), self.turnaround)
        return self._on_the_line(unit, device, pdu, request)

    def _on_the_line(self, unit: int, device: VirtualDevice, pdu: bytes, asked: Request | DeviceException) -> Answer:
        """The answer of `device`, as its line fault lets it through."""
        fault = device.line_fault
        mode, argument, late = fault.mode, fault.argument, fault.delay_ms / 1000
        delay = self.turnaround
        _count_down(fault)
        if mode == LineFaultMode.CABLE_PULLED:
            return Answer(unit, None)
        device.telegram_seen()
        if mode == LineFaultMode.EXCEPTION:
            return Answer(unit, exception_answer(pdu[0], argument), delay)
        answer = (
            exception_answer(pdu[0], asked.code) if isinstance(asked, DeviceException) else self._ask(device, asked)
        )
        if mode == LineFaultMode.SILENT:
            return Answer(unit, None)
        if mode == LineFaultMode.SLOW:
            return Answer(unit, answer, delay + late)
        if mode == LineFaultMode.WRONG_UNIT:
            return Answer(unit % 247 + 1, answer, delay, "unit")
        if mode == LineFaultMode.WRONG_LENGTH:
            return Answer(unit, _of_other_length(answer), delay, "length")
        if mode == LineFaultMode.GARBAGE and argument:
            return Answer(unit, self._noise_instead_of(answer), delay, "garbage")
        return Answer(unit, answer, delay, "crc" if mode == LineFaultMode.GARBAGE else "")

    def _ask(self, device: VirtualDevice, request: Request) -> bytes:
        """The device's own answer.

        Function 23 reads before it writes: a write acts at the next step border anyway, and so it is all or nothing.
        """
        try:
            words: list[int] = []
            if request.function in READS:
                words = device.read(request.function, request.address, request.count)
            if request.function in WRITES:
                device.write(request.function, request.write_address, request.words)
            return build_answer(request, words)
        except DeviceException as refusal:
            return exception_answer(request.function, refusal.code)
        except Exception:
            log.exception("virtual device failed request=%s", request)
            return exception_answer(request.function, SERVER_FAILURE)

    def _broadcast(self, device: VirtualDevice, pdu: bytes) -> None:
        try:
            request = parse_request(pdu)
        except DeviceException:
            return
        mode = int(LineFaultMode.NONE)
        if not _is_training(request):
            mode = device.line_fault.mode
            _count_down(device.line_fault)
            if mode == LineFaultMode.CABLE_PULLED:
                return
            device.telegram_seen()
        if request.function in WRITES and request.function not in READS and mode != LineFaultMode.EXCEPTION:
            self._ask(device, request)

    def _noise_instead_of(self, answer: bytes) -> bytes:
        """As many bytes of noise as the answer had; the first is never its function code, nor that of its refusal."""
        noise = bytearray(self._noise.randbytes(len(answer)))
        noise[0] = damaged(answer)[0]
        return bytes(noise)


def _is_training(request: Request) -> bool:
    """Whether all of it is the instructor's: those are registers."""
    return request.function not in BITS and all(is_training(address) for address in request.addresses)


def damaged(pdu: bytes) -> bytes:
    """`pdu` with a function code that no master can take for its answer: damage for carriers that have no check sum."""
    return bytes((pdu[0] ^ 0x55,)) + pdu[1:]


def _count_down(fault: LineFault) -> None:
    if fault.mode != LineFaultMode.NONE and fault.count > 0:
        fault.count -= 1
        if fault.count == 0:
            fault.mode = LineFaultMode.NONE


def _of_other_length(answer: bytes) -> bytes:
    """One register, or eight bits, fewer (more when there is only one); an echo or an exception loses its last byte."""
    if answer[0] not in READS:
        return answer[:-1]
    size = 1 if answer[0] in BITS else 2
    if answer[1] <= size:
        return bytes((answer[0], answer[1] + size)) + answer[2:] + bytes(size)
    return bytes((answer[0], answer[1] - size)) + answer[2:-size]
