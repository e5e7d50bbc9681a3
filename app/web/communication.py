"""The Communication page: how every link is doing, what its line can carry, and raw words beside scaled values.

Numbers are tags and kept true by the socket. What is a list (exceptions by name, warnings, words) are fragments that the page fetches
again every few seconds. The page is of level 4: operators, engineers and administrators (app/access/roles.py, `diagnose`).
"""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import Any
from urllib.parse import urlencode

from fastapi import APIRouter, Request
from fastapi.responses import Response
from starlette.exceptions import HTTPException

from app.addresses import as_written
from app.errors import Refused
from app.links import bus_load
from app.links.register_link import RegisterLink
from app.links.scan_block import ScanBlock, words_of
from app.links.statistics import ERROR_KINDS, LinkState
from app.plant.definitions import Equipment, Link, Point, Scan
from app.registers.references import reference
from app.registers.register import BIT_TABLES
from app.web import format as fmt
from app.web.guard import allow
from app.web.language import language_of
from app.web.pages import plant_of, view_of
from app.web.points import EquipmentView, PointView, plant_text, point_view
from app.web.view import View

router = APIRouter()

MOST_REGISTERS = 10_000
"""Most registers whose load on the bus is asked for."""
DEFAULT_REGISTERS = 25
GROUPS: Sequence[tuple[str, Sequence[str]]] = (
    ("communication.pace", ("polls", "scan_time", "bus_share", "connections")),
    ("communication.trouble", ("timeouts", "exceptions", "retries", "late_scans", "damaged", "late_answers", "torn")),
)
"""Heading → counters of a link (links/statistics.py)."""
SERIAL_ONLY = ("damaged", "late_answers")


@dataclass(frozen=True)
class LinkView:
    """A link for templates."""

    link: Link
    label: str
    where: str
    """Transport and address: `/dev/ttyUSB0 · 9600 8E1`."""
    simulated: bool
    state: PointView
    last_error: PointView
    groups: Sequence[tuple[str, Sequence[PointView]]]
    asked: str
    """Period of the fast blocks as the plan asks for it."""
    limit: str
    """Arithmetic limit of a serial line for its longest fast block; empty elsewhere."""
    units: Sequence["UnitView"] = ()


@dataclass(frozen=True)
class UnitView:
    """A unit of a link for templates."""

    number: int
    machines: Sequence[EquipmentView]
    state: PointView
    counters: Sequence[PointView]
    open: str
    """Address that opens or closes its words."""
    is_open: bool


@dataclass(frozen=True, slots=True)
class WordRow:
    """A point with the words that it came from."""

    label: str
    name: str
    address: str
    """0-based [hex]."""
    reference: str
    """The number of older manuals: 44097."""
    words: str
    view: PointView
    age: str
    block: str


@router.get("/communication", dependencies=[allow("diagnose")])
async def communication(request: Request) -> Response:
    """All links; `?open=<link>.<unit>` shows the words of a unit."""
    plant_of(request)
    view = view_of(request)
    opened = request.query_params.get("open", "")
    links = [await _link_view(request, link, opened) for link in plant_of(request).links.values()]
    link_name, _, unit = opened.rpartition(".")
    rows = _word_rows(request, link_name, _number(unit)) if link_name else []
    chosen = request.query_params.get("link", "")
    runtime = view.runtime(request)
    details = {name: _details(request, link) for name, link in runtime.links.items()}
    bus_loads = {
        name: _bus_load(
            request,
            link,
            _number(request.query_params.get("unit", "")) if name == chosen else min(link.stations, default=0),
            _number(request.query_params.get("registers", ""), DEFAULT_REGISTERS)
            if name == chosen
            else DEFAULT_REGISTERS,
        )
        for name, link in runtime.links.items()
    }
    return view.page(
        request,
        "pages/communication.html",
        title=view.text(request, "nav.communication"),
        kind="communication",
        links=links,
        details=details,
        bus_loads=bus_loads,
        opened=opened,
        rows=rows,
    )


@router.get("/communication/{name}/details", dependencies=[allow("diagnose")])
async def details(request: Request, name: str) -> Response:
    """Warnings, the last error and the exceptions by name, as a fragment."""
    return view_of(request).fragment(
        request, "fragments/communication_details.html", detail=_details(request, _link(request, name))
    )


@router.get("/communication/{name}/forecast", dependencies=[allow("diagnose")])
async def bus_load_of(request: Request, name: str) -> Response:
    """What `registers` more of `unit` would cost, as a fragment."""
    query = request.query_params
    found = _bus_load(
        request,
        _link(request, name),
        _number(query.get("unit", "")),
        _number(query.get("registers", ""), DEFAULT_REGISTERS),
    )
    return view_of(request).fragment(request, "fragments/communication_bus_load.html", bus_load=found)


@router.get("/communication/{name}/{unit}/words", dependencies=[allow("diagnose")])
async def words(request: Request, name: str, unit: int) -> Response:
    """Raw words beside scaled values of a unit, as a fragment."""
    _link(request, name)
    return view_of(request).fragment(
        request, "fragments/communication_words.html", rows=_word_rows(request, name, unit)
    )


def _link(request: Request, name: str) -> RegisterLink:
    plant_of(request)
    link = view_of(request).runtime(request).links.get(name)
    if link is None:
        raise HTTPException(404)
    return link


def _number(text: str, default: int = 0) -> int:
    """
    Raises:
        Refused: 422, not a whole number from 0 up to what the page takes.
    """
    if not text:
        return default
    if not text.isascii() or not text.isdecimal() or len(text) > 6 or int(text) > MOST_REGISTERS:
        raise Refused("communication.registers_wrong", 422, most=MOST_REGISTERS)
    return int(text)


async def _link_view(request: Request, link: Link, opened: str) -> LinkView:
    view, plant = view_of(request), plant_of(request)
    lang = language_of(request)
    running = view.runtime(request).links.get(link.name)
    serial = link.transport == "rtu"
    machines = [item for item in plant.equipment.values() if item.link == link.name]
    load = bus_load.load(link, _reads(running)) if running else None
    units = []
    for unit in sorted({item.unit for item in machines}):
        units.append(_unit_view(request, link, unit, [item for item in machines if item.unit == unit], opened))
        await asyncio.sleep(0)
    longest = max((n for reads in _reads(running) for n, _ in reads.fast), default=0) if running else 0
    return LinkView(
        link=link,
        label=plant_text(link.label, lang, plant) or link.name,
        where=_where(link),
        simulated=bool(running and running.simulated),
        state=_counter(request, link, "state", _states(request)),
        last_error=_counter(request, link, "last_error", _errors(request)),
        groups=[
            (heading, [_counter(request, link, key) for key in keys if serial or key not in SERIAL_ONLY])
            for heading, keys in GROUPS
        ],
        asked=_milliseconds(load.asked, lang) if load else "",
        limit=fmt.number(bus_load.arithmetic_limit(link, longest), 1, lang) if serial and longest else "",
        units=units,
    )


def _unit_view(request: Request, link: Link, unit: int, machines: Sequence[Equipment], opened: str) -> UnitView:
    key = f"{link.name}.{unit}"
    return UnitView(
        unit,
        [view_of(request).machine(request, item) for item in machines],
        _counter(request, link, f"unit{unit}.state", _states(request)),
        [_counter(request, link, f"unit{unit}.{name}") for name in ("answer_time", "timeouts", "exceptions")],
        "/communication" if opened == key else f"/communication?{urlencode({'open': key})}#words",
        opened == key,
    )


def _counter(request: Request, link: Link, key: str, texts: dict[str, str] | None = None) -> PointView:
    """A tag of the link as it stands; one that is not there is drawn without a value."""
    view = view_of(request)
    runtime, name = view.runtime(request), f"sys.link.{link.name}.{key}"
    point = getattr(runtime, "points", {}).get(name) or Point(name, name, "sys", key, "", unit="")
    label = view.text(request, "sys.link." + key.rpartition(".")[2])
    if texts:
        point = replace(point, texts={int(value): text for value, text in texts.items()})
    return point_view(point, runtime, language_of(request), _text(request, view), label=label, texts=texts)


def _text(request: Request, view: View) -> fmt.Text:
    return lambda key, **params: view.text(request, key, **params)


def _states(request: Request) -> dict[str, str]:
    view = view_of(request)
    return {str(int(state)): view.text(request, f"communication.state.{state.name.lower()}") for state in LinkState}


def _errors(request: Request) -> dict[str, str]:
    view = view_of(request)
    return {str(number): view.text(request, f"link.error.{kind or 'none'}") for number, kind in enumerate(ERROR_KINDS)}


def _where(link: Link) -> str:
    if link.transport == "rtu":
        return f"{link.port} · {link.baud} 8{link.parity[0].upper()}{link.stop_bits}"
    return as_written(link.host, link.tcp_port) if link.transport == "tcp" else ""


def _reads(link: RegisterLink | None) -> list[bus_load.Reads]:
    if link is None:
        return []
    return [bus_load.reads_of(station, link.statistics.units[number]) for number, station in link.stations.items()]


def _milliseconds(seconds: float, lang: str) -> str:
    return fmt.quantity(1000 * seconds, 0 if seconds >= 0.1 else 1, "ms", lang) if seconds < inf else "–"


def _details(request: Request, link: RegisterLink) -> dict[str, Any]:
    """Warnings, the last error in words, exceptions by name."""
    view, lang = view_of(request), language_of(request)
    load, statistics = bus_load.load(link.link, _reads(link)), link.statistics
    numbers = {
        "asked": _milliseconds(load.asked, lang),
        "cycle": _milliseconds(load.cycle, lang),
        "share": fmt.percent(100 * load.share, 0, lang),
    }
    warnings = []
    if load.too_short:
        warnings.append(view.text(request, "communication.too_fast", **numbers))
    elif load.full:
        warnings.append(view.text(request, "communication.nearly_full", **numbers))
    warnings += _hearing(request, link)
    kind = statistics.last_error
    return {
        "name": link.name,
        "warnings": warnings,
        "share": numbers["share"],
        "cycle": numbers["cycle"],
        "error": view.text(request, f"link.error.{kind}") if kind else "",
        "sentence": statistics.last_error_text if kind else "",
        "exceptions": [
            (number, _exception(request, code), count)
            for number, unit in sorted(statistics.units.items())
            for code, count in sorted(unit.by_code.items())
        ],
    }


def _hearing(request: Request, link: RegisterLink) -> list[str]:
    """What is likely wrong with a serial line on which nothing is understood."""
    wire, line, text = link.statistics.wire, link.link, view_of(request).text
    parity = text(request, f"communication.parity.{line.parity}")
    settings = {"baud": line.baud, "parity": parity, "stop": line.stop_bits}
    if link.up:
        return []
    if wire.parity or wire.framing:
        return [text(request, "communication.port_errors", faults=wire.parity, framing=wire.framing, **settings)]
    return [text(request, "communication.strange", **settings)] if wire.strange else []


def _exception(request: Request, code: int) -> str:
    return f"{code:02d} {view_of(request).text(request, fmt.exception_key(code))}"


def _bus_load(request: Request, link: RegisterLink, unit: int, registers: int) -> dict[str, Any]:
    """What more registers would cost; of the first unit when `unit` is none of the link's."""
    view, lang = view_of(request), language_of(request)
    reads = _reads(link)
    chosen = next((one for one in reads if one.unit == unit), reads[0] if reads else None)
    found: dict[str, Any] = {
        "name": link.name,
        "unit": chosen.unit if chosen else 0,
        "units": [one.unit for one in reads],
        "registers": registers,
        "most": MOST_REGISTERS,
        "text": "",
        "warning": "",
    }
    if chosen is None:
        return found
    more = bus_load.cost(link.link, chosen, registers)
    after = bus_load.with_more(link.link, reads, chosen.unit, registers)
    found["text"] = view.text(
        request,
        "communication.cost",
        n=registers,
        cost=fmt.quantity(1000 * more, 1, "ms", lang),
        cycle=_milliseconds(after.cycle, lang),
        share=fmt.percent(100 * after.share, 0, lang),
    )
    if after.too_short:
        found["warning"] = view.text(
            request,
            "communication.too_fast",
            asked=_milliseconds(after.asked, lang),
            cycle=_milliseconds(after.cycle, lang),
            share=fmt.percent(100 * after.share, 0, lang),
        )
    return found


def _word_rows(request: Request, name: str, unit: int) -> list[WordRow]:
    link = view_of(request).runtime(request).links.get(name)
    station = link.stations.get(unit) if link else None
    if station is None:
        return []
    machines = {item.id: view_of(request).machine(request, item) for item in station.equipment}
    blocks = sorted(station.blocks, key=lambda block: (block.block.function, block.block.address))
    return [
        _word_row(request, machines[point.equipment], block, point)
        for block in blocks
        for point in sorted(block.points, key=lambda point: point.register.address if point.register else 0)
    ]


def _word_row(request: Request, machine: EquipmentView, block: ScanBlock, point: Point) -> WordRow:
    register, lang = point.register, language_of(request)
    assert register is not None
    raw, drawn = words_of(block, point), machine.point(point.key)
    form = "d" if register.table in BIT_TABLES else "04X"
    period = "" if block.scan in (Scan.ONCE, Scan.PAGE) else f" · {_milliseconds(block.period, lang)}"
    scan = view_of(request).text(request, f"communication.scan.{block.scan.value}")
    return WordRow(
        label=drawn.label,
        name=point.name,
        address=fmt.hexadecimal(register.address),
        reference=reference(register.address, register.table),
        words=" ".join(f"{word:{form}}" for word in raw) if raw is not None else fmt.NO_VALUE,
        view=drawn,
        age=fmt.age(drawn.age) if drawn.state != "none" else "–",
        block=f"{fmt.hexadecimal(block.block.address)} + {block.block.count} · {scan}{period}",
    )
