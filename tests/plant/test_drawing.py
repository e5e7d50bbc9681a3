"""Drawings of an integrator's own: what may be drawn, what is refused and how it is told."""

import random
from pathlib import Path

import pytest

from app.plant.drawing import CLASSES, DEEPEST, ELEMENTS, LARGEST_DRAWING, MOST_ELEMENTS, Drawn, read_drawing

HEAD = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" viewBox="0 0 100 50">'
POINTS, MACHINES = ("m1.speed", "m1.status", "c1.state"), ("m1", "c1")


def read(body: str, head: str = HEAD) -> Drawn:
    return read_drawing(f"{head}{body}</svg>".encode(), "screens/hall.svg", POINTS, MACHINES)


def mistake(body: str, head: str = HEAD) -> str:
    drawn = read(body, head)
    assert drawn.picture is None
    return str(drawn.problems[0])


def test_a_text_with_a_tag_is_a_value_and_a_part_leads_to_its_machine() -> None:
    drawn = read(
        '<g data-href="m1"><text x="1" y="2" data-tag="m1.speed"/></g><rect data-tag="c1.state" data-show="1,2" />'
    )
    assert drawn.problems == () and drawn.picture is not None
    assert drawn.picture.tags == ("m1.speed", "c1.state")
    group, rect = (part for part in drawn.picture.all() if part.name in ("g", "rect"))
    text = next(part for part in drawn.picture.all() if part.name == "text")
    assert (group.href, text.is_value, rect.show) == ("m1", True, "1,2")


def test_what_inkscape_writes_is_taken_or_left_out_silently() -> None:
    head = (
        HEAD[:-1]
        + ' xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape" version="1.1" inkscape:version="1.3">'
    )
    drawn = read(
        "<inkscape:namedview><inkscape:grid/></inkscape:namedview><metadata><a/></metadata>"
        '<g inkscape:label="L" id="layer1"><path style="fill:#ccc;stroke-width:0.5;-inkscape-stroke:none" d="M 0,0 H 5"/></g>',
        head,
    )
    assert drawn.picture is not None
    path = next(part for part in drawn.picture.all() if part.name == "path")
    assert path.attributes == {"d": "M 0,0 H 5", "fill": "#ccc", "stroke-width": "0.5"}
    assert [str(doubt) for doubt in drawn.doubts] == [
        'screens/hall.svg:1: <path> style = "-inkscape-stroke:none": expected nothing: it is left out'
    ]


def test_ids_and_references_are_none_of_the_page() -> None:
    drawn = read('<defs><g id="live"><rect/></g></defs><use xlink:href="#live"/><rect fill="url(#live)"/>')
    assert drawn.picture is not None
    found = [dict(part.attributes) for part in drawn.picture.all()]
    assert {"id": "drawn-live"} in found and {"href": "#drawn-live"} in found and {"fill": "url(#drawn-live)"} in found


@pytest.mark.parametrize(
    "body",
    [
        "<script>alert(1)</script>", "<style>*{fill:red}</style>", "<foreignObject/>", "<image href='data:image/png;base64,AA'/>",
        "<animate/>", "<set/>", "<a href='javascript:alert(1)'/>", "<filter/>", "<iframe/>", "<svg/>", "<rect onload='x'/>",
        "<rect OnClick='x'/>", "<rect hx-on:click='x' data-hx-get='/x'/>", "<use href='https://x.example/#a'/>",
        "<use xlink:href='//x/#a'/>", "<rect fill='url(https://x)'/>", "<rect style='fill:url(//x#a)'/>", "<rect fill='u\\72l(x)'/>",
        "<rect style='fill:URL(//x)'/>", "<rect clip-path='url(#none)'/>", "<use href='#none'/>", "<rect data-live='1'/>",
        "<rect id='a'/><rect id='a'/>", "<rect id='a b'/>", "<g id='a'><use href='#a'/></g>",
        "<g id='a'><rect/></g><g id='b'><use href='#a'/></g><use href='#b'/>", "<path d='M0&lt;'/>", "<rect data-tag='m1.sped'/>",
        "<rect data-show='1'/>", "<rect data-tag='m1.speed' data-show='x > 1'/>", "<rect data-tag='m1.speed' data-class='hot:1'/>",
        "<rect data-tag='m1.speed' data-map='1:2' data-move='x'/>", "<rect data-tag='m1.speed' data-map='2:0 1:9' data-move='x'/>",
        "<rect data-tag='m1.speed' data-map='1:0 2:9' data-turn='1'/>", "<title data-tag='m1.speed'/>", "<rect data-href='m2'/>",
        "<rect data-href='javascript:alert(1)'/>", "<rect>", "<rect/></svg><svg>", "&nbsp;", "\x00",
    ],
)  # fmt: skip
def test_what_could_do_harm_or_says_nothing_refuses_the_drawing(body: str) -> None:
    assert mistake(body)


def test_a_mistake_is_told_with_line_element_value_and_the_name_that_was_perhaps_meant() -> None:
    assert mistake('\n<text data-tag="m1.sped"/>') == (
        'screens/hall.svg:2: <text> data-tag = "m1.sped": expected one of c1.state, m1.speed, m1.status (perhaps m1.speed)'
    )
    assert "perhaps m1" in mistake('<g data-href="mm1"/>')
    assert "<rekt> = rekt" in mistake("<rekt/>") and "perhaps rect" in mistake("<rekt/>")


def test_entities_and_a_dtd_are_not_even_read() -> None:
    bomb = '<!DOCTYPE svg [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]>'
    assert "without DTD" in mistake("&b;", bomb + HEAD)
    assert "without DTD" in mistake("", '<!DOCTYPE svg SYSTEM "file:///etc/passwd">' + HEAD)
    assert "an svg element" in mistake("", "<html><svg>")
    assert "viewBox" in mistake("", '<svg xmlns="http://www.w3.org/2000/svg">')


def test_size_depth_elements_and_what_use_repeats_are_bounded() -> None:
    assert "bytes" in mistake(" " * LARGEST_DRAWING)
    assert "in each other" in mistake("<g>" * DEEPEST + "</g>" * DEEPEST)
    assert read("<g>" * (DEEPEST - 1) + "</g>" * (DEEPEST - 1)).picture is not None
    assert read("<g/>" * (MOST_ELEMENTS - 1)).picture is not None
    assert "elements" in mistake("<g/>" * MOST_ELEMENTS)
    assert "elements" in mistake(f"<g id='a'>{'<g/>' * 99}</g>" + "<use href='#a'/>" * 50)


@pytest.mark.sweep(8)
def test_whatever_becomes_of_a_drawing_nothing_but_what_is_allowed_is_left() -> None:
    chance = random.Random(7)
    pieces = [
        *(f"<{name} " for name in (*ELEMENTS, "script", "a", "image")), "/>", ">", "</g>", "</svg>", "onload='1' ", "fill='red' ",
        "style='fill:url(x);stroke:#111' ", "href='#a' ", "xlink:href='http://x' ", "id='a' ", "data-tag='m1.speed' ", "data-show='1' ",
        "class='d-run x' ", "&#x6a;", "]]>", "<!--", "-->", "<![CDATA[", "<?php ?>", "\u202e", "x='1' ", "<g>", "<g/>", "<rect/>",
    ]  # fmt: skip
    whole = 0
    for _ in range(8000):
        drawn = read("".join(chance.choice(pieces) for _ in range(chance.randint(1, 8))))
        assert (drawn.picture is None) == bool(drawn.problems)
        for part in drawn.picture.all() if drawn.picture else ():
            whole += 1
            assert part.name in ELEMENTS
            assert not any(key.startswith(("on", "style", "data-", "hx")) for key in part.attributes)
            assert part.attributes.get("href", "#drawn-").startswith("#drawn-")
            assert set(part.attributes.get("class", "").split()) <= set(CLASSES)
    assert whole > 500


def test_the_first_screen_of_the_documentation_has_no_mistake() -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "screens.md").read_text("utf-8")
    drawing = page.partition("```xml\n")[2].partition("```")[0]
    points = ("m1.running", "m1.speed", "m1.status")
    drawn = read_drawing(drawing.encode(), "screens/fan.svg", points, MACHINES)
    assert drawn.problems == drawn.doubts == () and drawn.picture is not None
    assert set(drawn.picture.tags) == set(points)
    assert all(f"`{name}`" in page for name in CLASSES) and all(name in page for name in ELEMENTS)


@pytest.mark.parametrize("key", ["data-name", "data-alarm"])
def test_the_name_or_the_alarm_of_a_machine_is_a_text_of_its_own(key: str) -> None:
    def problems(inside: str) -> list[str]:
        return [str(problem) for problem in read(inside).problems]

    drawn = read(f'<g data-href="m1"><text x="3" {key}="m1"/></g>')
    part = next(one for one in drawn.picture.all() if one.machine) if drawn.picture else None
    assert part is not None and (part.machine, part.is_alarm, part.tag) == ("m1", key == "data-alarm", "")
    assert any('"m3"' in told and "m1" in told for told in problems(f'<text {key}="m3"/>'))
    for wrong in (f'<g {key}="m1"/>', f'<text {key}="m1" data-tag="m1.speed"/>'):
        assert problems(wrong), wrong


def box(viewbox: str) -> Drawn:
    return read("<rect/>", HEAD.replace("0 0 100 50", viewbox))


@pytest.mark.parametrize("viewbox", ["0 0 0 50", "0 0 100 0", "0 0 -100 50", "0 0 100", "0 0 100 50 1", "a b c d", ""])
def test_a_picture_without_an_area_is_told_and_not_drawn_as_nothing(viewbox: str) -> None:
    assert "viewBox" in str(box(viewbox).problems[0])


@pytest.mark.parametrize(
    "viewbox", [" 0 0 100 50 ", "+0,-0, 1e2 .5e+2", "0 0 105.83333333333334 52.916666666667", "0\n0\n1. 5."]
)
def test_numbers_are_those_of_svg(viewbox: str) -> None:
    assert box(viewbox).problems == ()


@pytest.mark.parametrize("at", ["x='50%'", "y='10mm'", "x='1em'", "x='50%' data-href='m1'"])
def test_a_value_stands_where_numbers_say(at: str) -> None:
    """Its box knows nothing of percents and millimetres: it stood elsewhere."""
    assert "plain numbers" in mistake(f"<text {at} data-tag='m1.speed'/>")
    assert "plain numbers" in mistake(f"<text {at.partition(' ')[0]} data-alarm='m1'/>")
    assert read(f"<text {at}>m</text>").picture is not None or "data-href" in at
    assert read("<text x='.5' y='+1e1 5' data-tag='m1.speed'/>").picture is not None


def test_rules_may_end_with_a_semicolon_and_places_stand_on_lines_of_their_own() -> None:
    drawn = read(
        "<rect data-tag='m1.speed' data-class='d-run:1; d-warn:>80;' data-map=' 0:0\n  100:300 ' data-move='x'/>"
    )
    assert drawn.problems == () and drawn.picture is not None
    rect = drawn.picture.children[0]
    assert not isinstance(rect, str) and rect.classes == (("d-run", "1"), ("d-warn", ">80"))
    assert rect.map == ((0.0, 0.0), (100.0, 300.0))
