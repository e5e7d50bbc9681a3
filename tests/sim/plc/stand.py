"""Telegrams to a fake PLC, and what its registers say."""

from collections.abc import Callable
from struct import pack, unpack
from zlib import crc32

import pytest

from app.errors import DeviceException
from app.registers import plc_map
from app.registers.plc_map import Answer, DeviceEvent, Request, real_of
from app.sim.plc import VirtualPlc
from tests.sim.fake_plc import SETTINGS, STAGING


def go(plc: VirtualPlc, scans: int) -> None:
    for _ in range(scans):
        plc.step()


def ask(plc: VirtualPlc, code: int, *arguments: int, id: int = 7, expected: int = 0) -> Answer:
    """The answer to a command, after one scan."""
    plc.write(16, plc_map.COMMAND, plc_map.request_words(Request(code, 0, expected, arguments, id)))
    plc.step()
    return answers(plc)[id]


def answers(plc: VirtualPlc) -> dict[int, Answer]:
    found = plc_map.answers_of(plc.read(3, plc_map.ANSWERS, plc_map.ANSWERS_WORDS))
    assert found is not None
    return {answer.id: answer for answer in found}


def events(plc: VirtualPlc, after: int = 0) -> list[DeviceEvent]:
    """The events in the ring, oldest first."""
    head = plc.read(3, plc_map.EVENTS, plc_map.EVENTS_WORDS)
    assert plc_map.is_whole(head)
    oldest, newest = head[3] << 16 | head[4], head[5] << 16 | head[6]
    size = plc_map.EVENT_WORDS
    rows = [
        plc.read(3, plc_map.EVENT_ROWS + n % head[1] * size, size) for n in range(max(oldest, after + 1), newest + 1)
    ]
    return [plc_map.event_of(row) for row in rows]


def refused(call: Callable[..., object], *arguments: object) -> int:
    with pytest.raises(DeviceException) as error:
        call(*arguments)
    return error.value.code


def stage(plc: VirtualPlc, *values: float) -> tuple[int, int]:
    """Write the staging area; count and check sum of what was written."""
    raw = pack(f">{len(values)}f", *values)
    plc.write(16, STAGING, unpack(f">{len(raw) // 2}H", raw))
    return len(raw) // 2, crc32(raw)


def settings(plc: VirtualPlc) -> list[float]:
    words = plc.read(3, SETTINGS, 8)
    assert plc_map.is_whole(words) and words[1] == 2
    return [real_of(words[at] << 16 | words[at + 1]) for at in (2, 4)]
