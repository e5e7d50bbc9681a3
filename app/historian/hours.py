"""Roll-ups of hours, made by the database of those of minutes: it works on them without holding up the interpreter."""

from sqlalchemy import BigInteger, Insert, bindparam, case, func, or_, select, union_all

from app.historian.dialect import Statement, greatest, in_order, least, materialized, replacing
from app.historian.minutes import MINUTE
from app.historian.tables import hour, minute, point


def _hours() -> Insert:
    """Of the points `first` to `last`, from `begin` to `end`; `gap` is how long a value holds at most, `width` that of a row [µs]."""
    begin, end, gap, width = (bindparam(name, type_=BigInteger) for name in ("begin", "end", "gap", "width"))
    asked = point.c.id.between(bindparam("first"), bindparam("last"))
    former = minute.alias()
    held = (
        select(func.max(former.c.t))
        .where(former.c.point == point.c.id, former.c.t < begin, former.c.t >= begin - gap - MINUTE)
        .correlate(point)
        .scalar_subquery()
    )
    within = in_order(point, minute, minute.c.point == point.c.id, minute.c.t >= begin, minute.c.t < end)
    before = in_order(point, minute, minute.c.point == point.c.id, minute.c.t == held)
    part = materialized(
        union_all(select(minute).select_from(within).where(asked), select(minute).select_from(before).where(asked)).cte(
            "part"
        )
    )
    following = func.lead(part.c.t, 1, end).over(partition_by=part.c.point, order_by=part.c.t)
    # what the last value of each minute did after it, until the next minute that has samples
    span = (
        select(
            part.c.point,
            (part.c.t + MINUTE).label("t"),
            part.c.last.label("v"),
            part.c.last_q.bitwise_and(3).label("level"),
            case((point.c.kind == "text", 1), else_=0).label("is_text"),
            least(following, part.c.last_t + gap).label("e"),
        )
        .join_from(part, point, point.c.id == part.c.point)
        .cte("span")
    )
    since = greatest(span.c.t, begin)
    piece = (
        select(span.c.point, since.label("t"), span.c.e, span.c.v, case((span.c.level == 0, 1), else_=0).label("good"))
        .where(or_(span.c.v.is_not(None), span.c.is_text == 1), span.c.level < 2, span.c.e > since)
        .cte("piece", recursive=True)
    )
    border = (piece.c.t // width + 1) * width
    piece = piece.union_all(select(piece.c.point, border, piece.c.e, piece.c.v, piece.c.good).where(border < piece.c.e))
    lasted = least(piece.c.e, (piece.c.t // width + 1) * width) - piece.c.t
    cut = select(piece.c.point, piece.c.t, piece.c.v, piece.c.good, lasted.label("d")).subquery()
    share = union_all(
        select(
            cut.c.point,
            (cut.c.t // width * width).label("m"),
            cut.c.d.label("held"),
            (cut.c.d * cut.c.good).label("good"),
            (cut.c.v * cut.c.d * cut.c.good).label("area"),
        ),
        select(part.c.point, part.c.t // width * width, part.c.held, part.c.good, part.c.mean * part.c.good).where(
            part.c.t >= begin
        ),
    ).subquery()
    sums = (func.sum(share.c[name]).label(name) for name in ("held", "good", "area"))
    weight = materialized(select(share.c.point, share.c.m, *sums).group_by(share.c.point, share.c.m).cte("weight"))
    of = part.c.t // width * width
    seen = (
        select(
            part.c.point,
            of.label("m"),
            func.min(part.c.low).label("low"),
            func.max(part.c.high).label("high"),
            func.min(part.c.t).label("t0"),
            func.max(part.c.t).label("t1"),
            func.sum(part.c["count"]).label("n"),
            func.max(part.c.level).label("level"),
        )
        .where(part.c.t >= begin)
        .group_by("point", "m")
        .cte("seen")
    )
    first, last = minute.alias("f"), minute.alias("l")
    found = (
        select(
            seen.c.point,
            seen.c.m,
            seen.c.low,
            seen.c.high,
            first.c.first_t,
            first.c.first,
            last.c.last_t,
            last.c.last,
            last.c.last_q,
            case((weight.c.good > 0, weight.c.area / weight.c.good), else_=None),
            weight.c.good,
            weight.c.held,
            seen.c.n,
            seen.c.level,
        )
        .join_from(seen, first, (first.c.point == seen.c.point) & (first.c.t == seen.c.t0))
        .join(last, (last.c.point == seen.c.point) & (last.c.t == seen.c.t1))
        .join(weight, (weight.c.point == seen.c.point) & (weight.c.m == seen.c.m))
    )
    columns = (
        "point", "t", "low", "high", "first_t", "first", "last_t", "last", "last_q", "mean", "good", "held", "count", "level",
    )  # fmt: skip
    return replacing(hour).from_select(columns, found)


HOURS = Statement(_hours())
"""Write the hours that have minutes; one that is there is replaced."""
