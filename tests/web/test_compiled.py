"""What templates were compiled to is kept from one start to the next, and taken only when it is ours and of this template."""

import asyncio
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from jinja2 import Environment

from app.web import compile_templates, compiled, view
from app.web.compiled import KeptCode
from app.web.view import Compiled
from tests.conftest import ROOT
from tests.web.people import Staff

PAGES = (("equipment", ""), ("equipment", "/faceplate"), ("equipment", "/parameters"), ("instructor", ""))


class Starts:
    """Starts of the program one after the other, with templates in a folder of their own."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.templates = folder / "templates"
        self.templates.mkdir(mode=0o755)
        self.kept = folder / "kept"
        self.compiled: list[str] = []
        """Names of the files that were compiled since the last start."""
        self._monkeypatch = monkeypatch
        monkeypatch.setattr("app.web.view.bundled", lambda _folder: self.templates)
        compile = Environment._compile

        def count(environment: Environment, source: str, filename: str) -> Any:
            self.compiled.append(Path(filename).name)
            return compile(environment, source, filename)

        monkeypatch.setattr(Environment, "_compile", count)

    def write(self, name: str, text: str) -> None:
        (self.templates / name).write_text(text, "utf-8")

    def start(self) -> None:
        """Nothing is known any more but what was kept."""
        self._monkeypatch.setattr(view, "COMPILED", Compiled(KeptCode(self.kept)))
        self.compiled.clear()

    def shown(self, name: str = "a.html") -> str:
        """The template, drawn by a program that has just started."""
        self.start()
        return view.templates().get_template(name).render(n="<7>")

    @property
    def file(self) -> Path:
        """The only one that is kept."""
        (found,) = self.kept.iterdir()
        return found


@pytest.fixture
def starts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Starts:
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    made = Starts(tmp_path, monkeypatch)
    made.write("a.html", "n is {{ n }}")
    return made


def test_the_second_start_compiles_nothing(starts: Starts) -> None:
    assert (starts.shown(), starts.compiled) == ("n is &lt;7&gt;", ["a.html"])
    assert (starts.shown(), starts.compiled) == ("n is &lt;7&gt;", [])


def test_what_a_template_names_is_known_without_compiling_it(starts: Starts) -> None:
    starts.write("a.html", "{% include 'b.html' %}")
    starts.write("b.html", "b")
    for compiled_now in (["a.html", "b.html"], []):
        starts.start()
        environment = view.templates()
        view._compile(environment, "a.html")
        assert view.COMPILED.names == {
            str(starts.templates / "a.html"): ["b.html"],
            str(starts.templates / "b.html"): [],
        }
        assert starts.compiled == compiled_now


def test_templates_that_are_named_by_a_value_or_in_parts_are_known_too(starts: Starts) -> None:
    starts.write("a.html", "{% include body %}{% include ['s-' ~ n ~ '.html', 'c.html'] %}")
    starts.write("s-1.html", "{% include 'd.html' %}")
    for name in ("b.html", "c.html", "d.html"):
        starts.write(name, name)
    for compiled_now in (["a.html", "c.html", "d.html", "s-1.html"], []):
        starts.start()
        assert view._compile(view.templates(), "a.html") == ["body"]
        assert sorted(starts.compiled) == compiled_now


@pytest.mark.sweep(20)
def test_no_page_has_a_template_compiled_on_the_loop(demo: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    staff, aside, compiled_here = Staff(demo), [False], set[str]()
    staff.enter("ivana", "engineer", "operator")
    compile, to_thread = Environment._compile, asyncio.to_thread

    def note(environment: Environment, source: str, filename: str) -> Any:
        if not aside[0]:
            compiled_here.add(filename)
        return compile(environment, source, filename)

    async def away(work: Any, *given: Any) -> Any:
        aside[0] = True
        try:
            return await to_thread(work, *given)
        finally:
            aside[0] = False

    monkeypatch.setattr(Environment, "_compile", note)
    monkeypatch.setattr(asyncio, "to_thread", away)
    machines = demo.app.state.runtime.plant.equipment  # type: ignore[attr-defined]
    pages = ["", *(f"{kind}/{id}{part}" for id in machines for kind, part in PAGES)]
    for page in pages:
        monkeypatch.setattr(view, "COMPILED", Compiled())
        monkeypatch.setattr(demo.app.state.view, "_environments", {})  # type: ignore[attr-defined]
        assert demo.get(f"/{page}").status_code in (200, 404)
        assert view.COMPILED.names and (page, compiled_here) == (page, set())


def test_a_template_that_changed_is_compiled_anew_and_replaces_what_was_kept(starts: Starts) -> None:
    starts.shown()
    former = starts.file.stat()
    starts.write("a.html", "n was {{ n }}")  # as long as the former one
    os.utime(starts.templates / "a.html", ns=(former.st_mtime_ns, former.st_mtime_ns))
    assert (starts.shown(), starts.compiled) == ("n was &lt;7&gt;", ["a.html"])
    assert (starts.shown(), starts.compiled) == ("n was &lt;7&gt;", [])
    assert starts.file.name.endswith(".jinja")


@pytest.mark.parametrize("mode", [0o620, 0o602, 0o666])
def test_a_file_that_others_may_write_is_not_taken(starts: Starts, mode: int) -> None:
    starts.shown()
    starts.file.chmod(mode)
    assert (starts.shown(), starts.compiled) == ("n is &lt;7&gt;", ["a.html"])


@pytest.mark.parametrize("mode", [0o770, 0o707, 0o777])
def test_nothing_is_taken_from_a_folder_that_others_may_write_and_nothing_put_there(starts: Starts, mode: int) -> None:
    starts.shown()
    starts.kept.chmod(mode)
    assert (starts.shown(), starts.compiled) == ("n is &lt;7&gt;", ["a.html"])
    starts.file.unlink()
    starts.shown()
    assert not list(starts.kept.iterdir())


def test_a_file_of_another_account_is_not_taken(starts: Starts, monkeypatch: pytest.MonkeyPatch) -> None:
    starts.shown()
    owned = os.fstat

    def by_another(descriptor: int) -> os.stat_result:
        return os.stat_result((*owned(descriptor)[:4], os.geteuid() + 1, *owned(descriptor)[5:]))

    monkeypatch.setattr(os, "fstat", by_another)
    assert (starts.shown(), starts.compiled) == ("n is &lt;7&gt;", ["a.html"])


def test_a_link_to_a_file_and_a_pipe_are_not_taken(starts: Starts, tmp_path: Path) -> None:
    starts.shown()
    file = starts.file
    file.rename(tmp_path / "elsewhere")
    file.symlink_to(tmp_path / "elsewhere")
    starts.start()
    assert KeptCode(starts.kept).read(file.name.partition(".")[0], "") is None
    assert (starts.shown(), starts.compiled) == ("n is &lt;7&gt;", ["a.html"])
    starts.file.unlink()
    os.mkfifo(file, 0o600)
    assert (starts.shown(), starts.compiled) == ("n is &lt;7&gt;", ["a.html"])


@pytest.mark.parametrize("left", [0, 10, 32, 100, -1])
def test_a_file_that_was_cut_short_is_not_taken(starts: Starts, left: int) -> None:
    starts.shown()
    starts.file.write_bytes(starts.file.read_bytes()[:left])
    assert (starts.shown(), starts.compiled) == ("n is &lt;7&gt;", ["a.html"])


def test_a_file_with_another_byte_anywhere_is_not_taken(starts: Starts) -> None:
    starts.shown()
    whole = starts.file.read_bytes()
    for place in range(0, len(whole), 97):
        starts.file.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        assert (starts.shown(), starts.compiled) == ("n is &lt;7&gt;", ["a.html"])


def test_what_another_version_compiled_is_not_taken(starts: Starts, monkeypatch: pytest.MonkeyPatch) -> None:
    starts.shown()
    monkeypatch.setattr(compiled, "MAKER", compiled.MAKER + "+1")
    assert (starts.shown(), starts.compiled) == ("n is &lt;7&gt;", ["a.html"])


def test_the_code_of_one_template_is_not_taken_for_another(starts: Starts) -> None:
    starts.shown()
    first = starts.file.read_bytes()
    starts.file.unlink()
    starts.write("b.html", "n is {{ n }}")
    starts.shown("b.html")
    starts.file.write_bytes(first)
    assert (starts.shown("b.html"), starts.compiled) == ("n is &lt;7&gt;", ["b.html"])


def test_nothing_is_kept_where_python_keeps_none(starts: Starts, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    assert starts.shown() == "n is &lt;7&gt;"
    assert not starts.kept.exists()


def test_a_page_is_drawn_where_nothing_can_be_kept(starts: Starts) -> None:
    starts.kept.write_text("no folder")
    assert (starts.shown(), starts.compiled) == ("n is &lt;7&gt;", ["a.html"])
    assert starts.kept.read_text() == "no folder"


def test_a_write_that_fails_leaves_nothing_behind(starts: Starts, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_source: object, _target: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    assert starts.shown() == "n is &lt;7&gt;"
    assert not list(starts.kept.iterdir())


@pytest.mark.parametrize(("folder", "file"), [(0o700, 0o600), (0o755, 0o644), (0o750, 0o640)])
def test_who_may_read_the_folder_may_read_the_file(starts: Starts, folder: int, file: int) -> None:
    starts.kept.mkdir()
    starts.kept.chmod(folder)
    starts.shown()
    assert starts.file.stat().st_mode & 0o777 == file


def test_all_templates_are_compiled_at_once_for_who_may_not_write_there(starts: Starts) -> None:
    (starts.templates / "screens").mkdir()
    starts.write("screens/b.html", "b")
    starts.start()
    compile_templates.main()
    assert sorted(starts.compiled) == ["a.html", "b.html"]
    assert (starts.shown(), starts.shown("screens/b.html"), starts.compiled) == ("n is &lt;7&gt;", "b", [])


COUNT = """
from jinja2 import Environment
from app.web import view
compiled, compile = [], Environment._compile
Environment._compile = lambda self, source, filename: compiled.append(filename) or compile(self, source, filename)
view.templates().get_template("layouts/frame.html")
print(len(compiled))
"""


@pytest.mark.sweep(8)
def test_one_process_of_the_product_leaves_to_the_next_what_it_compiled() -> None:
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    counts = [
        subprocess.run([sys.executable, "-c", COUNT], cwd=ROOT, env=kept, capture_output=True, text=True, check=True)
        for _ in range(2)
    ]
    assert counts[1].stdout == "0\n"


def test_a_folder_made_by_an_account_whose_group_may_write_is_taken_all_the_same(starts: Starts) -> None:
    mask = os.umask(0o002)
    try:
        starts.shown()
        starts.shown()
    finally:
        os.umask(mask)
    assert starts.compiled == []
