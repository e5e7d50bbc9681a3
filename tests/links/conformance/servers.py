"""PLC servers to examine: the virtual PLCs of the demo plant, and one that breaks a rule."""

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from functools import cache
from struct import pack, unpack

from app.clock import ManualClock
from app.errors import NoAnswer
from app.links.conformance.examination import examine
from app.links.conformance.finding import Finding, State
from app.links.conformance.server import Exchange
from app.plant import types
from app.plant.definitions import Plant
from app.plant.loader import read_plant
from app.plant.type_files.data import TypeData
from app.registers import plc_map
from app.registers.plc_map import Request
from app.sim.bus import Bus
from app.sim.plant import SimPlant
from tests.demo_plant import DEMO

KINDS = ("coil_car", "conveyor", "crane", "sequence")


@cache
def data_of(kind: str) -> TypeData:
    data, problems = types.read_type(kind, ["en"])
    assert problems == []
    return data


@cache
def demo() -> Plant:
    plant, problems = read_plant(DEMO)
    assert plant, problems
    return plant


def simulation() -> SimPlant:
    """The virtual devices of the demo plant, some seconds after it was switched on."""
    plant = SimPlant(demo(), ManualClock())
    for _ in range(1500):
        for device in plant.devices.values():
            device.step()
    return plant


@asynccontextmanager
async def scanning(kind: str, of: Plant | None = None) -> AsyncIterator[tuple[Bus, int]]:
    """The line and the unit of a machine of type `kind`, 15 s after it was switched on, its PLC scanning every 10 ms; `of` the demo plant
    unless another one is given.

    A plant of its own for every test: where a product is does not depend on which test ran before.
    """
    plant = SimPlant(of or demo(), ManualClock())
    item = next(item for item in plant.equipment.values() if item.type.name == kind)
    device = plant.devices[item.id]
    for _ in range(1500):
        device.step()

    async def scan() -> None:
        while True:
            await asyncio.sleep(device.dt)
            device.step()

    task = asyncio.create_task(scan())
    try:
        yield plant.buses[item.link], item.unit
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


class Faulty:
    """A server between the wire and a virtual PLC; what is not overridden keeps every rule."""

    def __init__(self, bus: Bus, unit: int) -> None:
        self.bus, self.unit = bus, unit
        self.requests = 0

    async def __call__(self, pdu: bytes) -> bytes:
        self.requests += 1
        refused = self.refuses(pdu)
        if refused:
            return bytes((pdu[0] | 0x80, refused))
        answer = self.answer(self.request(pdu))
        if pdu[0] == 3 and answer[0] == 3:
            address, count = unpack(">HH", pdu[1:5])
            words = list(unpack(f">{count}H", answer[2:]))
            self.words(address, words)
            answer = answer[:2] + pack(f">{count}H", *words)
        return self.wire(pdu, answer)

    def answer(self, pdu: bytes) -> bytes:
        """What the PLC behind it says."""
        said = self.bus.answer(self.unit, pdu).pdu
        if said is None:
            raise NoAnswer("silence")
        return said

    def refuses(self, pdu: bytes) -> int:
        """Exception code for this request; 0 = none."""
        return 0

    def request(self, pdu: bytes) -> bytes:
        """The request as the PLC hears it."""
        return pdu

    def words(self, address: int, words: list[int]) -> None:
        """Change the words read from `address` on."""

    def wire(self, pdu: bytes, answer: bytes) -> bytes:
        """The answer as it goes onto the wire."""
        return answer


class Put(Faulty):
    """Has other words at some addresses: the word, or what makes it of the right one."""

    def __init__(self, bus: Bus, unit: int, words: dict[int, int | Callable[[int], int]]) -> None:
        super().__init__(bus, unit)
        self.other = words

    def words(self, address: int, words: list[int]) -> None:
        for place, word in self.other.items():
            if 0 <= place - address < len(words):
                old = words[place - address]
                words[place - address] = (word(old) if callable(word) else word) & 0xFFFF


def reading(pdu: bytes, address: int) -> bool:
    """Whether `pdu` reads from exactly `address`."""
    return pdu[0] == 3 and unpack(">H", pdu[1:3])[0] == address


def writing(pdu: bytes, address: int) -> bool:
    """Whether `pdu` writes from exactly `address` on."""
    return pdu[0] in (6, 16) and unpack(">H", pdu[1:3])[0] == address


def command(code: int, id: int, arguments: Sequence[int] = ()) -> bytes:
    """The telegram of a command."""
    words = plc_map.request_words(Request(code, arguments=tuple(arguments), id=id))
    return pack(">BHHB16H", 16, plc_map.COMMAND, 16, 32, *words)


async def judged(
    exchange: Exchange, kind: str, *, write: bool = True, data: TypeData | None = None
) -> dict[str, Finding]:
    """Every finding by its rule; `data`: of a machine that has other numbers of something than usual."""
    return {finding.rule: finding async for finding in examine(exchange, data or data_of(kind), write=write)}


def rules_in(found: dict[str, Finding], state: State) -> set[str]:
    return {rule for rule, finding in found.items() if finding.state is state}
