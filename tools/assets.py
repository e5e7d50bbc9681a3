"""Fetch the packaged front-end libraries and put the few files we serve into static/vendor.

`npm ci` installs exactly package-lock.json into node_modules (nothing is run from the packages),
then the files below are copied with the licence of each library beside them.
"""

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
MODULES = ROOT / "node_modules"
FILES = {
    "static/vendor": [
        "htmx.org/dist/htmx.min.js",
        "uplot/dist/uPlot.iife.min.js",
        "uplot/dist/uPlot.min.css",
        "swagger-ui-dist/swagger-ui-bundle.js",
        "swagger-ui-dist/swagger-ui.css",
    ],
    "tests/.vendor": ["axe-core/axe.min.js"],
}


def main() -> None:
    lock = hashlib.sha256((ROOT / "package-lock.json").read_bytes()).hexdigest()
    stamp = MODULES / ".lock-sha256"
    if not stamp.is_file() or stamp.read_text() != lock:
        npm_ci()
        stamp.write_text(lock)
    for folder, files in FILES.items():
        target = ROOT / folder
        shutil.rmtree(target, ignore_errors=True)
        target.mkdir(parents=True)
        for file in files:
            shutil.copyfile(MODULES / file, target / Path(file).name)
            copy_licence(file.split("/")[0], target)


def npm_ci() -> None:
    """Install node_modules, with the npm of this environment before any other."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    npm = shutil.which("npm", path=path)
    if npm is None:
        sys.exit("npm is missing: `make setup` installs it, or install Node.js 20 or newer")
    subprocess.run([npm, "ci", "--silent"], cwd=ROOT, env=os.environ | {"PATH": path}, check=True)


def copy_licence(package: str, target: Path) -> None:
    for licence in (MODULES / package).glob("LICEN[CS]E*"):
        suffix = ".txt" if licence.suffix != ".md" else ".md"
        shutil.copyfile(licence, target / f"{package}-{licence.stem}{suffix}")


if __name__ == "__main__":
    main()
