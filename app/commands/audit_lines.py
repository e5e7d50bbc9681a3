"""What the gate writes into the audit trail: one line for every command that is over, and one for every change of control."""

import asyncio
import json
import logging
from collections.abc import Callable, Coroutine, Mapping
from typing import Any

from app.access.roles import Person
from app.commands import value_set
from app.commands.lifecycle import Progress
from app.commands.orders import Audit, AuditLine, Foretell, Order
from app.tags.batch import Value

log = logging.getLogger(__name__)

LONGEST_LINE = 200
Spawn = Callable[[Coroutine[Any, Any, None], str], None]
"""Runs something without waiting for it, under a name."""


class AuditLines:
    """The audit trail of the gate. What goes wrong with it is logged and keeps no command from going on but one that was not sent yet."""

    def __init__(self, audit: Audit, spawn: Spawn, foretell: Foretell) -> None:
        self._audit = audit
        self._spawn = spawn
        self._foretell = foretell

    async def sent(self, order: Order, progress: Progress) -> bool:
        """Have on the disk that `order` is being sent; False: it can be written nowhere."""
        new = (
            value_set.values_text(progress.changes, old=False)
            or arguments_text(progress.arguments)
            or progress.argument
        )
        params: dict[str, Any] = {"id": progress.id, "requested": progress.requested}
        params |= {"why": order.reason} if order.reason else {}
        params |= _what_was_sent(progress)
        try:
            return await self._foretell(
                AuditLine(
                    "command.sent", order.person, f"{order.equipment}.{order.key}", progress.old, new, "sent",
                    params=params, address=order.address,
                )
            )  # fmt: skip
        except Exception:
            log.exception("audit failed object=%s", f"{order.equipment}.{order.key}")
            return False

    def command(self, order: Order, progress: Progress, *, refused: bool = False) -> None:
        """What became of `order`; of a refused one what was typed, of another what was sent."""
        arguments = order.arguments if refused else progress.arguments
        new = (
            value_set.values_text(progress.changes, old=False)
            or arguments_text(arguments)
            or (order.argument if refused else progress.argument)
        )
        self.line(
            order.person, f"{order.equipment}.{order.key}", progress.old, new, progress, order.address, why=order.reason
        )

    def line(
        self,
        person: Person | None,
        what: str,
        old: Value,
        new: Value,
        progress: Progress,
        address: str = "",
        **more: str,
    ) -> None:
        """One line about `what` (`equipment.command`)."""
        params: dict[str, Any] = {f"reason_{key}": value for key, value in progress.params.items()}
        params |= {key: value for key, value in more.items() if value}
        params |= {
            "id": progress.id,
            "requested": progress.requested,
            "accepted": progress.accepted,
            "ended": progress.ended,
        }
        params |= _what_was_sent(progress)
        params |= {"requests": list(progress.requests)} if progress.requests else {}
        self._write(AuditLine("command", person, what, old, new, str(progress.state), progress.reason, params, address))

    def control(self, person: Person | None, equipment: str, what: str, former: str) -> None:
        """Control of a machine was taken, released, handed over, refused or lost."""
        self._write(AuditLine("control", person, equipment, former or None, None, what, f"control.{what}"))

    def _write(self, line: AuditLine) -> None:
        try:
            found = self._audit(line)
            if asyncio.iscoroutine(found):
                self._spawn(found, "audit")
        except Exception:
            log.exception("audit failed object=%s", line.object)


def _what_was_sent(progress: Progress) -> dict[str, Any]:
    """Telegrams and arguments; of a set each value by itself, so that none is cut off: key, former, new, found, where it stands."""
    if progress.changes:
        return {
            f"change_{number}": json.dumps([one.key, one.old, one.new, one.found, one.stands])
            for number, one in enumerate(progress.changes, 1)
        }
    params: dict[str, Any] = {"telegrams": [list(telegram) for telegram in progress.telegrams]}
    params |= {"former": json.dumps(dict(progress.former))} if progress.former else {}
    return params | ({"arguments": dict(progress.arguments)} if progress.arguments else {})


def arguments_text(arguments: Mapping[str, str | float]) -> str:
    """Arguments in one line: `product = 5, head = 100.5`."""
    written = (f"{name} = {value if isinstance(value, str) else f'{value:.10g}'}" for name, value in arguments.items())
    return ", ".join(written)[:LONGEST_LINE]
