"""What can be said of styles, symbols and templates without looking at them."""

import re
from pathlib import Path

import pytest

from app import bundled

CSS = sorted(path for folder in ("css", "screens") for path in (bundled("static") / folder).glob("**/*.css"))
TEMPLATES = sorted(bundled("templates").glob("**/*.html"))
TOKENS = (bundled("static") / "css" / "tokens.css").read_text("utf-8")


def block(selector: str) -> dict[str, str]:
    found = re.search(re.escape(selector) + r"\s*\{(.*?)\}", TOKENS, re.S)
    assert found
    return {
        name: " ".join(value.split()) for name, value in re.findall(r"(--[\w-]+|color-scheme):\s*([^;]+);", found[1])
    }


def test_following_the_system_looks_like_the_dark_theme() -> None:
    assert block('[data-theme="dark"]') == block('[data-theme="auto"]')


def test_both_themes_name_the_same_colours() -> None:
    assert set(block(':root, [data-theme="light"]')) == set(block('[data-theme="dark"]'))


def luminance(colour: str) -> float:
    parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    r, g, b = (part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts)
    return 0.2126 * r + 0.7152 * g + 0.0722 * b


def contrast(one: str, other: str) -> float:
    light, dark = sorted((luminance(one), luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("theme", [':root, [data-theme="light"]', '[data-theme="dark"]'])
def test_text_can_be_read_on_what_it_stands_on(theme: str) -> None:
    colours = block(theme)
    for ground in ("--bg", "--panel", "--inset", "--header"):
        assert contrast(colours["--text"], colours[ground]) >= 7
        assert contrast(colours["--text-2"], colours[ground]) >= 4.5
    for value in ("--live", "--sp"):
        assert contrast(colours[value], colours["--panel"]) >= 7
    assert contrast(colours["--stop-text"], colours["--stop-face"]) >= 7
    for priority in "1234":
        assert contrast(colours[f"--alm-{priority}-on"], colours[f"--alm-{priority}"]) >= 4.5


@pytest.mark.parametrize("path", CSS, ids=lambda path: path.name)
def test_every_token_that_is_used_exists(path: Path) -> None:
    own = set(re.findall(r"(--[\w-]+)\s*:", TOKENS + path.read_text("utf-8")))
    set_elsewhere = {"--fill", "--on", "--c", "--edge", "--edge2", "--head"}
    assert set(re.findall(r"var\((--[\w-]+)", path.read_text("utf-8"))) <= own | set_elsewhere


@pytest.mark.parametrize("path", CSS, ids=lambda path: path.name)
def test_styles_fetch_only_our_letters_and_shout_nothing(path: Path) -> None:
    text = path.read_text("utf-8")
    assert not re.search(r'url\((?!#|"\.\./vendor/)|@import', text)
    assert "text-transform" not in text
    assert text.count("{") == text.count("}")


@pytest.mark.parametrize("path", TEMPLATES, ids=lambda path: path.name)
def test_templates_escape_everything_and_write_no_program(path: Path) -> None:
    text = path.read_text("utf-8")
    assert "|safe" not in text.replace(" ", "") and "autoescape" not in text
    text = re.sub(r"\{%.*?%\}|\{#.*?#\}", "", text, flags=re.S)
    assert not re.search(r"\sstyle=\"|\son[a-z]+=\"|hx-on|javascript:|js:", text)
    assert not re.search(r"<(script|style)(?![^>]*\ssrc=)[^>]*>", text)
    assert "http://" not in text and "https://" not in text


def test_every_symbol_that_is_drawn_exists() -> None:
    known = set(re.findall(r'id="([\w-]+)"', (bundled("static") / "symbols.svg").read_text("utf-8")))
    for path in TEMPLATES:
        text = path.read_text("utf-8")
        drawn = set(re.findall(r'icon\("([\w-]+)"', text)) | set(re.findall(r"#([ice]-[\w-]+)\"", text))
        assert drawn <= known, path.name


@pytest.mark.parametrize("path", TEMPLATES, ids=lambda path: "/".join(path.parts[-3:]))
def test_a_symbol_that_follows_nothing_is_neither_light_nor_dark(path: Path) -> None:
    """Light says that a machine runs and dark that it stands, so one that tells neither would be wrong half of the time."""
    drawn = re.findall(r"<svg class=\"eq\b[^>]*>.*?</svg>", path.read_text("utf-8"), re.S)
    still = [one for one in drawn if not re.search(r"data-|shown\(|worn\(|unknown", one)]
    assert [one for one in still if "eq-kind" not in one] == []


def test_words_under_the_bars_of_alarms_have_room_below_their_line() -> None:
    """A letter that goes below its line, as in "today", is a third of an em deep; type there is 11 high."""
    found = 0
    for path in sorted(Path(bundled("templates")).rglob("*.html")):
        for height, inside in re.findall(
            r'class="hist" viewBox="0 0 \d+ (\d+)"(.*?)</svg>', path.read_text("utf-8"), re.DOTALL
        ):
            found += 1
            assert int(height) - max(int(y) for y in re.findall(r'<text [^>]*y="(\d+)"', inside)) >= 3, path.name
    assert found >= 2
