"""A plant folder, and the running plant of it, that tests take anew."""

import asyncio
import shutil
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from app import bundled
from app.runtime import Runtime
from app.settings import Settings
from app.tags.quality import is_good
from tests.virtual import inline, loop_clock

DEMO = (bundled("plants/demo") / "plant.toml").read_text("utf-8")


M3 = """
[equipment.m3]
type = "eura_e800"
link = "hall"
unit = 3
label = { hr = "Pumpa", en = "Pump", de = "Pumpe", cs = "Čerpadlo" }
rated_current = 2.5
"""


class Plant:
    """A plant folder, and the running plant of it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.runtime: Runtime

    def write(self, text: str) -> None:
        self.folder.mkdir(exist_ok=True)
        shutil.copytree(bundled("plants/demo"), self.folder, dirs_exist_ok=True)
        (self.folder / "plant.toml").write_text(text, "utf-8")

    async def take(self, text: str) -> Any:
        """Write the file and take it, as a person does who reads the changes first."""
        self.write(text)
        seen = await self.runtime.plant_files.look()
        return await self.runtime.plant_files.reload(None, seen.digest)

    def good(self, name: str) -> bool:
        tags = self.runtime.tags
        return name in tags and is_good(tags.sample(name).quality)

    async def until(self, true: Callable[[], bool], limit: float = 30.0) -> None:
        end = asyncio.get_running_loop().time() + limit
        while not true():
            assert asyncio.get_running_loop().time() < end, "not in time"
            await asyncio.sleep(0.02)


@asynccontextmanager
async def running(tmp_path: Path, text: str = DEMO, **settings: Any) -> AsyncIterator[Plant]:
    plant = Plant(tmp_path / "plant")
    plant.write(text)
    plant.runtime = Runtime(Settings(plant=plant.folder, data=tmp_path / "data", **settings), loop_clock(), inline)
    await plant.runtime.start()
    try:
        yield plant
    finally:
        await plant.runtime.stop()
