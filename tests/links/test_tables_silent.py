"""A device that is silent for a table, answers it late, or spoils its answers: the rest lives, and no wrong bit becomes a value."""

import asyncio

import pytest

from app.links.transports import TRANSPORTS
from app.sim.bus import Answer, Bus, LineFaultMode
from app.tags.quality import is_good
from tests.links.devices import point, until
from tests.links.table_device import TableDevice
from tests.links.test_tables import bits, holding, linked


class Deaf(Bus):
    """A device that answers nothing to some functions: not all refuse what they do not know."""

    deaf: tuple[int, ...] = ()

    def answer(self, unit: int, pdu: bytes) -> Answer:
        return Answer(unit, None) if pdu[0] in self.deaf else super().answer(unit, pdu)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("deaf", [(1,), (2,), (1, 2), (3,)])
@pytest.mark.parametrize("name", list(TRANSPORTS))
async def test_a_device_that_is_silent_for_a_table_has_all_the_rest(name: str, deaf: tuple[int, ...]) -> None:
    points = [*bits(), *(point("m", f"v{n}", n) for n in range(20))]
    device = TableDevice({**holding(bits()), "holding": {n: n for n in range(20)}})
    bus = Deaf({1: device})
    bus.deaf = deaf
    heard = {name for name, function in (("coil", 1), ("discrete", 2), ("v", 3)) if function not in deaf}
    async with linked(name, device, points, bus=bus) as line:
        for kind in heard:
            await until(lambda kind=kind: is_good(line.quality(points_of(kind))), 120)
        await asyncio.sleep(20)
        for kind, known in (("coil", 1), ("discrete", 2), ("v", 3)):
            assert is_good(line.quality(points_of(kind))) == (known not in deaf), kind
        assert line.link.up
        bus.deaf = ()
        await until(lambda: all(is_good(line.quality(one.name)) for one in points), 120)


def points_of(kind: str) -> str:
    """A point of a table."""
    return "m.v3" if kind == "v" else f"m.{kind}_3"


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    "mode", [LineFaultMode.SLOW, LineFaultMode.WRONG_LENGTH, LineFaultMode.GARBAGE, LineFaultMode.SILENT]
)
@pytest.mark.parametrize("name", list(TRANSPORTS))
async def test_after_any_fault_of_the_line_every_bit_is_what_the_device_has(name: str, mode: LineFaultMode) -> None:
    points = [*bits(), *(point("m", f"v{n}", n) for n in range(20))]
    device = TableDevice({**holding(bits()), "holding": {n: n for n in range(20)}})
    wrong: list[object] = []
    async with linked(name, device, points) as line:
        await until(lambda: all(is_good(line.quality(one.name)) for one in points))
        line.tags.subscribe(
            lambda batch: wrong.extend(
                value for value in batch.values if batch.source == "link.hall" and value not in (None, *range(20))
            )
        )
        device.line_fault.mode, device.line_fault.delay_ms, device.line_fault.count = mode, 700, 6
        await asyncio.sleep(6)
        await until(lambda: all(is_good(line.quality(one.name)) for one in points), 60)
        for n in range(20):
            device.tables["coil"][n], device.tables["holding"][n] = int(n % 4 == 1), 19 - n
        await asyncio.sleep(2)
        assert [line.value(f"m.coil_{n}") for n in range(20)] == [n % 4 == 1 for n in range(20)]
        assert [line.value(f"m.v{n}") for n in range(20)] == [19 - n for n in range(20)]
        assert not wrong
