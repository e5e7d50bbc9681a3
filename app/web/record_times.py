"""What the parts of a machine's records took."""

from collections.abc import Mapping, Sequence
from typing import Any

from app.historian.record_query import PartTimes, Spread
from app.plant.kept import Definition
from app.records.record import OPEN
from app.web import format as fmt
from app.web.record_words import GLYPHS, NOTHING, RecordWords


def times(
    draw: RecordWords,
    id: str,
    parts: Sequence[PartTimes],
    outcomes: Mapping[str, int],
    whole: Spread,
    newest: Definition | None = None,
) -> dict[str, Any]:
    """What the parts of a machine's records took."""
    item = draw.item(id)
    labels = newest.parts if newest else {}
    names = draw.part_names(id)
    order = {key: number for number, key in enumerate(labels, 1)}
    return {
        "equipment": id,
        "machine": draw.label(item.label) if item else id,
        "outcomes": [
            (
                draw.text(f"outcome.{one}"),
                fmt.number(outcomes[one], 0, draw.lang),
                GLYPHS.get("active" if one == OPEN else one, ""),
            )
            for one in draw.kind.outcomes
            if one in outcomes
        ],
        "whole": None if whole.mean is None else _spread(draw, whole),
        "parts": [
            {
                "number": order.get(one.key, NOTHING),
                "label": draw.label(labels.get(one.key, {})) or names.get(one.key, one.key),
                **_spread(draw, one.spread),
            }
            for one in sorted(parts, key=lambda one: (order.get(one.key, 1000), one.number))
        ],
    }


def _spread(draw: RecordWords, one: Spread) -> dict[str, str]:
    said = {
        name: NOTHING if (value := getattr(one, name)) is None else draw.seconds(value)
        for name in ("least", "mean", "most", "last")
    }
    return {"count": fmt.number(one.count, 0, draw.lang)} | said
