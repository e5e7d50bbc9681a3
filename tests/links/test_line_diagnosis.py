"""What a serial line on which nothing is understood is told to be: no telegrams, parity, framing."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from random import Random

import pytest

from app.errors import BadAnswer, LinkError
from app.links import line_diagnosis
from app.links.contract import Block
from app.links.port_errors import PortErrors
from app.plant.definitions import Link
from tests.links.serial_slaves import bad_slave, opened
from tests.wires import SerialLine


def line(path: str, baud: int = 9600, parity: str = "even", stop_bits: int = 1) -> Link:
    return Link("line", "rtu", port=path, baud=baud, parity=parity, stop_bits=stop_bits)


@contextmanager
def answering(said: bytes) -> Iterator[SerialLine]:
    """Somebody answers with these bytes, whatever he is asked."""
    wire = SerialLine()

    def answer() -> None:
        wire.ours.recv(4096)
        wire.ours.send(said)

    asyncio.get_running_loop().add_reader(wire.fileno(), answer)
    try:
        yield wire
    finally:
        asyncio.get_running_loop().remove_reader(wire.fileno())
        wire.close()


@pytest.mark.parametrize(("baud", "parity", "stop_bits", "told"), [
    (9600, "even", 1, "9600 baud, parity even, 1 stop bit"),
    (19200, "none", 2, "19200 baud, parity none, 2 stop bits"),
])  # fmt: skip
@pytest.mark.parametrize("seed", range(4))
async def test_bytes_of_another_speed_are_told_with_what_to_compare(
    baud: int, parity: str, stop_bits: int, told: str, seed: int
) -> None:
    with answering(Random(seed).randbytes(5 + 7 * seed)) as wire:
        async with opened(line(wire.path, baud, parity, stop_bits)) as t:
            for _ in range(3):
                with pytest.raises(
                    BadAnswer, match=r"check sum.*no telegram was heard since the port was opened"
                ) as error:
                    await t.read(1, Block(0, 2), 0.1)
                assert told in str(error.value) and "A and B" in str(error.value)
            assert t.counts.strange


async def test_one_good_telegram_shows_that_the_settings_fit() -> None:
    async with bad_slave() as slave, opened(line(slave.path)) as t:
        slave.damaged = 1.0
        with pytest.raises(BadAnswer, match="has the device 9600 baud"):
            await t.read(1, Block(0, 4), 0.1)
        slave.damaged = 0.0
        await asyncio.sleep(12)  # until nothing is owed
        await t.read(1, Block(4, 4), 0.1)
        assert not t.counts.strange
        slave.damaged = 1.0
        with pytest.raises(BadAnswer) as error:
            await t.read(1, Block(8, 4), 0.1)
        assert str(error.value).endswith("(check sum)") and not t.counts.strange


async def test_silence_and_a_click_say_nothing_about_settings() -> None:
    for said in (b"", b"\x00", b"\x00\xff\x00"):
        with answering(said) as wire:
            async with opened(line(wire.path)) as t:
                with pytest.raises(LinkError, match=r"no answer in 0.1 s$"):
                    await t.read(1, Block(0, 2), 0.1)
                assert not t.counts.strange


@pytest.mark.parametrize(("parity", "framing"), [(3, 0), (0, 8), (2, 5)])
async def test_what_the_port_counts_is_told_since_it_was_opened(
    monkeypatch: pytest.MonkeyPatch, parity: int, framing: int
) -> None:
    counted = [PortErrors(100, 7)]
    monkeypatch.setattr(line_diagnosis, "port_errors", lambda port: counted[-1])
    with answering(bytes(range(20))) as wire:
        async with opened(line(wire.path)) as t:
            counted.append(PortErrors(100 + parity, 7 + framing))
            with pytest.raises(
                BadAnswer, match=f"{parity} parity and {framing} framing errors: has the device 9600 baud, parity even"
            ):
                await t.read(1, Block(0, 2), 0.1)
            assert (t.counts.parity, t.counts.framing) == (parity, framing)
            await t.connect()
            assert (t.counts.parity, t.counts.framing, t.counts.strange) == (0, 0, False)
