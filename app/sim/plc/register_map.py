"""The registers of one virtual PLC: every area of the map, and who gives its words."""

from collections.abc import Callable, Sequence
from functools import partial
from struct import unpack
from zlib import crc32

from app.registers import plc_map
from app.sim.plc.areas import Areas, Image, Table
from app.sim.plc.command_area import CommandArea
from app.sim.plc.hold import HoldRequest
from app.sim.plc.ring import EventRing
from app.sim.plc.settings import Settings


class RegisterMap:
    """Reads the map of one device; an image is encoded when it is first asked for and kept until `forget`."""

    def __init__(
        self,
        generation: Callable[[], int],
        *,
        header: Callable[[], Sequence[int]],
        images: Sequence[Image],
        configuration: int,
        tables: Sequence[Table],
        settings: tuple[int, int, Settings],
        commands: CommandArea,
        hold: HoldRequest,
        ring: EventRing,
    ) -> None:
        """`generation` of everything that a scan may change; `configuration`: address of the image with the check sum; `settings`: the
        addresses of those in effect and of those that are staged, and who has both.

        Raises:
            ValueError: two areas overlap.
        """
        self._generation = generation
        self._configuration = next(image for image in images if image.address == configuration)
        self._areas = areas = Areas()
        at, staging, given = settings
        areas.add_image(plc_map.HEADER, plc_map.HEADER_WORDS, header)
        for image in images:
            areas.add_image(image.address, image.words, partial(self._swapped, image))
        areas.add_image(at, given.words + 4, lambda: _whole(given.image, given.generation))
        areas.add(staging, given.words, lambda first, after: given.staged[first:after])
        areas.add(plc_map.COMMAND, plc_map.COMMAND_WORDS, lambda first, after: commands.words[first:after])
        areas.add_image(plc_map.ANSWERS, plc_map.ANSWERS_WORDS, lambda: _whole(commands.answers, generation()))
        areas.add(plc_map.HOLD, plc_map.HOLD_WORDS, lambda first, after: hold.words[first:after])
        areas.add_image(plc_map.EVENTS, plc_map.EVENTS_WORDS, lambda: _whole(ring.head, generation()))
        areas.add(plc_map.EVENT_ROWS, len(ring.rows), lambda first, after: ring.rows[first:after])
        for table in tables:
            areas.add_table(table)

    def read(self, address: int, count: int) -> list[int]:
        """`count` words from `address` on; fewer when the next one is not mapped."""
        return self._areas.read(address, count)

    def forget(self) -> None:
        """What was encoded is of an earlier scan."""
        self._areas.forget()

    def configuration_crc(self) -> int:
        """Of the configuration image."""
        return crc32(self._configuration.encode())

    def _swapped(self, image: Image) -> list[int]:
        return _whole(unpack(f">{image.words - 2}H", image.encode()), self._generation())


def _whole(payload: Sequence[int], generation: int) -> list[int]:
    """An image between its two generations: a reader sees by them that it has one scan's."""
    return [generation, *payload, generation]
