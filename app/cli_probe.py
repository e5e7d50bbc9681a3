"""pogon probe and pogon inject: the first look at a real drive, and the instructor's hand on a simulated one.

Exit codes: 0 something answered or was done · 1 nothing answered, or the device refused · 2 it was not tried: what was asked makes no
sense, the port is not there or belongs to another program, or the device is real.
"""

import asyncio
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from app.addresses import host_and_port
from app.errors import ConfigurationError, LinkError, NotConnected
from app.plant.definitions import Link
from app.registers.line_faults import LINE_FAULTS, SLOW_DELAY
from app.registers.pdu import BITS, FUNCTIONS, MAX_READ, MAX_READ_BITS, most_read

if TYPE_CHECKING:
    from app.links.contract import Block
    from app.links.inject import Injection
    from app.links.probe import Found, Try
    from app.plant.definitions import Equipment, Plant

UNITS, UNITS_OVER_TCP = range(1, 248), range(256)
"""On a serial line, and over TCP, where a device without units behind it may be 0 or 255."""
AUTO = "auto"


def probe(
    port: Annotated[str, typer.Option(metavar="DEVICE", help="Serial device, such as /dev/ttyUSB0.")] = "",
    tcp: Annotated[str, typer.Option(metavar="HOST:PORT", help="Modbus TCP instead of a serial line.")] = "",
    baud: Annotated[str, typer.Option(help="Baud rate, or auto: the usual ones, 9600 first.")] = AUTO,
    parity: Annotated[str, typer.Option(help="even, none, odd, or auto (8E1, 8N2, 8N1, 8O1).")] = AUTO,
    unit: Annotated[str, typer.Option(help="Unit or units: 1, 1-10, 1,5,7-9.")] = "1-10",
    read: Annotated[str, typer.Option(metavar="ADDRESS", help="Then read from this register (0x1000, 4096).")] = "",
    count: Annotated[
        int, typer.Option(min=1, max=MAX_READ_BITS, help=f"Registers, or bits, to read; {MAX_READ} registers at most.")
    ] = 1,
    function: Annotated[
        int, typer.Option(help="3 holding registers, 4 input registers, 1 coils, 2 discrete inputs.")
    ] = 3,
    patience: Annotated[int, typer.Option(min=10, max=10000, help="Time a device is given to answer, in ms.")] = 150,
) -> None:
    """Find out what answers on a line, and read some registers raw. Never writes anything."""
    from app.links.contract import Block

    try:
        if bool(port) == bool(tcp):
            raise ConfigurationError("give --port DEVICE, or --tcp HOST:PORT")
        if function not in FUNCTIONS.values():
            raise ConfigurationError(f"--function {function}: expected 1, 2, 3 or 4")
        if count > most_read(function):
            raise ConfigurationError(f"--count {count}: expected 1 to {most_read(function)} registers")
        units = _units(unit, UNITS_OVER_TCP if tcp else UNITS)
        address = _address(read, count) if read else -1
        asyncio.run(
            _probe(
                _tries(port, tcp, baud, parity, units),
                Block(max(address, 0), count, function),
                address >= 0,
                patience / 1000,
            )
        )
    except (ConfigurationError, NotConnected) as error:
        _fail(error, 2)
    except LinkError as error:
        _fail(error, 1)


def inject(
    equipment: Annotated[str, typer.Argument(metavar="EQUIPMENT", help="Machine of the plant file, such as m1.")],
    fault: Annotated[
        str,
        typer.Argument(
            metavar="FAULT",
            help=f"A machine fault by its name or code (OC, 0x04, jam_1), {', '.join(LINE_FAULTS)}, or clear.",
        ),
    ],
    tcp: Annotated[str, typer.Option(metavar="HOST:PORT", help="Where the simulated plant answers Modbus TCP.")] = "",
    plant: Annotated[Path | None, typer.Option(help="Plant folder; else POGON_PLANT.")] = None,
    delay: Annotated[int, typer.Option(min=0, max=60000, help="Of a slow answer, in ms.")] = SLOW_DELAY,
    code: Annotated[int, typer.Option(min=1, max=255, help="Of the exception.")] = 4,
    count: Annotated[int, typer.Option(min=0, max=65535, help="Telegrams that a line fault hits; 0: until clear.")] = 0,
) -> None:
    """Break a simulated machine, or its line, over its own Modbus port. A real device is never written to."""
    from app.links.inject import injection
    from app.settings import read_settings

    try:
        settings = read_settings()
        folder = plant or settings.plant
        item, link = _machine(folder, equipment)
        where = tcp or (settings.serve_modbus if link.transport == "memory" else "")
        if where:
            host, number = _host(where, "--tcp" if tcp else "POGON_SERVE_MODBUS")
            link = replace(link, transport="tcp", host=host, tcp_port=number)
        elif link.transport == "memory":
            raise ConfigurationError(
                f"{equipment} is simulated inside the server: start that with --serve-modbus HOST:PORT (or POGON_SERVE_MODBUS), "
                "and give --tcp HOST:PORT"
            )
        what = injection(fault, item.type.training.faults, delay=delay, code=code, count=count)
        asyncio.run(_inject(link, item.unit, what))
    except (ConfigurationError, NotConnected, ValueError) as error:
        _fail(error, 2)
    except LinkError as error:
        _fail(error, 1)
    typer.echo(f"{equipment}: {fault}")


async def _inject(link: Link, unit: int, what: "Injection") -> None:
    from app.links.inject import inject
    from app.links.probe import transport_of

    transport = transport_of(link)
    await transport.connect()
    try:
        await inject(transport, unit, what)
    finally:
        await transport.close()


async def _probe(tries: "Sequence[Try]", block: "Block", read: bool, patience: float) -> None:
    from app.links.probe import probe, settings_of
    from app.links.serial_port import NotSupported

    found: list[Found] = []
    others = ""
    impossible: list[NotSupported] = []
    for number, one in enumerate(tries, 1):

        def tell(unit: int, one: "Try" = one, number: int = number) -> None:
            _progress(f"{number}/{len(tries)} {one} unit {unit}")

        try:
            answers = await probe(one, tell, patience, block.function)
            found = [answer for answer in answers if answer.there]
            others = next((f"; {_other(each)}" for each in answers if not each.there), "")
        except NotSupported as error:
            impossible.append(error)
            continue
        if found:
            break
    _progress("")
    if len(impossible) == len(tries):
        raise impossible[0]
    for answer in found:
        typer.echo(f"{settings_of(answer.link)} unit {answer.unit} answers: {answer.answer}")
    if not found:
        tried = f"{len(tries)} settings, " if len(tries) > 1 else ""
        raise LinkError(
            f"nothing answers ({tried}units {tries[0].units[0]} to {tries[0].units[-1]}). Is it switched on, set to Modbus RTU, "
            "A and B not swapped, the unit another one?"
            if tries[0].link.transport == "rtu"
            else f"nothing answers at {tries[0]}, units {tries[0].units[0]} to {tries[0].units[-1]}{others}"
        )
    refused = False
    if read:
        for answer in found:
            refused = not await _show(answer, block) or refused
    if refused:
        raise typer.Exit(1)


def _other(found: "Found") -> str:
    """What came in place of an answer."""
    return f"a gateway is there: {found.answer}" if found.sense else found.answer


async def _show(found: "Found", block: "Block") -> bool:
    """Print the words of `block`, hexadecimal and decimal, or its bits; False when they were refused, or did not come."""
    from app.links.probe import read_once

    try:
        words = await read_once(found.link, found.unit, block)
    except LinkError as error:
        typer.echo(f"unit {found.unit} {block.address:#06x}: {error}")
        return False
    for at, word in enumerate(words, block.address):
        if block.function in BITS:
            typer.echo(f"unit {found.unit} {at:#06x}  {word}")
            continue
        signed = f"  {word - 0x10000}" if word >= 0x8000 else ""
        typer.echo(f"unit {found.unit} {at:#06x}  {word:#06x}  {word:5d}{signed}")
    return True


def _tries(port: str, tcp: str, baud: str, parity: str, units: Sequence[int]) -> "list[Try]":
    from app.links import probe as probing

    if tcp:
        host, number = _host(tcp, "--tcp")
        return [probing.Try(Link("probe", "tcp", host=host, tcp_port=number), units)]
    bauds: Sequence[int] = probing.BAUDS
    if baud != AUTO:
        if not baud.isdecimal() or not 50 <= int(baud) <= 4_000_000:
            raise ConfigurationError(f"--baud {baud}: expected a rate such as 9600, or auto")
        bauds = (int(baud),)
    parities: Sequence[tuple[str, int]] = probing.PARITIES
    if parity != AUTO:
        parities = [pair for pair in probing.PARITIES if pair[0] == parity]
        if not parities:
            raise ConfigurationError(f"--parity {parity}: expected even, none, odd or auto")
    return list(probing.tries(Link("probe", "rtu", port=port), bauds, parities, units))


def _units(text: str, known: range) -> list[int]:
    low, high = known[0], known[-1]
    found: list[int] = []
    for part in text.split(","):
        first, _, last = part.strip().partition("-")
        if (
            not first.isdecimal()
            or not (last or first).isdecimal()
            or not low <= int(first) <= int(last or first) <= high
        ):
            raise ConfigurationError(f"--unit {text}: expected units from {low} to {high}, such as 1, 1-10 or 1,5,7-9")
        found += range(int(first), int(last or first) + 1)
    return list(dict.fromkeys(found))


def _address(text: str, count: int) -> int:
    try:
        address = int(text, 0)
    except ValueError:
        address = -1
    if not 0 <= address <= 0x10000 - count:
        raise ConfigurationError(f"--read {text}: expected a register from 0 to {0x10000 - count:#06x}, such as 0x1000")
    return address


def _host(text: str, name: str) -> tuple[str, int]:
    try:
        host, port = host_and_port(text)
    except ConfigurationError as error:
        raise ConfigurationError(f"{name} {text}: {error}") from error
    if port == 0:
        raise ConfigurationError(f"{name} {text}: expected the port that is really open, not 0")
    return host, port


def _machine(folder: Path, name: str) -> "tuple[Equipment, Link]":
    from app.plant.loader import read_plant

    plant: Plant | None
    plant, problems = read_plant(folder)
    if plant is None:
        raise ConfigurationError("\n".join(map(str, problems)))
    item = plant.equipment.get(name)
    if item is None:
        raise ConfigurationError(f"{folder}: no equipment {name}, expected one of {', '.join(plant.equipment)}")
    return item, plant.links[item.link]


def _progress(text: str) -> None:
    """One line that is written over, where somebody watches."""
    if sys.stderr.isatty():
        sys.stderr.write(f"\r\x1b[K{text}")
        sys.stderr.flush()


def _fail(error: Exception, code: int) -> NoReturn:
    _progress("")
    for line in str(error).splitlines():
        typer.echo(f"pogon: {line}", err=True)
    raise typer.Exit(code) from error
