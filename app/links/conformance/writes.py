"""Rules that cannot be seen without writing. What is written moves nothing: a heartbeat, a hold-to-run without a button, settings that are
staged and not committed, and commands that every device must refuse.

The staged settings are those in effect, one of them changed by the last bit of its float32, so that a server that wrongly lets them take
effect at once shows it and changes nothing that anybody could measure.
"""

import asyncio
from collections.abc import Sequence
from struct import pack
from zlib import crc32

from app import chance
from app.errors import BadAnswer, DeviceException, NoAnswer
from app.links.conformance.finding import Broken, Skipped, at, refusal, require, span
from app.links.conformance.lists import ANSWERS, RING
from app.links.conformance.subject import Subject, number
from app.plant.definitions import Image
from app.registers import plc_map
from app.registers.pdu import MAX_WRITE, WRITE_SINGLE
from app.registers.plc_map import Answer, AnswerState, Request

REFUSED_CODE = 0xFFFF
"""A command that no type has."""
ANSWER_LIMIT = 1.0
"""Longest wait for an answer, and for a heartbeat to be shown [s]."""
SETTLED = 0.3
"""After this time a server that wrongly acts has acted [s]."""
LOOK = 0.02
REASON_UNKNOWN, REASON_COUNT, REASON_CRC = 1, 20, 22
BASE_REASONS = (1, 20, 21, 22, 23)
"""Every other reason is the machine's own."""


async def host_heartbeat(subject: Subject) -> None:
    """Word 9 takes function 06 and shows what was written."""
    word = ((await subject.look()).words[plc_map.AT_HOST_HEARTBEAT] + 1) & 0xFFFF
    await subject.write(plc_map.HEADER + plc_map.AT_HOST_HEARTBEAT, [word], WRITE_SINGLE)
    end = _now() + ANSWER_LIMIT
    while (seen := (await subject.look()).words[plc_map.AT_HOST_HEARTBEAT]) != word:
        require(_now() < end, at(plc_map.AT_HOST_HEARTBEAT, seen), f"{word}")
        await asyncio.sleep(LOOK)


async def hold(subject: Subject) -> None:
    """A hold-to-run of four words is taken; its request bits are 0, its counter rises."""
    for counter in (1, 2):
        await subject.write(plc_map.HOLD, [0, counter, 0, 0])
        await asyncio.sleep(LOOK)


async def command_whole(subject: Subject) -> None:
    """Nothing less than 16 words with an id is a command: it is refused with 03, or has no effect."""
    before = await _answers(subject)
    words = plc_map.request_words(Request(REFUSED_CODE, id=await _unused(subject)))
    for part in (words[:15], [*words[:15], 0]):
        try:
            await subject.server.write(plc_map.COMMAND, part)
        except DeviceException as error:
            require(error.code == 3, f"{span(plc_map.COMMAND, len(part))}: {refusal(error)}", "exception 03")
            continue
        except NoAnswer as error:
            raise Broken(f"{span(plc_map.COMMAND, len(part))}: {{no_answer}}", "exception 03") from error
        except BadAnswer as error:
            raise Skipped("needs", "telegram") from error
        await asyncio.sleep(SETTLED)
        after = await _answers(subject)
        new = next((answer for answer in after if answer not in before), None)
        require(
            new is None,
            f"{span(plc_map.COMMAND, len(part))}: {at(plc_map.ANSWERS + 1, new and new.id)}",
            "exception 03",
        )


async def command_answer(subject: Subject) -> None:
    """A command that no device knows is rejected, with reason 1, in the first place of the answers."""
    answer = await _ask(subject, Request(REFUSED_CODE, id=await _unused(subject)))
    _require_rejected(answer, REASON_UNKNOWN)


async def command_once(subject: Subject) -> None:
    """The same id again changes nothing in the answers."""
    request = Request(REFUSED_CODE, id=await _unused(subject))
    first = await _ask(subject, request)
    await subject.write(plc_map.COMMAND, plc_map.request_words(request))
    await asyncio.sleep(SETTLED)
    found = [answer for answer in await _answers(subject) if answer.id == request.id]
    told = ", ".join(f"{answer.id} ({answer.time} µs)" for answer in found)
    require(found == [first], f"{span(ANSWERS.address, ANSWERS.words)}: {told}", f"{first.id} ({first.time} µs)")


async def staging(subject: Subject) -> None:
    """What is staged is not in effect."""
    image, words = await _settings(subject)
    staged = _staged(subject, words)
    changed = _one_bit_off(staged)
    try:
        await _stage(subject, changed)
        await asyncio.sleep(SETTLED)
        after = await subject.again(image)
    finally:
        await _stage(subject, staged)
    await asyncio.sleep(SETTLED)
    if after[1:-1] != words[1:-1]:
        place = next(n for n in range(1, len(words) - 1) if after[n] != words[n])
        raise Broken(at(image.address + place, after[place]), f"{words[place]}")


async def commit(subject: Subject) -> None:
    """A set whose count or check sum is wrong is rejected as a whole."""
    image, words = await _settings(subject)
    staged = _staged(subject, words)
    await _stage(subject, staged)
    crc = crc32(pack(f">{len(staged)}H", *staged))
    for count, check, reason in ((len(staged) - 1, crc, REASON_COUNT), (len(staged), crc ^ 1, REASON_CRC)):
        request = Request(plc_map.COMMIT_SETTINGS, arguments=(count, check), id=await _unused(subject))
        answer = await _ask(subject, request)
        if (
            answer.state is AnswerState.REJECTED
            and answer.reason in subject.kind.reasons
            and answer.reason not in BASE_REASONS
        ):
            raise Skipped("own_reason")  # a crane that moves takes no settings at all
        _require_rejected(answer, reason)
    after = await subject.again(image)
    require(after[1:-1] == words[1:-1], span(image.address, image.words), "{unchanged}")


async def acknowledge(subject: Subject) -> None:
    """The acknowledged sequence is two words in one write; the one that stands there is written again."""
    if not subject.map.events:
        raise Skipped("none")
    head = await subject.again(RING)
    place = slice(plc_map.AT_ACKNOWLEDGED, plc_map.AT_ACKNOWLEDGED + 2)
    await subject.write(plc_map.EVENTS + plc_map.AT_ACKNOWLEDGED, head[place])
    await asyncio.sleep(SETTLED)
    seen = number((await subject.again(RING))[place])
    require(seen >= number(head[place]), at(plc_map.EVENTS + plc_map.AT_ACKNOWLEDGED, seen), f"{number(head[place])}")


async def _settings(subject: Subject) -> tuple[Image, list[int]]:
    image = subject.map.settings
    if image is None:
        raise Skipped("none")
    return image, await subject.again(image)


async def _answers(subject: Subject) -> list[Answer]:
    return plc_map.answers_of(await subject.again(ANSWERS)) or []


async def _unused(subject: Subject) -> int:
    """An id that the device does not remember."""
    known = {answer.id for answer in await _answers(subject)}
    while (id := chance.randrange(1, 0xFFFF)) in known:
        pass
    return id


async def _ask(subject: Subject, request: Request) -> Answer:
    """Send `request` once; its answer, which stands in the first place."""
    await subject.write(plc_map.COMMAND, plc_map.request_words(request))
    end = _now() + ANSWER_LIMIT
    while True:
        found = await _answers(subject)
        answer = next((one for one in found if one.id == request.id), None)
        if answer is not None and answer.state not in (AnswerState.NONE, AnswerState.ACCEPTED, AnswerState.RUNNING):
            require(found[0].id == request.id, at(ANSWERS.address + 1, found[0].id), f"{request.id}")
            return answer
        seen = at(ANSWERS.address + 1, found[0].id if found else 0)
        if answer is not None:
            seen = f"{answer.id}: {int(answer.state)}"
        require(_now() < end, seen, f"{request.id}: {int(AnswerState.REJECTED)} (≤ {ANSWER_LIMIT:g} s)")
        await asyncio.sleep(LOOK)


def _require_rejected(answer: Answer, reason: int) -> None:
    seen = f"{int(answer.state)}, {answer.reason}"
    require(
        (answer.state, answer.reason) == (AnswerState.REJECTED, reason), seen, f"{int(AnswerState.REJECTED)}, {reason}"
    )


def _staged(subject: Subject, words: Sequence[int]) -> list[int]:
    """The words of the staging area that are in effect."""
    return list(words[2 : 2 + 2 * len(subject.setpoints)])


def _one_bit_off(staged: Sequence[int]) -> list[int]:
    """`staged` with the first number that is not 0 nearer to 0 by the last bit of its float32."""
    changed = list(staged)
    for n in range(0, len(changed), 2):
        raw = number(changed[n : n + 2])
        if raw & 0x7FFFFFFF:
            changed[n : n + 2] = plc_map.long_words(raw - 1)
            break
    return changed


async def _stage(subject: Subject, words: Sequence[int]) -> None:
    most = MAX_WRITE - MAX_WRITE % 2
    for begin in range(0, len(words), most):
        await subject.write(subject.map.staging + begin, words[begin : begin + most])


def _now() -> float:
    return asyncio.get_running_loop().time()
