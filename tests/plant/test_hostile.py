"""A plant folder may hold anything: each is a few lines, in bounded time and memory, and nothing of a file outside is shown."""

import itertools
import os
import resource
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli import cli
from app.errors import ConfigurationError, MissingFile, UnusableFile
from app.files import read_bytes, read_text
from app.plant.loader import read_plant
from app.plant.plant_files.machines import MOST_MACHINES
from app.plant.problems import Problem
from app.plant.tables import MOST_PROBLEMS, STOP_AT
from app.plant.toml import DEEPEST, LARGEST_FILE, LONGEST_TEXT, MOST_VALUES
from app.sim.plant import read_simulated

HEAD = """
[plant]
name = "Hall"
timezone = "Europe/Zagreb"
languages = ["en"]
[links.hall]
transport = "memory"
"""
MOTOR = '[equipment.m1]\ntype = "eura_e800"\nlink = "hall"\nunit = 1\n'
SEQUENCE = '[equipment.s1]\ntype = "sequence"\nlink = "hall"\nunit = 2\ndefinition = "stroke"\n'
QUOTED = ["'a'"]
SECRET = "a-secret-that-is-none-of-its-business"


@contextmanager
def bounded_work() -> Iterator[None]:
    """What a reading may cost: generous against a busy machine, for it counts work of the processor and not time [s]."""
    before = resource.getrusage(resource.RUSAGE_SELF)
    yield
    after = resource.getrusage(resource.RUSAGE_SELF)
    assert after.ru_utime - before.ru_utime < 20


def told(folder: Path) -> list[Problem]:
    """The mistakes of a folder, which are few and short and the same on the command line."""
    with bounded_work():
        plant, problems = read_simulated(folder)
    assert plant is None
    assert 1 <= len(problems) <= MOST_PROBLEMS + 1
    for problem in problems:
        assert len(str(problem)) < 1000 and str(problem).isprintable()
        assert SECRET not in str(problem)
    return problems


def one(folder: Path) -> str:
    problems = told(folder)
    assert len(problems) == 1, problems
    return str(problems[0])


def write(folder: Path, text: str | bytes) -> Path:
    (folder / "plant.toml").write_bytes(text if isinstance(text, bytes) else text.encode())
    return folder


def a_pipe(path: Path) -> None:
    os.mkfifo(path)


def a_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as line:
        former = Path.cwd()
        os.chdir(path.parent)  # an address is short
        try:
            line.bind(path.name)
        finally:
            os.chdir(former)


def a_link_to(target: str) -> Callable[[Path], None]:
    def make(path: Path) -> None:
        outside = path.parents[1 if path.name == "plant.toml" else 2] / "outside"
        outside.write_text(f"{SECRET} = {SECRET}\n")
        path.symlink_to(outside if target == "outside" else target)

    make.__name__ = f"a_link_to_{target}"
    return make


def a_loop(path: Path) -> None:
    path.symlink_to(path)


KINDS: list[tuple[Callable[[Path], None], str]] = [
    (a_pipe, "a pipe"),
    (a_socket, "a socket"),
    (Path.mkdir, "a folder"),
    (a_link_to("outside"), "a link that leads out of its folder"),
    (a_link_to("/etc/passwd"), "a link that leads out of its folder"),
    (a_link_to("/dev/zero"), "a link that leads out of its folder"),
    (a_link_to("/proc/self/environ"), "a link that leads out of its folder"),
    (a_link_to("nowhere"), "no such file"),
    (a_loop, "Too many levels of symbolic links"),
]


@pytest.mark.parametrize(("make", "found"), KINDS, ids=lambda value: getattr(value, "__name__", ""))
@pytest.mark.parametrize("name", ["plant.toml", "sequences/stroke.toml"])
def test_what_is_no_file_of_the_folder_is_one_line(
    tmp_path: Path, name: str, make: Callable[[Path], None], found: str
) -> None:
    folder = tmp_path / "plant"
    (folder / "sequences").mkdir(parents=True)
    if name != "plant.toml":
        write(folder, HEAD + SEQUENCE)
    make(folder / name)
    said = one(folder)
    assert said.startswith(f"{name}: (file) = ") and found in said


def test_a_folder_of_sequences_elsewhere_is_not_looked_into(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "stroke.toml").write_text(SECRET)
    (tmp_path / "elsewhere" / "private_name.toml").write_text(SECRET)
    folder = tmp_path / "plant"
    folder.mkdir()
    (folder / "sequences").symlink_to(tmp_path / "elsewhere")
    said = one(write(folder, HEAD + SEQUENCE))
    assert "private_name" not in said


def test_a_link_within_the_folder_is_followed(tmp_path: Path) -> None:
    """As a mounted configuration has it, and the folder itself may be a link."""
    folder = tmp_path / "plant"
    (folder / "..data").mkdir(parents=True)
    (folder / "..data" / "plant.toml").write_text(HEAD + MOTOR)
    (folder / "plant.toml").symlink_to("..data/plant.toml")
    (tmp_path / "current").symlink_to(folder)
    assert read_plant(tmp_path / "current")[1] == []


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_a_file_that_may_not_be_read_is_one_line(tmp_path: Path) -> None:
    write(tmp_path, HEAD + MOTOR)
    (tmp_path / "plant.toml").chmod(0)
    assert "Permission denied" in one(tmp_path)


def nested(before: str, after: str, times: int) -> str:
    return f"{HEAD}{MOTOR}x = {before * times}{after * times}\n"


@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f"{HEAD}{MOTOR}rated_current = {'9' * 5000}\n", ":12: (file) = a key or a number of 5000 characters"),
        (f"{HEAD}{MOTOR}rated_current = -{'9' * 5000}\n", "a key or a number of 5001 characters"),
        (f"{HEAD}{MOTOR}rated_current = 0x{'f' * 5000}\n", "a key or a number of 5002 characters"),
        (f"{HEAD}{MOTOR}rated_current = 1.{'0' * 5000}\n", "a key or a number of 5000 characters"),
        (f"{HEAD}{MOTOR}rated_current = {2**64}\n", "rated_current: a number of 65 bits"),
        (f"{HEAD}{MOTOR}rated_current = 0x{'f' * 150}\n", "rated_current: a number of 600 bits"),
        (f"{HEAD}{MOTOR}{'k' * 5000} = 1\n", "a key or a number of 5000 characters"),
        (f"{HEAD}{MOTOR}'{'k' * 5000}' = 1\n", "a key with control characters, or a long one"),
        (f'{HEAD}{MOTOR}"\\u001b[2J" = 1\n', "a key with control characters"),
        (f'{HEAD}{MOTOR}label = "\\u0000"\n', "label: a text with control characters"),
        (f'{HEAD}{MOTOR}label = "{"x" * 100_000}"\n', "label: a text of 100000 characters"),
        (f"{HEAD}{MOTOR}label = '''{'x' * 100_000}'''\n", f"at most {LONGEST_TEXT} characters"),
        (nested("[", "]", 100), f"at most {DEEPEST} in each other"),
        (nested("[", "]", 100_000), f"at most {DEEPEST} in each other"),
        (nested("{a = ", "}", 100), f"at most {DEEPEST} in each other"),
        (nested("[{a = ", "}]", 100_000), f"at most {DEEPEST} in each other"),
        (nested("[", "", 20_000), f"at most {DEEPEST} in each other"),
        (f"{HEAD}{MOTOR}{'.'.join('a' * 100_000)} = 1\n", f"at most {DEEPEST} parts"),
        (f"{HEAD}{MOTOR}{' . '.join(QUOTED * 100_000)} = 1\n", f"at most {DEEPEST} parts"),
        (f"[{'.'.join('a' * 100_000)}]\n", f"at most {DEEPEST} parts"),
        (HEAD + MOTOR + "".join(f"k{i} = 1\n" for i in range(200_000)), f"at most {LARGEST_FILE} bytes"),
        (HEAD + MOTOR + "".join(f"{i}=1\n" for i in range(200_000)), f"at most {MOST_VALUES} in one file"),
        (f"{HEAD}{MOTOR}x = [{'1,' * 200_000}]\n", f"at most {MOST_VALUES} in one file"),
        (HEAD + "#" * LARGEST_FILE, f"at most {LARGEST_FILE} bytes"),
        (b"[plant]\nname = '\x80'\n", ":2: (file) = byte 0x80: expected text in UTF-8"),
        ((HEAD + MOTOR).encode("utf-16"), "byte 0xff"),
        (f'{HEAD}{MOTOR}label = "a\0b"\n', "expected TOML ("),
        (b"\0" * 100_000, "expected TOML ("),
        (bytes(range(256)) * 400, "expected text in UTF-8"),
        (f'{HEAD}{MOTOR}label = "{"x " * 500_000}\n', "expected TOML ("),
        (f"{HEAD}{MOTOR}label = {'x' * 100}\n" + '"' * 500_000, "expected TOML ("),
        (f"{HEAD}{MOTOR}" + '"""' + "\\" * 1_000_001, "expected TOML ("),
        (f"{HEAD}{MOTOR}" + " " * 1_000_000 + "[", "expected TOML ("),
        (f"{HEAD}{MOTOR}" + "[ " + " " * 1_000_000 + "x", "expected TOML ("),
        (f"{HEAD}{MOTOR}x = 2026-13-45\n", "expected TOML ("),
    ],
    ids=itertools.count(),
)  # fmt: skip
def test_what_nobody_writes_by_hand_is_one_line(tmp_path: Path, text: str | bytes, said: str) -> None:
    assert said in one(write(tmp_path, text))


def test_of_very_many_mistakes_the_first_are_told_and_the_rest_counted(tmp_path: Path) -> None:
    text = HEAD + MOTOR + "".join(f"k{i} = 1\n" for i in range(MOST_PROBLEMS + 312))
    problems = told(write(tmp_path, text))
    assert len(problems) == MOST_PROBLEMS + 1
    assert str(problems[-1]) == "and 312 more"
    done = CliRunner().invoke(cli, ["check", str(tmp_path)])
    assert done.exit_code == 2
    assert done.stderr.splitlines()[-1] == "pogon: and 312 more"
    assert f"{tmp_path}/plant.toml:12: equipment.m1.k0 = 1: expected no such key" in done.stderr


MISTAKES: dict[str, Callable[[int], str]] = {
    "keys": lambda n: MOTOR + "".join(f"k{i} = 1\n" for i in range(n)),
    "tables": lambda n: MOTOR + "".join(f"[t{i}]\n" for i in range(n)),
    "alarms": lambda n: MOTOR + "".join(f'[[alarms]]\nequipment = "nobody{i}"\n' for i in range(n)),
    "machines": lambda n: "".join(f'[equipment.m{i}]\ntype = "none{i}"\n' for i in range(n)),
    "units": lambda n: "".join(MOTOR.replace("m1", f"m{i}") for i in range(n)),
    "links": lambda n: "".join(f'[links.l{i}]\ntransport = "x{i}"\n' for i in range(n)) + MOTOR,
    "areas": lambda n: "".join(f"[areas.a{i}]\nlabel = 1\n" for i in range(n)) + MOTOR,
    "points": lambda n: MOTOR + "".join(f"[equipment.m1.points.p{i}]\nhistory = 1\n" for i in range(n)),
    "labels": lambda n: MOTOR + "label = { " + ", ".join(f"l{i} = 'x'" for i in range(n)) + " }\n",
    "languages": lambda n: MOTOR + "[plant2]\nx = [" + ", ".join(f"'l{i}'" for i in range(n)) + "]\n",
}


@pytest.mark.sweep(8)
@pytest.mark.parametrize("mistake", MISTAKES.values(), ids=MISTAKES)
@pytest.mark.parametrize("many", [STOP_AT + 500, 15_000])
def test_reading_stops_when_it_is_not_worth_it(tmp_path: Path, mistake: Callable[[int], str], many: int) -> None:
    problems = told(write(tmp_path, HEAD + mistake(many)))
    if len(problems) > MOST_PROBLEMS:
        assert str(problems[-1]).startswith(f"and {STOP_AT - MOST_PROBLEMS} more, and the rest")


@pytest.mark.sweep(20)
@pytest.mark.slow
def test_five_thousand_machines_are_one_line(tmp_path: Path) -> None:
    links = "".join(f'[links.l{k}]\ntransport = "memory"\n' for k in range(21))
    motors = [MOTOR.replace("m1", f"m{i}").replace("hall", f"l{i // 247}") for i in range(5000)]
    text = HEAD + links + "".join(motor.replace("unit = 1", f"unit = {i % 247 + 1}") for i, motor in enumerate(motors))
    assert f"more than {MOST_MACHINES} machines" in one(write(tmp_path, text))


@pytest.mark.sweep(8)
def test_a_reload_with_a_pipe_in_the_plant_is_answered(tmp_path: Path) -> None:
    """In a process of its own and with an end to its time and memory: nothing else proves that it does not hang."""
    os.mkfifo(tmp_path / "plant.toml")

    def least() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (20, 20))
        resource.setrlimit(resource.RLIMIT_AS, (2**30, 2**30))

    done = subprocess.run(
        [sys.executable, "-m", "app.cli", "check", str(tmp_path)],
        capture_output=True, text=True, timeout=120, preexec_fn=least, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr == f"pogon: {tmp_path}/plant.toml: (file) = a pipe: expected a TOML file\n"


def test_files_are_read_only_as_far_as_agreed(tmp_path: Path) -> None:
    file = tmp_path / "a"
    file.write_bytes(b"x" * 10)
    assert read_bytes(file, 10) == b"x" * 10
    with pytest.raises(UnusableFile, match=r"a: 10 bytes, expected at most 9 bytes"):
        read_bytes(file, 9)
    with pytest.raises(UnusableFile, match="expected at most 4 bytes"):
        read_bytes(Path("/proc/self/status"), 4)  # whose size is told as 0
    with pytest.raises(MissingFile):
        read_bytes(file / "b", 9)
    with pytest.raises(UnusableFile, match=r"null (byte|character)"):
        read_bytes(Path("a\0b"), 9)
    with pytest.raises(UnusableFile, match="too long"):
        read_bytes(Path("a" * 300), 9)
    for device in ("/dev/zero", "/dev/null", "/dev/ptmx"):
        with pytest.raises(ConfigurationError, match="a device, expected an ordinary file"):
            read_bytes(Path(device), 9)
    file.write_bytes(b"\xef\xbb\xbfab")
    assert read_text(file, 9) == "ab"
