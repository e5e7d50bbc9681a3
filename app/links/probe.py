"""Finds a device nobody knows anything about: tries speeds, parities and units until something answers with a good check sum.

Only reads are sent: one register, or bit, by function 03 or the one that is asked for. An exception is an answer too, even the surest
one: nothing but a slave sends it, or a gateway (0A, 0B), which then says that there is none.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import cast

from app.addresses import as_written
from app.errors import GATEWAY, BadAnswer, DeviceException, NoAnswer, NotConnected
from app.links.contract import Block, Transport
from app.links.rtu import RtuTransport
from app.links.serial_port import NotSupported
from app.links.tcp import TcpTransport
from app.plant.definitions import Link
from app.registers.pdu import BITS, READ_HOLDING

BAUDS = (9600, 19200, 38400, 57600, 115200, 4800, 2400, 1200)
"""In the order in which they are met; the E800 knows those up to 57 600."""
PARITIES = (("even", 1), ("none", 2), ("none", 1), ("odd", 1))
"""Parity and stop bits; 8E1 is what Modbus asks for, 8N1 what many send."""
ADDRESS = 0x1000
"""Of the register that is asked for."""
PATIENCE = 0.15
"""For a device whose time nobody knows [s]; time on the wire comes on top."""


@dataclass(frozen=True, slots=True)
class Found:
    """A unit that answered."""

    link: Link
    unit: int
    answer: str
    """What it said, in words."""
    there: bool = True
    """False: a gateway answered in its place, and does not reach it, or what came is no answer."""
    sense: bool = True
    """False: what came is no answer."""


@dataclass(frozen=True, slots=True)
class Try:
    """What is tried now."""

    link: Link
    units: Sequence[int]

    def __str__(self) -> str:
        return settings_of(self.link)


def settings_of(link: Link) -> str:
    """`9600 8E1`, or host and port."""
    if link.transport == "tcp":
        return as_written(link.host, link.tcp_port)
    return f"{link.baud} 8{link.parity[0].upper()}{link.stop_bits}"


def tries(link: Link, bauds: Sequence[int], parities: Sequence[tuple[str, int]], units: Sequence[int]) -> Iterable[Try]:
    """Every combination of `bauds` and `parities`, the likely ones first: all speeds of a parity come before the next parity."""
    for parity, stop_bits in parities:
        for baud in bauds:
            yield Try(replace(link, baud=baud, parity=parity, stop_bits=stop_bits), units)


def transport_of(link: Link) -> Transport:
    """An unopened connection."""
    return cast(Transport, TcpTransport(link) if link.transport == "tcp" else RtuTransport(link))


async def probe(
    one: Try, tell: Callable[[int], None], patience: float = PATIENCE, function: int = READ_HOLDING
) -> list[Found]:
    """The units that answer under the settings `one` to `function`, and those for which something else came that they are not.

    `tell` hears each unit before it is asked. Some devices close the connection when they are asked for another unit: it is opened again.

    Raises:
        NotSupported: the port does not take this speed or parity, or passes over the parity.
        NotConnected: the port or the host is not to be had, or each unit had the connection closed.
    """
    transport = transport_of(one.link)
    await transport.connect()
    if isinstance(transport, RtuTransport) and (parity := transport.parity) != one.link.parity:
        await transport.close()
        raise NotSupported(f"{one.link.port}: does not take parity {one.link.parity}, it has {parity}")
    found: list[Found] = []
    lost: NotConnected | None = None
    stayed = 0
    try:
        for unit in one.units:
            tell(unit)
            try:
                if not transport.connected:
                    await transport.connect()
                answer = await _ask(transport, one.link, unit, patience, function)
                stayed += 1
            except NotConnected as error:
                if one.link.transport != "tcp":
                    raise
                lost = error
                continue
            if answer is not None:
                found.append(answer)
    finally:
        await transport.close()
    if lost is not None and not stayed:
        raise lost
    return found


async def _ask(transport: Transport, link: Link, unit: int, patience: float, function: int) -> Found | None:
    """What the unit says, or over TCP what came in its place; None when it is silent, or when only noise came."""
    try:
        words = await transport.read(unit, Block(ADDRESS, 1, function), patience)
    except DeviceException as error:
        return Found(link, unit, str(error), error.code not in GATEWAY)
    except NoAnswer as error:
        return Found(link, unit, error.instead, False, False) if error.instead else None
    except BadAnswer as error:  # on a serial line the wrong settings make one
        return Found(link, unit, f"unit {unit}: {error}", False, False) if link.transport == "tcp" else None
    return Found(link, unit, f"{ADDRESS:#06x} = {words[0] if function in BITS else f'{words[0]:#06x}'}")


async def read_once(link: Link, unit: int, block: Block, patience: float = 1.0) -> list[int]:
    """One raw read.

    Raises:
        LinkError: as the transport.
    """
    transport = transport_of(link)
    await transport.connect()
    try:
        return await transport.read(unit, block, patience)
    finally:
        await transport.close()
