"""The simulated plant: a virtual device for every equipment, a bus for every link, and the clock that drives them.

Time is steps x dt, at a speed that an instructor chooses: none at all up to ten times as fast as real time. Only what happens in the plant
is faster then: lines, time-outs of hosts and time stamps keep real time.
Behind the clock it catches up at most 20 steps at a time; what is still owed then is given up, so an overloaded
machine shows a slower plant, never a jumping one.
"""

import asyncio
import logging
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from math import isfinite, nan
from pathlib import Path
from types import MappingProxyType
from typing import Any
from zlib import crc32

from app.clock import Clock
from app.errors import BadAnswer, ConfigurationError, DeviceException
from app.plant.definitions import Equipment, Plant
from app.plant.loader import PLANT_FILE, read_plant, shortened
from app.plant.problems import Problem
from app.plant.said import not_as, said
from app.plant.sequences import program
from app.plant.type_files.simulation import FILE as SIMULATION
from app.plant.types import OWN
from app.registers.codec import decode
from app.registers.pdu import FUNCTIONS
from app.sim.bus import Bus, damaged
from app.sim.described.device import DescribedDevice
from app.sim.described.unit import SharedUnit
from app.sim.device import DT, Paced, Permanent, VirtualDevice
from app.sim.machines import VIRTUAL_DEVICES, Factory, factory_of
from app.sim.plc import VirtualPlc
from app.sim.sequence.machine import Machine
from app.sim.sequence.orders import Desk
from app.sim.sequence.program import VirtualSequence

log = logging.getLogger(__name__)

SPEEDS = (0, 1, 2, 5, 10)
"""Simulated time per real time that can be chosen; 0 = paused."""
CATCH_UP = 20
"""Most steps that are made up for, times the speed."""
REST = 0.02
"""Between two looks at a plant that is paused [s]."""
TURN = 0.02
"""After this the loop is given back, whatever is still owed [s]."""
GIVE_BACK = 0.5
"""What the loop then has at least for others, as a part of what the steps took: links and pages go on beside a plant that is too large."""
PACE_WINDOW = 5.0
"""Over which the pace is measured [s]."""


def read_simulated(
    folder: Path,
    factories: Mapping[str, Factory] | None = None,
    drafts: Mapping[str, str] = MappingProxyType({}),
) -> tuple[Plant | None, list[Problem]]:
    """A plant folder as `read_plant` reads it; what the virtual devices of its simulated links do not take is a problem, too."""
    plant, problems = read_plant(folder, drafts=drafts)
    if plant is None:
        return None, problems
    known = VIRTUAL_DEVICES if factories is None else factories
    for item in plant.equipment.values():
        if plant.links[item.link].simulated and factory_of(item, known) is None:
            expected = said("mistake.real_link", type=item.type.name, file=f"{OWN}/{item.type.name}/{SIMULATION}")
            problems.append(Problem(PLANT_FILE, f"equipment.{item.id}.link", f'"{item.link}"', expected))
        elif plant.links[item.link].simulated:
            try:
                _try_out(item, plant, known)
            except ConfigurationError as error:
                key, expected = f"equipment.{item.id}.simulation", said("mistake.virtual_device")
                problems.append(Problem(PLANT_FILE, key, error.args[0], expected))
    return (None if problems else plant), shortened(problems)


class SimPlant:
    """Every virtual device of a plant, in step.

    The same seed and the same writes at the same steps repeat a run exactly.
    """

    def __init__(
        self,
        plant: Plant,
        clock: Clock,
        *,
        seed: int = 1,
        links: Iterable[str] | None = None,
        turnaround: float = 0.0,
        factories: Mapping[str, Factory] = VIRTUAL_DEVICES,
        memories: Mapping[str, Mapping[str, Any]] = MappingProxyType({}),
    ) -> None:
        """`links`: only the equipment of these, None = of all; `turnaround`: time a device takes for an answer [s]; `memories`: what
        permanent memories hold, by `place_of`, looked up for every device that is built.

        Raises:
            ConfigurationError: a link that the plant does not have, or a type without a virtual device.
        """
        wanted = list(plant.links if links is None else links)
        for name in wanted:
            if name not in plant.links:
                raise ConfigurationError(
                    f"link {name}: expected one of {', '.join(plant.links) or 'none, the plant has no link'}"
                )
        self.equipment: Mapping[str, Equipment] = {
            id: item for id, item in plant.equipment.items() if item.link in wanted
        }
        self._seed = seed
        self._factories = factories
        self._memories = memories
        self.devices: Mapping[str, VirtualDevice] = {id: self._built(item) for id, item in self.equipment.items()}
        """By equipment."""
        self.point: Callable[[str], float] = self._register
        """The value of `equipment.point` for sequences, NaN unless it is good; a house gives what its tags say."""
        self.desk: Callable[[str], Desk | None] = lambda sequence: None
        """Who carries the commands of a sequence to the machines; nobody where there is no gate."""
        self._couple()
        self.buses: Mapping[str, Bus] = {
            name: Bus(_on_link(name, self.equipment, self.devices), turnaround=turnaround) for name in wanted
        }
        """By link."""
        self._clock = clock
        self._measure_scans()
        self._turnaround = turnaround
        self.speed = 1
        """Chosen simulated time per real time, 0 = paused."""
        self._due = clock.monotonic() + DT
        self.steps = 0
        self.lag = 0.0
        """How late the last round began [s]."""
        self.lost = 0.0
        """Simulated time given up since the start [s]."""
        self.overruns = 0
        """Rounds that had to give time up."""
        self.pace = 1.0
        """What it keeps of the chosen speed, over the last 5 s: 1 = all of it."""
        self._paced = (clock.monotonic(), 0)
        """Since when it is measured [s], and steps given up since then."""
        self._rested = clock.monotonic()
        """Up to when a paused plant was told of its pause [s]."""
        self.step_last = 0.0
        """Computing time of the last step of the whole plant [s]."""
        self.step_max = 0.0

    def renewed(
        self, plant: Plant, links: Iterable[str], former: Mapping[str, str]
    ) -> tuple[dict[str, Equipment], dict[str, VirtualDevice], dict[str, Bus]]:
        """What `take` would take: the devices of `plant` on `links`, those of machines that stay as they are among them.

        `former`: new id → id before. A machine keeps its device unless its type, its options or its sequence differ; a link
        keeps its bus.

        Raises:
            ConfigurationError: a type without a virtual device, or an option that it does not take.
        """
        wanted = frozenset(links)
        equipment = {id: item for id, item in plant.equipment.items() if item.link in wanted}
        devices: dict[str, VirtualDevice] = {}
        for id, item in equipment.items():
            before = self.equipment.get(former.get(id, id))
            stays = before is not None and _is_like(before, item)
            devices[id] = self.devices[before.id] if before and stays else self._built(item)
        # A sequence does not go on with another machine, nor with one that begins anew.
        for id, item in equipment.items():
            before = self.equipment.get(former.get(id, id)) if item.sequence else None
            if before is not None and devices.get(item.machine) is not self.devices.get(before.machine):
                devices[id] = self._built(item)
        for item, device, machine in _coupled(equipment, devices):
            with _named(item):
                _fit(item, device, machine)
        buses = {name: self.buses.get(name) or Bus({}, turnaround=self._turnaround) for name in wanted}
        return equipment, devices, buses

    def take(
        self, equipment: Mapping[str, Equipment], devices: Mapping[str, VirtualDevice], buses: Mapping[str, Bus]
    ) -> None:
        """Go on with what `renewed` gave; devices that are not among it stand still from now on."""
        for name, bus in buses.items():
            bus.devices = _on_link(name, equipment, devices)
        stay = list(devices.values())
        for device in self.devices.values():
            if isinstance(device, VirtualSequence) and not any(device is each for each in stay):
                device.orders.withdraw()
        self.equipment, self.devices, self.buses = equipment, devices, buses
        self._couple()
        self._measure_scans()
        self._tell_speed()

    def set_speed(self, speed: int) -> None:
        """Go on `speed` times as fast as real time, or not at all.

        Raises:
            ConfigurationError: not one of `SPEEDS`.
        """
        if speed not in SPEEDS:
            raise ConfigurationError(f"speed {speed}: expected one of {', '.join(map(str, SPEEDS))}")
        now = self._clock.monotonic()
        if not self.speed:
            self._rest(now)
        self.speed, self.pace, self.lag = speed, 1.0, 0.0
        self._due, self._paced, self._rested = now + DT / max(1, speed), (now, 0), now
        self._tell_speed()

    @property
    def achieved(self) -> float:
        """Simulated time per real time as it was over the last 5 s."""
        return self.speed * self.pace

    def _tell_speed(self) -> None:
        for bus in self.buses.values():
            bus.paused = not self.speed
        for device in self.devices.values():
            if isinstance(device, Paced):
                device.tempo = float(max(1, self.speed))

    def _rest(self, now: float) -> None:
        """The plant is paused: clocks of devices go on."""
        self._stand(now - self._rested)
        self._rested = now

    def _stand(self, seconds: float) -> None:
        for device in self.devices.values():
            if isinstance(device, Paced):
                device.stood(seconds)

    def permanent(self) -> dict[str, Permanent]:
        """The devices with a permanent memory, by `place_of`."""
        found = {place_of(item): self.devices[id] for id, item in self.equipment.items()}
        return {place: device for place, device in found.items() if isinstance(device, Permanent)}

    def _built(self, item: Equipment) -> VirtualDevice:
        with _named(item):
            device = _build(item, self._seed, self._factories)
        place = place_of(item)
        memory = self._memories.get(place)
        if memory and isinstance(device, Permanent) and not device.remember(memory):
            log.warning(
                "permanent memory of a simulated device does not fit, it begins as the plant file says device=%s", place
            )
        return device

    def _couple(self) -> None:
        """Give every sequence its machine, and the rest of the plant."""
        _couple(self.equipment, self.devices)
        for id, device in self.devices.items():
            if isinstance(device, VirtualSequence):
                device.permissives.plant = lambda name: self.point(name)
                device.orders.desk = partial(self._desk_of, id)

    def _desk_of(self, sequence: str) -> Desk | None:
        return self.desk(sequence)

    def _register(self, name: str) -> float:
        """What the virtual device of a machine has in the registers of a point, as of its last step; NaN: nothing, or not here."""
        id, _, key = name.partition(".")
        item, device = self.equipment.get(id), self.devices.get(id)
        point = item.points.get(key) if item else None
        if device is None or point is None or point.register is None:
            return nan
        register = point.register
        try:
            found = decode(register, device.read(FUNCTIONS[register.table], register.address, register.words))
        except DeviceException:
            return nan
        return float(found) if isinstance(found, int | float) and isfinite(found) else nan

    def _measure_scans(self) -> None:
        for device in self.devices.values():
            if isinstance(device, VirtualPlc):
                device.scan_time.stopwatch = self._clock.monotonic

    def step(self) -> None:
        """Advance every device by one step."""
        began = self._clock.monotonic()
        for device in self.devices.values():
            device.step()
        self.steps += 1
        self.step_last = self._clock.monotonic() - began
        self.step_max = max(self.step_max, self.step_last)

    def catch_up(self) -> int:
        """Do the steps that are due, at most 20 at speed 1 and for about 20 ms, and give up what is owed beyond; the number done."""
        began = self._clock.monotonic()
        if not self.speed:
            self._rest(began)
            return 0
        dt, most = DT / self.speed, CATCH_UP * self.speed
        late = began - self._due
        self.lag = max(0.0, late)
        if late < 0:
            self._measure_pace(began, 0)
            return 0
        owed = int(late / dt) + 1
        given_up = max(0, owed - most)
        if given_up:
            self._due += given_up * dt
            self.overruns += 1
            self.lost += given_up * DT
            if self.speed > 1:
                self._stand(given_up * dt)
        done = 0
        while done < owed - given_up:
            self.step()
            done += 1
            if self._clock.monotonic() - began >= TURN:
                break
        self._due += done * dt
        self._measure_pace(began, given_up)
        return done

    def _measure_pace(self, now: float, given_up: int) -> None:
        since, lost = self._paced
        if now - since >= PACE_WINDOW:
            self.pace = max(0.0, 1 - lost * DT / self.speed / (now - since))
            since, lost = now, 0
        self._paced = since, lost + given_up

    async def run(self) -> None:
        """Keep the plant moving until cancelled. What lies before the call is not caught up.

        A plant that is too large for its computer runs slower; what reads it and shows it does not stand still.
        """
        self._due = self._clock.monotonic() + DT
        self._paced = (self._clock.monotonic(), 0)
        self._rested = self._clock.monotonic()
        while True:
            began = self._clock.monotonic()
            self.catch_up()
            now = self._clock.monotonic()
            await asyncio.sleep(max(GIVE_BACK * (now - began), self._due - now) if self.speed else REST)

    def merged(self) -> Bus:
        """One bus with the units of all links, for one port.

        Raises:
            ConfigurationError: two devices have the same unit; all of them are named.
        """
        return Bus(units(self.equipment, self.devices), turnaround=self._turnaround)


def place_of(item: Equipment) -> str:
    """Under what the memory of a device is kept: what it is and where, whatever it is called."""
    return f"{item.type.name} {item.link} {item.unit}"


def units(equipment: Mapping[str, Equipment], devices: Mapping[str, VirtualDevice]) -> dict[int, VirtualDevice]:
    """The devices by unit, of all links.

    Raises:
        ConfigurationError: two devices have the same unit; all of them are named.
    """
    if found := clashes(equipment.values()):
        raise ConfigurationError(f"{found}: expected different units on one port, or one link of them")
    links = dict.fromkeys(item.link for item in equipment.values())
    return {unit: device for name in links for unit, device in _on_link(name, equipment, devices).items()}


def _on_link(
    name: str, equipment: Mapping[str, Equipment], devices: Mapping[str, VirtualDevice]
) -> dict[int, VirtualDevice]:
    """The devices of a link by unit; several machines behind one unit are one there."""
    found: dict[int, list[VirtualDevice]] = {}
    for id, item in equipment.items():
        if item.link == name:
            found.setdefault(item.unit, []).append(devices[id])
    return {unit: _one(of) for unit, of in found.items()}


def _one(machines: list[VirtualDevice]) -> VirtualDevice:
    """What the line has of the machines of a unit: only what is described shares one (`shared_units.read_base`)."""
    described = [one for one in machines if isinstance(one, DescribedDevice)]
    return SharedUnit(described) if len(described) > 1 else machines[-1]


def clashes(equipment: Iterable[Equipment]) -> str:
    """The machines that would have the same unit on one port, in words; empty: none."""
    owners: dict[int, dict[str, str]] = {}
    for item in equipment:  # those of one link that share a unit are one device
        owners.setdefault(item.unit, {}).setdefault(item.link, f"{item.id} on link {item.link}")
    return "; ".join(
        f"unit {unit} is {' and '.join(of.values())}" for unit, of in sorted(owners.items()) if len(of) > 1
    )


def clashes_of(plant: Plant) -> str:
    """Those of its simulated links, which are served together (POGON_SERVE_MODBUS)."""
    return clashes(item for item in plant.equipment.values() if plant.links[item.link].simulated)


@contextmanager
def _named(item: Equipment) -> Iterator[None]:
    """What cannot be of `item` is told with its id."""
    try:
        yield
    except ConfigurationError as error:
        raise ConfigurationError(said("mistake.of_machine", machine=item.id, what=error.args[0])) from error


def _build(item: Equipment, seed: int, factories: Mapping[str, Factory]) -> VirtualDevice:
    factory = factory_of(item, factories)
    if factory is None:
        none = said("mistake.no_virtual", type=item.type.name)
        known = said("mistake.one_of_known", known=", ".join(sorted(factories)) or said("mistake.none_yet"))
        raise ConfigurationError(not_as(none, known, "but_expected"))
    return factory(item, crc32(f"{seed} {item.id}".encode()))


def _is_like(before: Equipment, item: Equipment) -> bool:
    """Whether the device of `before` is one of `item`, too."""
    programs = [each.sequence and program(each.sequence) for each in (before, item)]
    if (before.type.name, before.options, programs[0]) != (item.type.name, item.options, programs[1]):
        return False
    return item.type.simulation is None or _described(before) == _described(item)


def _described(item: Equipment) -> object:
    """All that a described device is made of, besides its options."""
    registers = {key: point.register for key, point in item.points.items() if point.register}
    kind = item.type
    return kind.simulation, kind.device, kind.setpoints, kind.training, registers, item.base


def _coupled(
    equipment: Mapping[str, Equipment], devices: Mapping[str, VirtualDevice]
) -> list[tuple[Equipment, VirtualSequence, VirtualDevice | None]]:
    """Every sequence with the device of its machine, None when that is not simulated here."""
    return [
        (item, device, devices.get(item.machine) if item.machine else None)
        for id, item in equipment.items()
        if isinstance(device := devices[id], VirtualSequence)
    ]


def _fit(item: Equipment, device: VirtualSequence, machine: VirtualDevice | None) -> None:
    if machine is None:
        if item.machine:
            none = said("mistake.not_simulated", machine=item.machine)
            raise ConfigurationError(not_as(none, said("mistake.both_or_no"), "but_expected"))
        return
    if not isinstance(machine, Machine):
        raise ConfigurationError(said("mistake.cannot_drive", machine=item.machine, type=machine.type))
    device.fits(machine)


def _couple(equipment: Mapping[str, Equipment], devices: Mapping[str, VirtualDevice]) -> None:
    """Give every sequence its machine."""
    for item, device, machine in _coupled(equipment, devices):
        with _named(item):
            _fit(item, device, machine)
        device.attach(machine if isinstance(machine, Machine) else None)


def _try_out(item: Equipment, plant: Plant, factories: Mapping[str, Factory]) -> None:
    """Build the device of `item` and couple it, as a plant would."""
    devices = {item.id: _build(item, 1, factories)}
    machine = plant.equipment.get(item.machine)
    if machine and plant.links[machine.link].simulated and item.machine != item.id:
        with _named(machine):
            devices[machine.id] = _build(machine, 1, factories)
    for one, device, coupled in _coupled({item.id: item}, devices):
        _fit(one, device, coupled)


async def exchange(bus: Bus, unit: int, pdu: bytes) -> bytes | None:
    """Carry `pdu` to `unit` without any wire: its answer after the device's delay, None for silence.

    Raises:
        BadAnswer: what came back would not have got past the check sum or the unit of a real frame.
    """
    answer = bus.answer(unit, pdu)
    if answer.pdu is None:
        return None
    if answer.delay > 0:
        await asyncio.sleep(answer.delay)
    if answer.corrupt == "unit":
        raise BadAnswer(f"unit {answer.unit} answered: expected unit {unit}")
    if answer.corrupt == "crc":
        raise BadAnswer(f"check sum of the answer {damaged(answer.pdu).hex(' ')} is wrong")
    return answer.pdu
