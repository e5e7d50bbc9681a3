"""Tiles of machines on the overview: the same for all who look in one language, so one that was just drawn is good for the next as well.

Thirty who come at the same moment cost little more than one. A tile is given its machine, the mark of its alarms and what the machine needs
next, and nothing of whoever asks, so nothing of one person can reach another: a template that asks for more is an error (StrictUndefined).

A kept tile is never older than `FRESH`, and states and qualities on it are never old at all: when one of them, or the mark, is another one
by now, it is drawn anew. The live script renews the numbers (static/js/live.js).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from jinja2 import Environment
from markupsafe import Markup

from app.plant.picture import Picture
from app.tags.batch import Value
from app.tags.database import TagDatabase
from app.web.needs import Needs
from app.web.points import EquipmentView

FRESH = 0.3
"""So long a number on a tile is good for the next who looks [s]; less than the time in which the socket of a page brings it anew."""
REASON_FRESH = 1.0
"""So long the line that says why a machine does not go on is good for the next whose page asks for it again [s]."""
TEMPLATES = (
    "screens/*/tile.html",
    "fragments/tile.html",
    "fragments/plant_picture.html",
    "screens/*/part_why.html",
    "fragments/part_why.html",
)
"""Where they are drawn."""
FUNCTIONS = ("tile_of", "plant_picture_of", "why_of")
"""What pages call for them."""

Marks = Mapping[str, Sequence[str | int]]
"""Of the alarms of machines: priority and state; one without alarms has none."""


@dataclass(frozen=True, slots=True)
class _Kept:
    """A tile, and what it was drawn of."""

    markup: Markup
    drawn: float
    """When [s, monotonic]."""
    revision: int
    marks: Marks
    states: list[tuple[int, bool, Value, int]]
    """Handle, whether its value counts, value and quality of every point that it shows."""


class Tiles:
    """Tiles in one language, and the pictures that machines make together."""

    def __init__(self, environment: Environment) -> None:
        self._environment = environment
        self._kept: dict[str, _Kept] = {}

    @property
    def functions(self) -> dict[str, Callable[..., Markup]]:
        """What pages call."""
        return dict(zip(FUNCTIONS, (self.tile, self.picture, self.why), strict=True))

    def tile(self, equipment: EquipmentView, marks: Marks) -> Markup:
        """The tile of `equipment` as it is now, or was a moment ago."""
        templates = [f"screens/{equipment.type}/tile.html", "fragments/tile.html"]
        own = _alone(equipment)
        return self._draw(equipment.id, templates, [own], marks, equipment=own, operation=Needs(own))

    def picture(self, picture: Picture, machines: Sequence[EquipmentView], marks: Marks) -> Markup:
        """Machines at their places in the flow, likewise."""
        own = {one.id: _alone(one) for one in machines if one.id in picture.cells}
        key = f"picture {' '.join(picture.cells)}"
        return self._draw(
            key, ["fragments/plant_picture.html"], [*own.values()], marks, picture=picture, machines_of=own
        )

    def why(self, equipment: EquipmentView) -> Markup:
        """Why a machine does not go on, as its tile says it, likewise."""
        templates = [f"screens/{equipment.type}/part_why.html", "fragments/part_why.html"]
        own = _alone(equipment)
        key = f"why {equipment.id}"
        return self._draw(key, templates, [own], {}, REASON_FRESH, equipment=own, operation=Needs(own))

    def _draw(
        self,
        key: str,
        templates: list[str],
        machines: list[EquipmentView],
        marks: Marks,
        fresh: float = FRESH,
        **context: Any,
    ) -> Markup:
        """A piece of `machines`, of which each is asked for nothing yet."""
        tags, now = machines[0].runtime.tags, machines[0].runtime.clock.monotonic()
        own = {one.id: marks[one.id] for one in machines if one.id in marks}
        kept = self._kept.get(key)
        if kept is not None and now - kept.drawn < fresh and _same(kept, tags, own):
            return kept.markup
        markup = Markup(self._environment.select_template(templates).render(marks=own, **context))
        states = [
            (handle, point.shown_as != "number", point.value, point.quality)
            for one in machines
            for point in one.drawn
            if (handle := tags.handles.get(point.name)) is not None
        ]
        self._kept[key] = _Kept(markup, now, tags.revision, own, states)
        return markup


def _alone(equipment: EquipmentView) -> EquipmentView:
    """Of the same machine, and nobody has asked it for a point."""
    return EquipmentView(equipment.equipment, equipment.runtime, equipment.lang, equipment.text)


def _same(kept: _Kept, tags: TagDatabase, marks: Marks) -> bool:
    return (
        kept.revision == tags.revision
        and kept.marks == marks
        and all(
            tags.quality(handle) == quality and (not counts or tags.value(handle) == value)
            for handle, counts, value, quality in kept.states
        )
    )
