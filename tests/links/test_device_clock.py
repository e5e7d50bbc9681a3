"""The clock of a device that is read with its header."""

import pytest

from app.links.device_clock import DeviceClock
from app.registers import plc_map
from app.registers.plc_map import TimeQuality


def header(boots: int, time: int, quality: int = 0) -> list[int]:
    words = [0] * plc_map.HEADER_WORDS
    words[plc_map.AT_BOOTS], words[plc_map.AT_TIME_QUALITY] = boots, quality
    words[plc_map.AT_TIME : plc_map.AT_TIME_QUALITY] = plc_map.time_words(time)
    return words


def take(clock: DeviceClock, words: list[int], asked: int, answered: int, ahead: int = 0) -> bool:
    """What was read between these [µs] while our wall clock was so much ahead."""
    return clock.header(words, 0, asked / 1e6, answered / 1e6, answered + ahead)


def test_the_offset_is_kept_until_it_is_wrong_by_more_than_50_ms() -> None:
    clock = DeviceClock()
    assert not take(clock, header(1, 1_000_000), 50_000_000, 50_002_000)
    assert clock.utc(1_000_000) == 50_001_000
    take(clock, header(1, 2_000_000), 51_040_000, 51_041_000)
    assert clock.utc(2_000_000) == 51_001_000, "40 ms are not worth a jump"
    take(clock, header(1, 3_000_000), 52_000_000, 53_000_000)
    assert clock.utc(3_000_000) == 52_001_000, "a slow answer says nothing against it"
    take(clock, header(1, 4_000_000), 53_080_000, 53_082_000)
    assert clock.utc(4_000_000) == 53_081_000


def test_a_device_that_keeps_utc_is_believed() -> None:
    clock = DeviceClock()
    take(clock, header(1, 1_700_000_000_000_000, 2), 5, 6)
    assert clock.utc(1_700_000_000_000_123) == 1_700_000_000_000_123


def test_what_happened_before_a_restart_keeps_the_time_that_it_had() -> None:
    clock = DeviceClock()
    take(clock, header(1, 1_000_000), 50_000_000, 50_000_000)
    assert take(clock, header(2, 1_200_000), 80_000_000, 80_000_000)
    assert (clock.utc(900_000), clock.boot(900_000)) == (49_900_000, 1)
    assert (clock.utc(1_200_000), clock.boot(1_200_000)) == (80_000_000, 2)
    assert not take(clock, header(2, 1_100_000), 79_990_000, 80_000_000), "overtaken on another connection"
    assert not take(clock, header(2, 1_190_000), 80_000_000, 80_001_000), "served out of order"
    take(clock, header(2, 1_200_000), 80_000_000, 80_000_000)
    assert take(clock, header(1, 10_000), 90_000_000, 90_000_000), "its time began anew"
    assert (clock.utc(5_000), clock.boot(5_000)) == (89_995_000, 1)
    assert clock.utc(1_100_000) == 79_900_000


@pytest.mark.parametrize("step", [-86_400, -3600, -1, 1, 3600, 86_400])
def test_a_wall_clock_that_is_set_hides_no_restart_and_moves_what_happens_then(step: int) -> None:
    clock, ahead = DeviceClock(), step * 1_000_000
    take(clock, header(1, 1_000_000), 50_000_000, 50_000_000)
    assert not take(clock, header(1, 2_000_000), 51_000_000, 51_000_000, ahead), "it goes on"
    assert clock.utc(2_000_000) == 51_000_000 + ahead
    assert not take(clock, header(1, 1_999_000), 50_999_000, 51_000_000, ahead), "overtaken on another connection"
    assert take(clock, header(2, 10_000), 60_000_000, 60_000_000, ahead)
    assert (clock.utc(10_000), clock.boot(10_000)) == (60_000_000 + ahead, 2)


@pytest.mark.parametrize("halted", [False, True])
def test_a_program_that_is_known_to_stand_needs_no_second_header_for_that(halted: bool) -> None:
    clock = DeviceClock()
    take(clock, header(1, 1_000_000), 50_000_000, 50_000_000)
    assert clock.header(header(2, 1_010_000), 0, 58.01, 58.01, 58_010_000, halted=halted)
    assert clock.utc(1_000_000) == (58_000_000 if halted else 50_000_000)


@pytest.mark.parametrize("stood", [False, True])
def test_the_first_event_of_a_start_after_a_standstill_is_none_of_the_start_before(stood: bool) -> None:
    """Its program stands, so does the clock that counts its scans; whoever switches it off and on begins at the time at which it stood."""
    clock = DeviceClock()
    take(clock, header(1, 900_000 + 100_000 * stood), 49_000_000, 49_000_000)
    take(clock, header(1, 1_000_000), 50_000_000, 50_000_000)
    assert take(clock, header(2, 1_010_000), 58_010_000, 58_010_000)
    assert clock.boot(1_000_000) == (2 if stood else 1)
    assert clock.utc(1_000_000) == (58_000_000 if stood else 50_000_000)
    assert (clock.utc(999_000), clock.boot(999_000)) == (49_999_000, 1)


def test_a_start_whose_clock_stands_where_the_one_before_was_seen_last_begins_with_its_own_event() -> None:
    """Frozen right after that header and switched off and on before the next: nothing else ever says that it stood."""
    clock = DeviceClock()
    take(clock, header(1, 1_000_000), 50_000_000, 50_000_000)
    take(clock, header(1, 1_040_000), 51_000_000, 51_000_000)
    assert take(clock, header(2, 1_040_000), 51_700_000, 51_700_000)
    assert (clock.utc(1_040_000), clock.boot(1_040_000)) == (51_700_000, 2)
    assert (clock.utc(1_030_000), clock.boot(1_030_000)) == (50_990_000, 1)


@pytest.mark.parametrize("time", [2**64 - 1, 2**63, 10**18])
def test_a_time_that_no_calendar_has_is_none(time: int) -> None:
    """Of a device that keeps UTC itself, or says that it does: an event has the time then at which it was read."""
    clock = DeviceClock()
    take(clock, header(1, 1_700_000_000_000_000, TimeQuality.SYNCHRONISED), 5, 6)
    assert (clock.utc(time), clock.utc(time, instead=1_700_000_000_500_000)) == (0, 1_700_000_000_500_000)
