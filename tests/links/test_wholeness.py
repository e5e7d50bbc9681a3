"""An image that is never whole gives no value, and the log says why, once."""

import asyncio

import pytest

from app.links.services import Seen
from app.links.wholeness import LONGEST, Wholeness
from app.tags.quality import is_good
from tests.links.devices import until
from tests.links.plc_devices import CONFIGURATION, KINDS, ROW_WORDS, STATUS, TABLE, SmallPlc, plant


@pytest.mark.parametrize("words", [[3, 0, 3], [2, 0, 4], [2, 0, 3]])
def test_a_torn_image_is_told_after_a_while_once_and_when_it_is_whole(
    words: list[int], caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO")
    it = Wholeness("hall", 3)
    assert [it.judge(0x100, words, 0.1 * n) for n in range(200)] == [Seen.TORN] * 200
    (told,) = caplog.messages
    assert f"address=0x0100: its generation is {words[0]} at the beginning and {words[2]} at the end" in told
    assert it.judge(0x100, [4, 0, 4], 20.0) is Seen.WHOLE
    assert caplog.messages[1:] == ["whole again link=hall unit=3 address=0x0100"]


def test_one_that_is_torn_by_chance_is_not_told(caplog: pytest.LogCaptureFixture) -> None:
    it = Wholeness("hall", 3)
    for n in range(200):
        it.judge(0x100, [2, 0, 2 if n % 20 == 0 else 4], 0.1 * n)
    assert caplog.messages == []


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("image", [STATUS, CONFIGURATION])
async def test_whoever_waits_for_its_values_finds_why_in_the_log(
    kind: str, image: int, caplog: pytest.LogCaptureFixture
) -> None:
    """They were bad without data, the link was up, and nothing said anything."""
    caplog.set_level("INFO")
    name = "p.counter" if image == STATUS else "p.size"
    device = SmallPlc()
    device.torn.add(image)
    async with plant(device, kind) as (line, _):
        await asyncio.sleep(LONGEST + 10)
        told = [one for one in caplog.messages if one.startswith("never whole")]
        assert len(told) == 1 and f"unit=1 address={image:#06x}:" in told[0]
        assert line.value(name) is None
        device.torn.clear()
        await until(lambda: is_good(line.quality(name)))
    assert caplog.messages.count(f"whole again link=hall unit=1 address={image:#06x}") == 1


@pytest.mark.parametrize("kind", KINDS)
async def test_a_row_that_is_never_whole_is_told_with_its_place(kind: str, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    device = SmallPlc()
    device.put(11)
    device.put(12)
    device.torn_rows.add(1)
    async with plant(device, kind) as (line, _):
        await asyncio.sleep(LONGEST + 10)
        told = [one for one in caplog.messages if one.startswith("never whole")]
        assert (
            len(told) == 1
            and f"the row at {TABLE + 4 + ROW_WORDS:#06x} is 0 at the beginning and 2 at the end" in told[0]
        )
        device.torn_rows.clear()
        await until(lambda: line.value("p.thing_2_id") == 12)
    assert caplog.messages.count(f"whole again link=hall unit=1 address={TABLE:#06x}") == 1
