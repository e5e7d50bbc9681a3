"""A server killed while it takes a sequence from the editor: after its next start it is taken, or no revision, and the audit says which."""

import asyncio
import shutil
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from app import bundled
from app.access.audit.line import Record
from app.access.audit.search import Filter
from app.access.roles import Person
from app.files import exchange_file
from app.running.sequence_drafts import Draft
from app.runtime import Runtime
from app.settings import Settings
from tests.conftest import enroll
from tests.virtual import inline, loop_clock

FILE = (bundled("plants/feeding") / "sequences" / "feed.toml").read_text("utf-8")
CHANGED = FILE.replace("minimum = 20\n", "minimum = 25\n")
REASON = "the fan needs longer"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    found = tmp_path / "plant"
    shutil.copytree(bundled("plants/feeding"), found)
    enroll(tmp_path / "data", {"ana": ["engineer"]}, "tri plave ladice u kutu")
    return found


@asynccontextmanager
async def started(folder: Path) -> AsyncIterator[Runtime]:
    runtime = Runtime(Settings(plant=folder, data=folder.parent / "data"), loop_clock(), inline)
    await runtime.start()
    try:
        yield runtime
    finally:
        await runtime.stop()


async def ana(runtime: Runtime) -> Person:
    (account,) = await runtime.access.people.all()
    return Person(account.id, account.name, "Ana", frozenset(), frozenset(), "")


async def lines(runtime: Runtime) -> list[Record]:
    return await runtime.access.audit.find(Filter(kind="plant.edited"))


async def begun(runtime: Runtime) -> None:
    """What is done of a taking before the file is exchanged."""
    person = await ana(runtime)
    draft = await runtime.drafts.save(person, "feed", Draft(FILE, FILE), CHANGED, tab="1", seen=0)
    await runtime.drafts._keep(person, "feed", draft.base, draft.text, REASON)


async def test_killed_before_the_file_was_exchanged_it_is_no_revision_and_the_draft_stays(folder: Path) -> None:
    async with started(folder) as runtime:
        await begun(runtime)
    async with started(folder) as runtime:
        assert [one.text for one in await runtime.drafts.revisions("feed")] == [FILE]
        assert (await runtime.drafts.draft(await ana(runtime), "feed")).text == CHANGED
        (line,) = await lines(runtime)
        assert (line.person, line.object, line.result, line.reason) == (
            "ana",
            "feed",
            "refused",
            "editor.refused.killed",
        )


@pytest.mark.parametrize("told", [False, True])
async def test_killed_after_the_file_was_exchanged_it_is_taken_and_told_once(folder: Path, told: bool) -> None:
    async with started(folder) as runtime:
        await begun(runtime)
        exchange_file(folder / "sequences" / "feed.toml", CHANGED.encode())
        if told:
            await runtime.access.audit.record("plant.edited", await ana(runtime), "feed", reason=REASON, changes=1)
    for _ in range(2):
        async with started(folder) as runtime:
            assert [one.text for one in await runtime.drafts.revisions("feed")] == [CHANGED, FILE]
            assert not (await runtime.drafts.draft(await ana(runtime), "feed")).begun
            (line,) = await lines(runtime)
            assert (line.person, line.result, line.reason) == ("ana", "ok", REASON)


async def test_a_later_draft_with_the_words_of_a_revision_is_no_taking(folder: Path) -> None:
    async with started(folder) as runtime:
        await begun(runtime)
        person = await ana(runtime)
        await runtime.drafts.discard(person, "feed")
        await asyncio.sleep(60)
        await runtime.drafts.save(person, "feed", Draft(FILE, FILE), CHANGED, tab="1", seen=0)
    async with started(folder) as runtime:
        assert [one.text for one in await runtime.drafts.revisions("feed")] == [CHANGED, FILE]
        assert await lines(runtime) == []
