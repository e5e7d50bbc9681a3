"""The plant files beside the plant that runs: what would change, and taking it."""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

from app.access.audit.audit import Audit
from app.access.roles import Person
from app.commands.interlocks import met, stopped
from app.errors import UnusableFile
from app.files import exchange_file, may_exchange, read_bytes
from app.links import forecast
from app.plant.changes import Change, compare, digest
from app.plant.definitions import Plant
from app.plant.problems import Problem
from app.plant.sequences import RUNNING
from app.plant.toml import LARGEST_FILE
from app.sim.plant import read_simulated
from app.tags.batch import Value
from app.tags.database import TagDatabase
from app.tags.quality import NO_DATA

log = logging.getLogger(__name__)

NO_DRAFTS: Mapping[str, str] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Reading:
    """The plant files as they are now, beside the plant that runs."""

    problems: tuple[Problem, ...] = ()
    """What is wrong with them; then the running plant stays."""
    changes: tuple[Change, ...] = ()
    digest: str = ""
    """Of the changes: what is given back to confirm them."""
    first: bool = False
    """Nothing runs yet: the plant starts."""
    done: bool = False
    """They were taken."""
    refused: str = ""
    """Text key of why they were not: `plant.refused.…`."""
    error: str = ""
    """What did not take them, for people who configure."""
    doubts: tuple[Problem, ...] = ()
    """What is no mistake in them and seldom meant; it holds nothing up."""


class PlantFiles:
    """Reads `folder` anew; `running` is the plant that runs, `take` exchanges it."""

    def __init__(
        self,
        folder: Path,
        tags: TagDatabase,
        audit: Callable[[], Audit],
        *,
        running: Callable[[], Plant | None],
        take: Callable[[Plant, Person | None], Awaitable[None]],
    ) -> None:
        self._folder = folder
        self._tags = tags
        self._audit = audit
        self._running = running
        self._take = take
        self._reloading = asyncio.Lock()

    async def look(self) -> Reading:
        """Read the plant files and compare them with what runs; nothing is changed."""
        return (await self._look())[1]

    async def check(self, drafts: Mapping[str, str]) -> list[Problem]:
        """What would be wrong with the plant files if the definitions of sequences `drafts` were as they say."""
        return (await asyncio.to_thread(read_simulated, self._folder, None, drafts))[1]

    async def review(self, drafts: Mapping[str, str]) -> Reading:
        """As `look`, with `drafts` in place of the definitions of sequences that they name."""
        return (await self._look(drafts))[1]

    async def take_definition(
        self, person: Person, path: Path, text: str, confirm: str, reason: str, address: str = "", *, former: str
    ) -> Reading:
        """Write `text` in the definition `path` of a sequence and take the plant files with it, as `reload` does.

        Refused while the sequence runs, and when the file is not `former` any more. The file is exchanged as a whole; when the plant does
        not take it, it is as before. Each try is one line of the audit.
        """
        async with self._reloading:
            name, running = path.stem, self._running()
            plant, reading = await self._look({name: text})
            if reading.problems:
                reading = replace(reading, refused="plant.refused.problems")
            elif running is None or plant is None:
                reading = replace(reading, refused="editor.refused.no_plant")
            elif self.read_only(path):
                reading = replace(reading, refused="editor.refused.read_only", error=str(path.parent))
            elif busy := self.who_runs(name):
                reading = replace(reading, refused="editor.refused.runs", error=", ".join(busy))
            elif reading.digest != confirm:
                reading = replace(reading, refused="plant.refused.other")
            else:
                reading = await self._written(plant, person, reading, path, text, former)
            await self._audit().record(
                "plant.edited",
                person,
                name,
                new=" · ".join(detail for change in reading.changes for detail in change.details)[:400],
                result="ok" if reading.done else "refused",
                reason=reason if reading.done else reading.refused,
                address=address,
                changes=len(reading.changes),
            )
            return reading

    async def _written(
        self, plant: Plant, person: Person, reading: Reading, path: Path, text: str, former: str
    ) -> Reading:
        try:
            before = await asyncio.to_thread(read_bytes, path, LARGEST_FILE, inside=self._folder)
            if before.decode("utf-8-sig").replace("\r\n", "\n") != former:
                return replace(reading, refused="editor.refused.overtaken")
            lines = text.replace("\n", "\r\n") if b"\r\n" in before else text
            await asyncio.to_thread(exchange_file, path, lines.encode())
        except (OSError, UnicodeDecodeError, UnusableFile) as error:
            why = getattr(error, "strerror", None) or str(error)
            return replace(reading, refused="editor.refused.not_written", error=why)
        taken = await self._taken(plant, person, reading)
        if not taken.done:
            try:
                await asyncio.to_thread(exchange_file, path, before)
            except OSError as error:
                log.error("definition not put back file=%s reason=%s", path, error.strerror)
                return replace(taken, refused="editor.refused.not_put_back")
        return taken

    def read_only(self, path: Path) -> bool:
        """Whether the definition `path` can be written by no means: its folder is not this server's to write in, as where it is mounted."""
        return not may_exchange(path)

    def who_runs(self, definition: str) -> list[str]:
        """Machines whose sequence is `definition` and runs now, suspended or not."""
        plant = self._running()
        runs = self._running_sequences(plant) if plant else []
        return [
            id for id in runs if plant and (one := plant.equipment[id].sequence) is not None and one.name == definition
        ]

    async def drawn_up(self, drafts: Mapping[str, str]) -> Plant | None:
        """The plant as it would be with `drafts`; None when something is wrong."""
        return (await asyncio.to_thread(read_simulated, self._folder, None, drafts))[0]

    async def reload(self, person: Person | None, confirm: str, address: str = "") -> Reading:
        """Take the plant files if their changes are still those with the digest `confirm`; a running plant is never taken down.

        What does not change runs on: links, values and their ages, virtual devices, alarms, commands. Files with problems, other
        changes than those confirmed, or an error while taking them leave the plant as it was. Each try is one line of the audit.
        """
        async with self._reloading:
            plant, reading = await self._look()
            if reading.problems:
                reading = replace(reading, refused="plant.refused.problems")
            elif not reading.changes and not reading.first:
                reading = replace(reading, refused="plant.refused.nothing")
            elif reading.digest != confirm:
                reading = replace(reading, refused="plant.refused.other")
            elif plant is not None:
                reading = await self._taken(plant, person, reading)
            await self._audit().record(
                "plant.reloaded",
                person,
                str(self._folder),
                new=" · ".join(f"{change.kind} {change.name}" for change in reading.changes)[:400],
                result="ok" if reading.done else "refused",
                reason=reading.refused,
                address=address,
                changes=len(reading.changes),
                problems=len(reading.problems),
            )
            return reading

    async def _taken(self, plant: Plant, person: Person | None, reading: Reading) -> Reading:
        try:
            await self._take(plant, person)
        except Exception as error:
            log.exception("plant not reloaded")
            return replace(reading, refused="plant.refused.failed", error=f"{type(error).__name__}: {error}")
        log.info("plant reloaded changes=%d by=%s", len(reading.changes), person.name if person else "-")
        return replace(reading, done=True)

    async def _look(self, drafts: Mapping[str, str] = NO_DRAFTS) -> tuple[Plant | None, Reading]:
        plant, problems = await asyncio.to_thread(read_simulated, self._folder, None, drafts)
        running = self._running()
        if plant is None:
            return None, Reading(tuple(problems))
        doubts = tuple(await asyncio.to_thread(_doubts, plant))
        if running is None:
            return plant, Reading(digest=digest([]), first=True, doubts=doubts)
        busy = self._running_sequences(running), self._moving(running)
        return plant, replace(await asyncio.to_thread(_compared, running, plant, *busy), doubts=doubts)

    def _running_sequences(self, plant: Plant) -> list[str]:
        """Equipment whose sequence runs, suspended or not."""
        found: list[str] = []
        for id, item in plant.equipment.items():
            ring = item.type.device.plc if item.sequence else None
            name = f"{id}.{ring.status}" if ring else ""
            if name in self._tags and self._tags.sample(name).value in RUNNING:
                found.append(id)
        return found

    def _moving(self, plant: Plant) -> list[str]:
        """Equipment that is seen not to stand, by what its Stop is confirmed by."""
        found: list[str] = []
        for id, item in plant.equipment.items():

            def look(key: str, id: str = id) -> tuple[Value, int]:
                name = f"{id}.{key}"
                if name not in self._tags:
                    return None, NO_DATA
                sample = self._tags.sample(name)
                return sample.value, sample.quality

            if not item.sequence and met(stopped(item.type), look) is False:
                found.append(id)
        return found


def _compared(old: Plant, new: Plant, running: Collection[str], moving: Collection[str]) -> Reading:
    """What changes; with some thousand machines this takes a while."""
    told = compare(old, new, running, moving)
    return Reading((), tuple(told), digest(told))


def _doubts(plant: Plant) -> list[Problem]:
    """What is seldom meant in its files, and what its lines cannot carry."""
    return [*plant.doubts, *forecast.doubts(plant)]
