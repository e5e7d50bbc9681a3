"""A template is compiled once, whoever looks at it in whatever language."""

from pathlib import Path
from typing import Any

import pytest
from jinja2 import Environment, FileSystemLoader, nodes

from app import bundled
from app.plant.texts import Texts
from app.web.assets import Assets
from app.web.view import Compiled, Drawn, View


@pytest.fixture
def compiled(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the files that were compiled, in order; nothing is known at the begin."""
    names: list[str] = []
    compile = Environment._compile

    def count(environment: Environment, source: str, filename: str) -> Any:
        names.append(Path(filename).name)
        return compile(environment, source, filename)

    monkeypatch.setattr(Environment, "_compile", count)
    monkeypatch.setattr("app.web.view.COMPILED", Compiled())
    return names


def test_all_languages_and_views_share_what_was_compiled(
    compiled: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.html").write_text(
        "{% macro b() %}{{ _('nav.overview') }}{% endmacro %}{{ lang }}: {{ b() }}", "utf-8"
    )
    monkeypatch.setattr("app.web.view.bundled", lambda _folder: tmp_path)
    texts, assets = Texts.read(), Assets(bundled("static"))
    for _ in range(2):
        view = View(assets)
        said = [view._environment(texts, lang).get_template("a.html").render() for lang in texts.languages]
        assert said == [f"{lang}: {texts.text(lang, 'nav.overview')}" for lang in texts.languages]
    assert compiled == ["a.html"]


def test_a_template_that_changed_is_compiled_anew(compiled: list[str], tmp_path: Path) -> None:
    known = Compiled()

    def shown(text: str) -> str:
        (tmp_path / "a.html").write_text(text, "utf-8")
        return Environment(loader=FileSystemLoader(tmp_path), bytecode_cache=known).get_template("a.html").render(n=7)

    assert [shown(text) for text in ("{{ n }}", "{{ n }}!", "{{ n }}")] == ["7", "7!", "7"]
    assert compiled == ["a.html", "a.html"]


async def test_what_a_page_names_is_compiled_before_it_is_drawn_and_parsed_once(
    compiled: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.html").write_text("{% if n %}{% include 'b.html' %}{% endif %}{% include 'c.html' %}", "utf-8")
    (tmp_path / "b.html").write_text("{% include 'c.html' %}", "utf-8")
    (tmp_path / "c.html").write_text("c{{ n }}", "utf-8")
    monkeypatch.setattr("app.web.view.bundled", lambda _folder: tmp_path)
    parsed: list[str] = []
    parse = Environment._parse

    def count(environment: Environment, source: str, name: str | None, filename: str | None) -> nodes.Template:
        parsed.append(source)
        return parse(environment, source, name, filename)

    monkeypatch.setattr(Environment, "_parse", count)
    texts, view = Texts.read(), View(Assets(bundled("static")))
    for lang in texts.languages:
        assert await Drawn(view._environment(texts, lang), "a.html", {"n": 0}, 200).draw() == b"c0"
    assert sorted(compiled) == ["a.html", "b.html", "c.html"]
    assert len(parsed) == len(set(parsed)) == 3
