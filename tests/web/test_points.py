"""How a point is shown: value, unit, quality and origin in one sentence, and the conditions of a picture."""

from functools import partial

import pytest

from app.clock import ManualClock
from app.plant.definitions import Kind, Point
from app.plant.texts import Texts, read_product
from app.tags import quality as q
from app.tags.batch import Batch, Value
from app.tags.database import Tag, TagDatabase
from app.tags.quality import Origin
from app.web import format as fmt
from app.web.points import PointView, point_view

TEXTS = Texts(read_product())


def text(lang: str) -> fmt.Text:
    return partial(TEXTS.text, lang)


class Hall:
    """The little that a view needs of the runtime."""

    def __init__(self) -> None:
        self.clock = ManualClock()
        self.tags = TagDatabase(self.clock)
        self.plant = None
        self.tags.configure([Tag("m1.speed", "m1.speed", "hall", stale_after=2.0)])

    def view(self, lang: str = "en", **point: object) -> PointView:
        given = {"unit": "rpm", "normal": (900.0, 1250.0), "scale_low": -1500.0, "scale_high": 1500.0} | point
        texts = {"0": "Stopped", "1": "Running forward"} if "texts" in given else None
        drawn = Point("m1.speed", "m1.speed", "m1", "speed", "point.speed", **given)  # type: ignore[arg-type]
        return point_view(drawn, self, lang, text(lang), label="Speed", texts=texts)

    def publish(self, value: Value, quality: int = q.GOOD) -> None:
        now = self.clock.micros()
        self.tags.publish(Batch("hall", 0, now, now, [0], [value], quality))


def test_a_view_tells_value_unit_and_quality_in_one_sentence() -> None:
    hall = Hall()
    hall.publish(1180.4)
    view = hall.view("hr")
    assert (view.text, view.unit, view.state, view.badge("bare")) == ("1\u202f180", "o/min", "good", "")
    assert view.accessible_name == "Speed: 1\u202f180 okretaja u minuti, ispravno"
    assert view.normal_text == "900\u00a0–\u00a01\u202f250"


def test_a_bad_value_never_shows_its_last_number_and_a_stale_one_shows_its_age() -> None:
    hall = Hall()
    assert hall.view().text == "–\u00a0–"
    hall.publish(1180)
    hall.clock.advance(12)
    hall.tags.sweep()
    stale = hall.view()
    assert (stale.text, stale.state, stale.badge("bare")) == ("1\u202f180", "stale", "12\u00a0s")
    hall.publish(1180, q.COMM_FAILURE)
    bad = hall.view()
    assert (bad.text, bad.state, bad.badge("bare"), bad.usable) == ("----", "bad", "BAD", False)
    assert "1" not in bad.accessible_name


def test_letters_say_where_a_value_comes_from_and_s_only_in_a_box() -> None:
    hall = Hall()
    for flag, letter in ((Origin.FORCED, "F"), (Origin.LOCAL, "M"), (Origin.SUBSTITUTED, "M"), (Origin.SIMULATED, "")):
        hall.publish(1, q.GOOD | flag)
        assert hall.view().badge("bare") == letter
    assert hall.view().badge("boxed") == "S"


def test_an_enumeration_shows_its_text_and_an_unlisted_value_its_number() -> None:
    hall = Hall()
    hall.publish(1)
    assert hall.view(kind=Kind.ENUM, texts={0: "a", 1: "b"}).text == "Running forward"
    hall.publish(9)
    assert hall.view(kind=Kind.ENUM, texts={0: "a", 1: "b"}).text == "Unknown (9)"


def test_a_moment_is_a_time_of_day_and_on_other_days_a_date_too() -> None:
    hall = Hall()
    hall.publish(hall.clock.micros())
    assert hall.view(unit="time", kind=Kind.STEP).text == "06:05:00"
    hall.clock.advance(86_400)
    assert hall.view(unit="time", kind=Kind.STEP).text == "09/03 06:05:00"


@pytest.mark.parametrize(
    ("value", "condition", "holds"),
    [(1, "1,2", True), (0, "1,2", False), (3.5, ">3", True), (-1, "<0", True), (0, "<0,>0", False), (0, "bad", False)],
)
def test_conditions_of_a_picture(value: float, condition: str, holds: bool) -> None:
    hall = Hall()
    hall.publish(value)
    assert hall.view().holds(condition) is holds
    hall.publish(value, q.COMM_FAILURE)
    assert hall.view().holds(condition) is ("bad" in condition)


@pytest.mark.parametrize(
    ("quality", "holds"),
    [
        (q.GOOD, False),
        (q.GOOD | Origin.FORCED, False),
        (q.OUT_OF_RANGE, True),
        (q.STALE, True),
        (q.HALTED, True),
        (q.COMM_FAILURE, False),
        (q.NO_DATA, False),
    ],
)
def test_what_may_not_be_so_any_more_holds_as_uncertain(quality: int, holds: bool) -> None:
    hall = Hall()
    hall.publish(1.0, quality)
    assert hall.view().holds("uncertain") is holds
    assert hall.view().holds("7,uncertain") is holds
