"""The registers of a PLC: an image is encoded once a scan, between two generations; a read over a border is one scan's."""

from dataclasses import dataclass, field
from struct import pack

import pytest

from app.registers import plc_map
from app.registers.plc_map import Request
from app.sim.plc import Image, Setting, Verdict
from app.sim.plc.command_area import CommandArea
from app.sim.plc.hold import HoldRequest
from app.sim.plc.register_map import RegisterMap
from app.sim.plc.ring import EventRing
from app.sim.plc.settings import Settings


@dataclass
class Device:
    """Counts its scans, and how often its image was asked for."""

    scan: int = 1
    encoded: list[int] = field(default_factory=list)

    def image(self) -> bytes:
        self.encoded.append(self.scan)
        return pack(">4H", *[self.scan] * 4)

    def map(self, *, at: int = 0x0100, staging: int = 0x0240) -> RegisterMap:
        return RegisterMap(
            lambda: 2 * self.scan,
            header=lambda: [self.scan] * plc_map.HEADER_WORDS,
            images=(Image(at, 6, self.image), Image(0x0180, 4, lambda: pack(">2H", 7, 8))),
            configuration=0x0180,
            tables=(),
            settings=(0x0200, staging, Settings((Setting("rate", 1.0, 0.0, 9.0),))),
            commands=CommandArea(lambda request: Verdict()),
            hold=HoldRequest(),
            ring=EventRing(),
        )


def test_an_image_is_one_scans_until_it_is_forgotten() -> None:
    device = Device()
    served = device.map()
    assert served.read(0x0100, 6) == [2, 1, 1, 1, 1, 2]
    device.scan = 2
    assert served.read(0x0102, 3) == [1, 1, 1], "nobody has ended the scan"
    served.forget()
    assert served.read(0x0100, 6) == [4, 2, 2, 2, 2, 4]
    assert device.encoded == [1, 2]


def test_what_nobody_mapped_ends_a_read() -> None:
    served = Device().map()
    assert served.read(0x0104, 5) == [1, 2]
    assert served.read(0x0106, 1) == []
    assert len(served.read(plc_map.COMMAND, 100)) == plc_map.COMMAND_WORDS


def test_the_check_sum_is_of_the_configuration_alone() -> None:
    device = Device()
    served = device.map()
    before = served.configuration_crc()
    device.scan = 9
    assert served.configuration_crc() == before and not device.encoded


@pytest.mark.parametrize("places", [{"at": 0x001F}, {"at": plc_map.COMMAND - 5}, {"staging": 0x0205}])
def test_areas_that_overlap_are_refused(places: dict[str, int]) -> None:
    with pytest.raises(ValueError, match="registers overlap at 0x"):
        Device().map(**places)


def test_commands_answers_and_hold_are_read_back_where_they_were_written() -> None:
    area, hold = CommandArea(lambda request: Verdict(detail=request.code)), HoldRequest()
    device = Device()
    served = RegisterMap(
        lambda: 2,
        header=lambda: [0] * plc_map.HEADER_WORDS,
        images=(Image(0x0180, 4, device.image),),
        configuration=0x0180,
        tables=(),
        settings=(0x0200, 0x0240, Settings(())),
        commands=area,
        hold=hold,
        ring=EventRing(),
    )
    words = plc_map.request_words(Request(5, id=3))
    area.take(words, 1000)
    hold.take([4, 1, 0, 0])
    assert served.read(plc_map.COMMAND, plc_map.COMMAND_WORDS) == list(words)
    assert served.read(plc_map.HOLD, plc_map.HOLD_WORDS) == [4, 1, 0, 0]
    (answer,) = plc_map.answers_of(served.read(plc_map.ANSWERS, plc_map.ANSWERS_WORDS)) or ()
    assert (answer.id, answer.detail, answer.time) == (3, 5, 1000)
