"""Breaks a simulated device over its own Modbus port, for lessons and tests. Never a real one.

Training registers lie from 0xE000 up (reference/register-map.md). Before anything is written their head is read; a device without the magic
and the flag "simulated" is not written to, and neither is one that does not answer.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from app.errors import ConfigurationError, DeviceException, LinkError
from app.links.contract import Block, Transport
from app.links.training_head import MAGIC, SIMULATED, VERSION, WORDS
from app.registers.line_faults import LINE_FAULTS, SLOW_DELAY

BASE = 0xE000
MACHINE_FAULT, LINE_FAULT, LINE_DELAY, LINE_ARGUMENT, LINE_COUNT = 0xE010, 0xE011, 0xE012, 0xE013, 0xE014
PATIENCE = 1.0
CLEAR = "clear"


@dataclass(frozen=True, slots=True)
class Injection:
    """What is written, in order, each word by function 06; the line fault is last, for it acts at once."""

    writes: Sequence[tuple[int, int]]


def injection(
    fault: str, machine_faults: Mapping[str, int], *, delay: int = SLOW_DELAY, code: int = 4, count: int = 0
) -> Injection:
    """What makes `fault`: a name of `LINE_FAULTS`, a machine fault by name or status code (0x04), or `clear` for none of either.

    `delay` of a slow answer [ms]; `code` of an exception; `count` telegrams that a line fault hits, 0 = until cleared.

    Raises:
        ConfigurationError: no such fault, with those that there are.
    """
    if fault == CLEAR:
        return Injection(((LINE_FAULT, 0), (LINE_DELAY, 0), (LINE_ARGUMENT, 0), (LINE_COUNT, 0), (MACHINE_FAULT, 0)))
    if fault in LINE_FAULTS:
        argument = code if fault == "exception" else 0
        return Injection(
            (
                (LINE_DELAY, delay if fault == "slow" else 0),
                (LINE_ARGUMENT, argument),
                (LINE_COUNT, count),
                (LINE_FAULT, LINE_FAULTS[fault]),
            )
        )
    by_name = {name.lower(): number for name, number in machine_faults.items()}
    number = by_name.get(fault.lower())
    if number is None:
        try:
            number = int(fault, 0)
        except ValueError:
            number = -1
        if number not in by_name.values():
            known = ", ".join([*machine_faults, *LINE_FAULTS, CLEAR])
            raise ConfigurationError(f"fault {fault}: expected one of {known}")
    return Injection(((MACHINE_FAULT, number),))


async def inject(transport: Transport, unit: int, what: Injection) -> None:
    """Write `what` to the unit, if it says that it is simulated.

    Raises:
        ConfigurationError: the device is real, or its training registers are of another version: nothing was written.
        LinkError: it did not answer, or refused a word.
    """
    try:
        magic, flags, version, _ = await transport.read(unit, Block(BASE, WORDS), PATIENCE)
    except DeviceException as error:
        raise ConfigurationError(
            f"unit {unit} has no training registers ({error}): it is a real device, nothing was written"
        ) from error
    if magic != MAGIC or not flags & SIMULATED:
        raise ConfigurationError(
            f"unit {unit}: {BASE:#06x} = {magic:#06x} {flags:#06x}, expected {MAGIC:#06x} and the flag "
            "simulated: it is a real device, nothing was written"
        )
    if version != VERSION:
        raise ConfigurationError(
            f"unit {unit}: training registers of version {version}, expected {VERSION}: nothing was written"
        )
    for address, word in what.writes:
        try:
            await transport.write(unit, address, [word], PATIENCE)
        except LinkError as error:
            raise LinkError(f"unit {unit}: {address:#06x} = {word} not written: {error}") from error
