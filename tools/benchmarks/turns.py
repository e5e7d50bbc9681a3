"""The longest turn of the loop while a large plant is looked at, as a ratio to a bare loop: nobody waits longer for his Stop."""

import asyncio
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

from app import bundled
from app.settings import Settings
from benchmarks.common import Row
from tests.virtual import house
from tests.web.people import Staff
from tests.web.work import bare_loop, frozen, timed

MACHINES = 150
PLANT = f"""
[links.big]
transport = "tcp"
host = "127.0.0.1"
port = 1502

[equipment.k]
type = "eura_e800"
link = "big"
unit = 1
repeat = {MACHINES}
label = {{ hr = "Pogon {{n}}", en = "Drive {{n}}", de = "Antrieb {{n}}", cs = "Pohon {{n}}" }}
rated_current = 2.5
"""
PAGES = ("/", "/signin", "/communication", "/trends/points", "/api/v1/tags", "/api/v1/plant", "/alarms", "/audit")


async def measure() -> list[Row]:
    """The longest turn of any of `PAGES`."""
    return await asyncio.to_thread(_measure)


def _measure() -> list[Row]:
    with TemporaryDirectory() as folder:
        plant = Path(folder, "plant")
        shutil.copytree(bundled("plants/demo"), plant)
        with (plant / "plant.toml").open("a", encoding="utf-8") as file:
            file.write(PLANT)
        with house(Settings(plant=plant, data=Path(folder, "data"))) as client:
            client.pass_time(1)
            staff = Staff(client)
            staff.enter("ada", "admin", "engineer", "operator")
            found = {}
            with frozen():
                for page in PAGES:
                    client.get(page)  # compiles its templates
                    with timed() as spent:
                        client.get(page)
                    found[page] = spent.longest
    bare = bare_loop()
    page = max(found, key=lambda name: found[name])
    return [
        Row(
            f"longest turn of the loop, {MACHINES} drives and the demo",
            f"{1000 * found[page]:.0f} ms",
            "50 ms",
            f"{1000 * bare:.0f} ms",
            found[page] / bare,
            met=found[page] <= 0.05,
            note=f"{page}, of {len(PAGES)} pages and lists; processor time; the bare loop counts to a million",
        )
    ]
