"""The table of states: every state and every event, and the stories of reference/alarms.md section 12."""

from itertools import product

import pytest

from app.alarms.lifecycle import (
    ANNUNCIATED,
    AUDIBLE,
    REFUSED,
    TRANSITIONS,
    UNACKED,
    AlarmEvent,
    AlarmState,
    Entry,
    Life,
    Traits,
    displayed,
    step,
)

LIVES = [Life(*layers) for layers in product((False, True), repeat=6)]
TRAITS = [Traits(latching, required) for latching, required in product((False, True), repeat=2)]
PLAIN = Traits()


def story(events: str, traits: Traits = PLAIN) -> str:
    """Letters of the states after each event."""
    life = Life()
    letters = [str(life.state)]
    for name in events.split():
        life = step(life, AlarmEvent(name), traits).life
        letters.append(str(life.state))
    return "".join(letters)


@pytest.mark.parametrize("event", AlarmEvent)
def test_every_state_and_event_does_what_a_row_says_or_nothing(event: AlarmEvent) -> None:
    for life, traits in product(LIVES, TRAITS):
        result = step(life, event, traits)
        assert result.before is displayed(life)
        assert result.after is displayed(result.life)
        rows = [row for row in TRANSITIONS if row.event is event and result.before in row.states]
        if result.entry is None:
            assert result.life == life
            assert not result.annunciates
            continue
        assert not result.refused
        row = next(row for row in rows if row.entry is result.entry and fits(row.when, life, traits))
        assert row.to in ("*", str(result.after)) or (row.to == "=" and result.after is result.before)
        assert result.annunciates <= (result.after is AlarmState.UNACKNOWLEDGED), (
            "only what comes to B asks for attention"
        )


def fits(when: object, life: Life, traits: Traits) -> bool:
    assert when is None or isinstance(when, dict)
    for name, wanted in (when or {}).items():
        fact = life.hidden == 1 if name == "alone" else getattr(traits, name, None)
        if fact is None:
            fact = getattr(life, name)
        if fact is not wanted:
            return False
    return True


def test_every_row_of_the_table_can_happen() -> None:
    happened = set()
    for row in TRANSITIONS:
        for life, traits in product(LIVES, TRAITS):
            if displayed(life) in row.states and fits(row.when, life, traits):
                happened.add(row.number)
                assert step(life, row.event, traits).entry is row.entry
    assert happened == {row.number for row in TRANSITIONS}


@pytest.mark.parametrize("event", [AlarmEvent.ACKNOWLEDGE, AlarmEvent.RESET])
def test_what_a_person_asks_happens_or_comes_back_with_a_reason(event: AlarmEvent) -> None:
    for life, traits in product(LIVES, TRAITS):
        result = step(life, event, traits)
        assert (result.entry is None) == bool(result.refused)


def test_an_acknowledgement_never_touches_the_condition_and_data_never_acknowledges() -> None:
    for life, traits in product(LIVES, TRAITS):
        assert step(life, AlarmEvent.ACKNOWLEDGE, traits).life.active is life.active
        assert not (
            step(life, AlarmEvent.RAISE, traits).life.acked
            and not life.active
            and step(life, AlarmEvent.RAISE, traits).entry
        )
        for event in (AlarmEvent.QUALITY, AlarmEvent.RESTART, AlarmEvent.PRIORITY, AlarmEvent.LIMIT):
            assert step(life, event, traits).life == life


@pytest.mark.parametrize(
    ("events", "traits", "letters"),
    [
        ("raise acknowledge return", Traits(), "ABCA"),
        ("raise return acknowledge", Traits(), "ABDA"),
        ("raise return raise acknowledge", Traits(), "ABDBC"),
        ("raise return acknowledge reset", Traits(latching=True), "ABEFA"),
        ("raise acknowledge return reset", Traits(latching=True), "ABCFA"),
        ("raise return reset acknowledge reset", Traits(latching=True), "ABEEFA"),
        ("raise return raise", Traits(latching=True), "ABEB"),
        ("raise acknowledge return raise", Traits(latching=True), "ABCFB"),
        ("raise return", Traits(ack_required=False), "ABA"),
        ("raise acknowledge realarm", Traits(), "ABCB"),
        ("raise acknowledge reset", Traits(latching=True), "ABCC"),
        ("raise acknowledge shelve realarm", Traits(), "ABCGG"),
        ("raise acknowledge shelve unshelve", Traits(), "ABCGB"),
        ("shelve raise unshelve", Traits(), "AGGB"),
        ("shelve raise return unshelve", Traits(), "AGGGA"),
        ("raise suppress return unsuppress", Traits(), "ABHHA"),
        ("raise suppress unsuppress raise", Traits(), "ABHAB"),
        ("raise take_out return put_back", Traits(), "ABIIA"),
        ("raise take_out put_back", Traits(), "ABIB"),
        ("shelve suppress take_out put_back unsuppress", Traits(), "AGHIHG"),
        ("raise suppress remove", Traits(), "ABHA"),
    ],
)
def test_the_life_of_an_alarm(events: str, traits: Traits, letters: str) -> None:
    assert story(events, traits) == letters


def test_a_latch_is_not_lost_by_hiding_the_alarm() -> None:
    latching = Traits(latching=True)
    assert story("raise suppress return unsuppress", latching) == "ABHHE"
    assert story("raise return acknowledge shelve unshelve reset", latching) == "ABEFGFA"


def test_silent_records_are_those_of_hidden_alarms() -> None:
    hidden = Life(suppressed=True)
    raised = step(hidden, AlarmEvent.RAISE, Traits())
    assert (raised.entry, raised.silent, raised.annunciates) == (Entry.RAISED, True, False)
    assert not step(Life(), AlarmEvent.RAISE, Traits()).silent


def test_reset_is_refused_while_the_condition_holds_and_before_the_acknowledgement() -> None:
    assert REFUSED[(AlarmEvent.RESET, "B")] == REFUSED[(AlarmEvent.RESET, "C")] == "alarm.why.still_active"
    assert REFUSED[(AlarmEvent.RESET, "E")] == "alarm.why.acknowledge_first"


def test_what_is_listed_heard_and_waited_for_follows_the_table_of_the_sheet() -> None:
    assert set("BCDEF") == ANNUNCIATED
    assert set("BDE") == UNACKED
    assert set("BE") == AUDIBLE
