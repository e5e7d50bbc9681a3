"""Containers and services, as far as they can be checked where neither runs."""

import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
DOCKERFILE = (ROOT / "Dockerfile").read_text("utf-8")
UNIT = (ROOT / "packaging" / "pogon.service").read_text("utf-8")


def test_the_compose_file_follows_the_schema() -> None:
    dclint = [shutil.which("node") or "node", "node_modules/dclint/bin/dclint.cjs", "--max-warnings", "0"]
    lint = subprocess.run([*dclint, "docker-compose.yml"], cwd=ROOT, capture_output=True, text=True)
    assert lint.returncode == 0, lint.stdout + lint.stderr


def test_the_container_is_locked_down() -> None:
    compose = (ROOT / "docker-compose.yml").read_text("utf-8")
    for line in ("read_only: true", "- ALL", "no-new-privileges:true", "127.0.0.1:8000:8000", "POGON_BEHIND_PROXY:"):
        assert line in compose
    assert not re.search(r"^name:", compose, re.MULTILINE)


def test_the_image_runs_as_nobody_and_says_whether_it_is_well() -> None:
    last = DOCKERFILE.rsplit("\nFROM ", 1)[1]
    (user,) = re.findall(r"^USER (\S+)$", last, re.MULTILINE)
    assert user not in ("root", "0")
    assert re.search(r"^HEALTHCHECK .*\\\n +CMD .*/healthz", last, re.MULTILINE)
    assert re.search(r"^VOLUME /data$", last, re.MULTILINE)
    assert "--require-hashes" in DOCKERFILE


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd on this machine")
def test_the_service_is_valid_and_hardened(tmp_path: Path) -> None:
    unit = tmp_path / "pogon.service"
    unit.write_text(re.sub(r"^ExecStart=\S+", f"ExecStart={sys.executable}", UNIT, flags=re.MULTILINE))
    verify = subprocess.run(["systemd-analyze", "verify", "--man=no", unit], capture_output=True, text=True)
    assert [line for line in verify.stderr.splitlines() if "pogon.service" in line] == []
    audit = ["systemd-analyze", "security", "--offline=true", "--threshold=25", unit]
    grade = subprocess.run(audit, capture_output=True, text=True)
    assert grade.returncode == 0, grade.stdout[-300:]


@pytest.mark.slow
def test_a_wheel_brings_everything_it_shows(tmp_path: Path) -> None:
    build = [Path(sys.executable).parent / "uv", "build", "-q", "--wheel", "--no-build-isolation", "--offline"]
    made = [*build, "--python", sys.executable, "--out-dir", tmp_path, ROOT]
    subprocess.run(made, capture_output=True, check=True)
    (wheel,) = tmp_path.glob("*.whl")
    inside = set(zipfile.ZipFile(wheel).namelist())
    wanted = {"app/cli.py", "app/_data/static/vendor/htmx.min.js"}
    for folder in ("app", "templates", "static", "migrations", "plants/demo"):
        for path in (ROOT / folder).rglob("*"):
            if path.is_file() and "__pycache__" not in path.parts and not path.name.startswith("."):
                wanted.add(str(path.relative_to(ROOT)) if folder == "app" else f"app/_data/{path.relative_to(ROOT)}")
    assert wanted - inside == set()
