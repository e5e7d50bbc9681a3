"""The software bill of materials of what runs, CycloneDX 1.6 as JSON: `python tools/sbom.py dist/pogon.cdx.json`.

Names, versions and hashes are those of the lock files (the Python packages of requirements/app.lock, the browser libraries that
package.json ships), licences those that the installed packages say. Nothing is asked of a network, and no host is named in it.
"""

import base64
import json
import re
import sys
from collections.abc import Iterator
from email.message import Message
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import cast

from cyclonedx.contrib.license.factories import LicenseFactory
from cyclonedx.model import HashAlgorithm, HashType, Property
from cyclonedx.model.bom import Bom
from cyclonedx.model.component import Component, ComponentType
from cyclonedx.model.license import License
from cyclonedx.output.json import JsonV1Dot6
from packageurl import PackageURL

from app import __version__

ROOT = Path(__file__).resolve().parent.parent
UNTOLD = {"colorama": "BSD-3-Clause", "pyrage": "MIT"}
"""Licences of packages that do not say theirs in a field, or are for another platform."""


def main() -> int:
    target = Path(sys.argv[1])
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(JsonV1Dot6(bom()).output_as_string(indent=1) + "\n", "utf-8")
    print(f"{target}: {len(bom().components)} components")
    return 0


def bom() -> Bom:
    """Pogon and all it runs with."""
    made = Bom()
    own = Component(
        type=ComponentType.APPLICATION,
        name="pogon",
        version=__version__,
        bom_ref=f"pogon@{__version__}",
        licenses=[LicenseFactory().make_from_string("MIT")],
    )
    made.metadata.component = own
    components = [*python_packages(), *browser_libraries()]
    for component in components:
        made.components.add(component)
    made.register_dependency(own, components)
    return made


def python_packages() -> Iterator[Component]:
    """What `pip install -r requirements/app.lock` brings, with the condition under which it does."""
    text = (ROOT / "requirements" / "app.lock").read_text("utf-8")
    for block in re.split(r"\n(?=\S)", text.strip()):
        found = re.match(r"([\w.-]+)(?:\[[^\]]*\])?==(\S+)(?: *; *([^\\\n]+))?", block)
        if not found:
            raise ValueError(f"requirements/app.lock: {block.splitlines()[0]}: expected name==version")
        name, version, condition = found[1], found[2], (found[3] or "").strip()
        hashes = re.findall(r"--hash=sha256:([0-9a-f]{64})", block)
        told = [Property(name="pogon:sha256-of-a-file", value=one) for one in hashes]
        if condition:
            told.append(Property(name="pogon:only-if", value=condition))
        purl = PackageURL("pypi", name=name.lower().replace("_", "-"), version=version)
        yield Component(
            name=name, version=version, purl=purl, bom_ref=str(purl), licenses=licences(name), properties=told
        )


def browser_libraries() -> Iterator[Component]:
    """What static/vendor is made of; what only checks us is not shipped."""
    packages = json.loads((ROOT / "package-lock.json").read_text("utf-8"))["packages"]
    for full in sorted(json.loads((ROOT / "package.json").read_text("utf-8"))["dependencies"]):
        package = packages[f"node_modules/{full}"]
        group, _, name = full.rpartition("/")
        digest = base64.b64decode(package["integrity"].removeprefix("sha512-")).hex()
        purl = PackageURL("npm", namespace=group or None, name=name, version=package["version"])
        yield Component(
            name=name,
            group=group or None,
            version=package["version"],
            purl=purl,
            bom_ref=str(purl),
            hashes=[HashType(alg=HashAlgorithm.SHA_512, content=digest)],
            licenses=[LicenseFactory().make_from_string(package["license"])],
        )


def licences(name: str) -> list[License]:
    """What the installed package says; nothing for one that is not for this platform."""
    try:
        about = cast(Message, distribution(name).metadata)
    except PackageNotFoundError:
        return [LicenseFactory().make_from_string(UNTOLD[name])] if name in UNTOLD else []
    said = about.get("License-Expression") or ""
    if not said and 0 < len(about.get("License") or "") < 60:
        said = about["License"].strip()
    if not said:
        ends = [row.rpartition(" :: ")[2] for row in about.get_all("Classifier") or [] if row.startswith("License ::")]
        said = " / ".join(ends) or UNTOLD.get(name, "")
    return [LicenseFactory().make_from_string(said)] if said else []


if __name__ == "__main__":
    sys.exit(main())
