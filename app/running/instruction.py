"""What an instructor does to a simulated device, by its training registers: written, and read back before it counts as done.

A machine counts as simulated only when its link says so (the header at 0xE000 was found when it connected) and when the header is there
again right before each write. A live device has no such registers; nothing is ever written to it from here.
"""

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass

from app.errors import LinkError, Refused
from app.links.register_link import RegisterLink
from app.plant.definitions import Equipment
from app.sim import training

READ_BACK = 2.0
"""What was written is looked for in the registers for so long [s]."""
LOOK_PERIOD = 0.05

Words = Mapping[int, int]
"""Training registers by address, as they were read."""


@dataclass(frozen=True, slots=True)
class Trainee:
    """A machine as the instructor sees it."""

    item: Equipment
    link: RegisterLink
    words: Words | None
    """None: they could not be read, or the device is not a simulated one."""
    problem: str = ""
    """Text key of why."""
    reason: str = ""
    """Text key of what its line says, where that is it."""


async def write(link: RegisterLink, item: Equipment, wanted: Mapping[int, int], act: str = "") -> Words:
    """Write `wanted` and wait until it is read back; what was there before. What acts once cannot be read back.

    Raises:
        Refused: its simulation is paused, the device is not simulated, does not answer, or shows something else.
    """
    if link.paused:
        raise Refused("why.simulation_paused", 409)
    before = await look(link, item)
    if before.words is None:
        raise Refused(before.problem, 409, machine=item.id, cause=before.reason)
    trained = item.type.training
    if act in trained.switches:
        wanted = {register: before.words[register] ^ 1 << (number - 1) for register, number in wanted.items()}
    try:
        for first, words in _telegrams(wanted):
            await link.raw_write(item.unit, first, words)
        if act not in trained.acts:
            await _confirm(link, item, wanted)
    except LinkError as error:
        raise Refused("instructor.not_written", 409, cause=f"link.error.{error.kind}") from error
    return {address: before.words[address] for address in wanted}


async def _confirm(link: RegisterLink, item: Equipment, wanted: Mapping[int, int]) -> None:
    """Wait until the registers show `wanted`; a count may have run down meanwhile, and a reset leaves no fault and no broken line."""
    if training.REG_RESET in wanted:
        wanted = dict.fromkeys((training.REG_MACHINE_FAULT, training.REG_LINE_FAULT, training.REG_LINE_COUNT), 0)
    loop = asyncio.get_running_loop()
    until = loop.time() + READ_BACK
    while True:
        await asyncio.sleep(LOOK_PERIOD)
        now = await _area(link, item.unit)
        if now is not None and _shows(now, wanted):
            return
        if loop.time() > until:
            raise Refused("instructor.not_confirmed", 409)


def _shows(now: Words, wanted: Mapping[int, int]) -> bool:
    count = wanted.get(training.REG_LINE_COUNT, 0)
    if count and now[training.REG_LINE_COUNT] < count:  # hit some requests already, and is over at 0
        ran_down = {training.REG_LINE_COUNT: now[training.REG_LINE_COUNT]}
        if not now[training.REG_LINE_COUNT]:
            ran_down[training.REG_LINE_FAULT] = 0
        wanted = {**wanted, **ran_down}
    return all(now[address] == word for address, word in wanted.items())


async def look(link: RegisterLink, item: Equipment) -> Trainee:
    """Read the whole training area of a machine that its link calls simulated; nobody else is asked."""
    if not says_simulated(link, item):
        return Trainee(item, link, None, "instructor.not_simulated")
    try:
        words = await _area(link, item.unit)
    except LinkError as error:
        return Trainee(item, link, None, "instructor.not_read", f"link.error.{error.kind}")
    if words is None:
        return Trainee(item, link, None, "instructor.not_simulated")
    return Trainee(item, link, words)


async def _area(link: RegisterLink, unit: int) -> Words | None:
    """The training registers, or None when the header is not that of a simulated device."""
    area = await link.raw_read(unit, training.BASE, training.END - training.BASE)
    words = dict(enumerate(area, training.BASE))
    good = words[training.REG_MAGIC] == training.MAGIC and words[training.REG_VERSION] == training.VERSION
    return words if good and words[training.REG_FLAGS] & training.SIMULATED else None


def says_simulated(link: RegisterLink, item: Equipment) -> bool:
    station = link.stations.get(item.unit)
    return link.simulated or (station is not None and station.simulated)


def _telegrams(wanted: Mapping[int, int]) -> list[tuple[int, list[int]]]:
    """Neighbouring registers in one telegram, so that they act in the same step."""
    telegrams: list[tuple[int, list[int]]] = []
    for address in sorted(wanted):
        if telegrams and telegrams[-1][0] + len(telegrams[-1][1]) == address:
            telegrams[-1][1].append(wanted[address])
        else:
            telegrams.append((address, [wanted[address]]))
    return telegrams
