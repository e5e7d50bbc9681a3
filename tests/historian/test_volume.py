"""How much a busy plant writes, counted in virtual time: rows, bytes of the database, bytes given to the disk."""

import asyncio
from pathlib import Path

import pytest

from app import bundled
from app.historian import store
from app.runtime import Runtime
from app.settings import Settings
from tests.virtual import VirtualLoop, inline

MINUTES = 4
A_DAY = 24 * 60 / MINUTES


def written() -> int:
    """Bytes that this process has given to files."""
    lines = dict(line.split(": ") for line in Path("/proc/self/io").read_text().splitlines())
    return int(lines["wchar"])


@pytest.mark.skipif(not Path("/proc/self/io").exists(), reason="counts what the kernel counts")
def test_a_day_of_the_demo_plant_is_small(tmp_path: Path) -> None:
    loop = VirtualLoop()
    folder = tmp_path / "data"

    async def run() -> tuple[float, int, int]:
        runtime = Runtime(Settings(plant=bundled("plants/demo"), data=folder), loop.clock, threads=inline)
        await runtime.start()
        await asyncio.sleep(60)
        rows, used, bytes_ = runtime.recorder.rows_stored, runtime.history.run(store.used), written()
        await asyncio.sleep(60 * MINUTES)
        found = (
            (runtime.recorder.rows_stored - rows) / (60 * MINUTES),
            runtime.history.run(store.used) - used,
            written() - bytes_,
        )
        await runtime.stop()
        return found

    rows, grown, given = loop.run_until_complete(run())
    loop.close()
    print(f"{rows:.1f} rows/s, {grown * A_DAY / 1e6:.0f} MB a day, {given * A_DAY / 1e6:.0f} MB a day written")
    # 31 rows/s, 93 MB and 11.1 GB a day when the server's own points were stored at each change, in pages of 4 KB; 15 rows/s and 50 MB
    # without four speeds when every sample of a ramp was stored
    assert rows < 15
    assert grown * A_DAY < 50e6
    assert given * A_DAY < 2.7e9
