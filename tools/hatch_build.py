"""Build hook: a wheel carries templates, static files, migrations and the demo plant under app/_data."""

import subprocess
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

DATA = ("templates", "static", "migrations", "plants/demo")


class WheelData(BuildHookInterface):  # type: ignore[type-arg]
    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if self.target_name != "wheel" or version == "editable":  # a working tree reads its own folders
            return
        root = Path(self.root)
        subprocess.run([sys.executable, str(root / "tools" / "assets.py")], check=True)
        for folder in DATA:
            if (root / folder).is_dir():
                build_data["force_include"][str(root / folder)] = f"app/_data/{folder}"
