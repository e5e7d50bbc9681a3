"""What a command says of itself: each state in every language, names for who is signed in alone, numbers of the reader."""

from functools import partial
from zoneinfo import ZoneInfo

import pytest

from app.clock import ManualClock
from app.commands.interlocks import RefusalReason
from app.commands.lifecycle import Progress, ProgressState
from app.errors import Refused
from app.plant.loader import read_plant
from app.plant.texts import Texts
from app.web import format as fmt
from app.web.command_words import CommandWords
from app.web.points import EquipmentView
from tests.conftest import ROOT

PLANT, _ = read_plant(ROOT / "plants" / "demo")
assert PLANT is not None
TEXTS = Texts.read(PLANT)
LANGUAGES = ("hr", "en", "de", "cs")
ASKED = 1_772_000_000_000_000


class Nothing:
    """A runtime without a value."""

    plant = PLANT
    clock = ManualClock(fmt.to_datetime(ASKED))
    tags: dict[str, object] = {}  # noqa: RUF012


def words(lang: str = "en", machine: str = "m1", *, signed_in: bool = True) -> CommandWords:
    assert PLANT is not None
    view = EquipmentView(PLANT.equipment[machine], Nothing(), lang, partial(TEXTS.text, lang))  # type: ignore[arg-type]
    return CommandWords(view, ZoneInfo("Europe/Zagreb"), signed_in=signed_in)


def progress(state: ProgressState, **more: object) -> Progress:
    return Progress("7", "m1", "forward", "command.forward", "Ana Kos", state, ASKED, **more)  # type: ignore[arg-type]


@pytest.mark.parametrize("lang", LANGUAGES)
@pytest.mark.parametrize("state", list(ProgressState))
def test_every_state_is_a_line_without_a_key_in_it(state: ProgressState, lang: str) -> None:
    line = words(lang).tell(progress(state, ended=ASKED + 3_000_000)).text
    assert line.startswith("M1 ") and line.endswith(" · Ana Kos")
    assert "fb." not in line and "why." not in line and "command." not in line


@pytest.mark.parametrize("lang", LANGUAGES)
def test_a_motion_that_was_not_let_go_says_what_ended_it(lang: str) -> None:
    """Whoever still holds the button has read why once; the line that comes when the machine stands takes that away no more."""
    cut = words(lang).tell(progress(ProgressState.CONFIRMED, ended=ASKED, reason="hold.cause.permissive"))
    assert f": {TEXTS.text(lang, 'hold.cause.permissive')} · " in cut.text
    assert cut.kind == "info"
    released = words(lang).tell(progress(ProgressState.CONFIRMED, ended=ASKED, reason="hold.cause.released"))
    assert TEXTS.text(lang, "hold.cause.released") not in released.text
    assert released.kind == "done"


def test_the_kind_of_the_line_is_how_it_ended() -> None:
    kinds = {state: words().tell(progress(state, ended=ASKED)).kind for state in ProgressState}
    assert {state for state, kind in kinds.items() if kind == "done"} == {
        ProgressState.CONFIRMED,
        ProgressState.DRY_RUN,
    }
    info = {ProgressState.REQUESTED, ProgressState.ACCEPTED, ProgressState.SUPERSEDED}
    assert {state for state, kind in kinds.items() if kind == "info"} == info


@pytest.mark.parametrize(("lang", "day"), [("hr", "24.02."), ("en", "24/02"), ("de", "24.02."), ("cs", "24.02.")])
def test_what_was_yesterday_has_its_day(lang: str, day: str) -> None:
    today, yesterday = words(lang).time(ASKED), words(lang).time(ASKED - 86_400_000_000)
    assert yesterday == f"{day} {today}"
    told = words(lang).tell(progress(ProgressState.CONFIRMED, accepted=ASKED - 86_400_000_000, ended=ASKED)).text
    assert told.count(day) == 1


def test_a_guest_learns_no_name() -> None:
    line = words(signed_in=False).tell(progress(ProgressState.CONFIRMED, ended=ASKED)).text
    assert "Ana" not in line and "Operator" in line


@pytest.mark.parametrize("lang", LANGUAGES)
def test_why_it_failed_stands_behind_it(lang: str) -> None:
    told = words(lang)
    failed = progress(ProgressState.REFUSED, ended=ASKED, reason="why.rate")
    assert f": {told.text('why.rate', {})}" in told.tell(failed).text
    assert told.because(progress(ProgressState.CONFIRMED)) == ""


def test_of_several_missing_conditions_the_first_is_named_and_the_rest_counted() -> None:
    one = RefusalReason("why.condition", {}, "permissive.no_fault")
    alone, three = words().explain_first([one]), words().explain_first([one, one, one])
    assert alone != three and "2" in three
    assert words().explain_first([]) == ""


def test_a_refused_value_is_named_once() -> None:
    refused = Refused("why.not_a_number", 422, text="abc", argument="x", label="point.frequency_setpoint")
    said = words().refusal(refused)
    assert "abc" in said and not said.startswith("point.")


KINDS = {item.type.name: item.id for item in PLANT.equipment.values()}


@pytest.mark.parametrize("lang", LANGUAGES)
@pytest.mark.parametrize("kind", sorted(KINDS))
def test_what_a_command_does_and_what_is_missing_are_sentences_in_every_language(kind: str, lang: str) -> None:
    assert PLANT is not None
    told, type = words(lang, KINDS[kind]), PLANT.types[kind]
    sentences = [(one.text, one.values) for command in type.commands.values() for one in command.effects]
    sentences += [(one.missing, one.values) for one in (*type.permissives, *type.interlocks)]
    for key, values in sentences:
        said = told.told(key, dict.fromkeys(values, 1234.5))
        assert said and key not in said and "{" not in said and "[" not in said, (key, said)
        assert not values or fmt.number(1234.5, 1, lang) in said, (key, said)
        assert not values or "–" in told.told(key, dict.fromkeys(values)), key
    for command in type.commands.values():
        highest = max(command.level, command.level_when[1] if command.level_when else "")
        assert highest < "C2" or (command.effects and not command.effects[-1].when), command.key
