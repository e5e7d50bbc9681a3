"""The way of a value to a register: encoded, allowed, merged with the bits of others, in a telegram or through a service of the unit."""

from collections.abc import Mapping, Sequence

from app.errors import BadAnswer, LinkError, NoAnswer, NotConnected, NotTaken, Refused
from app.links.machines import Machines
from app.links.runner import LinkRunner
from app.links.schedule import Priority
from app.links.services import SetWrite
from app.links.station import Station
from app.links.statistics import LinkState
from app.plant.definitions import Equipment, Register, Type
from app.registers.codec import encode, own_bits
from app.registers.pdu import FUNCTIONS, MASK_WRITE, WRITE_COIL, WRITE_COILS, WRITE_MULTIPLE, WRITE_SINGLE


class Writes:
    """Writes to the units of one link. Nothing is ever repeated here."""

    def __init__(self, runner: LinkRunner, machines: Machines) -> None:
        self._runner, self._machines = runner, machines

    async def write(self, equipment: str, point: str, value: float, *, urgent: bool) -> int:
        """As `RegisterLink.write`."""
        item = self._machines.named(equipment)
        name, register, words = self._encoded(item, point, value)
        station = self._runner.stations[item.unit]
        service = next((each for each in station.services if each.takes(register)), None)
        if service is not None:
            self.check(station, urgent=urgent)
            return await service.write([(name, register, words)])
        function = _write_function(station, name, register, words)
        self.check(station, urgent=urgent)
        own = own_bits(register) or []
        if own and function == MASK_WRITE:
            words, own = [~own[0] & 0xFFFF, words[0] & own[0]], []
        others = own if register.readable else []
        try:
            await self.send(item.unit, register.address, words, function, urgent=urgent, machine=item.id, own=others)
        finally:  # what was not answered may have been done
            self._runner.written(station, register.address, register.words, FUNCTIONS[register.table])
        return 0

    def together(self, equipment: str, points: Sequence[str]) -> list[list[str]]:
        """As `RegisterLink.together`."""
        item = self._machines.named(equipment)
        services = self._runner.stations[item.unit].services
        groups: dict[object, list[str]] = {}
        for key in points:
            register = self._machines.point(item, key).register
            service = next((each for each in services if register is not None and each.takes(register)), None)
            groups.setdefault(key if service is None else id(service), []).append(key)
        return list(groups.values())

    async def write_set(self, equipment: str, values: Mapping[str, float]) -> int:
        """As `RegisterLink.write_set`."""
        if len(values) == 1:
            for point, value in values.items():
                return await self.write(equipment, point, value, urgent=False)
        item = self._machines.named(equipment)
        writes = [self._encoded(item, point, value) for point, value in values.items()]
        station = self._runner.stations[item.unit]
        service = next((each for each in station.services if all(each.takes(one[1]) for one in writes)), None)
        if service is None:
            raise LinkError(f"{item.id}: {', '.join(values)} are not taken as one set")
        self.check(station, urgent=False)
        return await service.write(writes)

    async def send(
        self,
        unit: int,
        address: int,
        words: Sequence[int],
        function: int,
        *,
        urgent: bool = False,
        liveness: bool = True,
        machine: str = "",
        own: Sequence[int] = (),
    ) -> None:
        """One telegram; `liveness`: its answer says that the unit is there; `machine`: whose it is, of several behind the unit; `own`:
        the bits of each word that are written, where not all, and the others are read just before, in the same turn.

        Raises:
            NotTaken: what they are is not to be had; nothing was written.
            LinkError: as the transport.
        """
        job = self._runner.job(unit, liveness=liveness)
        job.address, job.words, job.function, job.urgent = address, tuple(words), function, urgent
        job.machine, job.own = machine, own
        try:
            await self._runner.ask(job, Priority.URGENT if urgent else Priority.WRITE)
        except (NoAnswer, BadAnswer) as error:
            if job.sent or not own:
                raise
            unsent = NotTaken(
                f"unit {unit}: the other bits of {address:#06x} cannot be read, nothing was sent ({error})"
            )
            unsent.kind = error.kind
            raise unsent from error

    def check(self, station: Station, *, urgent: bool) -> None:
        """Whether anything may be written to a unit now; `urgent` is also tried on a silent one.

        Raises:
            Refused: writes are off, its simulation is paused, or its program stands still.
            LinkError: nothing would arrive.
        """
        link = self._runner.link.name
        if not self._runner.connected:
            raise NotConnected(f"link {link}: not connected ({self._runner.statistics.last_error_text or 'not yet'})")
        if station.state is LinkState.CONFIGURATION:
            raise LinkError(f"link {link}: unit {station.number} is not the device of the plant file")
        if station.state is not LinkState.UP and not (urgent and station.may_write):
            raise NoAnswer(f"link {link}: unit {station.number} is silent")
        if not station.may_write:
            raise Refused("command.writes_off", link=link)
        if self._runner.paused() and not urgent:
            raise Refused("why.simulation_paused")
        if station.halted and not urgent:
            raise Refused("why.program_halted", link=link)

    def _encoded(self, item: Equipment, point: str, value: float) -> SetWrite:
        definition = self._machines.point(item, point)
        register = definition.register
        if register is None or not register.writable:
            raise LinkError(f"{definition.name} cannot be written: it is read only")
        try:
            return definition.name, register, encode(register, value)
        except ValueError as error:
            raise LinkError(f"{definition.name}: {error}") from error


def _write_function(station: Station, name: str, register: Register, words: Sequence[int]) -> int:
    device = station.device
    if register.type is Type.BIT:
        for function in (WRITE_COIL, WRITE_COILS):
            if function in device.write_functions:
                return function
        raise LinkError(f"{name}: a coil cannot be written with functions {list(device.write_functions)}")
    if len(words) == 1 and own_bits(register) is not None and MASK_WRITE in device.write_functions:
        return MASK_WRITE  # the device keeps the bits of others itself
    if len(words) == 1 and WRITE_SINGLE in device.write_functions:
        return WRITE_SINGLE
    if WRITE_MULTIPLE in device.write_functions and len(words) <= max(1, device.max_write):
        return WRITE_MULTIPLE
    raise LinkError(
        f"{name}: {len(words)} words cannot be written with functions {list(device.write_functions)}, "
        f"at most {device.max_write} at once"
    )
