"""What became of sets of setpoints whose values could not be read: they are read when the device is back, and told. Nothing is written."""

import asyncio
import logging
from collections.abc import Iterable, Sequence
from dataclasses import replace

from app import chance
from app.commands import value_set
from app.commands.command_state import CommandState
from app.commands.interlocks import Prepared
from app.commands.lifecycle import Progress, ProgressState
from app.commands.machine import Machine
from app.commands.value_set import Change, Stands
from app.errors import LinkError, Refused
from app.tags.quality import is_good

log = logging.getLogger(__name__)

SETTLE = 2.0
"""A device that is back has answered with good values for so long before they are believed [s]."""
FOUND_EVERY = 1.0
"""Between two looks at values that could not be read [s]."""
UNREAD = "why.set_unread"
"""End of a set: some values cannot be read."""
FOUND_NEW, FOUND_OLD, FOUND_MIXED = "why.set_found_new", "why.set_found_old", "why.set_found_mixed"
"""What was found of a set whose values could not be read when it ended, or during which the server was killed."""
UNTOLD = frozenset({UNREAD})
"""Ends after which the values are still to be read."""


class SetFollowUp:
    """The sets of all machines of which nobody knows what the device holds."""

    def __init__(self, state: CommandState) -> None:
        self._state = state

    def take_open(self, sets: Iterable[Progress]) -> None:
        """Sets of a former run whose end is not known: told as such, and followed up."""
        for progress in sets:
            machine = self._state.machines.get(progress.equipment)
            if machine is not None:
                self._state.close(machine, replace(progress, ended=self._state.clock.micros()))
                self.begin(progress)

    def begin(self, progress: Progress) -> None:
        """Find out what became of the set that ended as `progress`."""
        self._state.spawn(self._follow(progress.equipment, progress), f"set of {progress.equipment}")

    async def _follow(self, equipment: str, progress: Progress) -> None:
        """Wait until the values of a set that nobody knows can be read, and tell once what stands where. Nothing is written."""
        good_since: float | None = None
        while True:
            machine = self._state.machines.get(equipment)
            parts = _parts(machine, progress)
            if machine is None or parts is None:
                return  # another plant: there is nothing to look at
            now = self._state.clock.monotonic()
            if machine.set is None and await read_now(self._state, machine, list(parts), now - FOUND_EVERY):
                good_since = now if good_since is None else good_since
                if now - good_since >= SETTLE:
                    break
            else:
                good_since = None
            await asyncio.sleep(FOUND_EVERY)
        changes = tuple(
            value_set.judged(change, parts[change.key], value_now(self._state, machine, change.key))
            for change in progress.changes
        )
        stands = {change.stands for change in changes}
        state, reason = ProgressState.UNCONFIRMED, FOUND_MIXED
        if stands == {Stands.NEW}:
            state, reason = ProgressState.CONFIRMED, FOUND_NEW
        elif stands == {Stands.OLD}:
            state, reason = ProgressState.FAILED, FOUND_OLD
        found = replace(
            progress,
            state=state,
            reason=reason,
            params=found_params(changes),
            changes=changes,
            ended=self._state.clock.micros(),
        )
        self._state.close(machine, found)
        self._state.audit_lines.line(
            None, f"{equipment}.{value_set.KEY}", value_set.values_text(changes, old=True), value_set.values_text(changes, old=False),
            found, by=found.person,
        )  # fmt: skip


async def read_now(state: CommandState, machine: Machine, keys: Sequence[str], since: float) -> bool:
    """Have `keys` read now; whether all are good and were read after `since` [s]."""
    try:
        await state.writers[machine.item.link].refresh(machine.item.id, keys)
    except (LinkError, Refused, KeyError) as error:
        log.info("set not read equipment=%s error=%s", machine.item.id, error)
        return False
    return state.readings.read_since(machine, keys, since)


def value_now(state: CommandState, machine: Machine, key: str) -> float | None:
    """The good value of a point; None = it is not known [EU]."""
    value, word = state.readings.look(machine)(key)
    return float(value) if is_good(word) and isinstance(value, int | float) else None


def left_open(
    equipment: str, id: str, person: str, requested: int, changes: Sequence[Change],
    *, key: str = value_set.KEY, label: str = value_set.LABEL,
) -> Progress:  # fmt: skip
    """A set that was being written when the server was killed, as the audit trail has it."""
    return Progress(
        id or chance.token_hex(16), equipment, key, label, person, ProgressState.UNCONFIRMED, requested,
        reason=UNREAD, params={"cause": "why.set_killed", **found_params(changes)},
        old=value_set.values_text(changes, old=True), changes=tuple(changes),
    )  # fmt: skip


def found_params(changes: Sequence[Change]) -> dict[str, object]:
    """What fills a text about where each value stands."""
    return {"values": value_set.found_text(changes)}


def _parts(machine: Machine | None, progress: Progress) -> dict[str, Prepared] | None:
    """The setpoints of a former set on its machine now; None when one is gone."""
    if machine is None or not all(change.key in machine.setpoints for change in progress.changes):
        return None
    return {change.key: machine.setpoints[change.key] for change in progress.changes}
