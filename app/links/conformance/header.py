"""Rules of the header and of the telegrams: who it is, how its numbers lie in the words, whether it lives, what it refuses."""

import asyncio

from app.errors import BadAnswer, DeviceException, LinkError, NoAnswer
from app.links.conformance.finding import Broken, Skipped, at, refusal, require, several, span
from app.links.conformance.server import Refusal
from app.links.conformance.subject import Look, Subject, number
from app.registers import plc_map

BETWEEN = 1.2
"""Between the two looks at the header that are compared [s]."""
SLACK, PART = 0.05, 0.05
"""How far the device's time may run from ours between them: [s], and part of it."""
SMALL = 1 << 32
"""Two looks at a number that counts scans or microseconds are never further apart."""
UNKNOWN_FUNCTION = 65
"""The first that Modbus leaves to users (application protocol 1.1b3, section 5)."""
MOST_SHOWN = 8
"""Bytes of an answer that is told as it came."""
BEYOND = 0xDFFF
"""A register behind the last row of every map and before the training registers."""
TRAINING_FLAG = 1


async def addressing(subject: Subject) -> None:
    """Registers count from 0: a header that begins at register 1 belongs to a server that is one off."""
    try:
        words = await subject.server.read(plc_map.HEADER, 1)
        if words[0] in (plc_map.MAGIC, _swapped(plc_map.MAGIC)):
            return
    except BadAnswer as error:
        raise Skipped("needs", "telegram") from error
    except LinkError:
        pass
    try:
        words = await subject.server.read(plc_map.HEADER + 1, 1)
    except LinkError as error:
        raise Skipped("needs", "header") from error
    subject.shifted = words[0] == plc_map.MAGIC
    require(not subject.shifted, at(1, f"0x{words[0]:04X}"), at(0, f"0x{plc_map.MAGIC:04X}"))
    raise Skipped("needs", "header")


async def header(subject: Subject) -> None:
    """All of it is one telegram."""
    if subject.shifted:
        raise Skipped("needs", "addressing")
    subject.first = await subject.look()


async def byte_order(subject: Subject) -> None:
    """A magic number with its bytes exchanged shows a server that exchanges those of every word."""
    word = _first(subject).words[plc_map.AT_MAGIC]
    require(word != _swapped(plc_map.MAGIC), at(0, f"0x{word:04X}"), at(0, f"0x{plc_map.MAGIC:04X}"))


async def magic(subject: Subject) -> None:
    """Word 0."""
    word = _first(subject).words[plc_map.AT_MAGIC]
    require(word == plc_map.MAGIC, at(0, f"0x{word:04X}"), f"0x{plc_map.MAGIC:04X}")


async def version(subject: Subject) -> None:
    """Word 1; a newer minor version is fine."""
    word = _first(subject).words[plc_map.AT_MAJOR]
    require(word == plc_map.MAJOR, at(plc_map.AT_MAJOR, word), f"{plc_map.MAJOR}")


async def type_code(subject: Subject) -> None:
    """Word 3."""
    word = _first(subject).words[plc_map.AT_TYPE]
    require(word == subject.map.type_code, at(plc_map.AT_TYPE, word), f"{subject.map.type_code}")


async def word_order(subject: Subject) -> None:
    """Numbers that must make sense with the high word first, and do only with the low one first, show the other order."""
    first, second = _first(subject), await _second(subject)
    wrong = []
    for address, words in ((plc_map.AT_TIME, 4), (plc_map.AT_STEP, 4)):
        ends = first.words[address : address + words], second.words[address : address + words]
        good, other = (number(ends[1]) - number(ends[0]), number(ends[1][::-1]) - number(ends[0][::-1]))
        if not 0 <= good < SMALL and 0 < other < SMALL:
            wrong.append(f"{span(address, words)}: +{other} (low word first)")
    wrong += await _ring_order(subject)
    wrong += await _settings_order(subject)
    require(not wrong, several(wrong), "{high_word_first}")


async def _ring_order(subject: Subject) -> list[str]:
    if not subject.map.events:
        return []
    try:
        words = await subject.server.read(plc_map.EVENTS, plc_map.EVENTS_WORDS)
    except LinkError:
        return []
    capacity = words[1]
    oldest, newest = words[plc_map.AT_OLDEST : plc_map.AT_OLDEST + 2], words[plc_map.AT_NEWEST : plc_map.AT_NEWEST + 2]
    good, other = number(newest) - number(oldest) + 1, number(newest[::-1]) - number(oldest[::-1]) + 1
    plausible = 0 <= good <= capacity and not (number(newest) and not newest[1])
    if plausible or not 0 < other <= capacity:
        return []
    where = plc_map.EVENTS + plc_map.AT_NEWEST
    return [f"{span(where, 2)} = {number(newest[::-1])} (low word first)"]


async def _settings_order(subject: Subject) -> list[str]:
    settings = subject.map.settings
    if settings is None:
        return []
    try:
        words = await subject.server.read(settings.address, settings.words)
    except LinkError:
        return []
    good = other = total = 0
    example = ""
    for point in subject.setpoints:
        limits = numeric_limits(subject, point.key)
        if limits is None or point.register is None:
            continue
        begin = point.register.address - settings.address
        pair = words[begin : begin + 2]
        total += 1
        good += limits[0] <= plc_map.real_of(number(pair)) <= limits[1]
        value = plc_map.real_of(number(pair[::-1]))
        if limits[0] <= value <= limits[1] and any(pair):
            other += 1
            example = example or f"{span(point.register.address, 2)} = {value:g} (low word first)"
    return [example] if total and good < total and other > good and example else []


def numeric_limits(subject: Subject, key: str) -> tuple[float, float] | None:
    """Least and greatest value of a setting as a float32 holds them; None when they depend on other points."""
    setpoint = subject.kind.setpoints.get(key)
    try:
        low, high = float(setpoint.low), float(setpoint.high)  # type: ignore[union-attr]
    except (ValueError, AttributeError):
        return None
    return plc_map.real_of(plc_map.real(low)), plc_map.real_of(plc_map.real(high))


async def heartbeat(subject: Subject) -> None:
    """Word 8 rises with every scan, that is as fast as the step number where that counts."""
    first, second = _first(subject), await _second(subject)
    beats = _risen(first, second)
    before, after = first.words[plc_map.AT_HEARTBEAT], second.words[plc_map.AT_HEARTBEAT]
    require(beats, f"{at(plc_map.AT_HEARTBEAT, before)}, {second.asked - first.asked:.1f} s: {after}", "{each_scan}")
    scans = second.long(plc_map.AT_STEP, 4) - first.long(plc_map.AT_STEP, 4)
    if 0 < scans < SMALL:
        apart = min(beats - scans & 0xFFFF, scans - beats & 0xFFFF)
        require(apart <= 1, f"0x0008: +{beats}, {span(plc_map.AT_STEP, 4)}: +{scans}", f"0x0008: +{scans & 0xFFFF}")


async def step_number(subject: Subject) -> None:
    """Words 19-22 count the scans."""
    first, second = _first(subject), await _second(subject)
    if not _risen(first, second):
        raise Skipped("needs", "heartbeat")
    scans = second.long(plc_map.AT_STEP, 4) - first.long(plc_map.AT_STEP, 4)
    require(0 < scans < SMALL, f"{span(plc_map.AT_STEP, 4)}: {scans:+d}", f"+{_risen(first, second)}")


async def device_time(subject: Subject) -> None:
    """Words 11-14 are microseconds: they run as our clock does."""
    first, second = _first(subject), await _second(subject)
    least = (second.asked - first.answered) * (1 - PART) - SLACK
    most = (second.answered - first.asked) * (1 + PART) + SLACK
    scan = max(first.words[plc_map.AT_SCAN], second.words[plc_map.AT_SCAN]) / 1e6
    seen = second.long(plc_map.AT_TIME, 4) - first.long(plc_map.AT_TIME, 4)
    good = (least - scan) * 1e6 <= seen <= (most + scan) * 1e6
    require(good, f"{span(plc_map.AT_TIME, 4)}: {seen:+d}", f"{least * 1e6:+.0f} … {most * 1e6:+.0f} µs")


async def time_quality(subject: Subject) -> None:
    """Word 15."""
    word = _first(subject).words[plc_map.AT_TIME_QUALITY]
    require(word <= max(plc_map.TimeQuality), at(plc_map.AT_TIME_QUALITY, word), "0 … 2")


async def scan_time(subject: Subject) -> None:
    """The longest scan is not shorter than the last one."""
    words = _first(subject).words
    last, longest = words[plc_map.AT_SCAN], words[plc_map.AT_SCAN_MAX]
    require(last <= longest, f"{at(plc_map.AT_SCAN, last)}, {at(plc_map.AT_SCAN_MAX, longest)}", "0x0010 ≤ 0x0011")


async def training(subject: Subject) -> None:
    """Training registers tell a simulated device from a real one: the flag says the same."""
    simulated = bool(_first(subject).words[plc_map.AT_FLAGS] & plc_map.SIMULATED)
    base = subject.kind.device.training
    try:
        words = await subject.server.read(base, 2)
    except DeviceException as error:
        seen = f"0x{base:04X}: {refusal(error)}"
        require(
            not simulated and error.code == 2, seen, at(base, f"0x{plc_map.MAGIC:04X}") if simulated else "exception 02"
        )
        return
    except BadAnswer as error:
        raise Skipped("needs", "telegram") from error
    except NoAnswer as error:
        raise Broken(f"0x{base:04X}: {{no_answer}}", "exception 02") from error
    there = words[0] == plc_map.MAGIC and words[1] & TRAINING_FLAG
    seen = f"0x{base:04X} = 0x{words[0]:04X}, {at(plc_map.AT_FLAGS, _first(subject).words[plc_map.AT_FLAGS])}"
    require(simulated and there, seen, at(base, f"0x{plc_map.MAGIC:04X}") if simulated else "exception 02")


async def functions(subject: Subject) -> None:
    """A function that is not served is refused with 01."""
    came = await _refusal_of(subject, bytes((UNKNOWN_FUNCTION, 0)), f"{UNKNOWN_FUNCTION}")
    require(came.code == 1, f"{UNKNOWN_FUNCTION}: {_told(came)}", "exception 01")


async def counts(subject: Subject) -> None:
    """No telegram has 0 registers or more than 125."""
    wrong = []
    for count in (0, 126):
        try:
            came = await subject.server.refusal_of_read(plc_map.HEADER, count)
        except NoAnswer:
            wrong.append(f"0x0000 + {count}: {{no_answer}}")
            continue
        if came.code != 3:
            wrong.append(f"0x0000 + {count}: {_told(came)}")
    require(not wrong, several(wrong), "exception 03")


async def beyond(subject: Subject) -> None:
    """What lies behind the last row of the map is not there."""
    try:
        came = await subject.server.refusal_of_read(BEYOND, 1)
    except NoAnswer as error:
        raise Broken(f"0x{BEYOND:04X}: {{no_answer}}", "exception 02") from error
    require(came.code == 2, f"0x{BEYOND:04X}: {_told(came)}", "exception 02")


async def telegram(subject: Subject) -> None:
    """Every answer so far was one to its request: function, byte count, length, echo."""
    require(not subject.server.malformed, subject.server.malformed, "Modbus 1.1b3")


async def timing(subject: Subject) -> None:
    """Every answer came within the time that the type's data give it."""
    server, limit = subject.server, subject.kind.device.timeout
    seen = f"0x{server.slowest_at:04X}: {server.slowest * 1000:.0f} ms"
    require(server.slowest <= limit, seen, f"≤ {limit * 1000:.0f} ms")


async def _refusal_of(subject: Subject, pdu: bytes, what: str) -> Refusal:
    try:
        return await subject.server.refusal_of(pdu)
    except NoAnswer as error:
        raise Broken(f"{what}: {{no_answer}}", "exception 01") from error


def _told(came: Refusal) -> str:
    """What is neither a refusal of the request nor an answer to it stands there byte by byte."""
    if came.code:
        return f"exception {came.code:02d}"
    return "✓" if came.answered else came.answer[:MOST_SHOWN].hex(" ").upper() or "–"


def _swapped(word: int) -> int:
    return word >> 8 | (word & 0xFF) << 8


def _first(subject: Subject) -> Look:
    if subject.first is None:
        raise Skipped("needs", "header")
    return subject.first


async def _second(subject: Subject) -> Look:
    if subject.second is None:
        pause = _first(subject).answered + BETWEEN - asyncio.get_running_loop().time()
        await asyncio.sleep(max(0.0, pause))
        subject.second = await subject.look()
    return subject.second


def _risen(first: Look, second: Look) -> int:
    return second.words[plc_map.AT_HEARTBEAT] - first.words[plc_map.AT_HEARTBEAT] & 0xFFFF
