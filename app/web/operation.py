"""What templates know of operating one machine: its buttons for this person, who holds it, what is missing, what became of it.

The gate (app/commands) decides; here its answers become words in the person's language.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING
from urllib.parse import quote

from starlette.requests import HTTPConnection

from app.commands import interlocks
from app.commands.encoder_adjustment import adjustable
from app.commands.lifecycle import Progress, ProgressState
from app.links.plc import PlcUnit
from app.plant.definitions import Equipment
from app.web import format as fmt
from app.web.command_words import CommandWords, Story
from app.web.needs import ConditionLine, Needs
from app.web.points import CommandView, PointView

if TYPE_CHECKING:
    from app.access.roles import Person
    from app.web.view import View

DRAWN: Mapping[ProgressState, str] = {
    ProgressState.REQUESTED: "requested",
    ProgressState.ACCEPTED: "accepted",
    ProgressState.UNKNOWN: "accepted",
    ProgressState.CONFIRMED: "done",
    ProgressState.DRY_RUN: "done",
}
"""`data-state` of a button; every other state is drawn as failed."""


@dataclass(frozen=True, slots=True)
class Button:
    """A command as it stands for this person."""

    view: CommandView
    url: str
    state: str = "idle"
    """data-state: idle, requested, accepted, done, failed."""
    line: str = ""
    """Second line: the object, the progress, or why not."""
    reason: str = ""
    """Why it cannot be pressed; empty = it can."""
    cause: str = ""
    """The first cause of that alone."""
    look: str = ""
    """`danger` for what asks first."""
    since: int = 0
    """When it was accepted [µs UTC], while its feedback is awaited."""
    limit: float = 0.0
    """Time for the feedback [s]."""
    waiting: str = ""
    """Pattern of the second line meanwhile, with {elapsed} and {limit}."""
    outcome: str = ""
    """What became of it in a word or two, when it came to another end than it should: the second line says why."""

    moves: bool = True
    """False for what does not make the machine move."""
    hidden: bool = False
    """There is nothing that it would put back."""
    passing: bool = False
    """`reason` is only that another one is on its way to the device: it is over before it is read, and nothing may move for it."""

    @property
    def why(self) -> str:
        """`reason` as it is drawn; empty for one that passes, which is heard, and told to who presses."""
        return "" if self.passing else self.reason

    @property
    def part(self) -> str:
        """Key of this part of a page."""
        return self.view.name


@dataclass(frozen=True, slots=True)
class Holding:
    """Who holds the machine, as this person sees it."""

    state: str
    """guest, free, mine, other."""
    text: str
    action: str = ""
    """take, release, request or withdraw; empty = none possible."""
    asks: str = ""
    """Somebody asks the holder for it."""
    line: str = ""
    """Who waits for it, or which place in the line this person has; empty = nobody waits."""
    left: float | None = None
    """Time left for the holder to refuse, for who is asked and who is next [s]; None for others, and while it cannot be told."""
    sentence: str = ""
    """`text` where nothing beside says what it is about; empty = `text` says it."""


class Operation(Needs):
    """Everything about operating one machine that a template draws, for one person in one language."""

    def __init__(self, request: HTTPConnection, item: Equipment) -> None:
        view: View = request.app.state.view
        self._request = request
        super().__init__(view.machine(request, item))
        self.person: Person | None = getattr(request.state, "person", None)
        self.csrf: str = getattr(request.state, "csrf", "")
        self.runtime = view.runtime(request)
        self.words = CommandWords(self.equipment, self.zone, signed_in=self.person is not None)

    def fresh(self) -> "Operation":
        """The same, drawn anew."""
        return Operation(self._request, self.equipment.equipment)

    def named(self, text: str) -> str:
        """What the message line says of the machine: a page may show several, or another one than is in its head."""
        return f"{self.id.upper()}: {text}"

    def about(self, key: str, text: str) -> str:
        """What the message line says of the command or the setpoint `key` of the machine, as it says what became of one."""
        view = self.equipment.commands.get(key)
        label = view.label if view else self.equipment.point(key).label if self.equipment.has(key) else ""
        return f"{self.id.upper()} {label}: {text}" if label else text

    @property
    def url(self) -> str:
        """Address of the machine."""
        return f"/equipment/{quote(self.id)}"

    def moment(self, point: PointView, *, milliseconds: bool = True) -> str:
        """A time of the device itself [µs since it was first switched on], with its day unless that is today; empty when not known."""
        link = self.runtime.links.get(self.equipment.link)
        station = link.stations.get(self.equipment.unit_address) if link else None
        plc = station.service(PlcUnit) if station else None
        if plc is None or not point.usable or not isinstance(point.value, int | float):
            return ""
        time, now = plc.clock.utc(int(point.value)), self.runtime.clock.micros()
        return fmt.moment_or_time(time, self.zone, self.equipment.lang, now, milliseconds=milliseconds) if time else ""

    @property
    def adjustable(self) -> bool:
        """Whether it may have an absolute encoder to be adjusted."""
        return adjustable(self.equipment.equipment.type)

    @property
    def instructs(self) -> bool:
        """Whether this person may lend the machine a hand: it is a simulated one, and they are an instructor."""
        if self.person is None or not self.person.may("instruct"):
            return False
        item = self.equipment.equipment
        link = self.runtime.links.get(item.link)
        if link is None:
            return False
        station = link.stations.get(item.unit)
        return link.simulated or (station is not None and station.simulated)

    @property
    def revision_tag(self) -> str:
        """The tag that changes with anything drawn here."""
        return revision_tag(self.id)

    @cached_property
    def progress(self) -> Progress | None:
        """The command at work, else the last one."""
        return self.gate.progress(self.id) if self.gate else None

    # ---- buttons --------------------------------------------------------------------------------------

    @cached_property
    def buttons(self) -> Mapping[str, Button]:
        """Every command by key."""
        commands = self.equipment.equipment.type.commands
        left = bool(self.gate and self.gate.left(self.id))
        return {
            key: replace(self._button(view), moves=commands[key].moves, hidden=commands[key].puts_back and not left)
            for key, view in self.equipment.commands.items()
        }

    @property
    def holds(self) -> list[Button]:
        """The hold-to-run commands."""
        return [button for button in self.buttons.values() if button.view.hold]

    def _button(self, view: CommandView) -> Button:
        command = self.equipment.equipment.type.commands[view.key]
        url = f"{self.url}/stop" if view.stop else f"{self.url}/{'hold' if view.hold else 'command'}/{view.key}"
        cause, reason, passing = self._why_not(view.key)
        asks = (
            (passing or not reason)
            and not command.stop
            and self.gate is not None
            and self.gate.level(self.id, view.key) >= "C2"
        )
        idle = self.equipment.text("operate.asks_first") if asks else f"{self.id.upper()} · {self.equipment.label}"
        look = "danger" if asks else ""
        progress = self.progress
        if progress is None or progress.command != view.key or (reason and progress.over):
            line = idle if passing else reason or idle
            return Button(view, url, line=line, reason=reason, cause=cause, look=look, passing=passing)
        state = DRAWN.get(progress.state, "failed")
        if progress.over and progress.state is ProgressState.UNKNOWN:
            state = "failed"
        if not progress.over:
            waits = progress.accepted if progress.state is ProgressState.ACCEPTED and not view.hold else 0
            line = f"{self.equipment.text(progress.text)} {self.words.time(progress.accepted or progress.requested)}"
            pattern = self.equipment.text("fb.waiting") if waits else ""
            return Button(view, url, state, line, reason, cause, look, waits, progress.limit, pattern, passing=passing)
        text = self.equipment.text(progress.text)
        line = f"{text} {self.words.time(progress.ended)}" if state == "done" else self.words.because(progress) or text
        outcome = "" if state == "done" else text
        line = f"{line} · {idle}" if asks else line
        return Button(view, url, state, line, reason, cause, look, outcome=outcome, passing=passing)

    def why_not(self, key: str) -> str:
        """Why this person cannot give the command (or write the setpoint) now, in words; empty = possible."""
        return self._why_not(key)[1]

    def _why_not(self, key: str) -> tuple[str, str, bool]:
        """The first cause alone, with how many there are besides, and whether it passes by itself in a moment."""
        text = self.equipment.text
        command = self.equipment.equipment.type.commands.get(key)
        permission = "stop" if command and command.stop else "operate"
        if self.gate is None:
            why = text("operate.not_ready")
        elif self.person is None:
            why = text("operate.sign_in")
        elif not self.person.may(permission):
            why = text("why.idle" if self.person.idle else "why.role")
        elif permission == "stop":
            why = ""  # whoever may stop may always try
        else:
            found = self.gate.why_not(self.person, self.id, key)
            passing = bool(found) and found[0].key == "why.busy"
            return self.words.explain_first(found[:1]), self.words.explain_first(found), passing
        return why, why, False

    def former(self, button: Button) -> str:
        """The value before the last change, as it is entered; empty when there is none, or it is the present one."""
        value = self.gate.former(self.id, button.view.key) if self.gate else None
        point = button.view.argument
        if value is None or point is None or button.reason or interlocks.same(point.value, value, point.decimals):
            return ""
        return fmt.number(value, point.decimals, self.equipment.lang)

    @cached_property
    def story(self) -> Story | None:
        """The latest command as the message line tells it to everybody who looks at the machine."""
        return self.words.tell(self.progress) if self.progress else None

    # ---- who holds it, what is missing ------------------------------------------------------------------

    @cached_property
    def holding(self) -> Holding:
        """Who holds the machine."""
        text = self.equipment.text
        if self.gate is None:
            return Holding("guest", text("operate.not_ready"))
        control, person = self.gate.control, self.person
        holder = control.holder(self.id)
        may = person is not None and person.may("operate")
        if holder is None:
            return (
                Holding("free", text("operate.free"), "take" if may else "")
                if may
                else Holding("guest", text("operate.free"))
            )
        if person is not None and holder.session == person.session:
            asks = self._waiting("operate.asks") if control.request_for(self.id) else ""
            waits, left = self._waiting("operate.waits"), control.yields_in(self.id)
            return Holding(
                "mine",
                text("operate.you" if waits else "operate.mine"),
                "release",
                asks,
                waits,
                left,
                text("operate.mine"),
            )
        number = control.number(person, self.id) if person is not None else 0
        line = self.place if number else self._waiting("operate.waits")
        name = self.words.named(holder.display)
        held = text("operate.held", display=name, since=self.words.time(holder.since))
        action = ("withdraw" if number else "request") if may else ""
        left = control.yields_in(self.id) if number == 1 else None
        told = text("why.held", display=held)
        return Holding("other" if may else "guest", name if line else held, action, "", line, left, told)

    @property
    def place(self) -> str:
        """Which place in the line for the machine this person has; empty = does not wait."""
        if self.gate is None or self.person is None:
            return ""
        control = self.gate.control
        number = control.number(self.person, self.id)
        if number == 1 and control.request_for(self.id):
            return self.equipment.text("operate.asked")
        of = len(control.line(self.id))
        return self.equipment.text("operate.place", number=number, of=of) if number else ""

    def _waiting(self, key: str) -> str:
        """Who waits, in the words of `key`, or of `<key>_more` with how many behind; empty = nobody."""
        line = self.gate.control.line(self.id) if self.gate else ()
        if not line:
            return ""
        first, more = self.words.named(line[0].display), len(line) - 1
        return self.equipment.text(f"{key}_more" if more else key, display=first, more=more)

    @cached_property
    def situation(self) -> list[ConditionLine]:
        """What single commands need of what the machine is doing; not to be met is normal, so each is named by what it asks for."""
        shown = {
            k for k, button in self.buttons.items() if not (button.hidden or button.view.hold or button.view.aside)
        }
        found = (
            line
            for line in self._permissives
            if line[0].situational and not shown.isdisjoint(line[0].commands or shown)
        )
        return self._lines(found, normal=True)

    @cached_property
    def hold_permissives(self) -> list[ConditionLine]:
        """What must be true besides for hold-to-run, missing ones first."""
        return self._lines((line for line in self._permissives if self._only_for_hold(line[0])), normal=True)

    @property
    def met(self) -> int:
        """How many permissives are met."""
        return sum(line.met is True for line in self.permissives)

    @property
    def doubts(self) -> list[str]:
        """In which the device and the plant file do not agree, in words; what is not known is no doubt."""
        look = self.look
        return [
            self.words.told(rating.missing, interlocks.amounts(rating.values, look))
            for rating in self.equipment.equipment.type.ratings
            if interlocks.met(rating, look) is False
        ]

    def effect(self, key: str) -> str:
        """What the command will do now, in words; empty when its type does not say."""
        command = self.equipment.equipment.type.commands.get(key)
        text, numbers = interlocks.effect(command, self.look) if command else ("", {})
        return self.words.told(text, numbers) if text else ""

    @property
    def texts(self) -> dict[str, str]:
        """What the scripts say by themselves."""
        text = self.equipment.text
        return {name: text(f"operate.{name}") for name in ("not_delivered", "cancelled", "discarded", "moving")} | {
            "no_answer": text("fb.lost"),
            "sending": text("fb.requested"),
            "required": text("why.argument_missing", label="{label}"),
        }


def revision_tag(equipment: str) -> str:
    """Name of the tag that counts changes of what commands of a machine look like."""
    return f"sys.commands.{equipment}"
