"""A newcomer types two commands: what they rest on, and what the README says about them, stays true."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from app.settings import Settings

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text("utf-8")
MAKEFILE = (ROOT / "Makefile").read_text("utf-8")
LOCKS = [*sorted((ROOT / "requirements").glob("*.lock")), ROOT / "package-lock.json"]


@pytest.mark.parametrize("lock", LOCKS, ids=lambda path: path.name)
def test_a_lock_names_packages_and_hashes_but_no_address(lock: Path) -> None:
    found = re.findall(r"https?://\S+|--(?:extra-)?index-url|--find-links|file:\S+", lock.read_text())
    assert found == []


@pytest.mark.parametrize("lock", [path for path in LOCKS if path.suffix == ".lock"], ids=lambda path: path.name)
def test_every_python_package_is_pinned_and_hashed(lock: Path) -> None:
    packages = re.split(r"\n(?=\S)", lock.read_text().strip())
    assert len(packages) >= 1
    assert [text for text in packages if not re.match(r"[\w.\[\]-]+==\S+[^\n]*\\\n +--hash=sha256:", text)] == []


def test_every_npm_package_has_its_hash_and_the_front_end_exact_versions() -> None:
    packages = json.loads((ROOT / "package-lock.json").read_text())["packages"]
    assert [name for name, package in packages.items() if name and "integrity" not in package] == []
    wanted = json.loads((ROOT / "package.json").read_text())
    versions = {**wanted["dependencies"], **wanted["devDependencies"]}
    assert {name: packages[f"node_modules/{name}"]["version"] for name in versions} == versions


def test_the_readme_names_every_setting_with_its_default_and_meaning() -> None:
    rows = dict(re.findall(r"^\| `(POGON_\w+)` \| (.*) \|$", README, re.MULTILINE))
    assert sorted(rows) == sorted(f"POGON_{name.upper()}" for name in Settings.model_fields)
    for name, field in Settings.model_fields.items():
        default, meaning = (cell.strip() for cell in rows[f"POGON_{name.upper()}"].split("|"))
        assert (field.description or "").rstrip(".") in meaning
        if name != "plant":  # its default is a folder of ours, wherever that is
            shown = str(field.default).lower() if isinstance(field.default, bool) else str(field.default or "")
            assert default.strip("`") == shown, name


def test_the_readme_gives_a_newcomer_exactly_two_commands() -> None:
    assert re.findall(r"```sh\n(.*?)```", README, re.DOTALL) == ["make run\nmake test\n"]


def test_help_lists_every_target() -> None:
    (targets,) = re.findall(r"^\.PHONY: (.*)$", MAKEFILE, re.MULTILINE)
    shown = subprocess.run(["make", "help"], cwd=ROOT, env=plain(), capture_output=True, text=True, check=True).stdout
    assert re.findall(r"^  make (\S+) +\S", shown, re.MULTILINE) == [
        t for t in targets.split() if not t.startswith(".")
    ]


def test_every_make_target_of_the_documentation_exists() -> None:
    (targets,) = re.findall(r"^\.PHONY: (.*)$", MAKEFILE, re.MULTILINE)
    for page in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]:
        assert set(re.findall(r"(?:`|^)make ([a-z]+)", page.read_text("utf-8"), re.MULTILINE)) <= set(
            targets.split()
        ), page


def test_every_file_that_the_readme_links_to_exists() -> None:
    links = re.findall(r"\]\(([^)#:]+)\)", README)
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_an_old_python_is_refused_in_one_line(tmp_path: Path) -> None:
    old = tmp_path / "python3.9"
    old.write_text('#!/bin/sh\n[ "$1" = -V ] && echo "Python 3.9.2" && exit 0\nexit 1\n')
    old.chmod(0o755)
    asked = ["make", "-s", "setup", f"PYTHON={old}", f"VENV={tmp_path / 'venv'}"]
    made = subprocess.run(asked, cwd=ROOT, env=plain(), capture_output=True, text=True)
    assert made.returncode != 0
    assert made.stdout.splitlines()[:1] == [
        "Pogon needs Python 3.11 or newer, not 'Python 3.9.2': make PYTHON=python3.12 ..."
    ]


def test_the_build_server_runs_every_test() -> None:
    script = ROOT / ".ci" / "run"
    assert os.access(script, os.X_OK)
    assert "set -euo pipefail" in script.read_text()
    assert script.read_text().splitlines()[-1] == "exec make test SWEEP=1"


def test_the_front_end_is_packaged_with_its_licences_and_not_committed() -> None:
    vendor = {path.name for path in (ROOT / "static" / "vendor").iterdir()}
    scripts = {"htmx.min.js", "uPlot.iife.min.js", "uPlot.min.css"}
    letters = {
        f"{face}.woff2"
        for face in ("arimo-latin", "arimo-latin-ext", "cousine-latin", "cousine-latin-ext", "noto-sans-math")
    }
    assert scripts | letters <= vendor
    fonts = ("fontsource-variable-arimo", "fontsource-cousine", "fontsource-noto-sans-math")
    for package in ("htmx.org", "uplot", *fonts):
        assert any(name.startswith(f"{package}-LICENSE") for name in vendor), package
    assert (ROOT / "tests" / ".vendor" / "axe.min.js").is_file()
    if (ROOT / ".git").exists():
        kept = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
        assert re.findall(r"^.*(?:node_modules|vendor)/.*$", kept, re.MULTILINE) == []


@pytest.mark.sweep(8)
def test_pogon_is_installed_from_this_tree() -> None:
    script = Path(sys.executable).parent / "pogon"
    shown = subprocess.run([script, "--version"], capture_output=True, text=True, check=True).stdout
    assert re.fullmatch(r"pogon \d+\.\d+\.\d+\n", shown)


@pytest.mark.sweep(8)
def test_a_server_starts_answers_and_ends_in_time(pogon_server) -> None:
    server = pogon_server()
    assert server.stop() in (0, -15)
    assert "Traceback" not in server.log()


def plain() -> dict[str, str]:
    """The environment without what `make test` hands down to a make of ours."""
    return {name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL")}
