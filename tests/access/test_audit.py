"""The chain: whatever is done to a line is found; whatever happens to the disk, no line is lost and Stop is not held up."""

import json
import sqlite3
from collections.abc import Callable
from pathlib import Path

import pytest

from app.access.access import Access
from app.access.audit import ANCHOR_LINES, Audit, Filter, printable
from app.clock import ManualClock
from app.errors import Refused, StorageError
from tests.access.conftest import OpenAccess, add, boss

LINES = 20
COLUMNS = [
    "time",
    "kind",
    "person_id",
    "person",
    "address",
    "session",
    "object",
    "old",
    "new",
    "result",
    "reason",
    "params",
    "mac",
]
COPY = f"INSERT INTO audit SELECT {{new}}, {', '.join(COLUMNS)} FROM audit WHERE seq = {{old}}"


async def filled(access: Access, lines: int = LINES) -> Access:
    for number in range(lines):
        await access.audit.record("command", boss(), f"m{number % 3}", old=number, new=number + 1, unit="Hz")
    return access


def tamper(data: Path, *statements: str) -> None:
    db = sqlite3.connect(data / "pogon.db")
    for statement in statements:
        db.execute(statement)
    db.commit()
    db.close()


# ---- finding what was done to it --------------------------------------------------------------------------


async def test_an_untouched_chain_is_in_order(access: Access) -> None:
    await filled(access)
    verdict = access.audit.check_now()
    assert (verdict.ok, verdict.count) == (True, LINES)


@pytest.mark.parametrize(
    ("statements", "bad", "why"),
    [
        (["UPDATE audit SET new = '99' WHERE seq = 7"], 7, "changed"),
        (["UPDATE audit SET time = time + 1 WHERE seq = 1"], 1, "changed"),
        (["UPDATE audit SET person = 'eve' WHERE seq = 20"], 20, "changed"),
        (["UPDATE audit SET params = '{}' WHERE seq = 5"], 5, "changed"),
        (["DELETE FROM audit WHERE seq = 9"], 9, "removed"),
        (["DELETE FROM audit WHERE seq <= 3"], 1, "removed"),
        (["DELETE FROM audit WHERE seq = 9", "UPDATE audit SET seq = seq - 1 WHERE seq > 9"], 9, "changed"),
        (
            [
                "UPDATE audit SET seq = -1 WHERE seq = 4",
                "UPDATE audit SET seq = 4 WHERE seq = 6",
                "UPDATE audit SET seq = 6 WHERE seq = -1",
            ],
            4,
            "changed",
        ),
        ([COPY.format(new=0, old=1)], 0, "inserted"),
        ([COPY.format(new=21, old=20)], 21, "changed"),
        (["DELETE FROM audit WHERE seq = 20"], 20, "cut"),
        (["DELETE FROM audit WHERE seq > 12"], 13, "cut"),
        (["DELETE FROM audit"], 1, "cut"),
    ],
)  # fmt: skip
async def test_a_touched_line_is_named(access: Access, data: Path, statements: list[str], bad: int, why: str) -> None:
    await filled(access)
    tamper(data, *statements)
    verdict = access.audit.check_now()
    assert (verdict.ok, verdict.bad, verdict.why) == (False, bad, why)


@pytest.mark.parametrize("column", COLUMNS)
async def test_every_column_is_in_the_chain(access: Access, data: Path, column: str) -> None:
    await filled(access, 3)
    tamper(data, f"UPDATE audit SET {column} = '1234' WHERE seq = 2")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("app.access.audit.log.error", lambda *_: None)
        assert (await access.audit.check()).bad == 2
    assert not access.audit.intact


async def test_the_head_cannot_be_taken_back_by_who_has_no_key(access: Access, data: Path) -> None:
    await filled(access)
    tamper(data, "DELETE FROM audit WHERE seq > 12")
    head = data / "audit.head"
    _, mac, sign = head.read_text().split()
    head.write_text(f"{12:020d} {mac} {sign}\n")
    assert access.audit.check_now().why == "head"
    head.unlink()
    assert not access.audit.check_now().ok


async def test_an_anchor_tells_of_a_cut_that_came_before_the_head_was_lost(
    access: Access, data: Path, clock: ManualClock
) -> None:
    await filled(access)
    clock.advance(3601)
    await access.audit.record("command", boss())
    anchored = int((data / "audit.anchors").read_text().split()[0])
    assert anchored == LINES + 1
    tamper(data, "DELETE FROM audit WHERE seq > 12")
    (data / "audit.head").unlink()
    verdict = access.audit.check_now()
    assert (verdict.bad, verdict.why) == (13, "cut")


async def test_an_anchor_after_a_thousand_lines(access: Access, data: Path) -> None:
    for _ in range(ANCHOR_LINES // 100):
        await access.audit.with_entries(
            lambda _connection: (None, [access.audit.entry("x", boss()) for _ in range(100)])
        )
    assert (data / "audit.anchors").read_text().startswith(f"{ANCHOR_LINES} ")
    assert access.audit.check_now().ok


async def test_the_chain_goes_on_over_a_restart_and_from_two_processes_at_once(open_access: OpenAccess) -> None:
    server, terminal = open_access(), open_access()
    for _ in range(5):
        await server.audit.record("a", boss())
        terminal.audit.run(lambda _connection: (None, [terminal.audit.entry("b", boss())]))
    verdict = open_access().audit.check_now()
    assert (verdict.ok, verdict.count) == (True, 10)


async def test_two_installations_have_two_chains(access: Access, data: Path) -> None:
    await filled(access, 3)
    (data / "audit.key").write_text("ab" * 32)
    assert Audit(access.audit._db, ManualClock(), data).check_now().bad is not None


# ---- what a line holds ------------------------------------------------------------------------------------


async def test_a_line_says_who_when_where_what_from_and_to(access: Access, clock: ManualClock) -> None:
    seq = await access.audit.record("setpoint", boss(), "m1.frequency", 40.0, 45.5, unit="Hz")
    (line,) = await access.audit.find(Filter())
    assert line.seq == seq
    assert (line.person, line.address, line.object, line.old, line.new) == (
        "ana",
        "10.0.0.1",
        "m1.frequency",
        "40.0",
        "45.5",
    )
    assert (line.time, line.result, line.parameters) == (clock.micros(), "ok", {"unit": "Hz"})


@pytest.mark.parametrize("name", ["password", "new_password", "token", "csrf", "secret_key", "sid"])
async def test_a_secret_is_never_written(access: Access, data: Path, name: str) -> None:
    await access.audit.record("x", boss(), **{name: "top secret value"})
    (line,) = await access.audit.find(Filter())
    assert line.parameters == {}


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("two\r\nlines", "two\\x0d\\x0alines"),
        ("\x1b[31mred", "\\x1b[31mred"),
        ("a\u2028b", "a\\u2028b"),
        ("\u202egnp.exe", "\\u202egnp.exe"),
        ("\x85\x00", "\\x85\\x00"),
        ("čšž <b>", "čšž <b>"),
        ("x" * 600, "x" * 499 + "…"),
    ],
)
async def test_a_line_stays_one_line(access: Access, text: str, shown: str) -> None:
    assert printable(text) == shown
    await access.audit.record("x", boss(), reason=text)
    (line,) = await access.audit.find(Filter())
    assert line.reason == shown
    assert access.audit.check_now().ok


async def test_a_lone_surrogate_does_not_break_the_chain(access: Access) -> None:
    await access.audit.record("x", boss(), reason="\ud800", object="\udfff", note="\ud800")
    assert access.audit.check_now().ok


async def test_lines_are_found_by_person_object_kind_and_time_newest_first(access: Access, clock: ManualClock) -> None:
    await filled(access, 6)
    middle = clock.micros() + 1
    clock.advance(10)
    await access.audit.record("signin.failed", None, "marko")
    await access.audit.record("signin.ok", boss("marko"), "marko")

    async def seqs(wanted: Filter, limit: int = 50) -> list[int]:
        return [line.seq for line in await access.audit.find(wanted, limit)]

    assert await seqs(Filter()) == [8, 7, 6, 5, 4, 3, 2, 1]
    assert await seqs(Filter(before=4), 2) == [3, 2]
    assert await seqs(Filter(person="marko")) == [8]
    assert await seqs(Filter(object="m1")) == [5, 2]
    assert await seqs(Filter(kind="signin")) == [8, 7]
    assert await seqs(Filter(kind="sign")) == []
    assert await seqs(Filter(since=middle)) == [8, 7]
    assert await seqs(Filter(until=middle)) == [6, 5, 4, 3, 2, 1]
    assert await seqs(Filter(object="%")) == []
    assert await seqs(Filter(object="_")) == []


async def test_a_step_of_the_clock_is_written_and_order_is_kept_by_number(access: Access, clock: ManualClock) -> None:
    offset = clock.micros() / 1e6 - clock.monotonic()
    await access.audit.record("before", boss())
    clock.step_wall(-3600)
    offset = await access.audit.note_clock(offset)
    clock.advance(30)
    assert await access.audit.note_clock(offset) == pytest.approx(offset)
    lines = await access.audit.find(Filter())
    assert [line.kind for line in lines] == ["clock.stepped", "before"]
    assert lines[0].parameters == {"seconds": "-3600.0"}
    assert lines[0].time < lines[1].time


# ---- when the database does not take it -------------------------------------------------------------------


def broken_disk(access: Access) -> Callable[[], None]:
    """The database refuses every write until the returned function is called."""
    write = access.audit._db.write

    async def refuse(work: object) -> object:
        raise StorageError("pogon.db: database or disk is full")

    access.audit._db.write = refuse  # type: ignore[method-assign, assignment]

    def mend() -> None:
        access.audit._db.write = write  # type: ignore[method-assign]

    return mend


async def test_a_full_disk_loses_no_line_and_holds_nobody_up(access: Access, data: Path) -> None:
    await access.audit.record("one", boss())
    mend = broken_disk(access)
    assert await access.audit.record("stop", boss(), "m1") == 0
    assert await access.audit.record("acknowledge", boss()) == 0
    assert not access.audit.healthy
    assert not await access.audit.replay()
    assert (data / "audit.buffer").stat().st_mode & 0o777 == 0o600
    mend()
    await access.audit.record("after", boss())
    assert access.audit.healthy
    assert [line.kind for line in await access.audit.find(Filter())] == ["after", "acknowledge", "stop", "one"]
    assert access.audit.check_now().count == 4
    assert not (data / "audit.buffer").exists()


async def test_changes_of_people_are_refused_meanwhile(access: Access) -> None:
    key = await add(access, "ana", "admin")
    mend = broken_disk(access)
    await access.audit.record("stop", boss())
    for change in (
        access.people.add(boss(), "eve", "", ["admin"]),
        access.people.set_roles(boss(), key, ["viewer"]),
        access.tokens.create(boss(), "x", ["view"], 7),
    ):
        with pytest.raises(Refused) as caught:
            await change
        assert caught.value.status == 503
    mend()
    assert await access.audit.replay()
    assert [account.name for account in await access.people.all()] == ["ana"]


async def test_the_buffer_outlives_the_server_and_is_written_once(open_access: OpenAccess, data: Path) -> None:
    access = open_access()
    broken_disk(access)
    await access.audit.record("stop", boss(), "m1")
    kept = (data / "audit.buffer").read_text()
    after = open_access()
    assert not after.audit.healthy
    assert await after.audit.replay()
    (data / "audit.buffer").write_text(kept)  # died between commit and emptying the buffer
    (data / "audit.buffer").chmod(0o600)
    again = open_access()
    assert await again.audit.replay()
    assert [line.kind for line in await again.audit.find(Filter())] == ["stop"]
    assert again.audit.check_now().ok


async def test_a_broken_line_in_the_buffer_does_not_stop_the_others(open_access: OpenAccess, data: Path) -> None:
    access = open_access()
    broken_disk(access)
    await access.audit.record("stop", boss())
    text = (data / "audit.buffer").read_text()
    (data / "audit.buffer").write_text("{half\n" + json.dumps({"id": "x"}) + "\n" + text)
    again = open_access()
    assert await again.audit.replay()
    assert [line.kind for line in await again.audit.find(Filter())] == ["stop"]


async def test_a_change_and_its_line_happen_together_or_not_at_all(access: Access) -> None:
    await add(access, "ana", "admin")
    before = await access.audit.count()
    with pytest.raises(Refused):
        await access.people.add(boss(), "ana", "", ["operator"])
    assert await access.audit.count() == before
    assert access.audit.check_now().ok
