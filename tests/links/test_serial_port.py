"""The serial port of a computer: who may have it, what is wrong with it, what happens when its adapter is pulled."""

import asyncio
import errno
import os
import termios
from pathlib import Path

import pytest
import serial  # type: ignore[import-untyped]

from app.errors import NotConnected
from app.links.contract import Block
from app.links.rtu import RtuTransport
from app.plant.definitions import Link
from app.sim.bus import Bus, LineFaultMode
from app.sim.server import serve_pty
from app.tags.quality import is_bad, is_good
from tests.links.devices import RegisterDevice, row, running, until
from tests.links.serial_slaves import bad_slave, rtu
from tests.links.test_rtu import opened

pytestmark = pytest.mark.real_time


async def test_what_is_wrong_with_a_port_is_told_with_its_name_and_what_helps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def told(path: Path | str) -> str:
        with pytest.raises(NotConnected) as error:
            await RtuTransport(rtu(str(path))).connect()
        assert str(error.value).startswith(f"{path}: ")
        return str(error.value)

    assert "adapter plugged in" in await told(tmp_path / "ttyUSB7")
    (tmp_path / "file").write_text("")
    assert "ENOTTY" in await told(tmp_path / "file")

    def refuse(*_: object, **__: object) -> None:
        raise serial.SerialException(errno.EACCES, "could not open port")

    monkeypatch.setattr(serial, "Serial", refuse)
    assert "dialout" in await told("/dev/ttyUSB0")


async def test_a_port_belongs_to_one_program() -> None:
    async with bad_slave(terminal=True) as slave, opened(rtu(slave.path)):
        with pytest.raises(NotConnected, match="in use by another program"):
            await RtuTransport(rtu(slave.path)).connect()
    async with bad_slave(terminal=True) as slave:
        async with opened(rtu(slave.path)):
            pass
        async with opened(rtu(slave.path)) as t:
            await t.read(1, Block(0, 1), 0.2)


@pytest.mark.parametrize(("stop_bits", "set_"), [(2, True), (1, False)])
async def test_without_parity_a_character_ends_with_the_stop_bits_of_the_plant_file(stop_bits: int, set_: bool) -> None:
    async with bad_slave(terminal=True) as slave:
        link = Link("hall", "rtu", port=slave.path, parity="none", stop_bits=stop_bits)
        async with opened(link):
            fd = os.open(slave.path, os.O_RDWR | os.O_NOCTTY)
            flags = termios.tcgetattr(fd)[2]
            os.close(fd)
            assert bool(flags & termios.CSTOPB) == set_
            assert not flags & termios.PARENB


async def test_an_adapter_that_is_unplugged_fails_the_request_on_its_way_at_once() -> None:
    device = RegisterDevice({0: 1})
    device.line_fault.mode = LineFaultMode.SILENT
    line = await serve_pty(Bus({1: device}), 115200)
    async with opened(rtu(line.path)) as t:
        reading = asyncio.create_task(t.read(1, Block(0, 1), 3600.0))
        await until(lambda: device.requests)
        await line.close()
        async with asyncio.timeout(60):
            with pytest.raises(NotConnected, match="gone"):
                await reading
        assert not t.connected


async def test_an_adapter_that_is_plugged_in_again_comes_back_by_itself(tmp_path: Path) -> None:
    bus = Bus({1: RegisterDevice({n: n for n in range(4)})})
    line = await serve_pty(bus, 115200)
    port = tmp_path / "adapter"
    port.symlink_to(line.path)
    async with running([row("m1", 1, 4)], link=rtu(str(port))) as hall:
        await until(lambda: is_good(hall.quality("m1.v3")))
        port.unlink()
        await line.close()
        await until(lambda: is_bad(hall.quality("m1.v3")))
        await until(lambda: "adapter plugged in" in hall.link.statistics.last_error_text)
        line = await serve_pty(bus, 115200)
        port.symlink_to(line.path)
        await until(lambda: is_good(hall.quality("m1.v3")))
    await line.close()


async def test_a_name_that_leads_to_another_adapter_is_followed_when_the_old_one_is_silent(tmp_path: Path) -> None:
    path, (old, new) = tmp_path / "by-id", (RegisterDevice(dict.fromkeys(range(25), n)) for n in (1, 2))
    first, second = [await serve_pty(Bus({1: device}), 115200) for device in (old, new)]
    path.symlink_to(first.path)
    async with running([row("m1", 1, 25)], link=rtu(str(path))) as made:
        await until(lambda: made.value("m1.v0") == 1)
        path.unlink()
        path.symlink_to(second.path)
        await asyncio.sleep(1)
        assert is_good(made.quality("m1.v0")) and made.value("m1.v0") == 1, "as long as it answers it stays"
        old.line_fault.mode = LineFaultMode.SILENT
        await until(lambda: is_good(made.quality("m1.v0")) and made.value("m1.v0") == 2, 10)
    for line in (first, second):
        await line.close()
