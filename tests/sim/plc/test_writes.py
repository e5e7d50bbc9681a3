"""What may be written where, and in which portions."""

import pytest

from app.errors import DeviceException
from app.registers import plc_map
from app.sim.plc.writes import check_write

STAGING = range(0x200, 0x206)
ACKNOWLEDGED = plc_map.EVENTS + plc_map.AT_ACKNOWLEDGED
HEARTBEAT = plc_map.HEADER + plc_map.AT_HOST_HEARTBEAT
COMMAND = [0] * (plc_map.COMMAND_WORDS - 1)
GOOD = [
    (plc_map.COMMAND, [*COMMAND, 1]),
    (plc_map.HOLD, [0] * plc_map.HOLD_WORDS),
    (ACKNOWLEDGED, [0, 5]),
    (HEARTBEAT, [9]),
    *((at, [0] * count) for at in STAGING for count in range(1, STAGING.stop - at + 1)),
]
BAD = [
    (plc_map.COMMAND, [*COMMAND, 0], 3),
    (plc_map.COMMAND, COMMAND, 3),
    (plc_map.COMMAND + 1, COMMAND, 3),
    (plc_map.COMMAND + plc_map.COMMAND_WORDS - 1, [1], 3),
    (plc_map.HOLD, [0] * (plc_map.HOLD_WORDS - 1), 3),
    (plc_map.HOLD + 1, [0], 3),
    (ACKNOWLEDGED, [5], 3),
    (ACKNOWLEDGED, [0, 6], 3),
    (ACKNOWLEDGED, [1, 0], 3),
    (HEARTBEAT, [1, 2], 2),
    (STAGING.start - 1, [0, 0], 2),
    (STAGING.stop - 1, [0, 0], 2),
    (STAGING.stop, [0], 2),
    (0x0000, [0], 2),
    (0xFFFF, [0], 2),
]


@pytest.mark.parametrize(("address", "words"), GOOD)
def test_whole_things_are_taken(address: int, words: list[int]) -> None:
    check_write("plc", address, words, newest=5, staging=STAGING)


@pytest.mark.parametrize(("address", "words", "code"), BAD)
def test_parts_and_other_places_are_refused_with_the_code_of_the_reason(
    address: int, words: list[int], code: int
) -> None:
    with pytest.raises(DeviceException) as refused:
        check_write("plc", address, words, newest=5, staging=STAGING)
    assert refused.value.code == code
