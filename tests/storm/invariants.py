"""What must be true of a house at any moment, whatever people and faults do to it; each is a function that raises `Fell`."""

import asyncio
import json
from collections import Counter, deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf
from typing import Any

from sqlalchemy import select

from app.access.tables import audit_table
from app.alarms.conditions import EVENT_LATE
from app.alarms.lifecycle import TRANSITIONS, Entry
from app.alarms.shelf import unpacked
from app.alarms.tables import journal_table, state_table
from app.commands.control_line import identity
from app.commands.hold import TTL
from app.commands.lifecycle import Progress, ProgressState
from app.commands.open_sets import values_of
from app.commands.parameter_change import KEY as PARAMETERS
from app.commands.set_follow_up import FOUND_MIXED, FOUND_NEW, FOUND_OLD, UNREAD
from app.historian import events
from app.historian import tables as history
from app.historian.recorder import BUFFER_LIMIT
from app.historian.records import source_of
from app.plant.definitions import Alarm, Equipment
from app.plant.expression import Look, Reading, parse
from app.profidrive.scaling import Scaling
from app.profidrive.words import Control, Status
from app.records.fold import number_of
from app.records.record import OPEN, UNKNOWN
from app.registers import plc_map
from app.registers.codec import decoder
from app.sim.bus import Bus
from app.sim.eura_e800.drive import VirtualE800
from app.sim.plc import VirtualPlc
from app.sim.sinamics.drive import VirtualSinamics
from app.tags.quality import NO_DATA, is_bad, is_good
from tests.storm.accounts import accounts
from tests.storm.line import Sent
from tests.storm.world import ADDRESS, AGENT, Fell, World

SLACK = 0.6
"""Sweep and answers on their way [s]."""
HEARD = 3.0
"""A machine that was not heard for longer is sent nothing but a Stop [s]."""
MOST_TASKS = 150
MOST_STORING = 40
WEIGHED = 10.0
"""How often everything that a server keeps in mind is counted [s]."""
MOST_MORE = 3000
"""So many entries more than three times those of the first count: something grows."""
DESCENDED = 300
"""Containers of more things are counted and not looked into."""
STOP_REASONS = {"why.no_such_command", "why.role", "why.signed_out", "why.dry_run"}
"""Why a Stop of somebody who may stop can be refused: only that the machine is gone, or the right."""
SEEN_LAST = 1_000_000
"""A time without a server is told when it is longer [µs]; what was seen before it may hold for a moment."""
UNDER_WAY = 3.0
"""So old is an event at least that has to be stored [s]."""
VirtualDrive = VirtualE800 | VirtualSinamics


@dataclass(frozen=True)
class Shown:
    """What a drive itself had when it answered."""

    at: float
    """[s]"""
    turns: int
    """1 forward, 2 reverse, 0 neither."""
    on: bool
    faulted: bool
    setpoint: float
    """As its registers have it."""


DRIVE_SHOWS: Mapping[str, Callable[[Shown], bool]] = {
    "forward": lambda shown: shown.turns == 1,
    "reverse": lambda shown: shown.turns == 2,
    "stop": lambda shown: not shown.on,
    "quick_stop": lambda shown: not shown.on,
    "coast": lambda shown: not shown.on,
    "reset": lambda shown: not shown.faulted,
}
"""Command of a drive → whether it has done it."""


STOPS = ("stop", "quick_stop", "coast")
"""They are confirmed by what they are about, whatever brought it about."""


def shown_by(device: VirtualDrive, at: float) -> Shown:
    """What `device` has now, `at` [s]."""
    if isinstance(device, VirtualE800):
        status, on = device.status, device.status in (1, 2)
        return Shown(
            at, status if on and device.frequency else 0, on, status not in (0, 1, 2), device.parameter("F113")
        )
    on = bool(device.status & Status.OPERATION_ENABLED)
    turns = (2 if device.machine.control & Control.INVERT else 1) if on else 0
    return Shown(at, turns, on, bool(device.status & Status.FAULT), Scaling(100.0).decode(device._output[1]))


def held_of(device: VirtualDrive, code: str, index: int = 0) -> float | None:
    """The parameter `code` as the drive has it; None when it has none of that name."""
    if isinstance(device, VirtualE800):
        return device.parameter(code) if code.startswith("F") else None
    return device.model.values(code)[index] if code in device.model._parameters else None


class Checker:
    """Called after every step and at the end."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.shown: dict[str, list[Shown]] = {}
        """By drive."""
        world.line.look, world.line.tell = self._look, self._told
        world.on_end.append(self._command_ended)
        self.false: list[str] = []
        self.weighed = 10.0
        self.stood: dict[str, tuple[bool | None, float, tuple[int, int]]] = {}
        """Alarm → what its condition says, since when [s], and to which server and plant."""
        self.used: dict[str, str] = {}
        """One-time number → the order that was sent with it."""
        self.judged = 0
        """Orders that were looked at."""
        self.first: dict[str, int] = {}
        """How many entries there were of anything when it was first counted."""
        self.counted = (0, 0, 0)
        """What there was when it was last counted."""
        self._items: dict[str, Equipment] = {}
        self._limited: tuple[tuple[int, int], dict[str, list[tuple[int, float]]]] | None = None

    async def __call__(self, _world: World, last: bool) -> None:
        self.item("")  # those that are there now may be gone with the next step
        for invariant in ALWAYS:
            invariant(self)
        if last:
            for final in AT_THE_END:
                await final(self)

    def limited(self) -> dict[str, list[tuple[int, float]]]:
        """Machine → handles of its values that get stale, and after which age at the latest [s]."""
        tags = self.world.runtime.tags
        if self._limited is None or self._limited[0] != (id(tags), tags.revision):
            found: dict[str, list[tuple[int, float]]] = {}
            for handle, tag in enumerate(tags.tags):
                if tag.stale_after:
                    found.setdefault(tag.name.partition(".")[0], []).append((handle, tag.stale_after + SLACK))
            self._limited = (id(tags), tags.revision), found
        return self._limited[1]

    def item(self, machine: str) -> Equipment | None:
        """A machine as the plant has it, or had it last: it may have gone with a reload since, or there may be no plant."""
        plant = self.world.runtime.plant
        if plant is not None:
            self._items.update(plant.equipment)
        return self._items.get(machine)

    def stops(self, sent: Sent) -> bool:
        """Whether a command telegram is a Stop."""
        item = self.item(sent.machine)
        return item is None or any(c.stop and c.code == sent.words[0] for c in item.type.commands.values())

    # ---- what is noted meanwhile

    def _look(self, bus: Bus, unit: int) -> tuple[str, Shown] | None:
        """A drive as it is when it answers."""
        device = bus.devices.get(unit)
        if not isinstance(device, VirtualDrive):
            return None
        return self.world.name_of(bus, unit), shown_by(device, self.world.now)

    def _told(self, seen: tuple[str, Shown] | None) -> None:
        """The server has just been told the truth about a drive."""
        if seen is not None:
            shown = self.shown.setdefault(seen[0], [])
            shown.append(seen[1])
            del shown[:-600]

    def _command_ended(self, progress: Progress) -> None:
        if progress.state is not ProgressState.CONFIRMED:
            return
        asked = self.world.asked.get(progress.id)
        device = self.world.devices.get(progress.equipment)
        if asked is None or device is None:
            return
        since, machine, key = asked
        if isinstance(device, VirtualDrive):
            self._confirmed_by_drive(device, since, machine, key, progress)
        elif isinstance(device, VirtualPlc):
            self._confirmed_by_plc(device, since, machine, key, progress)

    def _confirmed_by_drive(
        self, device: VirtualDrive, since: float, machine: str, key: str, progress: Progress
    ) -> None:
        shows = [one for one in self.shown.get(machine, ()) if one.at >= since]
        if key in DRIVE_SHOWS and not any(map(DRIVE_SHOWS[key], shows)):
            self.false.append(f"{machine}.{key} {progress.id}: the drive never showed it, {shows[-3:]}")
        before = [one for one in self.shown.get(machine, ()) if one.at < since][-1:]
        turned = any(not DRIVE_SHOWS[key](one) for one in before + shows) if key in DRIVE_SHOWS else True
        item = self.item(machine)
        command = item.type.commands.get(key) if item else None
        needless = command is not None and all(one.when for one in command.writes)
        taken = any(one.at >= since and one.machine == machine for one in self.world.line.taken)
        if not (turned or taken or needless or key in STOPS):
            self.false.append(f"{machine}.{key} {progress.id}: it was so before, and no telegram reached the drive")
        forgets = isinstance(device, VirtualSinamics) and self.world.powered.get(machine, 0.0) >= since
        if key in ("setpoints", PARAMETERS) and not forgets:
            held = {one.key: held_of(device, *_named(one.code)) for one in progress.changes}
            self._all_new(
                {one.key: one.new if (has := held[one.key]) is None else has for one in progress.changes}, progress
            )
        if key in ("set_frequency", "frequency_setpoint", "set_setpoint", "setpoint") and progress.argument is not None:
            wanted = progress.argument
            if not any(abs(one.setpoint - wanted) < 0.01 for one in shows):
                self.false.append(f"{machine}.{key} {progress.id}: its setpoint was never {wanted}, {shows[-3:]}")
        elif progress.argument is not None and not forgets:
            item = self.item(machine)
            setpoint = item.type.setpoints.get(key) if item else None
            present = held_of(device, *_named(setpoint.code)) if setpoint else None
            if present is not None and abs(present - progress.argument) > 0.06:
                self.false.append(f"{machine}.{key} {progress.id}: {present}, not {progress.argument}")

    def _all_new(self, held: Mapping[str, float], progress: Progress) -> None:
        """A set that is told as confirmed is there as a whole."""
        for change in progress.changes:
            if abs(held[change.key] - change.new) > 1e-3 + 1e-5 * abs(change.new):
                self.false.append(
                    f"{progress.equipment}.{change.key} {progress.id}: {held[change.key]}, not {change.new}"
                )

    def _confirmed_by_plc(self, device: VirtualPlc, since: float, machine: str, key: str, progress: Progress) -> None:
        item = self.item(machine)
        if item is None:
            self.false.append(f"{machine}.{key} {progress.id}: there never was such a machine")
            return
        command = item.type.commands.get(key)
        if command is None and progress.argument is not None and key in device.settings:
            if abs(device.settings[key] - progress.argument) > 1e-3 + 1e-5 * abs(progress.argument):
                self.false.append(f"{machine}.{key} {progress.id}: {device.settings[key]}, not {progress.argument}")
        elif key == "setpoints" and progress.state is ProgressState.CONFIRMED:
            self._all_new(device.settings, progress)
        elif command is not None and command.code and not command.stop:
            mine = [one for one in self.world.done if one.machine == machine and one.at >= since]
            if not any(one.taken for one in mine if one.code == command.code):
                self.false.append(f"{machine}.{key} {progress.id}: the PLC never took code {command.code}, {mine}")


def _named(code: str) -> tuple[str, int]:
    """p0791[1] → p0791, 1."""
    name, _, index = code.partition("[")
    return name, int(index[:-1] or 0) if index else 0


# ---- after every step ----------------------------------------------------------------------------------


def no_false_confirmation(c: Checker) -> None:
    """A command is told as confirmed only when the device itself did it."""
    if c.false:
        raise Fell("no_false_confirmation", "; ".join(c.false))


def nothing_twice(c: Checker) -> None:
    """What was asked for is done at most as often as it was asked, and sent no more often; only Stop is ever repeated."""
    world = c.world
    marks = len(world.done), len(world.line.sent), world.lives
    if marks == c.counted:
        return
    c.counted = marks
    asked = Counter((machine, key) for _, machine, key in world.asked.values())
    for id, keys in world.sets.items():  # each value once, and the former one when the set is put back
        asked.update({(world.asked[id][1], key): 2 for key in keys})
    for one in accounts(world):
        most = sum(times * asked[one.machine, key] for key, times in one.keys.items())
        if one.count > most:
            raise Fell("nothing_twice", f"{one.machine} {one.what} {one.count} times, asked {most} of {dict(one.keys)}")
    ids = Counter(
        (one.machine, one.life, one.words[-1])
        for one in world.line.sent
        if one.address == plc_map.COMMAND and one.function != 6
    )
    for one in world.line.sent:
        if one.address == plc_map.COMMAND and ids[one.machine, one.life, one.words[-1]] > 1 and not c.stops(one):
            raise Fell("nothing_twice", f"{one.machine}: command {one.words[-1]} was sent twice, {one}")


def good_is_fresh(c: Checker) -> None:
    """No value is good that its device has not told within the time after which it is stale."""
    world = c.world
    if world.down or world.runtime.plant is None:
        return
    tags, now = world.runtime.tags, world.now
    for item, limited in c.limited().items():
        found = world.bus_of(item)
        if found is None:
            continue
        silent = min(now - world.line.heard[id(found[0]), found[1]], 1e6)
        for handle, limit in limited:
            if not is_good(tags.quality(handle)):
                continue
            if silent > limit:
                raise Fell(
                    "good_is_fresh", f"{tags.tags[handle].name} is good, its unit told nothing for {silent:.1f} s"
                )
            if tags.age(handle) > limit:
                raise Fell("good_is_fresh", f"{tags.tags[handle].name} is good and {tags.age(handle):.1f} s old")


def control_is_lived(c: Checker) -> None:
    """Who holds a machine, waits for it, or moves it by hand, has a living session with the right to; everybody waits once."""
    world = c.world
    if world.down or world.runtime.gate is None:
        return
    gate, standing = world.runtime.gate, world.runtime.access.current
    for equipment, tenure in gate.control._tenures.items():
        person = standing(tenure.who)
        if person is None or not person.may("view"):
            raise Fell("control_is_lived", f"{equipment} is held by {tenure.holder.display}, whose session is over")
        if not person.may("operate") and not person.idle:
            raise Fell("control_is_lived", f"{equipment} is held by {tenure.holder.display}, who may not operate")
        for place in tenure.line.places:
            person = standing(place.who)
            if person is None or not (person.may("operate") or person.idle):
                raise Fell("control_is_lived", f"{equipment} is waited for by {place.display}, who may not")
            if place.session == tenure.holder.session:
                raise Fell("control_is_lived", f"{equipment} is waited for by {place.display}, who holds it")
        waiting = [identity(place.who) for place in tenure.line.places]
        if len(waiting) != len(set(waiting)):
            raise Fell("control_is_lived", f"somebody waits twice for {equipment}: {waiting}")
    for lease in gate.hold._leases.values():
        if not lease.moving:
            continue
        person = standing(lease.person)
        if person is None or not person.may("operate"):
            raise Fell("control_is_lived", f"{lease.equipment} is moved by {lease.person.name}, who may not")
        holder = gate.control.holder(lease.equipment)
        if holder is None or holder.session != lease.person.session:
            raise Fell("control_is_lived", f"{lease.equipment} is moved by {lease.person.name}, who does not hold it")


def what_was_taken_away_is_gone(c: Checker) -> None:
    """Nobody holds a machine, waits for it, or moves it by hand, whose session was ended or whose right was taken, by what the world was
    told of it."""
    world = c.world
    if world.down or world.runtime.gate is None:
        return
    gate, rights, late = world.runtime.gate, world.rights, world.now - SLACK
    at_it = [(id, tenure.who) for id, tenure in gate.control._tenures.items()]
    at_it += [(id, place.who) for id in gate.control._tenures for place in gate.control.line(id)]
    at_it += [(lease.equipment, lease.person) for lease in gate.hold._leases.values() if lease.moving]
    for equipment, person in at_it:
        over = rights.over.get(person.session)
        if over is not None and over.since < late:
            raise Fell(
                "what_was_taken_away_is_gone", f"{equipment}: {person.name}, whose session ended at {over.since}"
            )
        if (since := rights.without(person.name, "operate")) < late:
            raise Fell("what_was_taken_away_is_gone", f"{equipment}: {person.name}, who may not operate since {since}")


def held_is_held(c: Checker) -> None:
    """A machine is moved by a button only while word of that button keeps coming, and not after it was let go."""
    world = c.world
    if world.down or world.runtime.gate is None:
        return
    for lease in world.runtime.gate.hold._leases.values():
        if not lease.moving:
            continue
        last, let_go = world.kept.get(lease.token, -inf), world.let_go.get(lease.token, inf)
        if world.now - last > TTL + SLACK or world.now - let_go > SLACK:
            raise Fell("held_is_held", f"{lease.equipment}: last word at {last}, let go at {let_go}, it moves")


def orders_are_of_who_may(c: Checker) -> None:
    """What is being sent was asked by whoever holds the machine and has the right to, while it was heard, judged by values that are good,
    and its conditions were met."""
    world, orders = c.world, c.world.begun
    for one in orders[c.judged :]:
        what = f"{one.machine}.{one.key} {one.id} of {one.who} at {one.at}"
        if one.session != one.holder:
            raise Fell("orders_are_of_who_may", f"{what}: {one.holder or 'nobody'} holds the machine")
        program = one.who.startswith("token:")
        if (asker := world.askers.get(one.id, one.who)) != one.who and not program:
            raise Fell("orders_are_of_who_may", f"{what} was given by {asker}")
        if (since := world.rights.without(one.who, "operate")) < one.at - SLACK:
            raise Fell("orders_are_of_who_may", f"{what}, who may not since {since}")
        if (over := world.rights.over.get(one.session)) is not None and over.since < one.at - SLACK:
            raise Fell("orders_are_of_who_may", f"{what}, whose session ended at {over.since}")
        if one.silent > HEARD:
            raise Fell("orders_are_of_who_may", f"{what}: the machine is silent for {one.silent:.1f} s")
        if one.poor or one.unmet:
            raise Fell("orders_are_of_who_may", f"{what}: not good {one.poor}, not met {one.unmet}")
        nonce = world.nonces.get(one.id, one.id)
        if (first := c.used.setdefault(nonce, one.id)) != one.id:
            raise Fell("orders_are_of_who_may", f"{what} came with the nonce of {first}")
    c.judged = len(orders)


def nothing_dies(c: Checker) -> None:
    """Every task of the supervisor runs and never failed; nothing inside raised what nobody expected."""
    world = c.world
    if world.errors:
        raise Fell("nothing_dies", " | ".join(world.errors[:3]))
    if world.down:
        return
    for kept in world.runtime.supervisor.tasks.values():
        if kept.failures or kept.task is None or kept.task.done():
            raise Fell("nothing_dies", f"task {kept.name}: {kept.error or 'over'}")


def nothing_grows(c: Checker) -> None:
    """Tasks, waiting lines, subscriptions and memories of a server stay few, and level off."""
    world = c.world
    if world.down:
        return
    tasks = [task for task in asyncio.all_tasks() if task not in world.tasks]
    if len(tasks) > MOST_TASKS:
        raise Fell("nothing_grows", f"{len(tasks)} tasks: {Counter(task.get_name().split('-')[0] for task in tasks)}")
    if len(world.runtime.ring_events.storing) > MOST_STORING:
        raise Fell("nothing_grows", f"{len(world.runtime.ring_events.storing)} deliveries of events wait")
    if world.now - c.weighed >= WEIGHED:
        c.weighed = world.now
        for name, size in sizes(world.runtime).items():
            if name == "Recorder._rows" and world.runtime.recorder.full and size <= BUFFER_LIMIT:
                continue  # they wait for a disk that takes nothing, or was asked last when it did not
            if size > 3 * c.first.setdefault(name, size) + MOST_MORE:
                raise Fell("nothing_grows", f"{name} has {size} entries, first {c.first[name]}")


def sizes(root: object) -> dict[str, int]:
    """How many entries all containers have that the server keeps in mind, by class and name of the attribute; definitions left out."""
    found: Counter[str] = Counter()
    seen: set[int] = set()
    todo: list[object] = [root]
    while todo:
        one = todo.pop()
        kind = type(one)
        if id(one) in seen or not kind.__module__.startswith("app.") or kind.__module__.startswith("app.plant."):
            continue
        seen.add(id(one))
        names = [*getattr(one, "__dict__", ()), *(n for base in kind.__mro__ for n in getattr(base, "__slots__", ()))]
        for name in names:
            value = getattr(one, name, None)
            if isinstance(value, dict | list | set | deque):
                found[f"{kind.__name__}.{name}"] += len(value)
                inside = list(value.values() if isinstance(value, dict) else value)
                todo += inside if len(inside) <= DESCENDED else []
            else:
                todo.append(value)
    return found


def alarms_tell_what_is(c: Checker) -> None:
    """When all is calm: an alarm stands when what it is about has been so for its delay, and does not when that has been over for it."""
    world = c.world
    if world.down or world.now < world.calm:
        return
    tags, clock = world.runtime.tags, world.now
    here = {watch.id: watch for watch in world.runtime.alarms._index if watch.equipment}
    heard = {one.machine: one.at for one in world.heard}
    server = world.lives, tags.revision
    for id, watch in here.items():

        def look(key: str, machine: str = watch.equipment) -> Reading:
            handle = tags.handles.get(f"{machine}.{key}")
            return (None, NO_DATA) if handle is None else (tags.value(handle), tags.quality(handle))

        is_so, since, at = c.stood.get(id, (None, clock, server))
        now = says(watch.alarm, look)
        if now is not is_so or at != server:
            since = clock
        c.stood[id] = now, since, server
        alarm = watch.alarm
        delay = (alarm.on_delay if now else alarm.off_delay) + SETTLES
        if alarm.event:  # which may come after the value that it explains, and stands for a while without it
            delay += EVENT_LATE
            since = max(since, heard.get(watch.equipment, 0.0))
        if now is not None and watch.life.active is not now and clock - since > delay:
            raise Fell(
                "alarms_tell_what_is",
                f"{id} stands: {watch.life.active}, {alarm.expression} is so: {now} since {since}",
            )


def says(alarm: Alarm, look: Look) -> bool | None:
    """Whether what an alarm is about is so; None: nobody can say, or it lies in a dead-band, or an event alone says it."""
    if alarm.kind == "expression":
        over = parse(alarm.clear).true(look) if alarm.clear else None
        begun = parse(alarm.expression).true(look) if alarm.expression else None
        return False if over else begun if begun or not alarm.clear else None
    value, quality = look(alarm.value)
    if alarm.kind == "bad_quality":
        return is_bad(quality) or value is None
    if is_bad(quality) or not isinstance(value, int | float) or alarm.limit is None:
        return None
    match alarm.kind:
        case "high":
            return True if value >= alarm.limit else False if value < alarm.limit - alarm.dead_band else None
        case "low":
            return True if value <= alarm.limit else False if value > alarm.limit + alarm.dead_band else None
    return None


def stop_is_open(c: Checker) -> None:
    """A Stop of somebody who may stop is refused only because there is no such machine any more."""
    for machine, reason, status in c.world.refused_stops:
        if reason not in STOP_REASONS:
            raise Fell("stop_is_open", f"Stop of {machine} was refused: {status} {reason}")


# ---- when all is calm again ----------------------------------------------------------------------------


async def all_is_well_again(c: Checker) -> None:
    """Without faults every link is up and every value that is scanned is good."""
    world = c.world
    runtime = world.runtime
    for name, link in runtime.links.items():
        if not link.up:
            raise Fell("all_is_well_again", f"link {name} is {link.statistics.state}")
    bad = [
        f"{tag.name} ({runtime.tags.age(handle):.1f} s, quality {runtime.tags.quality(handle):#x})"
        for handle, tag in enumerate(runtime.tags.tags)
        if tag.stale_after and tag.source.startswith("link.") and runtime.tags.age(handle) > tag.stale_after + SLACK
    ]
    if bad:
        raise Fell("all_is_well_again", f"not read again: {', '.join(bad[:5])} and {len(bad)} in all")
    if not runtime.access.audit.healthy:
        raise Fell("all_is_well_again", "lines of the audit still wait outside the database")


async def ended_sessions_are_over(c: Checker) -> None:
    """Nobody comes in with a session that was ended, also after a restart or when an account that was barred is let in again."""
    for one in c.world.rights.over.values():
        if await c.world.runtime.access.sessions.find(one.sid, ADDRESS, AGENT) is not None:
            raise Fell("ended_sessions_are_over", f"a session of {one.who} that ended at {one.since} is one")


async def audit_is_whole(c: Checker) -> None:
    """The chain verifies, and every command that ended has exactly one line that says how; of a set whose values could not be read then,
    one more at most, when they were found."""
    world = c.world
    if world.down:
        return
    verdict = await world.runtime.access.audit.check()
    if not verdict.ok:
        raise Fell("audit_is_whole", f"{verdict}")
    rows = await world.runtime.db.read(
        lambda connection: connection.execute(
            select(audit_table.c.params, audit_table.c.result, audit_table.c.reason).where(
                audit_table.c.kind == "command"
            )
        ).all()
    )
    ends: Counter[str] = Counter()
    reasons: dict[str, str] = {}
    for row in rows:
        id = json.loads(row.params).get("id", "")
        if row.result != "sent":
            ends[id] += not (row.reason in (FOUND_NEW, FOUND_OLD, FOUND_MIXED) and reasons.get(id) == UNREAD)
            reasons[id] = row.reason
        world.trace(f"audit {id} {row.result}")
    for id, count in ends.items():
        if count > 1 and world.asked.get(id, (0, "", ""))[2] != "stop":
            raise Fell("audit_is_whole", f"{world.asked.get(id, id)} has {count} lines that say how it ended")
    sent = {json.loads(row.params).get("id", "") for row in rows if row.result == "sent"}
    atwork = (
        {one.progress.id for m in world.runtime.gate._state.machines.values() for one in (m.job, m.set) if one}
        if world.runtime.gate
        else set()
    )
    for id in sent - set(ends) - atwork:
        raise Fell("audit_is_whole", f"{world.asked.get(id, id)} was sent, and no line says how it ended")
    for at, progress in world.ended:
        if at > world.troubled and not ends[progress.id]:
            raise Fell("audit_is_whole", f"{progress.id} {progress.command} ended as {progress.state} without a line")


async def what_was_done_was_foretold(c: Checker) -> None:
    """What a device took was in the audit before it was sent, also of servers that were killed."""
    world = c.world
    if world.down:
        return
    rows = await world.runtime.db.read(
        lambda connection: connection.execute(
            select(audit_table.c.object, audit_table.c.params).where(audit_table.c.kind == "command.sent")
        ).all()
    )  # fmt: skip
    lines = Counter(row.object for row in rows)
    for row in rows:
        machine, _, key = row.object.partition(".")
        if key == "setpoints":
            lines.update({f"{machine}.{one[0]}": 2 for one in values_of(json.loads(row.params))})
    for one in accounts(world):
        most = sum(times * lines[f"{one.machine}.{key}"] for key, times in one.keys.items())
        if one.count > most:
            raise Fell("foretold", f"{one.machine} {one.what} {one.count} times, {most} lines say so")


ENTRIES: dict[str, set[tuple[str, str]]] = {}
for _row in TRANSITIONS:
    for _letter in _row.states:
        _after = set("ABCDEFGHI") if _row.to == "*" else {_letter if _row.to == "=" else _row.to}
        ENTRIES.setdefault(str(_row.entry), set()).update((_letter, one) for one in _after)


async def alarms_follow_the_table(c: Checker) -> None:
    """Every line of the journal is a row of the table, each begins where the one before of its alarm ended, and the states are the last."""
    runtime = c.world.runtime
    await runtime.alarms.journal.flush()
    columns = journal_table.c
    rows = await runtime.db.read(
        lambda connection: connection.execute(
            select(
                columns.alarm,
                columns.before,
                columns.after,
                columns.event,
                columns.seq,
                columns.occurrence,
                columns.person,
            ).order_by(columns.seq)
        ).all()
    )
    stands: dict[str, str] = {}
    for row in rows:
        c.world.trace(f"journal {row.seq} {row.alarm} {row.before}{row.after} {row.event}")
        if row.event not in ENTRIES and row.event not in set(Entry):
            continue
        if row.event in ENTRIES and (row.before, row.after) not in ENTRIES[row.event]:
            raise Fell("alarms_follow_the_table", f"{row.alarm}: {row.event} from {row.before} to {row.after}")
        if stands.get(row.alarm, "A") != row.before:
            raise Fell(
                "alarms_follow_the_table",
                f"{row.alarm}: {row.event} from {row.before}, it was {stands.get(row.alarm, 'A')}",
            )
        stands[row.alarm] = row.after
    written = Counter((row.alarm, row.event) for row in rows)
    if lost := c.world.hidden - written:
        raise Fell("alarms_follow_the_table", f"not in the journal though somebody was told so: {dict(lost)}")
    by = Counter(row.occurrence for row in rows if row.event == Entry.ACK and row.person)
    if lost := c.world.acknowledged - by:
        raise Fell("alarms_follow_the_table", f"nobody acknowledged it, though somebody was told so: {dict(lost)}")
    states = await runtime.db.read(
        lambda connection: connection.execute(select(state_table.c.alarm, state_table.c.hiding)).all()
    )
    for alarm, hiding in states:
        shelf, service = unpacked(hiding)
        watch = runtime.alarms._index.get(alarm)
        if watch is not None and (watch.shelf, watch.service) != (shelf, service):
            raise Fell(
                "alarms_follow_the_table", f"{alarm} is hidden by {watch.shelf} and {watch.service}, kept: {hiding}"
            )
        if shelf is not None and shelf.until < c.world.clock.micros() - UNDER_WAY * 1e6:
            raise Fell("alarms_follow_the_table", f"{alarm} is still shelved after its time: {hiding}")
    kept = [alarm for alarm, _ in states]
    left = {alarm for alarm, state in stands.items() if state != "A"}
    if left != set(kept):
        raise Fell("alarms_follow_the_table", f"states {sorted(set(kept) ^ left)} are not those of the journal")


async def events_are_stored(c: Checker) -> None:
    """Each event of a ring is stored once or told as a gap, counted against the list of the device; none that it never told is stored."""
    world = c.world
    runtime = world.runtime
    rows = await runtime.history.read(lambda connection: connection.execute(STORED).all())
    holes = await runtime.history.read(lambda connection: connection.execute(select(history.event_gap)).all())
    for row in (*rows, *holes):
        world.trace(f"event {tuple(row)}")
    stored = Counter((row.name, row.sequence, row.code) for row in rows)
    missing = {(row.equipment, row.sequence - n) for row in holes for n in range(1, row.count + 1)}
    told = Counter((one.machine, one.sequence, one.code) for one in world.told)
    for key, count in stored.items():
        if count > told[key]:
            raise Fell("events_are_stored", f"{key} is stored {count} times, told {told[key]} times")
    for item in runtime.plant.equipment.values() if runtime.plant else ():
        mine = [one for one in world.told if one.machine == item.id and one.at < world.now - UNDER_WAY]
        if item.id in world.removed or not mine:
            continue
        for one in mine:
            if not stored[one.machine, one.sequence, one.code] and (one.machine, one.sequence) not in missing:
                raise Fell("events_are_stored", f"{one} is neither stored nor told as a gap")


async def events_have_their_time(c: Checker) -> None:
    """Each event is told for the time at which it happened, by a wall clock that stood between then and when it was read.

    The clock of a PLC counts its scans: what is read after a standstill seems to be later by that at most.
    """
    world = c.world
    happened: dict[tuple[str, int, int], list[float]] = {}
    for one in world.told:
        happened.setdefault((one.machine, one.sequence, one.code), []).append(one.at)
    until = [begin for begin, _ in world.walls[1:]] + [inf]
    for heard in world.heard:
        off = []
        for at in happened.get((heard.machine, heard.sequence, heard.code), ()):
            stood = sum(
                max(0.0, min(end, heard.at) - max(begin, at))
                for (name, begin), end in world.frozen.items()
                if name == heard.machine
            )
            for (begin, ahead), end in zip(world.walls, until, strict=True):
                if at <= heard.at and begin <= heard.at and end >= at - MEASURED:
                    late = (heard.time - ahead) / 1e6 - at
                    off.append(max(0.0, late - stood, -late))
        if min(off, default=inf) > MISTIMED:
            raise Fell("events_have_their_time", f"{heard} is off by {min(off, default=inf):.3f} s at least")
    stored = await world.runtime.history.read(lambda connection: connection.execute(TIMED).all())
    known = {(heard.machine, heard.sequence, heard.code, heard.time) for heard in world.heard}
    for row in stored:
        if tuple(row) not in known:
            raise Fell("events_have_their_time", f"{tuple(row)} is stored and was never read so")


async def records_are_of_events(c: Checker) -> None:
    """Every record begins with an event that is stored, and one that is over ends with one, or after the time that its kind lasts."""
    runtime, row_of, of = c.world.runtime, history.event.c, history.record_event.c
    kinds = {kind.name: kind for item in c._items.values() for kind in item.type.records.values()}
    rows = await runtime.history.read(lambda connection: connection.execute(select(history.record)).all())
    parts = await runtime.history.read(
        lambda connection: connection.execute(
            select(of.record, of.event, row_of.machine, row_of.boot, row_of.sequence, row_of.time, row_of.code).join(
                history.event, row_of.id == of.event
            )
        ).all()
    )
    placed = {part.event for part in parts}
    mine: dict[int, list[Any]] = {}
    for part in parts:
        mine.setdefault(part.record, []).append(part)
    seen: Counter[tuple[object, ...]] = Counter()  # a machine that is built anew counts its starts from 1 again
    for row in rows:
        c.world.trace(f"record {row.id} {row.kind} {row.number} {row.outcome}")
        those, what = mine.get(row.id, []), f"{row.kind} {row.number} of {row.machine} ({row.outcome})"
        seen[row.machine, row.kind, row.number, row.boot, row.sequence, row.begun] += 1
        if any(one.machine != row.machine for one in those):
            raise Fell("records_are_of_events", f"{what} has events of another machine")
        first = (row.boot, row.sequence, row.entry, row.begun)
        if row.entry and first not in {(one.boot, one.sequence, one.code, one.time) for one in those}:
            raise Fell("records_are_of_events", f"{what} began with {first}, which is no event of it")
        if row.outcome in (OPEN, UNKNOWN) or kinds[row.kind].lasts:
            continue
        codes = {code for end in kinds[row.kind].ends for code in end.when.codes}
        ends = {max(row.begun, one.time) for one in those if one.code in codes}
        if row.ended not in ends:
            raise Fell("records_are_of_events", f"{what} ended at {row.ended}, its events say {sorted(ends)}")
    told = await runtime.history.read(lambda connection: connection.execute(events.told()).all())
    for event in map(events.event_of, told):
        item = c.item(event.equipment)
        source = source_of(item) if item is not None and event.equipment not in c.world.removed else None
        for kind in source.kinds.values() if source else ():
            begins = event.code in kind.begin and number_of(kind, source.reading(event)) is not None
            if begins and event.id not in placed:
                raise Fell("records_are_of_events", f"{event} begins a {kind.name}, and is of none")
    if twice := [key for key, count in seen.items() if count > 1]:
        raise Fell("records_are_of_events", f"there twice: {twice}")


async def nothing_good_while_nobody_looked(c: Checker) -> None:
    """Of a time in which the server was down or stood still the history has no good value."""
    runtime, columns = c.world.runtime, history.sample.c
    names = {
        row.id: row.name
        for row in await runtime.history.read(lambda connection: connection.execute(select(history.point)).all())
    }
    for begin, end in c.world.silences:
        if end - begin < SEEN_LAST:
            continue
        moment = end - SEEN_LAST // 10
        rows = await runtime.history.read(
            lambda connection, until=moment: connection.execute(  # type: ignore[misc]
                select(columns.point, columns.t, columns.q).where(columns.t <= until).order_by(columns.point, columns.t)
            ).all()
        )
        last = {number: (since, quality) for number, since, quality in rows}
        for number, (since, quality) in last.items():
            if is_good(quality):
                raise Fell(
                    "nothing_good_while_nobody_looked",
                    f"{names[number]} is good at {moment}, since {since}: nobody looked from {begin} to {end}",
                )


async def what_is_shown_is_kept(c: Checker) -> None:
    """What the history has last of every point is what is shown of it: the same quality, and no further from it than its dead-band.

    Two histories overlap where the clock was set back; which of them is which nobody can tell before that time is over.
    """
    runtime, columns = c.world.runtime, history.sample.c
    if c.world.down or runtime.plant is None:
        return
    for _ in c.world.lived:
        if until := c.world.lived_twice_until:
            await asyncio.sleep((until - runtime.clock.micros()) / 1e6 + 2.0)
    with c.world.standstill():
        await asyncio.sleep(STANDSTILL)
        await runtime.recorder.flush()
        tags = runtime.tags
        shown = {tag.id: tags.read(handle) for handle, tag in enumerate(tags.tags)}
    rows = await runtime.history.read(
        lambda connection: connection.execute(
            select(history.point.c.lasting_id, columns.v, columns.s, columns.q)
            .join(history.point, history.point.c.id == columns.point)
            .where(columns.t <= runtime.clock.micros())
            .order_by(columns.point, columns.t)
        ).all()
    )
    last = {id: (quality, value if text is None else text) for id, value, text, quality in rows}
    for point in runtime.points.values():
        if not point.history or point.name.startswith("sys.") or not (now := shown[point.id]).time:
            continue
        quality, value = last.get(point.id, (None, None))
        near = (
            abs(value - now.value) <= point.dead_band * 1.001 + 1e-6
            if isinstance(value, int | float) and isinstance(now.value, int | float)
            else value == now.value or is_bad(now.quality)
        )
        if quality is None or (quality & 0xFF) != (now.quality & 0xFF) or not near:
            raise Fell("what_is_shown_is_kept", f"{point.name}: the history has {value!r} {quality}, shown is {now}")


async def what_is_shown_is_so(c: Checker) -> None:
    """While machines stand still, every good value that was read meanwhile is the one in the registers of its machine."""
    world = c.world
    runtime, devices, since = world.runtime, world.devices, world.now
    if world.down or runtime.plant is None:
        return
    with world.standstill():
        await asyncio.sleep(STANDSTILL)
        tags, compared = runtime.tags, Counter[str]()
        for item in runtime.plant.equipment.values():
            for point in item.points.values() if item.id in devices else ():
                handle, register = tags.handles.get(point.name), point.register
                if handle is None or register is None or not register.readable or not is_good(tags.quality(handle)):
                    continue
                shown = tags.value(handle)
                if tags.age(handle) >= world.now - since - LATEST or (point.table and not shown):
                    continue
                function = 4 if register.table == "input" else 3
                held = decoder(register)(devices[item.id].read(function, register.address, register.words))
                compared[item.id] += 1
                alike = (
                    shown == held
                    if isinstance(shown, str | None) or isinstance(held, str | None)
                    else (abs(shown - held) <= 1e-6 * (1 + abs(held)))
                )
                if not alike:
                    raise Fell("what_is_shown_is_so", f"{point.name} is shown as {shown!r}, its machine has {held!r}")
        if min((compared[id] for id in runtime.plant.equipment if id in devices), default=1) == 0:
            raise Fell(
                "what_is_shown_is_so", f"a machine of which nothing was read in {STANDSTILL} s: {dict(compared)}"
            )


SETTLES = 3.0
"""So long after its delay an alarm has come or gone: values are read in turn, and conditions looked at in turn [s]."""
STANDSTILL = 0.9
"""A PLC whose program stands still for longer is told as such [s]."""
LATEST = 0.2
"""A telegram that was on its way when the machines stopped is answered by then [s]."""
STORED = select(history.event_machine.c.name, history.event.c.sequence, history.event.c.code).join(
    history.event, history.event.c.machine == history.event_machine.c.id
)
TIMED = STORED.add_columns(history.event.c.time)
MEASURED = 3.0
"""A header is at most so old when the time of an event is reckoned with it [s]."""
MISTIMED = 0.6
"""Half of what the slowest header takes, and what a clock may drift before it is measured anew [s]."""


ALWAYS: tuple[Callable[[Checker], None], ...] = (
    no_false_confirmation,
    nothing_twice,
    good_is_fresh,
    control_is_lived,
    what_was_taken_away_is_gone,
    held_is_held,
    orders_are_of_who_may,
    nothing_dies,
    nothing_grows,
    alarms_tell_what_is,
    stop_is_open,
)
AT_THE_END = (
    all_is_well_again, what_is_shown_is_so, what_is_shown_is_kept, ended_sessions_are_over,
    audit_is_whole, what_was_done_was_foretold, alarms_follow_the_table, events_are_stored,
    events_have_their_time, records_are_of_events, nothing_good_while_nobody_looked,
)  # fmt: skip
