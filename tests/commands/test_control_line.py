"""Many people and one machine: a line in which everybody has one place, and moves up."""

from collections.abc import Callable
from random import Random

import pytest

from app.access.roles import Person
from app.commands.control_line import ANSWER, MOST, REST
from app.commands.control_token import GONE, PAUSE
from app.errors import Refused
from tests.commands.stand import ANA, EVA, IVO, person
from tests.commands.test_control_token import Desk, refused

TOM, UMA = person("tom"), person("uma")
TICK = 0.25
"""Of the desk [s]."""

# ---- every state, every event ---------------------------------------------------------------------------------


def free(desk: Desk) -> None:
    """Nobody."""


def held(desk: Desk) -> None:
    desk.token.take(ANA, "m1")


def asked(desk: Desk) -> None:
    held(desk)
    desk.token.request(IVO, "m1")


def lined(desk: Desk) -> None:
    asked(desk)
    desk.token.request(EVA, "m1")


def resting(desk: Desk) -> None:
    """Ana has just refused somebody, and others wait."""
    held(desk)
    for who in (TOM, IVO, EVA):
        desk.token.request(who, "m1")
    desk.token.refuse(ANA, "m1")


def moved(desk: Desk) -> None:
    """Ana moves the machine by hand since before they asked."""
    held(desk)
    desk.moving = True
    for who in (IVO, EVA):
        desk.token.request(who, "m1")


def leaves(who: Person) -> Callable[[Desk], None]:
    def happen(desk: Desk) -> None:
        desk.token.socket_opened(who.session)
        desk.token.socket_closed(who.session)
        desk.pass_time(GONE)

    return happen


def loses(who: Person) -> Callable[[Desk], None]:
    def happen(desk: Desk) -> None:
        desk.barred.add(who.session)
        desk.token.check_rights()

    return happen


def moves(desk: Desk) -> None:
    desk.moving = True
    desk.pass_time(90)


STATES = (free, held, asked, lined, resting, moved)
EVENTS: dict[str, Callable[[Desk], object]] = {
    "eva takes it": lambda desk: desk.token.take(EVA, "m1"),
    "ana asks": lambda desk: desk.token.request(ANA, "m1"),
    "ivo asks": lambda desk: desk.token.request(IVO, "m1"),
    "uma asks": lambda desk: desk.token.request(UMA, "m1"),
    "tom asks": lambda desk: desk.token.request(TOM, "m1"),
    "ivo asks elsewhere": lambda desk: desk.token.request(person("ivo", session="other"), "m1"),
    "ivo withdraws": lambda desk: desk.token.withdraw(IVO, "m1"),
    "ivo withdraws elsewhere": lambda desk: desk.token.withdraw(person("ivo", session="other"), "m1"),
    "eva withdraws": lambda desk: desk.token.withdraw(EVA, "m1"),
    "ana refuses": lambda desk: desk.token.refuse(ANA, "m1"),
    "ivo refuses": lambda desk: desk.token.refuse(IVO, "m1"),
    "ana gives": lambda desk: desk.token.give(ANA, "m1"),
    "eva gives": lambda desk: desk.token.give(EVA, "m1"),
    "ana releases": lambda desk: desk.token.release(ANA, "m1"),
    "ivo releases": lambda desk: desk.token.release(IVO, "m1"),
    "ana signs out": lambda desk: desk.token.session_ended(ANA.session),
    "ivo signs out": lambda desk: desk.token.session_ended(IVO.session),
    "eva signs out": lambda desk: desk.token.session_ended(EVA.session),
    "ana leaves": leaves(ANA),
    "ivo leaves": leaves(IVO),
    "eva leaves": leaves(EVA),
    "ana may not": loses(ANA),
    "ivo may not": loses(IVO),
    "eva may not": loses(EVA),
    "it moves": moves,
    "ten seconds": lambda desk: desk.pass_time(ANSWER),
    "a minute": lambda desk: desk.pass_time(REST),
    "and an answer": lambda desk: desk.pass_time(REST + ANSWER),
    "two turns": lambda desk: desk.pass_time(REST + 2 * ANSWER),
    "it goes": lambda desk: desk.token.keep_only(frozenset({"m2"})),
}
TABLE = """
                          free   held      asked          lined              resting             moved
eva takes it            | Eva  | why.held| why.held     | why.held         | why.held          | why.held
ana asks                | Ana  | Ana     | Ana < Ivo!   | Ana < Ivo! Eva   | Ana < Ivo Eva     | Ana < Ivo Eva
ivo asks                | Ivo  | Ana < Ivo! | Ana < Ivo! | Ana < Ivo! Eva  | Ana < Ivo Eva     | Ana < Ivo Eva
uma asks                | Uma  | Ana < Uma! | Ana < Ivo! Uma | Ana < Ivo! Eva Uma | Ana < Ivo Eva Uma | Ana < Ivo Eva Uma
tom asks                | Tom  | Ana < Tom! | Ana < Ivo! Tom | Ana < Ivo! Eva Tom | why.take_over_refused | Ana < Ivo Eva Tom
ivo asks elsewhere      | Ivo  | Ana < Ivo! | why.in_line | why.in_line     | why.in_line       | why.in_line
ivo withdraws           | OUT  | OUT     | Ana          | Ana < Eva        | Ana < Eva         | Ana < Eva
ivo withdraws elsewhere | OUT  | OUT     | Ana          | Ana < Eva        | Ana < Eva         | Ana < Eva
eva withdraws           | OUT  | OUT     | OUT          | Ana < Ivo!       | Ana < Ivo         | Ana < Ivo
ana refuses             | NONE | NONE    | Ana          | Ana < Eva        | NONE              | NONE
ivo refuses             | NONE | NONE    | NONE         | NONE             | NONE              | NONE
ana gives               | NONE | NONE    | Ivo          | Ivo < Eva        | NONE              | NONE
eva gives               | NONE | NONE    | NONE         | NONE             | NONE              | NONE
ana releases            |      |         | Ivo          | Ivo < Eva        | Ivo < Eva         | HAND
ivo releases            |      | Ana     | Ana < Ivo!   | Ana < Ivo! Eva   | Ana < Ivo Eva     | Ana < Ivo Eva
ana signs out           |      |         | Ivo          | Ivo < Eva        | Ivo < Eva         | Ivo < Eva
ivo signs out           |      | Ana     | Ana          | Ana < Eva        | Ana < Eva         | Ana < Eva
eva signs out           |      | Ana     | Ana < Ivo!   | Ana < Ivo!       | Ana < Ivo         | Ana < Ivo
ana leaves              |      |         | Ivo          | Ivo < Eva        | Ivo < Eva         | Ana < Ivo Eva
ivo leaves              |      | Ana     | Ana          | Ana < Eva        | Ana < Eva         | Ana < Eva
eva leaves              |      | Ana     | Ivo          | Ivo              | Ana < Ivo         | Ana < Ivo
ana may not             |      |         | Ivo          | Ivo < Eva        | Ivo < Eva         | Ana < Ivo Eva
ivo may not             |      | Ana     | Ana          | Ana < Eva        | Ana < Eva         | Ana < Eva
eva may not             |      | Ana     | Ana < Ivo!   | Ana < Ivo!       | Ana < Ivo         | Ana < Ivo
it moves                |      | Ana     | Ana < Ivo!   | Ana < Ivo! Eva   | Ana < Ivo Eva     | Ana < Ivo Eva
ten seconds             |      | Ana     | Ivo          | Ivo < Eva        | Ana < Ivo Eva     | Ana < Ivo Eva
a minute                |      | Ana     | Ivo          | Ivo < Eva        | Ana < Ivo! Eva    | Ana < Ivo Eva
and an answer           |      | Ana     | Ivo          | Ivo < Eva!       | Ivo < Eva         | Ana < Ivo Eva
two turns               |      | Ana     | Ivo          | Eva              | Ivo < Eva         | Ana < Ivo Eva
it goes                 |      |         |              |                  |                   |
"""
SHORT = {"OUT": "why.not_in_line", "NONE": "why.no_request", "HAND": "why.hold_active"}
ROWS = [[cell.strip() for cell in row.split("|")] for row in TABLE.strip().splitlines()[1:]]
CASES = [(row[0], state, cell) for row in ROWS for state, cell in zip(STATES, row[1:], strict=True)]


@pytest.mark.parametrize(
    ("event", "state", "then"), CASES, ids=[f"{state.__name__}-{event}".replace(" ", "-") for event, state, _ in CASES]
)
def test_what_an_event_makes_of_a_state(event: str, state: Callable[[Desk], None], then: str) -> None:
    desk = Desk()
    state(desk)
    desk.changed.clear()
    before = desk.seen
    try:
        EVENTS[event](desk)
    except Refused as refusal:
        assert refusal.reason == SHORT.get(then, then)
        assert desk.seen == before
        return
    assert desk.seen == SHORT.get(then, then)
    assert desk.seen == before or desk.changed or event == "it goes", "whoever looks is told"


def test_every_event_is_in_the_table() -> None:
    assert [row[0] for row in ROWS] == list(EVENTS)


# ---- what a state alone does not tell -------------------------------------------------------------------------


def test_two_people_notice_no_line() -> None:
    desk = Desk()
    for who, other in ((ANA, IVO), (IVO, ANA)) * 3:
        desk.token.request(who, "m1")
        desk.token.request(other, "m1")
        assert desk.seen == f"{who.display} < {other.display}!"
        desk.pass_time(ANSWER)
        assert desk.seen == other.display


def test_a_refusal_takes_only_the_first_out_and_the_holder_has_a_minute_before_the_next() -> None:
    desk = Desk()
    lined(desk)
    desk.pass_time(4)
    desk.token.refuse(ANA, "m1")
    assert desk.seen == "Ana < Eva"
    assert desk.token.yields_in("m1") == REST + ANSWER
    desk.pass_time(PAUSE - TICK)
    assert refused(desk.token.request, IVO, "m1") == ("why.take_over_refused", 423)
    desk.pass_time(TICK)
    desk.token.request(IVO, "m1")
    desk.pass_time(REST - PAUSE - TICK)
    assert desk.seen == "Ana < Eva Ivo"
    desk.pass_time(TICK)
    assert desk.seen == "Ana < Eva! Ivo"
    assert desk.token.yields_in("m1") == ANSWER


def test_what_is_released_goes_to_the_first_at_once_who_then_has_a_minute() -> None:
    desk = Desk()
    lined(desk)
    desk.token.request(UMA, "m1")
    desk.token.release(ANA, "m1")
    assert desk.seen == "Ivo < Eva Uma"
    assert desk.story == ["ana taken", "ana released", "ivo moved_up"]
    desk.pass_time(20)
    desk.token.release(IVO, "m1")
    assert desk.seen == "Eva < Uma"
    desk.pass_time(REST - TICK)
    assert desk.seen == "Eva < Uma"
    desk.pass_time(TICK)
    assert desk.seen == "Eva < Uma!"


def test_who_asks_in_the_minute_of_a_holder_does_not_get_round_it_by_leaving_the_line() -> None:
    desk = Desk()
    lined(desk)
    desk.pass_time(ANSWER)
    assert desk.seen == "Ivo < Eva"
    desk.token.withdraw(EVA, "m1")
    desk.token.request(EVA, "m1")
    assert desk.seen == "Ivo < Eva"
    assert desk.story[-1] == "eva withdrawn"


def test_who_asks_while_it_moves_is_put_to_the_holder_when_it_stands() -> None:
    desk = Desk()
    moved(desk)
    assert desk.token.yields_in("m1") is None
    desk.pass_time(120)
    desk.moving = False
    desk.pass_time(TICK)
    assert desk.seen == "Ana < Ivo! Eva"
    desk.pass_time(ANSWER - TICK)
    assert desk.seen == "Ana < Ivo! Eva", "with all of his time to answer"
    desk.pass_time(TICK)
    assert desk.seen == "Ivo < Eva"


def test_the_place_is_the_persons_and_the_machine_goes_to_the_session_that_asked() -> None:
    desk = Desk()
    lined(desk)
    other = person("eva", session="phone")
    assert (desk.token.number(EVA, "m1"), desk.token.number(other, "m1"), desk.token.number(ANA, "m1")) == (2, 2, 0)
    desk.token.release(ANA, "m1")
    desk.token.release(IVO, "m1")
    assert desk.token.holds(EVA, "m1")
    assert not desk.token.holds(other, "m1")


def test_programs_are_told_apart_by_their_tokens() -> None:
    """They have no account of their own: a refusal of one is none of another."""
    desk = Desk()
    one, two = (
        Person(0, name, name, ANA.roles, ANA.permissions, f"token-{number}") for number, name in enumerate(("P", "Q"))
    )
    held(desk)
    desk.token.request(one, "m1")
    desk.token.request(two, "m1")
    assert desk.seen == "Ana < P! Q"
    desk.token.refuse(ANA, "m1")
    assert refused(desk.token.request, one, "m1") == ("why.take_over_refused", 423)
    desk.token.withdraw(two, "m1")
    desk.token.request(two, "m1")
    assert desk.seen == "Ana < Q"


def test_a_line_has_an_end_that_says_so() -> None:
    desk = Desk()
    held(desk)
    crowd = [Person(n, f"p{n}", f"P{n}", ANA.roles, ANA.permissions, f"session-{n}") for n in range(1, MOST + 2)]
    for who in crowd[:-1]:
        desk.token.request(who, "m1")
    assert refused(desk.token.request, crowd[-1], "m1") == ("why.line_full", 423)
    desk.token.withdraw(crowd[3], "m1")
    desk.token.request(crowd[-1], "m1")
    assert desk.token.number(crowd[-1], "m1") == MOST


def test_who_reloads_the_page_in_the_line_keeps_the_place() -> None:
    desk = Desk()
    lined(desk)
    for _ in range(3):
        desk.token.socket_opened(EVA.session)
        desk.token.socket_closed(EVA.session)
        desk.pass_time(2)
    desk.token.socket_opened(EVA.session)
    desk.pass_time(30)
    assert desk.seen == "Ivo < Eva"


def test_machines_have_lines_of_their_own() -> None:
    desk = Desk()
    lined(desk)
    desk.token.take(UMA, "m2")
    desk.token.request(IVO, "m2")
    desk.token.withdraw(IVO, "m1")
    assert desk.seen == "Ana < Eva"
    assert desk.token.number(IVO, "m2") == 1
    assert desk.token.line("m3") == ()


# ---- walks ----------------------------------------------------------------------------------------------------


class Model:
    """What the rules say, in lists: who holds it, who waits, since when the first is put to the holder, who left when, who was refused."""

    def __init__(self) -> None:
        self.now = 0.0
        self.holder = ""
        self.line: list[str] = []
        self.put: float | None = None
        self.rest = self.sign = 0.0
        self.moving = False
        self.away: dict[str, float] = {}
        self.refused: dict[str, float] = {}

    @property
    def seen(self) -> str:
        waiting = [f"{name}{'!' * (n == 0 and self.put is not None)}" for n, name in enumerate(self.line)]
        return " ".join([self.holder, *(["<", *waiting] if waiting else [])])

    def ask(self, name: str) -> bool:
        if not self.holder:
            self.holder = name
        if name == self.holder:
            self.sign = self.now
        if name == self.holder or name in self.line:
            return True
        if self.now - self.refused.get(name, -99) < 30:
            return False
        self.line.append(name)
        if self.put is None and not self.moving and self.now >= self.rest:
            self.put = self.now
        return True

    def out(self, *names: str) -> bool:
        stay = [name for name in self.line if name not in names]
        if self.put is not None and self.line[0] in names:
            self.put, self.rest = None, self.now + 60 if stay else self.rest
        left, self.line = len(stay) < len(self.line), stay
        return left

    def next(self) -> None:
        self.holder = self.line.pop(0) if self.line else ""
        self.put, self.rest, self.sign = None, self.now + 60 if self.line else 0.0, self.now

    def refuse(self) -> bool:
        if self.put is None:
            return False
        self.refused[self.line[0]] = self.sign = self.now
        return self.out(self.line[0])

    def release(self) -> bool:
        if not self.moving:
            self.next()
        return not self.moving

    def second(self, quarters: int) -> None:
        for _ in range(quarters):
            self.now += TICK
            gone = {name for name, at in self.away.items() if self.now - at >= 10}
            self.out(*gone)
            if self.moving or not self.holder:
                self.sign = self.now
            elif self.holder in gone or self.now - self.sign >= 900:
                self.next()
            elif self.put is None:
                self.put = self.now if self.line and self.now >= self.rest else None
            elif self.now - self.put >= 10 and self.line[0] not in self.away:
                self.next()


@pytest.mark.sweep(8)
@pytest.mark.parametrize("seed", range(40))
def test_a_walk_goes_as_the_rules_say(seed: int) -> None:
    random, desk, model = Random(seed), Desk(), Model()
    people = {who.display: who for who in (ANA, IVO, EVA, TOM, UMA)}
    for who in people.values():
        desk.token.socket_opened(who.session)

    def same(expected: bool, work: Callable[..., object], who: Person) -> None:
        if expected:
            work(who, "m1")
        else:
            refused(work, who, "m1")

    token = desk.token
    for _ in range(400):
        name = random.choice([name for name in people if name not in model.away] or [""])
        what = random.choices(
            ("ask", "out", "refuse", "release", "away", "back", "move", "wait"), (9, 2, 2, 2, 2, 4, 1, 9)
        )[0]
        holder = people.get(model.holder)
        if what == "ask" and name:
            same(model.ask(name), token.request, people[name])
        elif what == "out" and name:
            same(model.out(name), token.withdraw, people[name])
        elif what == "refuse" and holder:
            same(model.refuse(), token.refuse, holder)
        elif what == "release" and holder:
            same(model.release(), token.release, holder)
        elif what == "away" and name:
            token.socket_closed(people[name].session)
            model.away[name] = model.now
        elif what == "back" and model.away:
            name = random.choice(list(model.away))
            token.socket_opened(people[name].session)
            del model.away[name]
        elif what == "move":
            desk.moving = model.moving = bool(model.holder) and not model.moving
        elif what == "wait":
            quarters = random.choice((1, 4, 20, 48, 130, 300))
            desk.pass_time(quarters * TICK)
            model.second(quarters)
        assert desk.seen == model.seen, seed
        waiting = [place.display for place in token.line("m1")]
        assert len(waiting) == len(set(waiting))
        assert desk.holder or not waiting


@pytest.mark.sweep(8)
@pytest.mark.parametrize("seed", range(20))
def test_everybody_who_stays_has_it_in_time_while_holders_keep_silent(seed: int) -> None:
    random, desk = Random(seed), Desk()
    crowd = [Person(n, f"p{n}", f"P{n}", ANA.roles, ANA.permissions, f"session-{n}") for n in range(1, 31)]
    for who in crowd:
        desk.token.socket_opened(who.session)
    asked: dict[str, tuple[float, int]] = {}
    order: list[str] = []
    had: list[str] = []
    waiting = random.sample(crowd, len(crowd))
    while len(had) < len(crowd):
        for _ in range(random.randrange(4)):
            if waiting:
                who = waiting.pop()
                desk.token.request(who, "m1")
                asked[who.display] = desk.clock.monotonic(), desk.token.number(who, "m1")
                order.append(who.display)
        if random.random() < 0.1 and desk.holder:
            desk.token.release(next(who for who in crowd if who.display == desk.holder), "m1")
        desk.pass_time(random.choice((0.25, 1, 5)))
        had += [name for line in desk.story if line.endswith(("taken", "taken_over", "moved_up"))
                if (name := line.split()[0].upper()) not in had]  # fmt: skip
        for name, (at, place) in asked.items():
            limit = place * (REST + ANSWER + TICK) + 5
            assert name in had or desk.clock.monotonic() - at <= limit, f"{name} waits since {at}"
    assert had == order, "first come, first served"
