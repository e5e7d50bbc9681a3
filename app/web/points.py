"""What templates know of a machine: its points as they stand now, ready to be drawn and to be kept true by the live script."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol
from zoneinfo import ZoneInfo

from app.clock import Clock, is_moment
from app.plant.definitions import Command, Equipment, Kind, Plant, Point, Setpoint
from app.plant.derive import TIME_UNIT
from app.plant.texts import Texts, fill
from app.tags.batch import Value
from app.tags.database import TagDatabase
from app.tags.quality import NO_DATA, QualityReason, reason
from app.web import format as fmt
from app.web.drawing import Dial, Indicator, indicator
from app.web.format import Text


class Surroundings(Protocol):
    """What a view needs of the runtime."""

    @property
    def tags(self) -> TagDatabase: ...
    @property
    def plant(self) -> Plant | None: ...
    @property
    def clock(self) -> Clock: ...


@dataclass(frozen=True, slots=True)
class PointView:
    """One point as it stands, with everything that is needed to draw it."""

    name: str
    key: str
    label: str
    """In the language of the page."""
    unit: str
    """As drawn: `o/min`."""
    unit_words: str
    """As a screen reader says it."""
    decimals: int
    kind: Kind
    shown_as: str
    """number, enum, time or text: which way of writing the live script takes."""
    value: Value
    quality: int
    text: str
    """The value as drawn; `----` when bad, `– –` when there was never one."""
    quality_text: str
    """Quality in words, with its reason and origin."""
    state: str
    """data-q: good, uncertain, stale, bad, none."""
    source: str
    """data-src: field, manual, forced, sim."""
    age: float
    """Since the source last made sure of it [s]."""
    stale_after: float
    """[s], 0 = never."""
    normal: tuple[float, float] | None
    scale_low: float | None
    scale_high: float | None
    limits: tuple[float, ...]
    """Alarm limits [EU]."""
    texts: Mapping[str, str]
    """Value → text, of enumerations and booleans."""
    lang: str
    name_pattern: str
    """How label, value, unit and quality are put together for a screen reader."""
    unknown_pattern: str

    @property
    def usable(self) -> bool:
        """Whether there is a number to put a pointer at."""
        return self.state in ("good", "uncertain", "stale") and isinstance(self.value, int | float)

    @property
    def accessible_name(self) -> str:
        """Label, value, unit and quality as one sentence."""
        return self.name_pattern.format(
            label=self.label, value=self.text, unit=self.unit_words, quality=self.quality_text
        ).replace(" ,", ",")

    @property
    def value_now(self) -> str:
        """The plain number for `aria-valuenow`."""
        return f"{self.value:.12g}" if isinstance(self.value, int | float) else ""

    @property
    def value_text(self) -> str:
        """Value and unit as drawn, or the quality when there is no value: `aria-valuetext` of a meter."""
        if not self.usable or not isinstance(self.value, int | float):
            return self.quality_text
        return fmt.quantity(self.value, self.decimals, self.unit, self.lang)

    @property
    def misplaced(self) -> bool:
        """Whether something answers, and it is not what the plant file says."""
        return reason(self.quality) is QualityReason.CONFIGURATION

    def badge(self, style: str) -> str:
        """Letters beside the value: BAD, the age of a stale one, F forced, M manual or local; S only in a box, the header says it."""
        if self.state == "bad":
            return "BAD"
        if self.state == "stale":
            return fmt.age(self.age)
        return {"forced": "F", "manual": "M", "sim": "S" if "boxed" in style.split() else ""}.get(self.source, "")

    @property
    def signed_text(self) -> str:
        """`text` with a plus sign when it is more than nothing."""
        above = self.usable and isinstance(self.value, int | float) and self.value > 0 and re.search("[1-9]", self.text)
        return f"+{self.text}" if above else self.text

    @property
    def badge_look(self) -> str:
        """Classes of the badge beside `badge`."""
        if self.state in ("bad", "stale"):
            return " soft" if self.state == "stale" else ""
        return {"forced": " solid", "manual": " dot"}.get(self.source, "")

    @property
    def texts_json(self) -> str:
        """`texts` for the attribute `data-texts`."""
        return json.dumps(self.texts, ensure_ascii=False, separators=(",", ":")) if self.texts else ""

    @property
    def normal_text(self) -> str:
        """The normal band: `900 – 1 250`, or nothing."""
        return self.span(self.normal) if self.normal else ""

    @property
    def indicator(self) -> Indicator | None:
        """The moving analog indicator, when the point has a normal band and a scale."""
        if self.normal is None or self.scale_low is None or self.scale_high is None:
            return None
        return indicator(self.scale_low, self.scale_high, self.normal, self.limits)

    @property
    def dial(self) -> Dial | None:
        """The gauge, when the point has a scale."""
        if self.scale_low is None or self.scale_high is None or not self.scale_low < self.scale_high:
            return None
        return Dial(self.scale_low, self.scale_high)

    def number(self, value: float) -> str:
        """Another number of the same kind, without noughts at its end (limits, ends of scales)."""
        return fmt.number(value, fmt.shortest(value, self.decimals), self.lang)

    def span(self, pair: tuple[float, float]) -> str:
        """A range of such numbers, both with the decimals that the longer one needs."""
        decimals = max(fmt.shortest(value, self.decimals) for value in pair)
        return fmt.span(*pair, decimals, self.lang)

    def holds(self, condition: str) -> bool:
        """The small conditions of `data-show` and `data-class`: `1,2`, `>0`, `<0`, `bad`, `uncertain` (stale, too); one suffices."""
        parts = [part.strip() for part in condition.split(",")]
        if self.state in ("bad", "none") or not isinstance(self.value, int | float):
            return "bad" in parts
        value = self.value
        return any(
            value > float(part[1:])
            if part[0] == ">"
            else value < float(part[1:])
            if part[0] == "<"
            else self.state != "good"
            if part == "uncertain"
            else value == float(part)
            for part in parts
            if part != "bad"
        )


@dataclass(frozen=True, slots=True)
class CommandView:
    """A command as a button."""

    name: str
    """`<equipment>.<command>`."""
    key: str
    label: str
    symbol: str
    stop: bool
    hold: bool
    argument: PointView | None
    """The point whose value it sets."""
    low: float | None = None
    """Range of the argument as far as it is known now [EU]."""
    high: float | None = None
    aside: bool = False
    """It stands with all values of the machine, not among its commands."""


@dataclass(frozen=True)
class EquipmentView:
    """A machine for templates: `equipment.label`, `equipment.speed`, `equipment.commands["forward"]`."""

    equipment: Equipment
    runtime: Surroundings
    lang: str
    text: Text
    """Looks up the product's texts."""
    _drawn: dict[str, PointView] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def id(self) -> str:
        """Id in the plant file."""
        return self.equipment.id

    @property
    def label(self) -> str:
        """Name in the language of the page, else in another one with its mark."""
        return plant_text(self.equipment.label, self.lang, self.runtime.plant) or self.equipment.id

    @property
    def type(self) -> str:
        """Name of its equipment type."""
        return self.equipment.type.name

    @property
    def symbol(self) -> str:
        """Name of what it is drawn as in symbols.svg."""
        return self.equipment.type.symbol

    @property
    def area(self) -> str:
        """Key of its area."""
        return self.equipment.area

    @property
    def keeps_parameters(self) -> bool:
        """Whether what is written to it is still there after its supply was off."""
        return self.equipment.type.device.keeps

    @property
    def link(self) -> str:
        """Id of its link."""
        return self.equipment.link

    @property
    def link_label(self) -> str:
        """Name of its link."""
        plant = self.runtime.plant
        link = plant.links.get(self.equipment.link) if plant else None
        return (plant_text(link.label, self.lang, plant) if link else "") or self.equipment.link

    @property
    def unit_address(self) -> int:
        """Address of the device on its link."""
        return self.equipment.unit

    @property
    def commands(self) -> Mapping[str, CommandView]:
        """Its commands by key."""
        return {key: self._command(command) for key, command in self.equipment.type.commands.items()}

    def has(self, key: str) -> bool:
        """Whether it has a point `key`."""
        return key in self.equipment.points

    def words(self, texts: Mapping[str, str]) -> str:
        """`texts` of the plant's files in the language of the page, else in another one with its mark."""
        return plant_text(texts, self.lang, self.runtime.plant)

    def other(self, id: str) -> "EquipmentView | None":
        """Another machine of the plant in the same language; None when there is none of that id."""
        plant = self.runtime.plant
        found = plant.equipment.get(id) if plant else None
        return EquipmentView(found, self.runtime, self.lang, self.text) if found else None

    def t(self, key: str) -> str:
        """A text of the equipment type, else of the product; one that only another language has, with its mark."""
        own = self.equipment.type.texts
        here = own.get(self.lang, {}).get(key)
        if here is not None:
            return here
        told = self.text(key)
        if told != f"[{key}]":
            return told
        return self.words({language: texts[key] for language, texts in own.items() if key in texts}) or told

    def told(self, key: str, numbers: Mapping[str, object]) -> str:
        """The text `key` with the numbers that it names; – for one that is not known."""
        written = {
            name: fmt.number(value, fmt.shortest(value, 1), self.lang) if isinstance(value, int | float) else "–"
            for name, value in numbers.items()
            if value is None or isinstance(value, int | float)
        }
        return fill(self.t(key), {"name": self.label, **written})

    def point(self, key: str) -> PointView:
        """The point `key` as it stands; within one view always the same picture.

        Raises:
            KeyError: the machine has no such point.
        """
        if key not in self._drawn:
            self._drawn[key] = self._draw(self.equipment.points[key])
        return self._drawn[key]

    @property
    def drawn(self) -> list[PointView]:
        """The points that were asked for."""
        return list(self._drawn.values())

    def points(self, keys: Sequence[str]) -> list[PointView]:
        """Those of `keys` that the machine has."""
        return [self.point(key) for key in keys if key in self.equipment.points]

    def option(self, name: str) -> float | None:
        """A number that the plant file sets for this machine, or None."""
        value = self.equipment.options.get(name)
        return value if isinstance(value, float) else None

    @property
    def answer_time(self) -> PointView | None:
        """How long the device takes to answer [ms], when its link counts it."""
        name = f"sys.link.{self.link}.unit{self.unit_address}.answer_time"
        if name not in self.runtime.tags:
            return None
        point = Point(name=name, id=name, equipment="sys", key="answer_time", label="", unit="ms")
        return point_view(point, self.runtime, self.lang, self.text, label=self.text("screen.answer_time"))

    def __getitem__(self, key: str) -> PointView:
        return self.point(key)

    def __getattr__(self, key: str) -> PointView:
        equipment = self.__dict__.get("equipment")
        if equipment is None or key not in equipment.points:
            raise AttributeError(f"{equipment.id if equipment else 'equipment'} has no point {key}")
        return self.point(key)

    def _draw(self, point: Point) -> PointView:
        limits = [
            alarm.limit for alarm in self.equipment.alarms if alarm.value == point.key and alarm.limit is not None
        ]
        return point_view(
            point,
            self.runtime,
            self.lang,
            self.text,
            label=self.t(point.label),
            texts={str(value): self.t(key) for value, key in point.texts.items()},
            limits=tuple(sorted(set(limits))),
        )

    def _command(self, command: Command) -> CommandView:
        point = self.equipment.points.get(command.argument)
        argument = self.point(point.key) if point else None
        setpoint = self.equipment.type.setpoints.get(command.argument)
        return CommandView(
            name=f"{self.id}.{command.key}",
            key=command.key,
            label=self.t(command.label),
            symbol=command.symbol,
            stop=command.stop,
            hold=command.hold,
            argument=argument,
            low=self._bound(setpoint, "low") if setpoint else point.low if point else None,
            high=self._bound(setpoint, "high") if setpoint else point.high if point else None,
            aside=command.aside,
        )

    def _bound(self, setpoint: Setpoint | None, end: str) -> float | None:
        """A bound that is a number or the name of one point, as it stands; longer expressions are the gate's business."""
        text = getattr(setpoint, end) if setpoint else ""
        if text in self.equipment.points:
            view = self.point(text)
            return float(view.value) if view.usable and isinstance(view.value, int | float) else None
        try:
            return float(text)
        except ValueError:
            return None


def point_view(
    point: Point,
    runtime: Surroundings,
    lang: str,
    text: Text,
    *,
    label: str,
    texts: Mapping[str, str] | None = None,
    limits: tuple[float, ...] = (),
) -> PointView:
    """`point` as it stands in the tag database; one that is not there was never received."""
    tags = runtime.tags
    handle = tags.handles.get(point.name)
    value: Value = None
    quality, age, stale_after = NO_DATA, 0.0, 0.0
    if handle is not None:
        value, quality, stale_after = tags.value(handle), tags.quality(handle), tags.tags[handle].stale_after
        age = tags.age(handle)
    state = fmt.quality_state(quality)
    if value is None and state != "bad":
        state = "none"
    shown_as = _shown_as(point)
    known = texts or {}
    zone = ZoneInfo(runtime.plant.timezone) if runtime.plant else ZoneInfo("UTC")
    unknown = text("value.unknown")
    if state == "bad":
        drawn = fmt.NO_VALUE
    elif state == "none" or value is None:
        drawn = fmt.NO_DATA_YET
    elif shown_as == "enum":
        drawn = known.get(_plain(value)) or unknown.replace("{value}", _plain(value))
    elif isinstance(value, str):
        drawn = value
    elif shown_as == "time" and is_moment(int(value)):
        drawn = fmt.moment_or_time(int(value), zone, lang, runtime.clock.micros())
    elif shown_as == "time":
        drawn = unknown.replace("{value}", _plain(value))
    else:
        drawn = fmt.number(value, point.decimals, lang)
    return PointView(
        name=point.name,
        key=point.key,
        label=label,
        unit="" if shown_as != "number" else fmt.unit_symbol(point.unit, text),
        unit_words="" if shown_as != "number" else fmt.unit_words(point.unit, text),
        decimals=point.decimals,
        kind=point.kind,
        shown_as=shown_as,
        value=value,
        quality=quality,
        text=drawn,
        quality_text=fmt.quality_words(quality, text),
        state=state,
        source=fmt.source_state(quality),
        age=age,
        stale_after=stale_after,
        normal=point.normal,
        scale_low=point.scale_low,
        scale_high=point.scale_high,
        limits=limits,
        texts=known,
        lang=lang,
        name_pattern=text("value.name"),
        unknown_pattern=unknown,
    )


def plant_text(texts: Mapping[str, str], lang: str, plant: Plant | None) -> str:
    """A label of the plant's files in `lang`, else in another language with its mark: `[en] Fan 2` (plant/texts.py)."""
    return Texts({}, plant).label(lang, texts)


def live_texts(text: Text) -> dict[str, object]:
    """What the live script says by itself, in the language of the page (`data-texts` of #live)."""
    return {
        "quality": {
            "good": text("quality.good"),
            "uncertain": text("quality.uncertain"),
            "bad": text("quality.bad"),
            "because": text("quality.because"),
            "from": text("quality.from"),
        },
        "reasons": ["", *(text(f"quality.reason.{name}") for name in REASONS)],
        "origins": {name: text(f"quality.origin.{name}") for name in ("forced", "manual", "sim")},
        "name": text("value.name"),
        "unknown": text("value.unknown"),
        "no_connection": text("live.no_connection"),
        "misplaced": text("communication.state.configuration"),
        "tried": text("live.stop_is_tried"),
    }


REASONS = ("no_data", "comm_failure", "stale", "out_of_range", "not_connected", "configuration", "device", "halted")
"""Names of the reasons 1 to 8 of tags/quality.py."""


def _plain(value: float | str) -> str:
    """As a key of `texts`: 1 and 1.0 are "1"."""
    return f"{value:.15g}" if isinstance(value, int | float) else value


def _shown_as(point: Point) -> str:
    if point.texts or point.kind is Kind.ENUM:
        return "enum"
    if point.unit == TIME_UNIT:
        return "time"
    return "text" if point.kind is Kind.TEXT else "number"
