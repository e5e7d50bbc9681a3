"""A template is compiled once, whoever looks at it in whatever language."""

from pathlib import Path
from typing import Any

import pytest
from fastapi import FastAPI, Request, Response
from jinja2 import Environment, FileSystemLoader, nodes

from app import bundled
from app.plant.texts import Texts
from app.web.assets import Assets
from app.web.guard import allow
from app.web.pages import view_of
from app.web.view import Compiled, Drawn, View
from tests.web.conftest import Start


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


TEMPLATES = sorted(path.relative_to(bundled("templates")).as_posix() for path in bundled("templates").rglob("*.html"))


def own_names(environment: Environment, template: str) -> set[str]:
    """What a template gives a name to: by set, for, macro and its arguments, import."""
    assert environment.loader
    parsed = environment.parse(environment.loader.get_source(environment, template)[0])
    imported = {
        one if isinstance(one, str) else one[1] for taken in parsed.find_all(nodes.FromImport) for one in taken.names
    }
    given = {one.name for one in parsed.find_all(nodes.Name) if one.ctx in ("store", "param")}
    return imported | given | {macro.name for macro in parsed.find_all(nodes.Macro)}


@pytest.mark.sweep(8)
def test_no_template_takes_a_name_that_all_of_them_have() -> None:
    """A name given here hides that of the house in whatever is included or imported from here."""
    environment = View(Assets(bundled("static")))._environment(Texts.read(), "en")
    taken = {template: own_names(environment, template) & environment.globals.keys() for template in TEMPLATES}
    assert len(taken) > 100 and not any(taken.values()), {one: names for one, names in taken.items() if names}


def test_a_page_that_gives_a_name_which_all_templates_have_is_a_mistake_of_the_program(
    start: Start, caplog: pytest.LogCaptureFixture
) -> None:
    def mistaken(app: FastAPI) -> None:
        @app.get("/mistaken", dependencies=[allow("open")])
        async def page(request: Request) -> Response:
            return view_of(request).fragment(request, "fragments/help.html", label_of="mine")

    assert start(extend=mistaken).get("/mistaken").status_code == 500
    assert "fragments/help.html: label_of, expected names that no template has anyway" in caplog.text
