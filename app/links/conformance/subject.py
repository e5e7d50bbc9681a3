"""What the rules look at: the type as its data say, and the registers of the server, each read once where once is enough."""

import asyncio
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from app.errors import BadAnswer, DeviceException, NoAnswer
from app.links.conformance.finding import Broken, Skipped, refusal, span
from app.links.conformance.server import Server
from app.plant.definitions import EquipmentType, Image, PlcMap, Point, TableMap
from app.plant.type_files.data import TypeData
from app.registers import plc_map
from app.registers.register import Register

TRIES = 5
"""How often an image that was being changed is read again before its generation counts as wrong."""
PAUSE = 0.02
"""Between two tries [s]: about two scans."""
MOST_WORDS = 125


@dataclass(slots=True)
class Look:
    """The header, and between which moments it was read [s]."""

    words: list[int]
    asked: float
    answered: float

    def long(self, at: int, words: int) -> int:
        """The number in `words` words from `at` on, high word first."""
        return number(self.words[at : at + words])


@dataclass(slots=True)
class Rows:
    """A table as it was read: its head and the rows that the head counts."""

    head: list[int]
    rows: list[list[int]] = field(default_factory=list)


class Subject:
    """One unit under examination."""

    def __init__(self, server: Server, data: TypeData) -> None:
        """`data`: of a type that is a Pogon PLC."""
        assert data.type.device.plc
        self.server = server
        self.kind: EquipmentType = data.type
        self.map: PlcMap = data.type.device.plc
        self.columns: Mapping[str, Mapping[str, Point]] = {
            key: {name: cell.point for name, cell in cells.items()} for key, cells in data.columns.items()
        }
        self.counted = bool(data.counted)
        """Whether a machine of the type may have more of something than this one."""
        self.shifted = False
        """Whether its registers count from 1."""
        self.first: Look | None = None
        self.second: Look | None = None
        self.images: dict[int, list[int]] = {}
        """Whole ones by address."""
        self.tables: dict[str, Rows] = {}

    # what the type says

    @property
    def own_images(self) -> Sequence[Image]:
        """Those of the type that the map of the server has, settings last."""
        minor = self.first.words[plc_map.AT_MINOR] if self.first else plc_map.MINOR
        images = [image for image in self.map.images if image.since <= minor]
        return (*images, *((self.map.settings,) if self.map.settings else ()))

    @property
    def all_images(self) -> Sequence[Image]:
        """Everything that lies between two generations."""
        ring = (Image(plc_map.EVENTS, plc_map.EVENTS_WORDS),) if self.map.events else ()
        return (*self.own_images, Image(plc_map.ANSWERS, plc_map.ANSWERS_WORDS), *ring)

    @property
    def setpoints(self) -> Sequence[Point]:
        """The settings in the order of their registers."""
        return self.points_in(self.map.settings) if self.map.settings else ()

    def points_in(self, image: Image) -> Sequence[Point]:
        """Points of the type whose registers lie in `image`, in the order of these."""
        found = [
            (point.register.address, point.register.shift, point)
            for point in self.kind.points.values()
            if point.register
        ]
        inside = [one for one in found if image.address <= one[0] < image.address + image.words]
        return [point for _, _, point in sorted(inside, key=lambda one: one[:2])]

    def cells(self, table: TableMap) -> Iterator[tuple[str, Register]]:
        """Column and its register, from the first word of a row."""
        for name, point in self.columns[table.key].items():
            if point.register:
                yield name, point.register

    # what the server says

    async def read(self, address: int, count: int) -> list[int]:
        """`count` words; a refusal or silence breaks the rule that asks.

        Raises:
            Broken: it does not answer these registers.
            Skipped: what it answers is no answer to this request.
        """
        try:
            return await self.server.read(address, count)
        except (DeviceException, NoAnswer) as error:
            raise Broken(f"{span(address, count)}: {refusal(error)}", f"{count}") from error
        except BadAnswer as error:
            raise Skipped("needs", "telegram") from error

    async def write(self, address: int, words: Sequence[int], function: int = 16) -> None:
        """Write `words`, likewise."""
        try:
            await self.server.write(address, words, function)
        except (DeviceException, NoAnswer) as error:
            raise Broken(f"{span(address, len(words))}: {refusal(error)}", "echo") from error
        except BadAnswer as error:
            raise Skipped("needs", "telegram") from error

    async def look(self) -> Look:
        """The header now."""
        loop = asyncio.get_running_loop()
        asked = loop.time()
        words = await self.read(plc_map.HEADER, plc_map.HEADER_WORDS)
        return Look(words, asked, loop.time())

    async def whole(self, image: Image) -> list[int] | None:
        """The words of `image` now; None when it was being changed at every try."""
        for _ in range(TRIES):
            words = await self.read(image.address, image.words)
            if plc_map.is_whole(words):
                self.images[image.address] = words
                return words
            await asyncio.sleep(PAUSE)
        return None

    async def again(self, image: Image) -> list[int]:
        """`image` as it is now.

        Raises:
            Skipped: it is never whole.
        """
        words = await self.whole(image)
        if words is None:
            raise Skipped("needs", "generation")
        return words


def number(words: Sequence[int]) -> int:
    """The number in `words`, high word first."""
    value = 0
    for word in words:
        value = value << 16 | word
    return value
