"""Parts of the demo plant: a test whose subject is one machine need not move the others."""

import re
import shutil
from collections.abc import Collection, Mapping
from pathlib import Path

from app import bundled

DEMO = bundled("plants/demo")
MACHINES = ("m1", "m2", "c1", "cc1", "seq1", "cr1", "a1")
LINKS = ("hall", "line", "coil", "crane", "axis")


def plant_file(machines: Collection[str], links: Mapping[str, str] | None = None) -> str:
    """The plant file of the demo with only these machines and their links.

    `links`: link → what it says in place of `transport = "memory"`.
    """
    parts = re.split(r"(?m)^(?=\[)", (DEMO / "plant.toml").read_text("utf-8"))
    kept = [part for part in parts if not (found := re.match(r"\[equipment\.(\w+)\]", part)) or found[1] in machines]
    used = {found[1] for part in kept if (found := re.search(r'(?m)^link = "(\w+)"', part))}
    said = []
    for part in kept:
        found = re.match(r"\[links\.(\w+)\]", part)
        if not found:
            said.append(part)
        elif found[1] in used:
            said.append(
                re.sub(r'(?m)^transport = "memory".*$', (links or {}).get(found[1], 'transport = "memory"'), part)
            )
    return "".join(said)


def plant_folder(folder: Path, *machines: str) -> Path:
    """`folder`, made as that of a plant of these machines."""
    shutil.copytree(DEMO, folder)
    (folder / "plant.toml").write_text(plant_file(machines), "utf-8")
    return folder
