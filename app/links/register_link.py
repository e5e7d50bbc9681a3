"""The register link: the points of some machines, kept true over one connection to their registers, and the way for writes.

By itself it only reads. What is written comes from the command gate (`write`), the instructor or the probe (`raw_write`), and goes to a
device only when the plant file says `writes = true`; without a word of it, to what is simulated in this process.
"""

import asyncio
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import count
from typing import cast

from app.clock import Clock
from app.errors import BadAnswer, ConfigurationError, LinkError, NoAnswer, Refused
from app.links.contract import Block, Exchange, Transport
from app.links.host_event import EventTaker
from app.links.machines import Machines, by_unit, wiring
from app.links.mailbox import MailboxUnit
from app.links.plc import TORN_TRIES, PlcUnit
from app.links.register_parameters import RegisterParameters
from app.links.runner import LinkRunner
from app.links.scan_block import ScanBlock
from app.links.schedule import Priority
from app.links.station import Station
from app.links.statistics import LinkState, LinkStatistics
from app.links.statistics import statistic_names as statistic_names
from app.links.transports import TRANSPORTS
from app.links.writes import Writes
from app.plant.definitions import Equipment, Link
from app.registers.pdu import WRITE_MULTIPLE, WRITE_SINGLE
from app.registers.plc_map import Answer, Request
from app.tags.database import TagDatabase

UNITS = range(1, 248)


class RegisterLink:
    """One link of the plant. `run` keeps it alive; everything else may be called at any time, also while it is down."""

    def __init__(
        self,
        link: Link,
        equipment: Sequence[Equipment],
        tags: TagDatabase,
        clock: Clock,
        *,
        exchange: Exchange | None = None,
        paused: Callable[[], bool] = lambda: False,
    ) -> None:
        """`equipment`: the machines on this link; `exchange`: the simulated line of a memory link; `paused`: whether that is paused now.

        Raises:
            ConfigurationError: an unknown transport, a memory link without line, a unit outside 1 to 247 (255 over TCP).
        """
        if link.transport not in TRANSPORTS:
            raise ConfigurationError(
                f"links.{link.name}.transport = {link.transport}: expected one of {', '.join(TRANSPORTS)}"
            )
        transport = TRANSPORTS[link.transport]
        transport(link, exchange)  # a link that cannot be built fails here and not in its task
        for item in equipment:
            if item.unit not in UNITS and not (link.transport == "tcp" and item.unit in (0, 255)):
                raise ConfigurationError(f"{item.id}.unit = {item.unit}: expected 1 to 247")
        self.link = link
        self.name = link.name
        self._machines = Machines(link.name, equipment)
        self._demands: dict[object, frozenset[str]] = {}
        self._numbers = count()
        stations = {unit: self._station(unit, items) for unit, items in by_unit(equipment).items()}
        self._runner = LinkRunner(
            link, stations, tags, clock, lambda: cast(Transport, transport(link, exchange)), _lanes(link, equipment)
        )
        self._runner.paused = paused
        self._writes = Writes(self._runner, self._machines)

    @property
    def statistics(self) -> LinkStatistics:
        """How the link is doing."""
        return self._runner.statistics

    @property
    def simulated(self) -> bool:
        """Whether nothing real is behind the link: it is in this process, or the plant file lets its devices say so and all do."""
        return self._runner.statistics.simulated

    @property
    def paused(self) -> bool:
        """Whether the simulation behind the link is paused: its devices answer, and nothing moves."""
        return self._runner.paused()

    @property
    def up(self) -> bool:
        """Whether anybody behind the link answers."""
        return self.statistics.state in (LinkState.UP, LinkState.SOME_SILENT)

    @property
    def stations(self) -> Mapping[int, Station]:
        """The units, for pages that show how they are read."""
        return self._runner.stations

    @property
    def events(self) -> EventTaker:
        """Who takes the events of its Pogon PLCs."""
        return self._runner.events

    def only_here(self, equipment: str) -> int:
        """Events of a machine that are stored nowhere and that its ring has overwritten."""
        item = self._machines.get(equipment)
        plc = self._runner.stations[item.unit].service(PlcUnit) if item is not None else None
        return plc.events.only_here if plc is not None else 0

    def halted(self, equipment: str) -> bool:
        """Whether the program behind a machine stands still while its unit answers; of several on a unit the first one tells."""
        station = self._told_by(equipment)
        return station is not None and station.state is LinkState.UP and station.halted

    def restarts(self, equipment: str) -> bool:
        """Whether its PLC shows one restart after the other; of several on a unit the first one tells."""
        station = self._told_by(equipment)
        plc = station.service(PlcUnit) if station is not None else None
        return plc is not None and plc.clock.restarts.endless(self._runner.clock.monotonic())

    async def run(self) -> None:
        """Connect, scan, publish, back off, for ever."""
        await self._runner.run()

    def fits(self, equipment: Sequence[Equipment]) -> bool:
        """Whether `renew` could take these machines; else the link is to be built anew."""
        return _lanes(self.link, equipment) == _lanes(self.link, self._machines.all)

    def prepare(self, equipment: Sequence[Equipment]) -> dict[int, Station]:
        """What reads these machines, by unit, for `renew`. A unit whose registers stay as they are keeps what reads it.

        Nothing of what runs is touched: this may be done in a thread. Their units were checked by the plant file.
        """
        stations: dict[int, Station] = {}
        for unit, items in by_unit(equipment).items():
            before = self._runner.stations.get(unit)
            stays = before is not None and wiring(before.equipment) == wiring(items)
            stations[unit] = before if before is not None and stays else self._station(unit, items)
        return stations

    def renew(self, equipment: Sequence[Equipment], stations: Mapping[int, Station] | None = None) -> None:
        """Read these machines from now on, by the `stations` that `prepare` made for them; those that stay are read on without a pause.

        Call it after the tag database was configured for them.
        """
        stations = self.prepare(equipment) if stations is None else stations
        for unit, items in by_unit(equipment).items():
            stations[unit].equipment = items
        self._machines.take(equipment)
        self._runner.change(stations)

    async def write(self, equipment: str, point: str, value: float, *, urgent: bool = False) -> int:
        """Write `value` [EU] to the point with key `point`; returns when the device has echoed it (accepted, not confirmed).

        Never repeated here. `urgent` (Stop) goes before everything, is also tried on a silent unit, and takes writes to the same
        unit that still wait out of the queue. A setpoint of a Pogon PLC is put into the set that is in effect
        there, and the device takes the set as a whole; this returns when it has, the id by which it knows that (else 0).

        Raises:
            Rejected: the device took none of the set, with its own reason.
            Refused: `command.writes_off`: the plant file does not allow writes.
            LinkError: it was not accepted, or nobody knows (NoAnswer).
        """
        return await self._writes.write(equipment, point, value, urgent=urgent)

    def together(self, equipment: str, points: Sequence[str]) -> list[list[str]]:
        """`points` (keys) in the groups that the device takes all or none, in the order of their first; a register by itself is one.

        Raises:
            LinkError: no such machine or point.
        """
        return self._writes.together(equipment, points)

    async def write_set(self, equipment: str, values: Mapping[str, float]) -> int:
        """Have the device take the points of one group of `together` at once; otherwise as `write`, and returns the same.

        Raises:
            Rejected: the device took none of them, with its own reason.
            Refused, LinkError: as `write`.
        """
        return await self._writes.write_set(equipment, values)

    async def order(
        self,
        equipment: str,
        code: int,
        arguments: Sequence[int] = (),
        *,
        expected: int = 0,
        owner: int = 0,
        request: int = 0,
        urgent: bool = False,
    ) -> Answer:
        """Send command `code` of a Pogon PLC, once; returns its first word about it, which may be REJECTED.

        `arguments`: raw 32-bit words (`plc_map.real`); `expected`: state that the person saw, 0 = any; `request`: id, 0 = the next
        one. When the echo is lost the answers of the device tell whether it arrived. `urgent` as in `write`.

        Raises:
            Refused: `command.writes_off`: the plant file does not allow writes.
            LinkError: it did not arrive, or nobody knows (NoAnswer). It is never sent again by itself.
        """
        station, plc = self._plc_of(equipment)
        self._writes.check(station, urgent=urgent)
        return await plc.orders.order(Request(code, owner, expected, tuple(arguments), request), urgent=urgent)

    async def answer(self, equipment: str, id: int) -> Answer | None:
        """What the device says now about its command `id`; None when it does not know it, or no longer.

        Raises:
            LinkError: it could not be asked.
        """
        station, plc = self._plc_of(equipment)
        if station.state is LinkState.CONFIGURATION:
            raise LinkError(f"link {self.name}: unit {station.number} is not the device of the plant file")
        return await plc.orders.answer(id)

    async def hold(
        self, equipment: str, bits: int, counter: int, argument: float = 0.0, *, urgent: bool = False
    ) -> None:
        """Ask for hold-to-run: request bits, a counter that must rise at least every 500 ms, an argument; bits 0 release it.

        Raises:
            Refused: `command.writes_off`: the plant file does not allow writes.
            LinkError: it was not accepted, or nobody knows (NoAnswer).
        """
        station, plc = self._plc_of(equipment)
        self._writes.check(station, urgent=urgent or not bits)
        await plc.orders.hold(bits, counter, argument, urgent=urgent)

    def parameters(self, equipment: str) -> MailboxUnit | RegisterParameters:
        """The parameters of a drive: the one queue to its mailbox, or its registers. Changes come from the command gate.

        Raises:
            LinkError: no such machine, or it has no such parameters.
        """
        item = self._machines.named(equipment)
        station = self._runner.stations[item.unit]
        unit = station.service(MailboxUnit) or station.service(RegisterParameters)
        if unit is None:
            raise LinkError(f"{equipment} has no parameters: its type {item.type.name} is none with them")
        return unit

    async def refresh(self, equipment: str, points: Iterable[str]) -> None:
        """Read the blocks of these points (keys) now; they are published before it returns.

        Raises:
            LinkError: a block was not answered, or the device has no such register.
        """
        item = self._machines.named(equipment)
        names = {self._machines.point(item, key).name for key in points}
        station = self._runner.stations[item.unit]
        if station.state is LinkState.DOWN and self._runner.connected:
            raise NoAnswer(f"link {self.name}: unit {item.unit} is silent")
        blocks = station.covering(names)
        missing = names.difference(*(block.names for block in blocks))
        for service in station.services:
            blocks = service.worth_reading(blocks)
        if missing:
            raise LinkError(f"link {self.name}: {', '.join(sorted(missing))} cannot be read")
        results = await asyncio.gather(*(self._refresh(station, block) for block in blocks), return_exceptions=True)
        for result in results:
            if isinstance(result, BaseException):
                raise result

    async def raw_read(self, unit: int, address: int, count: int, function: int = 3) -> list[int]:
        """`count` words from `address` of any unit.

        Raises:
            LinkError: as the transport.
        """
        block = Block(address, count, function)
        job = self._runner.job(unit, block, liveness=not _is_training(self.stations.get(unit), address))
        return await self._runner.ask(job, Priority.REFRESH)

    async def raw_write(self, unit: int, address: int, words: Sequence[int]) -> None:
        """Write `words` from `address` of any unit, with function 06 for one word and 16 for more.

        Raises:
            Refused: `command.writes_off`: the plant file does not allow writes.
            LinkError: as the transport.
        """
        if not self.link.may_write:
            raise Refused("command.writes_off", link=self.name)
        function = WRITE_SINGLE if len(words) == 1 else WRITE_MULTIPLE
        await self._writes.send(
            unit, address, words, function, liveness=not _is_training(self.stations.get(unit), address)
        )
        self._runner.nudge(unit)

    def demand(self, who: object, points: Iterable[str]) -> None:
        """`who` (a page, a kind of page) shows these points (`equipment.point`) from now on; it replaces what it asked before."""
        self._demands[who] = frozenset(points)
        self._runner.demand(frozenset().union(*self._demands.values()))

    def release(self, who: object) -> None:
        """`who` is gone."""
        if self._demands.pop(who, None) is not None:
            self._runner.demand(frozenset().union(*self._demands.values()))

    def words(self, name: str) -> Sequence[int] | None:
        """Raw words of the point `name` (`equipment.point`) as last read; None while there are none."""
        item = self._machines.get(name.partition(".")[0])
        return self._runner.stations[item.unit].words(name) if item is not None else None

    # details

    def _station(self, unit: int, items: Sequence[Equipment]) -> Station:
        station = Station(self.link, unit, items, f"link.{self.name}", lambda: next(self._numbers))
        station.plan()
        return station

    async def _refresh(self, station: Station, block: ScanBlock) -> None:
        for more in range(TORN_TRIES if block.part else 1, -1, -1):
            try:
                await self._runner.ask(self._runner.job(station.number, block.block, scan=block), Priority.REFRESH)
                return
            except (NoAnswer, BadAnswer):
                if not more:
                    raise
                self.statistics.retries += 1

    def _plc_of(self, equipment: str) -> tuple[Station, PlcUnit]:
        item = self._machines.named(equipment)
        station = self._runner.stations[item.unit]
        plc = station.service(PlcUnit)
        if plc is None:
            raise LinkError(f"{equipment} takes no commands by code: its type {item.type.name} is no Pogon PLC")
        return station, plc

    def _told_by(self, equipment: str) -> Station | None:
        item = self._machines.get(equipment)
        station = self._runner.stations.get(item.unit) if item is not None else None
        return station if station is not None and station.equipment[0].id == equipment else None


def _is_training(station: Station | None, address: int) -> bool:
    return address >= (station.device.training if station else 0xE000)


def _lanes(link: Link, equipment: Sequence[Equipment]) -> int:
    """Connections that the machines on a link allow."""
    if not TRANSPORTS[link.transport].parallel:
        return 1
    return max(1, min((item.type.device.connections for item in equipment), default=1))
