"""Fetch the packaged front-end libraries and put the few files we serve into static/vendor.

`npm ci` installs exactly package-lock.json into node_modules (nothing is run from the packages),
then the files below are copied with the licence of each library beside them; of the fonts only the characters that we draw.
"""

import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from fontTools import subset  # type: ignore[import-untyped]

ROOT = Path(__file__).resolve().parent.parent
MODULES = ROOT / "node_modules"
FILES = {
    "static/vendor": [
        "htmx.org/dist/htmx.min.js",
        "uplot/dist/uPlot.iife.min.js",
        "uplot/dist/uPlot.min.css",
    ],
    "tests/.vendor": ["axe-core/axe.min.js"],
}
LETTERS = (
    "U+0020-007E,U+00A0-017F,U+0218-021B,U+1E9E,U+2002-2015,U+2018-201E,U+2020-2022,U+2026,U+202F,U+2030,U+2032-2033,"
    "U+2039-203A,U+20AC,U+2122,U+2191,U+2193,U+2212"
)
"""Latin-1, Latin-2 and the signs of print, from Arimo (as wide as Arial and Liberation Sans, digits of equal width) and Cousine."""
SYMBOLS = (
    "U+0394,U+03A9,U+03BC,U+2016,U+2190-2195,U+2219-221A,U+221E,U+2248,U+2260,U+2264-2265,U+2500,U+25A0-25A1,U+25B2-25BF,"
    "U+25CB,U+25CF,U+2713"
)
"""What those have not: arrows, signs of mathematics, marks."""
FEATURES = ["ccmp", "kern", "locl", "mark", "mkmk", "tnum"]
THIN_SPACE, NARROW_SPACE = 0x2009, 0x202F
FONTS = {
    "arimo-latin.woff2": ("@fontsource-variable/arimo/files/arimo-latin-wght-normal.woff2", LETTERS),
    "arimo-latin-ext.woff2": ("@fontsource-variable/arimo/files/arimo-latin-ext-wght-normal.woff2", LETTERS),
    "cousine-latin.woff2": ("@fontsource/cousine/files/cousine-latin-400-normal.woff2", LETTERS),
    "cousine-latin-ext.woff2": ("@fontsource/cousine/files/cousine-latin-ext-400-normal.woff2", LETTERS),
    "noto-sans-math.woff2": ("@fontsource/noto-sans-math/files/noto-sans-math-latin-400-normal.woff2", SYMBOLS),
}
FONTS_IN = "static/vendor"
"""File in it: where it comes from, what of it is kept. static/css/font.css names them."""


def main() -> None:
    lock = hashlib.sha256((ROOT / "package-lock.json").read_bytes()).hexdigest()
    stamp = MODULES / ".lock-sha256"
    if not stamp.is_file() or stamp.read_text() != lock:
        npm_ci()
        stamp.write_text(lock)
    for folder, files in FILES.items():
        with tempfile.TemporaryDirectory(dir=MODULES) as made:
            for file in files:
                shutil.copyfile(MODULES / file, Path(made) / Path(file).name)
                copy_licence(file, Path(made))
            for name, (file, characters) in FONTS.items() if folder == FONTS_IN else ():
                cut_font(MODULES / file, Path(made) / name, characters)
                copy_licence(file, Path(made))
            put(Path(made), ROOT / folder)


def put(made: Path, target: Path) -> None:
    """Make the folder `target` hold the files of `made`, each of them at every moment: a server may be reading them."""
    target.mkdir(parents=True, exist_ok=True)
    for former in target.iterdir():
        if not former.name.startswith(".") and not (made / former.name).exists():
            former.unlink()
    for file in made.iterdir():
        file.replace(target / file.name)


def npm_ci() -> None:
    """Install node_modules, with the npm of this environment before any other."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    npm = shutil.which("npm", path=path)
    if npm is None:
        sys.exit("npm is missing: `make setup` installs it, or install Node.js 20 or newer")
    subprocess.run([npm, "ci", "--silent"], cwd=ROOT, env=os.environ | {"PATH": path}, check=True)


def cut_font(source: Path, target: Path, characters: str) -> None:
    """Keep of a font only `characters` (`U+0041-005A,U+2192`), as a packed web font.

    The narrow space between groups of digits, which faces lack, is their thin space.
    """
    options = subset.Options(flavor="woff2", layout_features=FEATURES, hinting=False)
    options.drop_tables += ["MATH"]
    font = subset.load_font(source, options)
    cutter = subset.Subsetter(options)
    cutter.populate(unicodes=subset.parse_unicodes(characters))
    cutter.subset(font)
    for table in font["cmap"].tables:
        if THIN_SPACE in table.cmap:
            table.cmap.setdefault(NARROW_SPACE, table.cmap[THIN_SPACE])
    subset.save_font(font, target, options)


def copy_licence(file: str, target: Path) -> None:
    """Put the licence of the package that has `file` into the folder `target`: `@owner/name` as `owner-name-LICENSE.txt`."""
    parts = file.split("/")
    package = "/".join(parts[: 2 if file.startswith("@") else 1])
    for licence in (MODULES / package).glob("LICEN[CS]E*"):
        suffix = ".txt" if licence.suffix != ".md" else ".md"
        shutil.copyfile(licence, target / f"{package.removeprefix('@').replace('/', '-')}-{licence.stem}{suffix}")


if __name__ == "__main__":
    main()
