"""`[links.<name>]`: by which line machines are reached."""

import ipaddress
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress

from app.addresses import as_written, names_host
from app.plant.definitions import Link
from app.plant.plant_files.languages import PlantLanguages
from app.plant.plant_files.names import check_id
from app.plant.said import said
from app.plant.tables import Table, one_of
from app.plant.type_files.device import check_periods

BAUD = (1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200)
PARITY = ("none", "even", "odd")


def read_link(key: str, table: Table, transports: Sequence[str], languages: PlantLanguages) -> Link:
    """One link; of `transports` it has one."""
    check_id(key, table)
    transport = table.text("transport", choices=transports)
    serial, network = transport == "rtu", transport == "tcp"
    if network:
        port: str = ""
        tcp_port = table.whole("port", 502, 1, 65535)
    else:
        tcp_port = 502
        port = table.text("port", *([] if serial else [""]), expected=said("mistake.serial_device"))
    baud = table.raw("baud", 9600)
    if not isinstance(baud, int) or baud not in BAUD:
        table.note("baud", baud, one_of([str(one) for one in BAUD]))
        baud = 9600
    parity = table.text("parity", "even", choices=PARITY)
    writes = table.flag("writes")
    link = Link(
        name=key,
        transport=transport,
        host=_read_host(table, needed=network),
        tcp_port=tcp_port,
        port=port,
        baud=baud,
        parity=parity,
        stop_bits=table.whole("stop_bits", 2 if parity == "none" else 1, 1, 2),
        writes=writes if table.has("writes") else None,
        believe_simulated=table.flag("simulated"),
        fast=table.number("fast", None, 0.01, 3600),
        slow=table.number("slow", None, 0.01, 3600),
        timeout=table.number("timeout", None, 0.01, 60),
        label=languages.label(table, "label", default=key),
    )
    check_periods(table)
    table.done()
    return link


def read_links(root: Table, transports: Sequence[str], languages: PlantLanguages) -> dict[str, Link]:
    """Every link; a serial device is of one alone."""
    links: dict[str, Link] = {}
    serial: dict[str, str] = {}
    for key, table in root.tables("links"):
        link = links[key] = read_link(key, table, transports, languages)
        if link.transport == "rtu" and link.port and (other := serial.setdefault(line_of(link), key)) != key:
            table.note("port", link.port, said("mistake.serial_taken", other=other))
    return links


def line_of(link: Link) -> str:
    """What `link` reaches its units by, as far as its words say: two links with the same reach the same units."""
    if link.transport == "tcp":
        host = link.host.lower().rstrip(".")
        with suppress(ValueError):
            host = str(ipaddress.ip_address(host))
        return as_written("127.0.0.1" if host == "localhost" else host, link.tcp_port)
    return os.path.normpath(link.port) if link.transport == "rtu" else f"link {link.name}"


def same_devices(links: Mapping[str, Link]) -> Iterator[tuple[Link, Link]]:
    """Pairs of links whose ports are two names of one serial device on this machine, as it is plugged in now.

    Such as /dev/ttyUSB0 and its lasting name under /dev/serial/by-id. Only one of them gets it.
    """
    found: dict[str, Link] = {}
    for link in links.values():
        if link.transport == "rtu":
            other = found.setdefault(os.path.realpath(link.port), link)
            if other is not link:
                yield link, other


def _read_host(table: Table, *, needed: bool) -> str:
    """What a look-up of addresses may be asked; a port, brackets or http:// do not belong to it."""
    expected = said("mistake.host_name")
    host = table.text("host", *([] if needed else [""]), expected=expected)
    if host and not names_host(host):
        table.note("host", host, expected)
    return host
