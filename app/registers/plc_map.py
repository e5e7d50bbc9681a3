"""The registers that every Pogon PLC has in the same place, and their words (reference/register-map.md).

What a machine adds (status, setpoints, tables) stands in its type; `docs/registers/<type>.md` has the whole. Both ends use this file: the
virtual PLC to answer, the link to ask. Big-endian words, high word first.

| registers | content |
| --- | --- |
| 0–31 | header |
| 0x0100 … | images of the type: each begins with a generation word that is repeated as its last word |
| 0x0300–0x030F | command, written with one function 16 |
| 0x0320–0x0361 | answers: generation, the last 8 answers of 8 words with the newest first, generation |
| 0x0380–0x0383 | hold-to-run: request bits, counter, argument f32 |
| 0x0400–0x0409 | events, head: generation, capacity, words per row, oldest u32, newest u32, acknowledged u32, generation |
| 0x0410–0x07FF | events: row `sequence % capacity` of 17 words; 59 fit, capacity and words per row are in the head |
| 0x0800 … | tables: generation, capacity, count, words per row, then the rows |
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from struct import pack, unpack

MAGIC = 0x5047
MAJOR = 1
MINOR = 6
"""1: an event says which command caused it (word 16 of its row). 2: a conveyor keeps the last start and stop of its belts.
3: each of its belts may run at a share of the speed. 4: it may have a scanner. 5: it may have diverting gates.
6: lanes may join it at merging gates."""

HEADER = 0
HEADER_WORDS = 32
AT_MAGIC, AT_MAJOR, AT_MINOR, AT_TYPE, AT_CRC, AT_FLAGS, AT_BOOTS = 0, 1, 2, 3, 4, 6, 7
AT_HEARTBEAT, AT_HOST_HEARTBEAT, AT_HOST_TIMEOUT = 8, 9, 10
AT_TIME, AT_TIME_QUALITY = 11, 15
AT_SCAN, AT_SCAN_MAX, AT_OVERRUNS, AT_STEP, AT_CAPACITIES = 16, 17, 18, 19, 23
"""Words of the header; `AT_CAPACITIES` begins nine words that the type names."""

SIMULATED, WRITABLE, LOCAL = 1, 2, 4
"""Bits of the flags word."""


class TimeQuality(IntEnum):
    """What the time of a device is worth."""

    FREE = 0
    """Counts since the device was first switched on: only differences mean anything."""
    SET = 1
    SYNCHRONISED = 2


COMMAND = 0x0300
COMMAND_WORDS = 16
ANSWERS = 0x0320
ANSWER_WORDS = 8
ANSWERS_KEPT = 8
ANSWERS_WORDS = 2 + ANSWERS_KEPT * ANSWER_WORDS
HOLD = 0x0380
HOLD_WORDS = 4
HOLD_TIMEOUT = 0.5
"""A counter unchanged for this long means released [s]."""

EVENTS = 0x0400
EVENTS_WORDS = 10
AT_OLDEST, AT_NEWEST, AT_ACKNOWLEDGED = 3, 5, 7
"""Words of the head of the ring; the acknowledged sequence is written by the host."""
EVENT_ROWS = 0x0410
EVENTS_END = 0x0800
"""Behind the last row of the ring."""
EVENT_WORDS = 17
LEAST_EVENT_WORDS = 16
"""Of a device of map 1.0: its events do not say which command caused them. Words behind those that we know are ignored."""
AT_REQUEST = 16
SNAPSHOT_WORDS = 6

TABLE_HEAD = 4
"""Words before the rows of a table: generation of its structure, capacity, rows to read, words per row."""

ROW_GENERATION, ROW_STATE = 2, 3
"""Words of a row behind its id; the last word of a row repeats its generation."""

COMMIT_SETTINGS = 0x00F0
"""Command code that makes staged setpoints valid: arguments count, CRC of the staged words."""


class AnswerState(IntEnum):
    """What became of a command."""

    NONE = 0
    ACCEPTED = 1
    RUNNING = 2
    DONE = 3
    REJECTED = 4
    FAILED = 5
    EXPIRED = 6


@dataclass(frozen=True, slots=True)
class Request:
    """The 16 words of a command: code, owner, expected state, four arguments of two words, four spare words, request id (last word)."""

    code: int
    owner: int = 0
    """Who asks, for the device's own records."""
    expected: int = 0
    """State that the person saw; the device rejects when it is another; 0 = any."""
    arguments: Sequence[int] = (0, 0, 0, 0)
    """Raw 32-bit words; `real` makes one of a number."""
    id: int = 0
    """1–65535; the same id gives the same answer and is not executed again."""


@dataclass(frozen=True, slots=True)
class Answer:
    """One answer of a device."""

    id: int
    state: AnswerState
    reason: int = 0
    """Why not; texts are the type's (`reason.<n>`)."""
    detail: int = 0
    time: int = 0
    """Device time [µs]."""


@dataclass(frozen=True, slots=True)
class DeviceEvent:
    """One row of the event ring."""

    sequence: int
    """1 … 2³²−1, rises by one."""
    time: int
    """Device time [µs]."""
    code: int
    """Texts are the type's (`event.<n>`)."""
    source: int
    value: float
    snapshot: tuple[int, ...] = (0,) * SNAPSHOT_WORDS
    request: int = 0
    """Id of the command that caused it; 0 = none did, or the device does not say."""


def request_words(request: Request) -> list[int]:
    """The words to write at `COMMAND`."""
    arguments = [*request.arguments, 0, 0, 0, 0][:4]
    words = [word for argument in arguments for word in long_words(argument)]
    return [request.code, request.owner, request.expected, *words, 0, 0, 0, 0, request.id]


def request_of(words: Sequence[int]) -> Request:
    """The command in `words` of `COMMAND`."""
    arguments = tuple(words[3 + 2 * n] << 16 | words[4 + 2 * n] for n in range(4))
    return Request(words[0], words[1], words[2], arguments, words[15])


def answer_words(answer: Answer) -> list[int]:
    """The eight words of one answer."""
    return [answer.id, int(answer.state), answer.reason, answer.detail, *time_words(answer.time)]


def answers_of(words: Sequence[int]) -> list[Answer] | None:
    """The answers in a whole answer image, newest first; None when the image was being changed."""
    if not is_whole(words):
        return None
    rows = (words[1 + n * ANSWER_WORDS : 1 + (n + 1) * ANSWER_WORDS] for n in range(ANSWERS_KEPT))
    return [
        Answer(row[0], AnswerState(row[1]) if row[1] <= 6 else AnswerState.NONE, row[2], row[3], time_of(row[4:8]))
        for row in rows
        if row[0]
    ]


def event_words(event: DeviceEvent) -> list[int]:
    """The words of one row of the ring."""
    snapshot = [*event.snapshot, *(0,) * SNAPSHOT_WORDS][:SNAPSHOT_WORDS]
    return [
        *long_words(event.sequence),
        *time_words(event.time),
        event.code,
        event.source,
        *long_words(real(event.value)),
        *snapshot,
        event.request,
    ]


def event_of(words: Sequence[int]) -> DeviceEvent:
    """The event in one row of the ring, which may have fewer words, or more."""
    return DeviceEvent(
        words[0] << 16 | words[1],
        time_of(words[2:6]),
        words[6],
        words[7],
        real_of(words[8] << 16 | words[9]),
        tuple(words[10:16]),
        words[AT_REQUEST] if len(words) > AT_REQUEST else 0,
    )


def is_whole(words: Sequence[int]) -> bool:
    """Whether an image was not being changed while it was read: its generation is even and the same at both ends."""
    return bool(words) and words[0] == words[-1] and words[0] % 2 == 0


def long_words(value: int) -> tuple[int, int]:
    """The two words of a raw 32-bit number."""
    return value >> 16 & 0xFFFF, value & 0xFFFF


def real(value: float) -> int:
    """The raw 32 bits of `value` as float32."""
    return int(unpack(">I", pack(">f", value))[0])


def real_of(raw: int) -> float:
    """The number in the raw 32 bits of a float32."""
    return float(unpack(">f", pack(">I", raw))[0])


def time_words(micros: int) -> tuple[int, int, int, int]:
    """The four words of a time [µs]."""
    return micros >> 48 & 0xFFFF, micros >> 32 & 0xFFFF, micros >> 16 & 0xFFFF, micros & 0xFFFF


def time_of(words: Sequence[int]) -> int:
    """The time in four words [µs]."""
    return words[0] << 48 | words[1] << 32 | words[2] << 16 | words[3]
