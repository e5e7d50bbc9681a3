"""How much a busy plant writes, counted in virtual time: rows, bytes of the database, bytes given to the disk."""

import asyncio
import shutil
from functools import partial
from pathlib import Path

import pytest

from app import bundled
from app.historian import sealed, store
from app.runtime import Runtime
from app.settings import Settings
from tests.virtual import VirtualLoop, inline

A_DAY = 24 * 60
"""Minutes."""


def written() -> int:
    """Bytes that this process has given to files."""
    lines = dict(line.split(": ") for line in Path("/proc/self/io").read_text().splitlines())
    return int(lines["wchar"])


def pack(runtime: Runtime) -> None:
    """Pack all samples, as those of hours that are over are; in blocks much shorter than theirs."""
    point: int | None = 0
    while point is not None:
        point = runtime.history.run(partial(sealed.seal, before=runtime.clock.micros() + 26 * store.HOUR, point=point))


@pytest.mark.sweep(30)
@pytest.mark.skipif(not Path("/proc/self/io").exists(), reason="counts what the kernel counts")
def test_a_day_of_the_demo_plant_is_small(tmp_path: Path) -> None:
    """For a cycle of its crane and the pause after it; the bytes are those that stay when the hour is packed."""
    minutes, most_rows, most_bytes, most_written = 6, 18, 50e6, 3.6e9  # 17 rows/s before the axis was there
    loop = VirtualLoop()
    folder = tmp_path / "data"

    async def run() -> tuple[float, float, float]:
        plant = tmp_path / "plant"
        shutil.copytree(bundled("plants/demo"), plant)
        runtime = Runtime(Settings(plant=plant, data=folder), loop.clock, threads=inline)
        await runtime.start()
        await asyncio.sleep(60)
        rows, used, bytes_ = runtime.recorder.rows_stored, runtime.history.run(store.used), written()
        await asyncio.sleep(60 * minutes)
        stored, given = runtime.recorder.rows_stored - rows, written() - bytes_
        await runtime.recorder.flush()
        pack(runtime)
        found = stored / (60 * minutes), runtime.history.run(store.used) - used, given
        await runtime.stop()
        return found

    rows, grown, given = loop.run_until_complete(run())
    loop.close()
    grown, given = grown / minutes, given / minutes
    print(f"{rows:.1f} rows/s, {grown * A_DAY / 1e6:.0f} MB a day, {given * A_DAY / 1e6:.0f} MB a day written")
    # 31 rows/s, 93 MB and 11.1 GB a day when the server's own points were stored at each change, in pages of 4 KB; 15 rows/s and 50 MB
    # without four speeds when every sample of a ramp was stored
    assert rows < most_rows
    assert grown * A_DAY < most_bytes
    assert given * A_DAY < most_written
