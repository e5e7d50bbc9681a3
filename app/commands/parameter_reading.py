"""What a drive holds of the parameters that are being written: read before, read back, and judged."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from app.commands.parameter_change import ParameterChange
from app.commands.value_set import Change, Stands
from app.errors import LinkError, MailboxRefused, Refused
from app.links.mailbox import Missed, Outcome, ParameterAccess
from app.profidrive.parameter_access.error_numbers import key_of, mailbox_key_of, shown
from app.profidrive.parameter_access.messages import Failed, Values

TRIES, PAUSE = 3, 0.25
"""Of a read before its values count as not to be read, and the time between two [s]."""


@dataclass(slots=True)
class Stage:
    """How far a set is."""

    name: str
    """reading, writing, checking, restoring, saving."""
    count: int
    done: int = 0


@dataclass(slots=True)
class Work:
    """One set at work."""

    changes: Sequence[ParameterChange]
    mailbox: ParameterAccess
    sent: list[Sequence[ParameterChange]] = field(default_factory=list)
    """Requests that may have reached the drive."""
    errors: dict[str, int | None] = field(default_factory=dict)
    """Element → error number with which the drive refused it."""


class ParameterReading:
    """Reads what sets of parameters are about, and keeps how far each is."""

    def __init__(self) -> None:
        self.stages: dict[str, Stage] = {}
        """By machine, of those at work."""

    async def former(self, equipment: str, work: Work) -> dict[str, float]:
        """What the drive holds now.

        Raises:
            Refused: it does not tell, or it is not what the person saw.
        """
        found: dict[str, float] = {}
        told = await self.read(equipment, work, work.changes, "reading")
        for one, outcome in zip(work.changes, told, strict=True):
            if not isinstance(outcome, Values):
                key, params = why(one, outcome)
                raise Refused(key, 503 if isinstance(outcome, Missed) else 409, **params)
            found[one.key] = value = one.parameter.in_unit(outcome.values[0])
            if one.seen is not None and value != one.seen:
                unit = one.parameter.unit
                raise Refused(
                    "why.changed", 409, label=one.parameter.text_key, current=value, expected=one.seen, unit=unit
                )
        return found

    async def found(
        self, equipment: str, work: Work, described: Sequence[Change], *, failed: bool = False
    ) -> tuple[Change, ...]:
        """What the drive holds of each element; of one whose request never left it is the former value, read or not."""
        sent = {one.key for request in work.sent for one in request}
        told = await self.read(equipment, work, [one for one in work.changes if one.key in sent], "checking")
        values = dict(zip([one.key for one in work.changes if one.key in sent], told, strict=True))
        found = []
        for one, change in zip(work.changes, described, strict=True):
            if one.key not in sent:
                found.append(replace(change, found=change.old, stands=Stands.OLD))
                continue
            outcome = values[one.key]
            value = one.parameter.in_unit(outcome.values[0]) if isinstance(outcome, Values) else None
            refused = one.key in work.errors
            judged = one.judged(change, value, failed=failed and (refused or not one.acts))
            found.append(replace(judged, error=work.errors.get(one.key)))
        return tuple(found)

    async def read(self, equipment: str, work: Work, wanted: Sequence[ParameterChange], stage: str) -> list[Outcome]:
        """What the drive says of each, asked again while something could not be read."""
        told: dict[str, Outcome] = {}
        left = list(wanted)
        for attempt in range(TRIES):
            if attempt:
                await asyncio.sleep(PAUSE)
            at = self.begin(equipment, stage, len(wanted))
            for object in dict.fromkeys(one.object for one in left):
                group = [one for one in left if one.object == object]
                outcomes = await self.asked(work.mailbox, object, group)
                told |= {one.key: outcome for one, outcome in zip(group, outcomes, strict=True)}
                at.done = sum(not isinstance(outcome, Missed) for outcome in told.values())
            left = [one for one in left if isinstance(told[one.key], Missed)]
            if not left:
                break
        return [told[one.key] for one in wanted]

    @staticmethod
    async def asked(mailbox: ParameterAccess, object: int, group: Sequence[ParameterChange]) -> list[Outcome]:
        try:
            return await mailbox.read(object, [one.address for one in group], [one.parameter.format for one in group])
        except Refused:  # the plant was read anew, and its link may not write any more
            return [Missed(LinkError("commands are switched off"), sent=False)] * len(group)

    def begin(self, equipment: str, name: str, count: int) -> Stage:
        self.stages[equipment] = stage = Stage(name, count)
        return stage


def why(one: ParameterChange, outcome: Outcome) -> tuple[str, dict[str, object]]:
    """Why an element was not read or written, in the drive's own words where it has some."""
    named: dict[str, object] = {"parameter": one.name, "label": one.parameter.text_key}
    if isinstance(outcome, Failed):
        return "why.par_refused", {**named, "cause": key_of(outcome.number), "number": shown(outcome.number)}
    if isinstance(outcome, Missed) and isinstance(outcome.error, MailboxRefused):
        number = f"0x{outcome.error.number:04X}"
        return "why.par_refused", {**named, "cause": mailbox_key_of(outcome.error.number), "number": number}
    if isinstance(outcome, Missed):
        key = "why.par_unknown" if outcome.sent else "why.par_no_answer"
        return key, {**named, "cause": f"link.error.{outcome.error.kind}"}
    return "why.set_not_read", named
