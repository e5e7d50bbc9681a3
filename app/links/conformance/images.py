"""Rules of the images: generations, spare words, values that mean something, the settings in effect."""

import asyncio
from collections.abc import Iterator, Mapping, Sequence
from math import isnan

from app.errors import BadAnswer, DeviceException, NoAnswer
from app.links.conformance.finding import Broken, Skipped, at, refusal, require, require_none, several, span
from app.links.conformance.header import numeric_limits
from app.links.conformance.subject import TRIES, Subject, number
from app.plant.definitions import Image, Point
from app.registers import plc_map
from app.registers.codec import decode
from app.registers.register import Register

AGAIN = 0.05
"""Before an image is read a second time to see whether its generation tells of changes [s]."""


async def images(subject: Subject) -> None:
    """Each image is one telegram."""
    wrong = []
    for image in subject.own_images:
        try:
            await subject.server.read(image.address, image.words)
        except (DeviceException, NoAnswer) as error:
            wrong.append(f"{span(image.address, image.words)}: {refusal(error)}")
        except BadAnswer as error:
            raise Skipped("needs", "telegram") from error
    require(not wrong, several(wrong), "{one_telegram}")


async def generation(subject: Subject) -> None:
    """Even, and the same in the first and in the last word."""
    wrong = []
    for image in subject.all_images:
        try:
            if await subject.whole(image) is not None:
                continue
            words = await subject.read(image.address, image.words)
        except Broken:  # that it is not there is said by the rule of that area
            continue
        end = image.address + image.words - 1
        wrong.append(f"{at(image.address, words[0])}, {at(end, words[-1])} ({TRIES} ×)")
    require(not wrong, several(wrong), "{same_even}")


async def swap(subject: Subject) -> None:
    """What changed has another generation."""
    wrong = []
    for image in subject.all_images:
        before = subject.images.get(image.address)
        if before is None:
            continue
        await asyncio.sleep(AGAIN)
        after = await subject.whole(image)
        if after is not None and after[0] == before[0] and after != before:
            place = next(n for n, (old, new) in enumerate(zip(before, after, strict=True)) if old != new)
            old, new = before[place], after[place]
            wrong.append(f"{at(image.address, after[0])}, 0x{image.address + place:04X}: {old} → {new}")
    require(not wrong, several(wrong), "{risen_by_two}")


async def spare(subject: Subject) -> None:
    """Words without a meaning are 0: what stands there belongs to another place. Where a larger machine of the type has a number, NaN says
    that there is none."""
    wrong = []
    for image in subject.own_images:
        words = subject.images.get(image.address)
        if words is None:
            continue
        used = [point.register for point in subject.points_in(image) if point.register]
        first = image.address + (2 if image == subject.map.settings else 1)
        free = {
            place: words[place - image.address] for place in free_words(used, first, image.address + image.words - 1)
        }
        empty = set(_without_number(free)) if subject.counted else set()
        wrong += [at(place, word) for place, word in free.items() if word and place not in empty]
    require(not wrong, several(wrong), "0")


def free_words(used: Sequence[Register], first: int, end: int) -> Iterator[int]:
    """Addresses from `first` up to `end` that no register takes."""
    taken = {register.address + n for register in used for n in range(register.words)}
    return (place for place in range(first, end) if place not in taken)


def _without_number(free: Mapping[int, int]) -> Iterator[int]:
    """The words of `free` (address → word) that are a NaN, two and two."""
    for place, word in free.items():
        if place + 1 in free and isnan(plc_map.real_of(number((word, free[place + 1])))):
            yield from (place, place + 1)


async def values(subject: Subject) -> None:
    """An enumeration has one of its values."""
    wrong = []
    for image in subject.own_images:
        words = subject.images.get(image.address)
        if words is not None:
            for point in subject.points_in(image):
                assert point.register
                begin = point.register.address - image.address
                wrong += unknown_value(point, words[begin : begin + point.register.words], point.register.address)
    require_none(wrong)


def unknown_value(point: Point, words: Sequence[int], place: int) -> list[tuple[str, str]]:
    """What is wrong with the enumeration `point`, whose `words` begin at the address `place`; nothing for any other point."""
    if not point.texts or point.register is None:
        return []
    value = decode(point.register, words)
    if value is None or value in point.texts:
        return []
    known = ", ".join(str(one) for one in point.texts)
    return [(at(place, value), f"{point.key}: {known}")]


async def settings(subject: Subject) -> None:
    """Their number stands in word 1, each is within its limits."""
    image = subject.map.settings
    if image is None:
        raise Skipped("none")
    words = subject.images.get(image.address)
    if words is None:
        raise Skipped("needs", "generation")
    count = len(subject.setpoints)
    require(words[1] == count, at(image.address + 1, words[1]), f"{count}")
    require_none(list(_outside(subject, image, words)))


def _outside(subject: Subject, image: Image, words: Sequence[int]) -> Iterator[tuple[str, str]]:
    for point in subject.setpoints:
        assert point.register
        begin = point.register.address - image.address
        value = plc_map.real_of(number(words[begin : begin + 2]))
        low, high = numeric_limits(subject, point.key) or (value, value)
        if not low <= value <= high:
            yield at(point.register.address, f"{value:g}"), f"{point.key}: {low:g} … {high:g}"
