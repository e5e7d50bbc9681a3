"""Areas give their words wherever a read begins and ends, and encode what they give once a scan."""

from struct import pack

import pytest

from app.registers import plc_map
from app.sim.plc.areas import Areas, Table

WORDS = list(range(100, 120))


def mapped() -> Areas:
    areas = Areas()
    areas.add(0x20, 5, lambda first, after: WORDS[5:10][first:after])
    areas.add(0x10, 5, lambda first, after: WORDS[:5][first:after])
    areas.add_image(0x15, 3, lambda: WORDS[10:13])
    return areas


@pytest.mark.sweep(8)
@pytest.mark.parametrize("first", range(0x0E, 0x27))
@pytest.mark.parametrize("count", range(1, 12))
def test_a_read_gives_what_is_mapped_up_to_the_first_gap(first: int, count: int) -> None:
    image = dict(zip(range(0x10, 0x15), WORDS[:5], strict=True))
    image |= dict(zip(range(0x15, 0x18), WORDS[10:13], strict=True)) | dict(
        zip(range(0x20, 0x25), WORDS[5:10], strict=True)
    )
    wanted = []
    for address in range(first, first + count):
        if address not in image:
            break
        wanted.append(image[address])
    assert mapped().read(first, count) == wanted


@pytest.mark.parametrize(
    ("at", "words", "free"),
    [(0x0F, 1, True), (0x0F, 2, False), (0x18, 8, True), (0x18, 9, False), (0x24, 1, False), (0x25, 1, True)],
)
def test_areas_do_not_overlap(at: int, words: int, free: bool) -> None:
    areas = mapped()
    if free:
        areas.add(at, words, lambda first, after: [0] * (after - first))
        assert areas.read(at, words) == [0] * words
    else:
        with pytest.raises(ValueError, match="overlap"):
            areas.add(at, words, lambda first, after: [])


def test_an_image_is_the_same_until_the_next_scan() -> None:
    areas, encoded = Areas(), []

    def encode() -> list[int]:
        encoded.append(1)
        return [len(encoded), len(encoded)]

    areas.add_image(0, 2, encode)
    assert [areas.read(0, 1), areas.read(1, 1), areas.read(0, 2)] == [[1], [1], [1, 1]]
    areas.forget()
    assert areas.read(0, 2) == [2, 2]


def table(encoded: list[int]) -> Table:
    def encode(slot: int) -> bytes:
        encoded.append(slot)
        return pack(">3H", slot, slot + 10, slot + 20)

    return Table(0x800, 3, 4, encode)


@pytest.mark.parametrize("first", range(16))
@pytest.mark.parametrize("count", [1, 2, 3, 5, 7])
def test_only_the_rows_that_are_asked_for_are_encoded(first: int, count: int) -> None:
    encoded: list[int] = []
    rows, areas = table(encoded), Areas()
    areas.add_table(rows)
    rows.take(77)
    head = [rows.generation, 4, 1, 3]
    whole = head + [word for slot in range(4) for word in (slot, slot + 10, slot + 20)]
    assert areas.read(0x800 + first, count) == whole[first : first + count]
    after = min(first + count, len(whole))
    asked = {(at - plc_map.TABLE_HEAD) // 3 for at in range(first, after) if at >= plc_map.TABLE_HEAD}
    assert asked <= set(encoded) <= asked | {0}
    assert len(encoded) == len(set(encoded))


def test_a_thing_keeps_its_slot_and_a_new_one_takes_the_lowest_free() -> None:
    rows = table([])
    generations = [rows.generation]
    assert [rows.take(id) for id in (5, 6, 7, 8, 9)] == [0, 1, 2, 3, None]
    assert rows.count == 4
    rows.free(1)
    generations.append(rows.generation)
    assert (rows.count, rows.take(10), rows.ids) == (4, 1, [5, 10, 7, 8])
    rows.free(3)
    assert rows.count == 3
    rows.clear()
    generations.append(rows.generation)
    assert (rows.count, rows.ids) == (0, [0] * 4)
    assert len(set(generations)) == 3
    assert all(generation % 2 == 0 for generation in generations)
