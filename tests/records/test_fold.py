"""Kinds of record as they are declared, and what events make of them; no store, no clock."""

import pytest

from app.plant import types
from app.records import fold
from app.records.fold import Machine
from app.records.kind import Belongs, End, Field, Order, Parts, RecordKind, Rule, Verb, When
from app.records.record import OPEN, UNKNOWN, Reading, Record
from tests.historian import stories
from tests.historian.rings import Ring
from tests.records.shelf import MemoryShelf, reading

CONVEYOR = types.read_type("conveyor", [])[0].type
SEQUENCE = types.read_type("sequence", [])[0].type
SECOND = 1_000_000
A, B, C, D, E = 1, 2, 3, 4, 5
"""Codes: begins, fills, ends, pauses, goes on."""


def event(code: int, time: float = 0.0, value: float | None = None, *, source: int = 0, number: int = 7) -> Reading:
    return Reading(1, 1, round(time * SECOND), code, str(code), source, value, {"number": number})


def kind(**given: object) -> RecordKind:
    usual = {
        "name": "thing",
        "begin": frozenset({A}),
        "number": "number",
        "ends": (End("gone", When(frozenset({C}))),),
    }
    return RecordKind(**(usual | given))  # type: ignore[arg-type]


def told(kind: RecordKind, *events: Reading) -> list[Record]:
    shelf = MemoryShelf()
    for one in events:
        fold.take(Machine((kind,), {B}), shelf, one)
    return shelf.records


def rule(verb: Verb, of: str = "", **given: object) -> RecordKind:
    field = Field("it", rules=(Rule(verb, When(frozenset({B})), of, **given),))  # type: ignore[arg-type]
    return kind(fields={"it": field})


def test_a_record_begins_and_ends_with_its_events() -> None:
    (one,) = told(kind(), event(A, 1), event(B, 2), event(C, 4))
    assert (one.number, one.entry, one.begun, one.ended, one.outcome, one.seconds) == (
        7,
        A,
        1 * SECOND,
        4 * SECOND,
        "gone",
        3.0,
    )


@pytest.mark.parametrize(
    ("verb", "given", "values", "wanted"),
    [
        (Verb.SET, {}, (1.0, -3.0, 2.0), 2.0),
        (Verb.SET, {"above": 1.5}, (1.0, 3.0, 1.5), 3.0),
        (Verb.SET, {"amount": True}, (-3.0,), 3.0),
        (Verb.FIRST, {}, (None, 4.0, 5.0), 4.0),
        (Verb.COUNT, {}, (1.0, None, 2.0), 2),
        (Verb.SUM, {}, (1.0, 2.5), 3.5),
        (Verb.LARGEST, {}, (1.0, -7.0, 2.0), 2.0),
        (Verb.LARGEST, {"amount": True}, (1.0, -7.0, 2.0), 7.0),
        (Verb.SMALLEST, {}, (1.0, -7.0, None), -7.0),
        (Verb.SET, {}, (None, None), None),
    ],
)
def test_what_events_do_to_a_field(
    verb: Verb, given: dict[str, object], values: tuple[float | None, ...], wanted: object
) -> None:
    (one,) = told(rule(verb, "value", **given), event(A), *(event(B, n, value) for n, value in enumerate(values)))
    assert one.fields.get("it") == wanted


@pytest.mark.parametrize(
    ("of", "wanted"), [("", 1), ("source", 5), ("time", 9 * SECOND), ("number", 7), ("nothing", None)]
)
def test_where_a_field_takes_it_from(of: str, wanted: object) -> None:
    (one,) = told(rule(Verb.COUNT if not of else Verb.SET, of), event(A), event(B, 9, source=5))
    assert one.fields.get("it") == wanted


@pytest.mark.parametrize(
    ("late", "after", "same"),
    [(0.0, 0.0, False), (60.0, 60.0, True), (60.0, 60.000001, False)],
)
def test_how_long_after_its_end_an_event_still_belongs(late: float, after: float, same: bool) -> None:
    found = told(kind(late=late, implied=None), event(A), event(C, 10), event(B, 10 + after))
    assert len(found) == (1 if same else 2)
    assert found[-1].entry == (A if same else 0)


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ({}, []),
        ({"implied": None}, [0]),
        ({"implied": frozenset({B})}, [0]),
        ({"found": frozenset({B})}, [B]),
        ({"only": frozenset({A})}, []),
    ],
)
def test_what_begins_a_record_of_which_nothing_is_known(given: dict[str, object], wanted: list[int]) -> None:
    assert [one.entry for one in told(kind(**given), event(B))] == wanted


def test_another_of_the_same_number_takes_its_place() -> None:
    one, other = told(kind(), event(A, 1), event(A, 5))
    assert (one.outcome, one.ended, one.seconds, other.outcome) == (UNKNOWN, 5 * SECOND, None, OPEN)
    assert [one.number for one in told(kind(), event(A), event(A, number=8))] == [7, 8]
    assert told(kind(), event(A, number=0)) == []


def test_what_ended_may_be_proved_wrong() -> None:
    made = kind(reopen={"gone": frozenset({B})})
    (one,) = told(made, event(A), event(C, 2), event(B, 99))
    assert (one.outcome, one.ended, one.seconds) == (OPEN, None, None)


@pytest.mark.parametrize(
    ("source", "value", "wanted"), [(1, 6.0, "one"), (2, 6.0, "six"), (2, 5.0, "any"), (2, None, "any")]
)
def test_the_first_end_that_fits_is_the_one(source: int, value: float | None, wanted: str) -> None:
    code = frozenset({C})
    ends = (End("one", When(code, source=1)), End("six", When(code, value=6.0)), End("any", When(code)))
    (one,) = told(kind(ends=ends), event(A), event(C, 3, value, source=source))
    assert one.outcome == wanted


def test_a_part_whose_end_was_lost_is_not_known() -> None:
    made = kind(parts=Parts(frozenset({B}), frozenset({E})))
    (one,) = told(made, event(A), event(B, 1, source=1), event(B, 2, source=2), event(E, 4, 1.0, source=3))
    assert [(part.number, part.state) for part in one.parts.values()] == [(1, "unknown"), (2, "unknown"), (3, "done")]


@pytest.mark.parametrize(
    ("after", "outcome", "ended"), [(4.0, "again", 4.0), (10.0, "over", 10.0), (11.0, "over", 10.0)]
)
def test_one_that_ends_by_itself(after: float, outcome: str, ended: float) -> None:
    made = kind(lasts="value", expired="over", displaced="again")
    one, other = told(made, event(A, 0, 10.0), event(A, after, 10.0))
    assert (one.outcome, one.ended) == (outcome, round(ended * SECOND))
    assert other.ended == round((after + 10) * SECOND)


def test_overlapping_ones_are_counted_before_and_meanwhile() -> None:
    force = kind(
        name="force",
        begin=frozenset({10}),
        ends=(End("gone", When(frozenset({11}))),),
        lasts="value",
        displaced="again",
    )
    run = kind(name="run", number="", fields={"forces": Field("forces", overlapping="force")})
    shelf, machine = MemoryShelf(), Machine((force, run))
    for one in (
        event(10, 0, 5.0),
        event(10, 1, 1.0, number=8),
        event(A, 3),
        event(10, 4, 9.0),
        event(10, 4, 9.0, number=9),
        event(C, 5),
    ):
        fold.take(machine, shelf, one)
    (found,) = (one for one in shelf.records if one.kind == "run")
    assert found.fields["forces"] == 2, "one that stood, one that began; 8 was over, 7 only renewed"


def test_lost_events_are_those_of_all_that_are_under_way_and_order_says_who_left() -> None:
    made = kind(order=Order(frozenset({A}), frozenset({C})))
    shelf, machine = MemoryShelf(), Machine((made,))
    for number in (1, 2, 3):
        fold.take(machine, shelf, event(A, number, number=number))
        if number == 2:
            fold.lose(machine, shelf, 4)
    fold.take(machine, shelf, event(C, 9, number=3))
    assert [(one.missed, one.outcome) for one in shelf.records] == [(4, UNKNOWN), (4, UNKNOWN), (0, "gone")]


def test_things_that_pass_one_after_the_other_end_in_their_order() -> None:
    made = kind(
        number="", oldest=frozenset({C}), fields={"it": Field("it", rules=(Rule(Verb.COUNT, When(frozenset({B}))),))}
    )
    found = told(
        made, event(A, 1), event(B, 2), event(A, 3), event(B, 4), event(B, 5), event(C, 6), event(C, 7), event(C, 8)
    )
    assert [(one.begun, one.ended, one.outcome, one.fields["it"]) for one in found] == [
        (1 * SECOND, 6 * SECOND, "gone", 1),
        (3 * SECOND, 7 * SECOND, "gone", 2),
    ]


def test_a_ring_that_begins_again_ends_what_was_under_way_unless_the_machine_says_how() -> None:
    for restart, outcome in ((frozenset(), UNKNOWN), (frozenset({9}), OPEN)):
        made = kind(restart=restart)
        shelf, machine = MemoryShelf(), Machine((made,))
        fold.take(machine, shelf, event(A))
        fold.begin_again(machine, shelf, event(9, 3))
        assert shelf.records[0].outcome == outcome


def test_what_a_clock_that_is_set_back_lies_within_has_no_length() -> None:
    made = kind(parts=Parts(frozenset({B}), frozenset({E}), together=True))
    (one,) = told(made, event(A, 100), event(B, 101, source=1), event(C, 50))
    assert (one.outcome, one.ended, one.seconds) == ("gone", 100 * SECOND, None)
    assert one.parts[1].seconds is None


@pytest.mark.parametrize(
    ("named", "lasting", "outcome", "ended"),
    [("restart", 10.0, "restart", 3.0), ("", 10.0, OPEN, 10.0), ("restart", 2.0, OPEN, 2.0)],
)
def test_a_ring_that_begins_again_ends_what_still_lasts_where_the_kind_says_how(
    named: str, lasting: float, outcome: str, ended: float
) -> None:
    made = kind(lasts="value", expired="over", forgotten=named)
    shelf, machine = MemoryShelf(), Machine((made,))
    fold.take(machine, shelf, event(A, 0, lasting))
    fold.begin_again(machine, shelf, event(9, 3))
    (one,) = shelf.records
    assert (one.outcome, one.ended) == (outcome, round(ended * SECOND))


def test_a_function_of_the_kind_has_the_last_word() -> None:
    def belongs(latest: Record | None, event: Reading) -> Belongs | None:
        return Belongs.NOWHERE if event.source == 3 else None

    made = kind()
    own = RecordKind(
        **{name: getattr(made, name) for name in RecordKind.__slots__} | {"hooks": type(made.hooks)(belongs=belongs)}
    )
    assert told(own, event(A, source=3)) == []
    assert len(told(own, event(A, source=2))) == 1


@pytest.mark.parametrize("seed", range(5))
def test_a_story_told_in_one_piece_or_in_many_makes_the_same_records(seed: int) -> None:
    told = [one for portion in stories.products(seed, 60) for one in portion.events]
    machine = Machine(tuple(CONVEYOR.records.values()), {10, 11, 20})
    whole = MemoryShelf()
    for one in told:
        fold.take(machine, whole, reading(CONVEYOR, one))
    parts = MemoryShelf()
    for one in told:
        parts = MemoryShelf([each.copy() for each in parts.records], parts.events)
        fold.take(machine, parts, reading(CONVEYOR, one))
    assert parts.records == whole.records


def test_the_passage_of_a_product() -> None:
    ring = Ring()
    ring.passage(7, 30.5, (0.4, -2.5, 1.0))
    shelf = MemoryShelf()
    for one in ring.drain():
        fold.take(Machine(tuple(CONVEYOR.records.values())), shelf, reading(CONVEYOR, one))
    (found,) = shelf.records
    assert (found.number, found.outcome, found.fields) == (
        7,
        "unloaded",
        {"length": 30.5, "corrections": 6, "greatest": 2.5},
    )
