"""What a command says of itself, in words: how far it is, why it came to another end, what it was given, why it was refused."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from zoneinfo import ZoneInfo

from app.commands.interlocks import RefusalReason
from app.commands.lifecycle import Progress, ProgressState
from app.commands.value_set import Change, named
from app.errors import Refused
from app.plant.definitions import Argument
from app.web import format as fmt
from app.web.points import EquipmentView
from app.web.screens import in_words

MOST_VALUES = 4
"""So many values of a set are named in one line."""


@dataclass(frozen=True, slots=True)
class Story:
    """One line about the latest command, for the message line."""

    id: str
    text: str
    kind: str
    """info, done or error."""
    time: str


class CommandWords:
    """Commands of one machine in the language of its view; times in `zone`. Who is not signed in learns no name."""

    def __init__(self, equipment: EquipmentView, zone: ZoneInfo, *, signed_in: bool) -> None:
        self.equipment = equipment
        self.zone = zone
        self._signed_in = signed_in

    def named(self, display: str) -> str:
        """Somebody's name, for who is signed in; a guest learns only that it is an operator."""
        return display if self._signed_in else self.equipment.text("access.role.operator")

    def time(self, micros: int) -> str:
        """Time of day in the plant's zone, of another day with its date; empty for none."""
        now = self.equipment.runtime.clock.micros()
        return fmt.moment_or_time(micros, self.zone, self.equipment.lang, now) if micros else ""

    def explain_first(self, reasons: Sequence[RefusalReason]) -> str:
        """The first of `reasons` in words, with how many conditions are missing besides."""
        found = list(reasons)
        if not found:
            return ""
        guarding = ("why.condition", "why.condition_unknown")
        first = found[0]
        more = sum(reason.key in guarding for reason in found) - 1
        if first.key == "why.condition" and more > 0:
            return self.text("why.condition_more", {**first.params, "n": more}, first.label)
        return self.text(first.key, first.params, first.label)

    def text(self, key: str, params: Mapping[str, object], label: str = "") -> str:
        """The text `key` with its parameters written for people: numbers, times, labels, causes."""
        filled = self.filled(params, label)
        own = self.equipment.equipment.type.texts.get(self.equipment.lang, {})
        if key in own:
            return own[key]
        told = self.equipment.text(key, **filled).rstrip()
        return self.equipment.t(key) if told == f"[{key}]" else told

    def filled(self, params: Mapping[str, object], label: str = "") -> dict[str, object]:
        """`params` of a reason as they are written in this language."""
        text, lang = self.equipment.text, self.equipment.lang
        result = fmt.parameters(params, lang, text)
        if isinstance(since := params.get("since"), int):
            result["since"] = self.time(since)
        if isinstance(cause := params.get("cause"), str) and cause and "because" not in params:
            result["because"] = self.equipment.text(cause, **result)
        if isinstance(code := params.get("code"), int):
            result["meaning"] = text(fmt.exception_key(code))
        wanted = label or params.get("label")
        result["label"] = self.told(str(wanted), params) if wanted else self.equipment.label
        return result

    def told(self, key: str, numbers: Mapping[str, object]) -> str:
        """The text `key` of the type with the numbers that it names; – for one that is not known."""
        return self.equipment.told(key, numbers)

    def because(self, progress: Progress) -> str:
        """Why a command came to another end than it should; empty when it did not."""
        if not progress.reason:
            return ""
        params = dict(progress.params)
        if progress.changes:
            params["values"] = self.found_text(progress.changes)
            cause = str(params.get("cause", ""))
            deeper = {**progress.params, "cause": params.get("deeper", "")}
            params["because"] = self.text(cause, deeper).rstrip(".") if cause else ""
        return self.text(progress.reason, params)

    def found_text(self, changes: Sequence[Change]) -> str:
        """Which value of a set stands where, in words: F112 10,00 Hz (new), F114 5,0 s (former)."""
        text = self.equipment.text
        said = [f"{self._named(one)} {self.held(one)} ({text(f'set.{one.stands}')})" for one in named(changes)]
        return ", ".join(said) + (f" … ({len(changes)})" if len(said) < len(changes) else "")

    def _named(self, change: Change) -> str:
        return self.equipment.t(change.label) if change.code == change.key else change.code

    def held(self, change: Change) -> str:
        """What the device holds of a value, with its unit; ? when it is not known."""
        if change.found is None:
            return "?"
        unit = fmt.unit_symbol(change.unit, self.equipment.text)
        return fmt.quantity(change.found, change.decimals, unit, self.equipment.lang)

    def refusal(self, error: Refused) -> str:
        """`error` in words; a missing condition by its name, with how many more are missing."""
        missing = error.params.get("missing")
        more = len(missing) - 1 if isinstance(missing, list) else 0
        key = error.reason
        if key == "why.condition" and more > 0:
            return self.text("why.condition_more", {**error.params, "n": more})
        if key == "why.lease_over" and (cause := error.params.get("cause")) not in ("over", "late"):
            return self.text(f"hold.cause.{cause}", error.params)
        text = self.text(key, error.params)
        label = str(error.params.get("label", "")) if "argument" in error.params else ""
        named = self.equipment.t(label) if label else ""
        return text if named in text else f"{named}: {text}"

    def arguments_text(self, progress: Progress) -> str:
        """The arguments of a command in words: Product 5, Head 100.5 mm; what some mean together, by its name."""
        if progress.changes:
            said = [f"{self._named(one)} {self.held(replace(one, found=one.new))}" for one in progress.changes]
            return ", ".join(said[:MOST_VALUES]) + (f" … ({len(said)})" if len(said) > MOST_VALUES else "")
        command = self.equipment.equipment.type.commands.get(progress.command)
        given = progress.arguments
        text, together = in_words(self.equipment, given)
        parts = [text] if text else []
        for argument in command.arguments if command else ():
            if argument.name in given and argument.name not in together:
                value = self._amount(float(given[argument.name]), argument)
                parts.append(f"{self.equipment.t(argument.label)} {value}")
        return ", ".join(parts)

    def _amount(self, value: float, argument: Argument) -> str:
        """An argument with its unit; whole minutes as minutes and hours."""
        lang = self.equipment.lang
        if argument.unit == "s" and 60 <= value < 86400 and value % 60 == 0:
            return fmt.duration(value, lang)
        return fmt.quantity(value, argument.decimals, fmt.unit_symbol(argument.unit, self.equipment.text), lang)

    def tell(self, progress: Progress) -> Story:
        """`progress` in one line: accepted 07:02:08 → confirmed 07:02:11 · Ana Kos."""
        text = self.equipment.text
        steps = []
        if progress.accepted:
            steps.append(f"{text('fb.accepted')} {self.time(progress.accepted)}")
        else:
            steps.append(f"{text('fb.requested')} {self.time(progress.requested)}")
        if progress.over or progress.state is ProgressState.UNKNOWN:
            steps.append(f"{text(progress.text)} {self.time(progress.ended)}".rstrip())
        cut = progress.reason.startswith("hold.cause.") and progress.reason != "hold.cause.released"
        because = self.because(progress) if cut or progress.state is not ProgressState.CONFIRMED else ""
        argument = ""
        if progress.argument is not None:
            command = self.equipment.equipment.type.commands.get(progress.command)
            key = command.argument if command else progress.command
            point = self.equipment.point(key) if self.equipment.has(key) else None
            argument = f" = {point.number(progress.argument)}\u00a0{point.unit}".rstrip() if point else ""
        elif progress.arguments:
            argument = f" ({self.arguments_text(progress)})"
        who = f" · {self.named(progress.person)}" if progress.person else ""
        what = f"{self.equipment.id.upper()} {self.equipment.t(progress.label)}{argument}"
        line = f"{what}: {' → '.join(steps)}{': ' + because if because else ''}{who}"
        kind = "done" if progress.state in (ProgressState.CONFIRMED, ProgressState.DRY_RUN) else "info"
        if progress.state not in (
            ProgressState.CONFIRMED,
            ProgressState.DRY_RUN,
            ProgressState.REQUESTED,
            ProgressState.ACCEPTED,
        ):
            kind = "info" if progress.state is ProgressState.SUPERSEDED else "error"
        elif cut:
            kind = "info"
        return Story(
            f"{progress.id}.{progress.state}.{progress.over}",
            line,
            kind,
            self.time(progress.ended or progress.requested),
        )
