"""One scanned block: the quick way gives the codec's numbers, and only what changed is told."""

import pytest

from app.links.contract import Block
from app.links.planner import Reading
from app.links.scan_block import ScanBlock, word_decoder
from app.plant.definitions import Register, Scan, Type
from app.registers.codec import decode
from app.tags.quality import COMM_FAILURE, GOOD, IMPLAUSIBLE, NOT_CONNECTED, OUT_OF_RANGE
from tests.links.devices import point


@pytest.mark.sweep(8)
@pytest.mark.parametrize("scale", [1, 0.1, 0.01, 0.001, 0.0001])
@pytest.mark.parametrize(("mask", "shift"), [(None, 0), (0xFF, 0), (0xFF, 8), (0x1, 15), (None, 4)])
def test_the_quick_way_gives_the_number_of_the_codec_for_every_word(scale: float, mask: int | None, shift: int) -> None:
    register = Register(0, scale=scale, mask=mask, shift=shift)
    quick = word_decoder(register)
    assert quick is not None
    for word in range(65536):
        number, expected = quick(word), decode(register, [word])
        assert number == expected and type(number) is type(expected), word


@pytest.mark.parametrize(
    "register",
    [
        Register(0, Type.I16),
        Register(0, Type.U32, words=2),
        Register(0, none=0x8000),
        Register(0, scale=0.3),
        Register(0, offset=5),
    ],
)
def test_what_is_not_plain_goes_through_the_codec(register: Register) -> None:
    assert word_decoder(register) is None


def block() -> ScanBlock:
    points = (
        point("m", "a", 10, scale=0.1, low=0, high=100),
        point("m", "b", 11, type=Type.I32, words=2, low=-5, high=5),
        point("m", "c", 13, none=0xFFFF),
        point("m", "unknown", 14),
    )
    scan = ScanBlock("link.x", 3, 1, Reading(Block(10, 5), Scan.FAST, points), 0.1)
    scan.bind({"m.a": 0, "m.b": 1, "m.c": 2}, 1)
    return scan


def test_changes_and_qualities_of_a_block() -> None:
    scan = block()
    first = scan.seen([500, 0, 1, 7, 0], 1000, GOOD)
    assert (first.source, first.block, first.time, first.seen) == ("link.x", 3, 1000, 1000)
    assert (list(first.handles), list(first.values), first.qualities) == ([0, 1, 2], [50.0, 1, 7], None)
    same = scan.seen([500, 0, 1, 7, 9], 2000, GOOD)
    assert (list(same.handles), same.seen) == ([], 2000), "word 14 belongs to no tag"
    out = scan.seen([2000, 0xFFFF, 0xFFF0, 0xFFFF, 9], 3000, GOOD)
    assert list(out.values) == [200.0, -16, None]
    assert list(out.qualities or ()) == [OUT_OF_RANGE, OUT_OF_RANGE, NOT_CONNECTED]
    back = scan.seen([500, 0xFFFF, 0xFFF0, 0xFFFF, 9], 4000, GOOD)
    assert (list(back.handles), list(back.values), back.qualities) == ([0], [50.0], None)


def test_what_is_not_plausible_is_bad_and_what_the_device_cannot_report_is_uncertain() -> None:
    points = (
        point("m", "word", 10, low=5, high=100, plausible=(1, 1000)),
        point("m", "real", 11, type=Type.F32, words=2, plausible=(0, 1e6)),
    )
    scan = ScanBlock("link.x", 3, 1, Reading(Block(10, 3), Scan.FAST, points), 0.1)
    scan.bind({"m.word": 0, "m.real": 1}, 1)
    worth = {}
    for word in (0, 1, 4, 5, 100, 101, 1000, 1001):
        out = scan.seen([word, 0, 0], word, GOOD)
        worth[word] = out.qualities[0] if out.qualities else GOOD
    bad, doubtful = IMPLAUSIBLE, OUT_OF_RANGE
    assert worth == {0: bad, 1: doubtful, 4: doubtful, 5: GOOD, 100: GOOD, 101: doubtful, 1000: doubtful, 1001: bad}
    for words, quality in {(0x7F7F, 0xFFFF): bad, (0x4974, 0x2400): GOOD, (0xBF80, 0): bad}.items():  # 3.4e38, 1e6, -1
        out = scan.seen([5, *words], 5, GOOD)
        assert (out.qualities[-1] if out.qualities else GOOD) == quality, words


def test_a_lost_block_is_told_once_and_comes_back_whole() -> None:
    scan = block()
    scan.seen([1, 0, 1, 7, 0], 1, GOOD)
    lost = scan.lost(2, COMM_FAILURE)
    assert lost is not None
    assert sorted(lost.handles) == [0, 1, 2]
    assert set(lost.values) == {None}
    assert scan.lost(3, COMM_FAILURE) is None
    assert list(scan.seen([1, 0, 1, 7, 0], 4, GOOD).handles) == [0, 1, 2]


def test_a_change_of_quality_lists_everything() -> None:
    scan = block()
    scan.seen([1, 0, 1, 7, 0], 1, GOOD)
    again = scan.seen([1, 0, 1, 7, 0], 2, GOOD | 0x100)
    assert (len(again.handles), again.quality) == (3, GOOD | 0x100)
