"""A drawing of an integrator's own, SVG → (picture of allowed parts, problems, doubts); pure, never raises.

Expat of the standard library reads it: it stops at a DTD, without which there are no entities, and tells the line of each mistake;
defusedxml would wrap the same parser, nh3 and lxml bring a compiled library. What is not in the lists below never reaches a page. A mistake
(script, event, foreign reference, unknown tag) refuses the whole drawing; what merely has no meaning here (an unknown attribute, a property
of a style) is left out and told as a doubt; what editors keep for themselves in namespaces of their own is left out and not told.

Source of names and values: SVG 2, https://www.w3.org/TR/SVG2/ (attindex, eltindex); the bindings are those of static/js/values.js.
"""

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from itertools import pairwise
from xml.parsers import expat

from app.plant.problems import Problem
from app.plant.said import Plain, any_of, printable, said
from app.plant.tables import LONGEST_SHOWN

LARGEST_DRAWING = 512 * 1024
"""[bytes]"""
MOST_ELEMENTS, DEEPEST, MOST_TAGS = 4000, 40, 200
"""Of a drawing, with what `use` repeats; elements in each other; tags."""
MOST_TOLD = 50
"""Mistakes of one drawing that are told."""
SVG, XLINK, XML = "http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink", "http://www.w3.org/XML/1998/namespace"
SHAPES = ("g", "rect", "circle", "ellipse", "line", "polyline", "polygon", "path", "text", "tspan", "use")
ELEMENTS = ("svg", *SHAPES, "defs", "symbol", "title", "desc", "clipPath", "linearGradient", "radialGradient", "stop")
LEFT_OUT = ("metadata",)
PRESENTATION = frozenset(
    [
        "fill",
        "fill-opacity",
        "fill-rule",
        "stroke",
        "stroke-width",
        "stroke-opacity",
        "stroke-linecap",
        "stroke-linejoin",
        "stroke-miterlimit",
        "stroke-dasharray",
        "stroke-dashoffset",
        "opacity",
        "display",
        "visibility",
        "clip-path",
        "clip-rule",
        "font-size",
        "font-weight",
        "font-style",
        "text-anchor",
        "dominant-baseline",
        "letter-spacing",
        "stop-color",
        "stop-opacity",
        "vector-effect",
        "paint-order",
    ]
)
GEOMETRY = frozenset(
    [
        "x",
        "y",
        "x1",
        "y1",
        "x2",
        "y2",
        "cx",
        "cy",
        "r",
        "rx",
        "ry",
        "fx",
        "fy",
        "dx",
        "dy",
        "d",
        "points",
        "width",
        "height",
        "viewBox",
        "preserveAspectRatio",
        "transform",
        "gradientTransform",
        "gradientUnits",
        "spreadMethod",
        "clipPathUnits",
        "offset",
        "pathLength",
        "rotate",
        "textLength",
        "lengthAdjust",
    ]
)
IGNORED = frozenset({"version", "baseProfile", "enable-background", "xml:space"})
CLASSES = ("d-line", "d-body", "d-inset", "d-text", "d-quiet", "d-run", "d-alarm", "d-warn")
"""What a drawing may ask of our tokens (static/css/screens/drawn.css); other classes are left out."""
BINDINGS = (
    "data-tag",
    "data-show",
    "data-class",
    "data-map",
    "data-move",
    "data-turn",
    "data-href",
    "data-name",
    "data-alarm",
)
ID = re.compile(r"[A-Za-z_][\w.:-]{0,80}", re.ASCII)
PLAIN = re.compile(r"[\w\s.,%#()+-]{0,400}", re.ASCII)
LOCAL = re.compile(r"url\(\s*[\"']?#([A-Za-z_][\w.:-]{0,80})[\"']?\s*\)", re.ASCII)
SHAPE = re.compile(r"[\w\s.,%()+-]*", re.ASCII)
NUMBER = r"-?\d{1,9}(?:\.\d{1,9})?"
SVG_NUMBER = r"[+-]?(?:\d{1,9}(?:\.\d{0,17})?|\.\d{1,17})(?:[eE][+-]?\d{1,2})?"
"""A number as SVG writes it."""
NUMBERS = re.compile(rf"\s*{SVG_NUMBER}(?:[\s,]+{SVG_NUMBER})*\s*", re.ASCII)
ONE = rf"(?:bad|uncertain|[<>]?{NUMBER})"
CONDITION = re.compile(rf"{ONE}(?:\s*,\s*{ONE})*", re.ASCII)
MAP = re.compile(rf"{NUMBER}:{NUMBER}(?: {NUMBER}:{NUMBER}){{1,31}}", re.ASCII)
OF_MACHINE = {"data-name", "data-alarm"}
OWN = "drawn-"
"""Before every id, so that none is one of the page's."""


@dataclass(slots=True)
class Part:
    """An element that may be drawn, its attributes checked, ids and references with `OWN` before them."""

    name: str
    line: int
    attributes: dict[str, str] = field(default_factory=dict)
    children: "list[Part | str]" = field(default_factory=list)
    tag: str = ""
    """Name of the point that it shows or follows."""
    show: str = ""
    classes: tuple[tuple[str, str], ...] = ()
    """(class, condition)."""
    map: tuple[tuple[float, float], ...] = ()
    move: str = ""
    """x or y."""
    turn: str = ""
    """`x y`: the centre."""
    href: str = ""
    """Id of the machine to which it leads."""
    machine: str = ""
    """Id of the machine whose name, or whose sign of an alarm, stands here."""
    is_alarm: bool = False
    """The sign, not the name."""

    @property
    def is_value(self) -> bool:
        """Whether the value itself stands here, with unit and quality."""
        return self.name == "text" and bool(self.tag) and not (self.show or self.classes or self.map)

    @property
    def tags(self) -> "tuple[str, ...]":
        """Names of the points that it and the parts in it show, each once."""
        return tuple(dict.fromkeys(part.tag for part in self.all() if part.tag))

    def all(self) -> "Iterator[Part]":
        """It and all parts in it."""
        yield self
        for child in self.children:
            if isinstance(child, Part):
                yield from child.all()


@dataclass(frozen=True, slots=True)
class Drawn:
    """What became of a drawing: `picture` is None exactly when there are problems."""

    picture: Part | None
    problems: tuple[Problem, ...] = ()
    doubts: tuple[Problem, ...] = ()


class _Refused(Exception):
    """Reading on would be of no use."""


def read_drawing(content: bytes, file: str, points: Collection[str], machines: Collection[str]) -> Drawn:
    """Check the SVG in `content`; `file` is how mistakes name it, `points` and `machines` what it may be bound to."""
    return _Reader(file, points, machines).read(content)


class _Reader:
    def __init__(self, file: str, points: Collection[str], machines: Collection[str]) -> None:
        self._file, self._points, self._machines = file, points, machines
        self._problems: list[Problem] = []
        self._doubts: list[Problem] = []
        self._root: Part | None = None
        self._open: list[Part] = []
        self._skipped = 0
        self._elements = 0
        self._ids: dict[str, Part] = {}
        self._references: list[tuple[Part, str, str]] = []
        self._parser = expat.ParserCreate(namespace_separator=" ")

    def read(self, content: bytes) -> Drawn:
        parser = self._parser
        parser.StartElementHandler, parser.EndElementHandler = self._start, self._end
        parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = self._text, self._doctype
        try:
            if len(content) > LARGEST_DRAWING:
                self._refuse("(file)", f"{len(content)} B", said("mistake.drawing_size", most=LARGEST_DRAWING))
            parser.Parse(content, True)
            self._join()
        except _Refused:
            pass
        except (expat.ExpatError, ValueError, LookupError) as error:  # the last two: an encoding that nobody knows
            line = getattr(error, "lineno", None)
            found = Plain(expat.errors.messages.get(getattr(error, "code", 0), str(error)))
            self._problems.append(self._told("(file)", found, said("mistake.drawing_xml"), line))
        whole = self._root if not self._problems else None
        return Drawn(whole, tuple(self._problems), tuple(self._doubts[:MOST_TOLD]))

    def _doctype(self, *_: object) -> None:
        self._refuse("<!DOCTYPE>", Plain("DTD"), said("mistake.drawing_dtd"))

    def _start(self, name: str, given: dict[str, str]) -> None:
        self._elements += 1
        if self._elements > MOST_ELEMENTS:
            self._refuse("(file)", Plain(f"> {MOST_ELEMENTS}"), said("mistake.drawing_elements", most=MOST_ELEMENTS))
        if len(self._open) + self._skipped >= DEEPEST:
            self._refuse("(file)", Plain(f"> {DEEPEST}"), said("mistake.in_each_other", most=DEEPEST))
        space, _, short = name.rpartition(" ")
        if self._skipped or (self._root is not None and space != SVG) or short in LEFT_OUT:
            self._skipped += 1
            return
        place = f"<{short}>"
        if self._root is None and (short != "svg" or space != SVG):
            self._refuse(place, Plain(short), said("mistake.drawing_root", space=SVG))
        if short not in ELEMENTS or (short == "svg" and self._root is not None):
            self._note(place, Plain(short), _choice(short, ELEMENTS[1:]))
            self._skipped += 1
            return
        part = Part(short, self._parser.CurrentLineNumber)
        if self._open:
            self._open[-1].children.append(part)
        else:
            self._root = part
        self._open.append(part)
        style = given.pop("style", "")
        for key, value in given.items():
            self._attribute(part, key, value)
        for piece in filter(None, (piece.strip() for piece in style.split(";"))):
            self._property(part, piece)
        self._bindings(part, given)

    def _end(self, _: str) -> None:
        if self._skipped:
            self._skipped -= 1
        else:
            self._open.pop()

    def _text(self, text: str) -> None:
        if self._open and not self._skipped and self._open[-1].name in ("text", "tspan", "title", "desc"):
            self._open[-1].children.append(text)

    def _attribute(self, part: Part, key: str, value: str) -> None:
        space, _, short = key.rpartition(" ")
        place = f"<{part.name}> {short}"
        if space and (space != XLINK or short != "href"):
            return
        if short.lower().startswith("on"):
            self._note(place, value, said("mistake.drawing_event"))
        elif short == "id":
            if not ID.fullmatch(value) or value in self._ids:
                self._note(place, value, said("mistake.drawing_id"))
            self._ids[value] = part
            part.attributes["id"] = OWN + value
        elif short == "href":
            if (
                part.name not in ("use", "linearGradient", "radialGradient")
                or not ID.fullmatch(value[1:])
                or value[:1] != "#"
            ):
                self._note(place, value, said("mistake.drawing_reference"))
            else:
                self._references.append((part, place, value[1:]))
                part.attributes["href"] = f"#{OWN}{value[1:]}"
        elif short == "class":
            known = [name for name in value.split() if name in CLASSES]
            for name in value.split():
                if name not in CLASSES:
                    self._doubt(place, name, _choice(name, CLASSES))
            part.attributes["class"] = " ".join(known)
        elif short in PRESENTATION:
            self._presented(part, place, short, value)
        elif short in GEOMETRY:
            if SHAPE.fullmatch(value):
                part.attributes[short] = value
            else:
                self._note(place, value, said("mistake.drawing_value"))
        elif short.startswith("data-"):
            if short not in BINDINGS:
                self._note(place, value, _choice(short, BINDINGS))
        elif short not in IGNORED:
            self._doubt(place, value, said("mistake.drawing_attribute"))

    def _property(self, part: Part, piece: str) -> None:
        """One property of a style attribute, as editors write them, becomes an attribute where it may."""
        name, _, value = (text.strip() for text in piece.partition(":"))
        if name in PRESENTATION:
            self._presented(part, f"<{part.name}> style {name}", name, value)
        else:
            self._doubt(f"<{part.name}> style", piece, said("mistake.drawing_attribute"))

    def _presented(self, part: Part, place: str, name: str, value: str) -> None:
        if local := LOCAL.fullmatch(value.strip()):
            self._references.append((part, place, local[1]))
            part.attributes[name] = f"url(#{OWN}{local[1]})"
        elif PLAIN.fullmatch(value) and "url" not in value.lower():
            part.attributes[name] = value
        else:
            self._note(place, value, said("mistake.drawing_reference"))

    def _bindings(self, part: Part, given: Mapping[str, str]) -> None:
        place = f"<{part.name}> "
        bound = {key: value.strip() for key, value in given.items() if key in BINDINGS}
        if not bound:
            return
        if part.name not in SHAPES or part.name == "tspan":
            self._note(f"<{part.name}>", Plain(", ".join(bound)), any_of(name for name in SHAPES if name != "tspan"))
            return
        if (href := bound.get("data-href")) is not None:
            if href not in self._machines:
                self._note(place + "data-href", href, _choice(href, self._machines))
            part.href = href
        self._of_machine(part, place, bound)
        self._standing(part, place, bound)
        ways = [key for key in ("data-show", "data-class", "data-map") if key in bound]
        tag = bound.get("data-tag")
        if tag is None:
            for key in bound.keys() - {"data-href", *OF_MACHINE}:
                self._note(place + key, bound[key], said("mistake.only_beside", key="data-tag"))
            return
        if tag not in self._points:
            self._note(place + "data-tag", tag, _choice(tag, self._points))
        if not ways and part.name != "text":
            self._note(place + "data-tag", tag, said("mistake.drawing_bound"))
        part.tag = tag
        if (show := bound.get("data-show")) is not None:
            self._condition(place + "data-show", show)
            part.show = show
        if (rules := bound.get("data-class")) is not None:
            pairs = [
                tuple(text.strip() for text in rule.partition(":")[::2]) for rule in rules.removesuffix(";").split(";")
            ]
            for name, condition in pairs:
                if name not in CLASSES:
                    self._note(place + "data-class", name, _choice(name, CLASSES))
                self._condition(place + "data-class", condition)
            part.classes = tuple((name, condition) for name, condition in pairs)
        self._moving(part, place, bound)

    def _of_machine(self, part: Part, place: str, bound: Mapping[str, str]) -> None:
        """A text may be the name of a machine, or the sign of its most important alarm; then it is nothing else."""
        for key in OF_MACHINE & bound.keys():
            if part.name != "text" or len(bound) > 1 + ("data-href" in bound):
                self._note(place + key, bound[key], said("mistake.drawing_alone"))
            elif bound[key] not in self._machines:
                self._note(place + key, bound[key], _choice(bound[key], self._machines))
            part.machine, part.is_alarm = bound[key], key == "data-alarm"

    def _standing(self, part: Part, place: str, bound: Mapping[str, str]) -> None:
        """A value or a sign has a box of its own, which stands where plain numbers say."""
        if "data-alarm" in bound or (
            "data-tag" in bound and not {"data-show", "data-class", "data-map"} & bound.keys()
        ):
            for key in ("x", "y"):
                if not NUMBERS.fullmatch(part.attributes.get(key, "0")):
                    self._note(place + key, part.attributes[key], said("mistake.drawing_place"))

    def _moving(self, part: Part, place: str, bound: Mapping[str, str]) -> None:
        road, move, turn = bound.get("data-map"), bound.get("data-move"), bound.get("data-turn")
        road = None if road is None else " ".join(road.split())
        if road is None and move is None and turn is None:
            return
        if road is None or not MAP.fullmatch(road):
            self._note(place + "data-map", road or "", said("mistake.drawing_map"))
            return
        knots = tuple((float(a), float(b)) for a, _, b in (knot.partition(":") for knot in road.split(" ")))
        if any(a[0] >= b[0] for a, b in pairwise(knots)):
            self._note(place + "data-map", road, said("mistake.drawing_map"))
        if (move is None) == (turn is None):
            self._note(place + "data-map", road, said("mistake.exactly_one", names="data-move, data-turn"))
        if move is not None and move not in ("x", "y"):
            self._note(place + "data-move", move, any_of(("x", "y")))
        if turn is not None and not re.fullmatch(rf"{NUMBER} {NUMBER}", turn, re.ASCII):
            self._note(place + "data-turn", turn, said("mistake.drawing_centre"))
        if "transform" in part.attributes:  # the script would put its own in the place of it
            self._note(place + "data-map", road, said("mistake.drawing_transform"))
        part.map, part.move, part.turn = knots, move or "", turn or ""

    def _condition(self, place: str, condition: str) -> None:
        if not CONDITION.fullmatch(condition):
            self._note(place, condition, said("mistake.drawing_condition"))

    def _join(self) -> None:
        """Every reference has its aim; what `use` repeats is counted, and repeats nothing itself."""
        if self._root is None:
            return
        total = self._elements
        for part, place, aim in self._references:
            found = self._ids.get(aim)
            if found is None:
                near = _choice(aim, self._ids) if self._ids else said("mistake.drawing_reference")
                self._note(place, f"#{aim}", near, part.line)
            elif part.name == "use" and part.attributes.get("href") == f"#{OWN}{aim}":
                inside = list(found.all())
                total += len(inside)
                if total > MOST_ELEMENTS:
                    self._refuse(place, f"#{aim}", said("mistake.drawing_elements", most=MOST_ELEMENTS))
                if any(one.name == "use" or one.tag or one.href or one.machine for one in inside):
                    self._note(place, f"#{aim}", said("mistake.drawing_use"), part.line)
        parts = list(self._root.all())
        if len({part.tag for part in parts if part.tag}) > MOST_TAGS:
            self._note("data-tag", Plain(f"> {MOST_TAGS}"), said("mistake.drawing_tags", most=MOST_TAGS))
        box = self._root.attributes.get("viewBox", "")
        numbers = [float(number) for number in box.replace(",", " ").split()] if NUMBERS.fullmatch(box) else []
        if len(numbers) != 4 or not (numbers[2] > 0 and numbers[3] > 0):
            given = self._root.attributes.get("viewBox", said("mistake.missing"))
            self._note("<svg> viewBox", given, said("mistake.drawing_box"), self._root.line)

    def _refuse(self, key: str, value: str, expected: str) -> None:
        self._problems.append(self._told(key, value, expected, self._parser.CurrentLineNumber))
        raise _Refused

    def _note(self, key: str, value: str, expected: str, line: int | None = None) -> None:
        self._problems.append(self._told(key, value, expected, line or self._parser.CurrentLineNumber))
        if len(self._problems) >= MOST_TOLD:
            raise _Refused

    def _doubt(self, key: str, value: str, expected: str) -> None:
        if len(self._doubts) < MOST_TOLD:
            self._doubts.append(self._told(key, value, expected, self._parser.CurrentLineNumber))

    def _told(self, key: str, value: str, expected: str, line: int | None) -> Problem:
        shown = value if isinstance(value, Plain) else f'"{value}"'
        return Problem(self._file, printable(key, LONGEST_SHOWN), printable(shown, LONGEST_SHOWN), expected, line)


def _choice(value: str, known: Collection[str]) -> str:
    """`one of …`, with the one that was perhaps meant; of very many only that one."""
    near = get_close_matches(value[:LONGEST_SHOWN], list(known)[:3000], 1)
    perhaps = said("mistake.perhaps", near=near[0]) if near else ""
    listed = sorted(known)[:12]
    more = said("mistake.and_more", number=len(known) - 12) if len(known) > 12 else ""
    return said("mistake.one_of", choices=", ".join(listed), more=more, near=perhaps)
