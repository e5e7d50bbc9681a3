"""An image is read again while it is being changed, and a refusal breaks the rule that asks."""

import pytest

from app.links.conformance.finding import Broken, Skipped
from app.links.conformance.server import Server
from app.links.conformance.subject import TRIES, Subject, number
from app.plant.definitions import Image
from tests.links.conformance.servers import data_of

IMAGE = Image(0x0180, 3)


def subject(*answers: bytes) -> tuple[Subject, list[bytes]]:
    left, asked = list(answers), list[bytes]()

    async def exchange(pdu: bytes) -> bytes:
        asked.append(pdu)
        return left.pop(0) if len(left) > 1 else left[0]

    return Subject(Server(exchange), data_of("conveyor")), asked


def image(first: int, last: int) -> bytes:
    return bytes((3, 6, 0, first, 0, 9, 0, last))


async def test_a_torn_image_is_read_again_until_it_is_whole() -> None:
    found, asked = subject(image(2, 4), image(3, 3), image(4, 4))
    assert await found.whole(IMAGE) == [4, 9, 4] == found.images[0x0180]
    assert len(asked) == 3


async def test_one_that_is_never_whole_is_given_up() -> None:
    found, asked = subject(image(2, 4))
    assert await found.whole(IMAGE) is None and len(asked) == TRIES
    with pytest.raises(Skipped):
        await found.again(IMAGE)


async def test_a_refusal_breaks_the_rule_and_nonsense_does_not() -> None:
    found, _ = subject(b"\x83\x02")
    with pytest.raises(Broken, match="0x0180–0x0182: exception 02"):
        await found.read(0x0180, 3)
    found, _ = subject(b"\x03\x02\x00\x01")
    with pytest.raises(Skipped, match="telegram"):
        await found.read(0x0180, 3)


def test_the_type_says_what_is_looked_at() -> None:
    found, _ = subject(b"")
    assert [one.address for one in found.all_images] == [0x0100, 0x0180, 0x0200, 0x0320, 0x0400]
    assert [point.key for point in found.setpoints][:2] == ["automatic_speed", "manual_speed"] and len(
        found.setpoints
    ) == 15
    assert number([1, 2]) == 65538
