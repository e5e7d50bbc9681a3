"""Our virtual PLCs keep every rule of the map; a server that breaks one is told that rule and no other."""

import asyncio
import re
import struct
from collections.abc import Callable
from struct import pack, unpack
from zlib import crc32

import pytest

from app.errors import NoAnswer
from app.links.conformance.examination import RULES
from app.links.conformance.finding import WORDS, State
from app.registers import plc_map
from app.sim.bus import Bus
from tests.conftest import ROOT
from tests.links.conformance.servers import (
    KINDS,
    Faulty,
    Put,
    command,
    data_of,
    judged,
    reading,
    rules_in,
    scanning,
    writing,
)

STATUS, CONFIGURATION, SETTINGS, STAGING, TABLE = 0x0100, 0x0180, 0x0200, 0x0240, 0x0800
"""Of the conveyor (docs/registers/conveyor.md)."""
HAS_NONE = {"coil_car": {"tables", "rows"}, "conveyor": set(), "crane": {"tables", "rows"}, "sequence": {"hold"}}
"""Rules that have nothing to judge in a type: it has no tables, or no hold-to-run."""
WRITES = {rule.name for rule in RULES if rule.writes}


@pytest.mark.parametrize("kind", KINDS)
async def test_a_virtual_plc_keeps_every_rule(kind: str) -> None:
    async with scanning(kind) as (bus, unit):
        bus.answer(unit, command(2, 40_000))  # so that there is an answer to look at
        await asyncio.sleep(0.1)
        found = await judged(Faulty(bus, unit), kind)
    assert not rules_in(found, State.BROKEN), [finding for finding in found.values() if finding.state is State.BROKEN]
    skipped = {rule for rule in rules_in(found, State.SKIPPED) if found[rule].why != "own_reason"}
    assert skipped == HAS_NONE[kind]
    assert {found[rule].why for rule in skipped} <= {"none"}, "not that its tables are to be mended first"
    assert len(found) == len(RULES)


@pytest.mark.parametrize("kind", KINDS)
async def test_without_write_nothing_is_written(kind: str) -> None:
    async with scanning(kind) as (bus, unit):
        server = Faulty(bus, unit)
        asked: list[int] = []

        async def listening(pdu: bytes) -> bytes:
            asked.append(pdu[0])
            return await server(pdu)

        found = await judged(listening, kind, write=False)
    assert set(asked) == {3, 65}
    assert rules_in(found, State.SKIPPED) == WRITES | HAS_NONE[kind]
    assert not rules_in(found, State.BROKEN)


async def test_what_is_written_moves_nothing() -> None:
    """All that a machine is told with --write: its own words afterwards are as if nobody had asked."""
    async with scanning("conveyor") as (bus, unit):
        device = bus.devices[unit]
        before = device.read(3, SETTINGS, 34), device.read(3, STATUS + 2, 1)
        events = device.read(3, plc_map.EVENTS + plc_map.AT_NEWEST, 2)
        told: list[int] = []

        async def listening(pdu: bytes) -> bytes:
            if pdu[0] == 16 and pdu[1:3] == b"\x03\x00" and len(pdu) == 38:
                told.append(unpack(">H", pdu[6:8])[0])
            if pdu[0] == 16 and pdu[1:3] == b"\x03\x80":
                assert unpack(">H", pdu[6:8])[0] == 0, "a button"
            return await Faulty(bus, unit)(pdu)

        await judged(listening, "conveyor")
        assert set(told) == {0xFFFF, 0x00F0}
        assert (device.read(3, SETTINGS, 34), device.read(3, STATUS + 2, 1)) == before
        newest = device.read(3, plc_map.EVENTS + plc_map.AT_NEWEST, 2)[1]
        codes = {device.read(3, plc_map.EVENT_ROWS + (n % 59) * 17 + 6, 1)[0] for n in range(events[1] + 1, newest + 1)}
        assert not codes & {30, 31, 32, 33, 38, 41}, "started, stopped, chosen or set"


async def test_a_server_that_is_not_writable_is_not_written_to() -> None:
    async with scanning("conveyor") as (bus, unit):
        found = await judged(Put(bus, unit, {plc_map.AT_FLAGS: 1}), "conveyor")
    assert {rule for rule in found if found[rule].why == "not_writable"} == WRITES


@pytest.mark.parametrize("kind", KINDS)
def test_every_rule_names_a_heading_that_the_page_has(kind: str) -> None:
    page = (ROOT / "docs" / "registers" / f"{kind}.md").read_text("utf-8")
    headings = [line.removeprefix("## ") for line in page.splitlines() if line.startswith("## ")]
    for rule in RULES:
        if rule.name not in HAS_NONE[kind]:
            assert not rule.section or any(head.startswith(rule.section) for head in headings), rule.name


def test_every_need_is_judged_before() -> None:
    names = [rule.name for rule in RULES]
    assert len(set(names)) == len(names)
    for place, rule in enumerate(RULES):
        assert set(rule.needs) <= set(names[:place]), rule.name


# ---- one break for each rule ---------------------------------------------------------------------------------


class OneOff(Faulty):
    """Counts registers from 1."""

    def refuses(self, pdu: bytes) -> int:
        return 2 if pdu[0] in (3, 6, 16) and pdu[1:3] == b"\0\0" else 0

    def request(self, pdu: bytes) -> bytes:
        if pdu[0] not in (3, 6, 16):
            return pdu
        return pdu[:1] + pack(">H", unpack(">H", pdu[1:3])[0] - 1) + pdu[3:]


class HeaderInParts(Faulty):
    def refuses(self, pdu: bytes) -> int:
        return 3 if reading(pdu, 0) and pdu[4] == 32 else 0


class SwappedBytes(Faulty):
    def words(self, address: int, words: list[int]) -> None:
        words[:] = [word >> 8 | (word & 0xFF) << 8 for word in words]


class SwappedWords(Faulty):
    """Low word first, in the numbers of these places."""

    places: tuple[tuple[int, int], ...] = ()

    def words(self, address: int, words: list[int]) -> None:
        for place, size in self.places:
            if 0 <= place - address <= len(words) - size:
                words[place - address : place - address + size] = words[place - address : place - address + size][::-1]


class SwappedSettings(SwappedWords):
    places = tuple((SETTINGS + 2 + 2 * n, 2) for n in range(15))


class SwappedTime(SwappedWords):
    places = ((11, 4),)


class SwappedStep(SwappedWords):
    places = ((19, 4),)


class SwappedRing(SwappedWords):
    places = ((0x0403, 2), (0x0405, 2), (0x0407, 2))


class BeatPerRead(Faulty):
    def words(self, address: int, words: list[int]) -> None:
        if address == 0 and len(words) > 8:
            words[8] = self.requests


class Milliseconds(Faulty):
    def words(self, address: int, words: list[int]) -> None:
        if address == 0 and len(words) > 14:
            words[11:15] = plc_map.time_words(plc_map.time_of(words[11:15]) // 1000)


class AnswersAnyFunction(Faulty):
    def wire(self, pdu: bytes, answer: bytes) -> bytes:
        return pdu if pdu[0] == 65 else answer


def refuses_nothing(request: bytes) -> type[Faulty]:
    """A server that refuses what begins with `request` as function 0, as one of pymodbus 3.16 does with all that it does not decode."""

    class RefusesNothing(Faulty):
        def wire(self, pdu: bytes, answer: bytes) -> bytes:
            return b"\x80\x01" if pdu.startswith(request) else answer

    return RefusesNothing


class Refuses(Faulty):
    """Answers requests that `which` names with the exception `code`."""

    code = 2

    def which(self, pdu: bytes) -> bool:
        raise NotImplementedError

    def refuses(self, pdu: bytes) -> int:
        return self.code if self.which(pdu) else 0


class WrongCountIsAddress(Refuses):
    def which(self, pdu: bytes) -> bool:
        return pdu[0] == 3 and pdu[4] == 126


class AnswersEverything(Faulty):
    """As a server whose whole address space is one memory."""

    def wire(self, pdu: bytes, answer: bytes) -> bytes:
        return bytes((3, 2, 0, 0)) if reading(pdu, 0xDFFF) else answer


class SmallImages(Refuses):
    code = 3

    def which(self, pdu: bytes) -> bool:
        return reading(pdu, STATUS) and pdu[4] > 60


class StillGeneration(Put):
    def __init__(self, bus: Bus, unit: int) -> None:
        super().__init__(bus, unit, {STATUS: 2, STATUS + 95: 2})
        self.encoder = 0

    def words(self, address: int, words: list[int]) -> None:
        super().words(address, words)
        if address == STATUS:
            words[0x37] = self.encoder = self.encoder + 1 & 0xFFFF


class ShiftedRows(Faulty):
    def words(self, address: int, words: list[int]) -> None:
        if 0x0410 <= address < 0x0800:
            for row in range(0, len(words), 17):
                words[row : row + 2] = plc_map.long_words((words[row] << 16 | words[row + 1]) + 1)


class EventRows(Faulty):
    """Other words in every row of the ring."""

    place, word = 6, 999

    def words(self, address: int, words: list[int]) -> None:
        if 0x0410 <= address < 0x0800:
            for row in range(0, len(words), 17):
                words[row + self.place] = self.word


class EventsOfTheFuture(EventRows):
    place, word = 2, 1


class NoHeartbeatIn(Put):
    def __init__(self, bus: Bus, unit: int) -> None:
        super().__init__(bus, unit, {9: 0xABCD})


class HeartbeatRefused(Refuses):
    def which(self, pdu: bytes) -> bool:
        return writing(pdu, 9)


class HoldRefused(Refuses):
    def which(self, pdu: bytes) -> bool:
        return writing(pdu, 0x0380)


class TakesParts(Faulty):
    """Takes a command of 15 words for one of 16."""

    def request(self, pdu: bytes) -> bytes:
        if writing(pdu, 0x0300) and pdu[5] == 30:
            return pdu[:4] + bytes((16, 32)) + pdu[6:] + pack(">H", 4711)
        return pdu

    def wire(self, pdu: bytes, answer: bytes) -> bytes:
        return answer[:4] + bytes((15,)) if writing(pdu, 0x0300) and pdu[5] == 30 and len(answer) == 5 else answer


class DoesTheUnknown(Faulty):
    """Says of every command that it is done."""

    def words(self, address: int, words: list[int]) -> None:
        if address == 0x0320:
            for row in range(1, 65, 8):
                if words[row]:
                    words[row + 1], words[row + 2] = 3, 0


class ExecutesAgain(Faulty):
    """Executes a command whose id it knows once more."""

    def __init__(self, bus: Bus, unit: int) -> None:
        super().__init__(bus, unit)
        self.heard: list[int] = []

    def request(self, pdu: bytes) -> bytes:
        if writing(pdu, 0x0300) and len(pdu) == 38:
            self.heard.append(unpack(">H", pdu[-2:])[0])
        return pdu

    def words(self, address: int, words: list[int]) -> None:
        if address == 0x0320:
            for row in range(1, 65, 8):
                words[row + 7] = words[row + 7] + max(0, self.heard.count(words[row]) - 1) & 0xFFFF


class Unstaged(Faulty):
    """Settings are in effect as soon as they are written."""

    staged: tuple[int, ...] = ()

    def request(self, pdu: bytes) -> bytes:
        if writing(pdu, STAGING):
            self.staged = unpack(f">{pdu[4]}H", pdu[6:])
        return pdu

    def words(self, address: int, words: list[int]) -> None:
        if address == SETTINGS and self.staged:
            words[2 : 2 + len(self.staged)] = self.staged


class AnyCheckSum(Faulty):
    """Does not look at the check sum of a set."""

    staged = b""

    def request(self, pdu: bytes) -> bytes:
        if writing(pdu, STAGING):
            self.staged = pdu[6:]
        if writing(pdu, 0x0300) and len(pdu) == 38 and pdu[6:8] == b"\x00\xf0":
            return pdu[:16] + pack(">I", crc32(self.staged)) + pdu[20:]
        return pdu


class AcknowledgeRefused(Refuses):
    def which(self, pdu: bytes) -> bool:
        return writing(pdu, 0x0407)


class WrongByteCount(Faulty):
    def wire(self, pdu: bytes, answer: bytes) -> bytes:
        return answer[:1] + bytes((answer[1] - 2,)) + answer[2:] if reading(pdu, 0x0400) else answer


class WrongEcho(Faulty):
    def wire(self, pdu: bytes, answer: bytes) -> bytes:
        return answer[:-1] + b"\x09" if writing(pdu, 0x0380) else answer


class Slow(Faulty):
    async def __call__(self, pdu: bytes) -> bytes:
        if reading(pdu, CONFIGURATION):
            await asyncio.sleep(0.4)
        return await super().__call__(pdu)


class Silent(Faulty):
    async def __call__(self, pdu: bytes) -> bytes:
        raise NoAnswer("silence")


class SilentTable(Faulty):
    async def __call__(self, pdu: bytes) -> bytes:
        if reading(pdu, TABLE):
            raise NoAnswer("silence")
        return await super().__call__(pdu)


def put(words: dict[int, int | Callable[[int], int]]) -> Callable[[Bus, int], Faulty]:
    return lambda bus, unit: Put(bus, unit, words)


BREAKS: list[tuple[str, str, Callable[[Bus, int], Faulty], str]] = [
    ("addressing", "registers count from 1", OneOff, "0x0001 = 0x5047"),
    ("header", "nobody answers", Silent, "{no_answer}"),
    ("header", "not in one telegram", HeaderInParts, "exception 03"),
    ("byte_order", "little-endian", SwappedBytes, "0x4750"),
    ("magic", "another number", put({0: 0x1234}), "0x1234"),
    ("version", "major 2", put({1: 2}), "0x0001 = 2"),
    ("type_code", "another type", put({3: 99}), "0x0003 = 99"),
    ("word_order", "settings", SwappedSettings, "= 30 (low word first)"),
    ("word_order", "time", SwappedTime, "0x000B–0x000E"),
    ("word_order", "step number", SwappedStep, "0x0013–0x0016"),
    ("word_order", "ring", SwappedRing, "0x0405–0x0406"),
    ("heartbeat", "stands", put({8: 5}), "0x0008 = 5"),
    ("heartbeat", "one per read", BeatPerRead, "0x0008: +"),
    ("step_number", "stands", put({19: 0, 20: 0, 21: 0, 22: 7}), "+0"),
    ("device_time", "milliseconds", Milliseconds, "0x000B–0x000E"),
    ("time_quality", "7", put({15: 7}), "0x000F = 7"),
    ("scan_time", "last longer than longest", put({16: 500, 17: 100}), "0x0010 = 500"),
    ("training", "flag of a real one", put({6: 2}), "0x0006 = 2"),
    ("functions", "answers 65", AnswersAnyFunction, "65: ✓"),
    ("functions", "refuses function 0", refuses_nothing(b"A"), "65: 80 01"),
    ("counts", "refuses function 0", refuses_nothing(b"\x03\0\0\0\x7e"), "0x0000 + 126: 80 01"),
    ("counts", "126 is an address", WrongCountIsAddress, "126: exception 02"),
    ("beyond", "answers everything", AnswersEverything, "0xDFFF: ✓"),
    ("beyond", "refuses function 0", refuses_nothing(b"\x03\xdf\xff"), "0xDFFF: 80 01"),
    ("images", "at most 60 words", SmallImages, "0x0100–0x015F: exception 03"),
    ("generation", "ends with another", put({STATUS + 95: lambda word: word + 2}), "0x015F"),
    ("generation", "odd", put({CONFIGURATION: 3, CONFIGURATION + 63: 3}), "0x0180 = 3"),
    ("generation", "of the answers", put({0x0361: lambda word: word + 2}), "0x0361"),
    ("swap", "the same after a change", StillGeneration, "0x0100 = 2, 0x01"),
    ("spare", "something in it", put({0x0109: 7}), "0x0109 = 7"),
    ("values", "state 99", put({STATUS + 1: 99}), "0x0101 = 99"),
    ("settings", "too few", put({SETTINGS + 1: 14}), "0x0201 = 14"),
    ("settings", "outside", put({SETTINGS + 2: 0x43FA, SETTINGS + 3: 0}), "0x0202 = 500"),
    ("ring", "too small", put({0x0401: 8}), "0x0401 = 8"),
    ("ring", "rows of 12 words", put({0x0402: 12}), "0x0402 = 12"),
    ("ring", "more than it has", put({0x0406: lambda word: word + 100}), "0x0405"),
    ("ring_rows", "one further", ShiftedRows, "0x0"),
    ("event_codes", "unknown", EventRows, ": 999"),
    ("event_time", "of the future", EventsOfTheFuture, ": 28147"),
    ("answers", "state 9", put({0x0322: 9}), "0x0322 = 9"),
    ("tables", "rows of 23 words", put({TABLE + 3: 23}), "0x0803 = 23"),
    ("tables", "silent", SilentTable, "{no_answer}"),
    ("rows", "torn", put({TABLE + 6: 4}), "0x0806 = 4"),
    ("rows", "a state that is none", put({TABLE + 7: 17}), "0x0807 = 17"),
    ("host_heartbeat", "not shown", NoHeartbeatIn, "0x0009 = 43981"),
    ("host_heartbeat", "refused", HeartbeatRefused, "exception 02"),
    ("hold", "refused", HoldRefused, "0x0380–0x0383: exception 02"),
    ("telegram", "echo", WrongEcho, "0x0380: echo"),
    ("command_whole", "15 words", TakesParts, "0x0300–0x030E"),
    ("command_answer", "done", DoesTheUnknown, "3, 0"),
    ("command_once", "executed again", ExecutesAgain, "µs"),
    ("staging", "in effect at once", Unstaged, "0x0202 = 16879"),
    ("commit", "any check sum", AnyCheckSum, "3, 0"),
    ("acknowledge", "refused", AcknowledgeRefused, "0x0407–0x0408: exception 02"),
    ("telegram", "byte count", WrongByteCount, "0x0400"),
    ("timing", "400 ms", Slow, "0x0180: 400 ms"),
]


FIRST_ROW = struct.pack(">BHH", 3, TABLE + 7, 1)
"""Asks for the state of the first row of the products; 0 = it is free."""


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("rule", "broken", "seen"),
    [(rule, broken, seen) for rule, _, broken, seen in BREAKS],
    ids=[f"{r}: {w}" for r, w, *_ in BREAKS],
)
async def test_a_break_is_found_and_no_other_rule_is_blamed(
    rule: str, broken: Callable[[Bus, int], Faulty], seen: str
) -> None:
    async with scanning("conveyor") as (bus, unit):
        for _ in range(600):  # a product on the belt: its row can be broken
            if any((bus.answer(unit, FIRST_ROW).pdu or b"")[2:]):
                break
            await asyncio.sleep(0.1)
        bus.answer(unit, command(3, 41_000))
        await asyncio.sleep(0.1)
        found = await judged(broken(bus, unit), "conveyor")
    assert rules_in(found, State.BROKEN) == {rule}, [one for one in found.values() if one.state is State.BROKEN]
    assert seen in found[rule].seen
    assert found[rule].expected
    told = found[rule].seen + found[rule].expected
    assert set(re.findall(r"\{(.*?)\}", told)) <= set(WORDS) and not re.search("[—≠]|= ?$|2n| × 0", told), told


def test_every_rule_is_broken_by_some_server() -> None:
    assert {rule for rule, *_ in BREAKS} == {rule.name for rule in RULES}
    assert data_of("conveyor").type.name == "conveyor"
