"""The chain: whatever is done to a line is found; whatever happens to the disk, no line is lost and Stop is not held up."""

import asyncio
import errno
import json
import os
import sqlite3
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import pytest

from app.access.access import Access
from app.access.audit import ANCHOR_LINES, Audit, Filter, printable
from app.access.audit_buffer import HEAD, SIZE
from app.clock import ManualClock
from app.db import Database
from app.errors import Refused, StorageError
from tests.access.conftest import OpenAccess, add, boss
from tests.virtual import inline

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


MARKS = ("audit.head", "audit.anchors", "audit.buffer", "audit.key")


async def older(access: Access, data: Path) -> dict[str, bytes]:
    """A chain of 12 lines whose marks were copied, and 8 lines more."""
    await filled(access, 12)
    copied = {name: (data / name).read_bytes() for name in MARKS if (data / name).exists()}
    await filled(access, 8)
    return copied


@pytest.mark.parametrize("gone", [("audit.head", "audit.anchors"), ("audit.head", "audit.anchors", "audit.buffer")])
async def test_wiping_everything_is_found(access: Access, data: Path, gone: tuple[str, ...]) -> None:
    await access.audit.begin()
    await filled(access)
    tamper(data, "DELETE FROM audit")
    for name in gone:
        (data / name).unlink(missing_ok=True)
    verdict = access.audit.check_now()
    assert not verdict.ok
    assert verdict.why == ("wiped" if "audit.buffer" in gone else "cut")


async def test_an_older_head_put_back_is_found(access: Access, data: Path) -> None:
    await access.audit.begin()
    copied = await older(access, data)
    tamper(data, "DELETE FROM audit WHERE seq > 12")
    (data / "audit.head").write_bytes(copied["audit.head"])
    verdict = access.audit.check_now()
    assert (verdict.bad, verdict.why) == (13, "cut")


async def test_all_older_marks_but_the_key_put_back_are_found_by_the_anchor_in_it(
    access: Access, data: Path, clock: ManualClock
) -> None:
    await access.audit.begin()
    copied = await older(access, data)
    clock.advance(3601)
    await access.audit.record("command", boss())
    tamper(data, "DELETE FROM audit WHERE seq > 12")
    for name in ("audit.head", "audit.buffer"):
        (data / name).write_bytes(copied[name])
    (data / "audit.anchors").unlink()
    verdict = access.audit.check_now()
    assert (verdict.bad, verdict.why) == (13, "cut")


async def test_everything_older_put_back_is_found_by_an_anchor_elsewhere(
    data: Path, clock: ManualClock, tmp_path: Path
) -> None:
    told: list[str] = []
    database = Database(data / "pogon.db", "pogon", inline)
    access = Access(database, clock, data, anchors=[told.append], threads=inline)
    copied = await older(access, data)
    clock.advance(3601)
    await access.audit.record("command", boss())
    tamper(data, "DELETE FROM audit WHERE seq > 12")
    for name in MARKS:
        if name in copied:
            (data / name).write_bytes(copied[name])
    (data / "audit.anchors").unlink()
    assert access.audit.check_now().ok  # nothing on this machine tells
    (tmp_path / "copied").write_text("\n".join(told))
    verdict = access.audit.check_now(tmp_path / "copied")
    assert (verdict.bad, verdict.why) == (13, "cut")
    access.close()


async def test_anchors_hang_together(access: Access, data: Path, clock: ManualClock) -> None:
    for _ in range(4):
        clock.advance(3601)
        await access.audit.record("command", boss())
    path = data / "audit.anchors"
    lines = path.read_text().splitlines()
    assert len(lines) == 4
    for wrong in ([*lines[:1], *lines[2:]], lines[1:], [lines[1], lines[0], *lines[2:]], [*lines, lines[0]]):
        path.write_text("\n".join(wrong) + "\n")
        assert access.audit.check_now().why == "anchor"
    path.write_text("\n".join(lines) + "\n")
    assert access.audit.check_now().ok


async def test_anchors_of_the_first_versions_are_understood(access: Access, data: Path) -> None:
    await filled(access, 3)
    mac = access.audit._newest[1]
    (data / "audit.anchors").write_text(f"3 5 {mac} {access.audit._sign('anchor', 3, mac, 5)}\n")
    assert access.audit.check_now().ok


ODD = ["é" * 64, "", "0" * 63 + "é", "zz" * 32, "\u2028", "1e5", "\ud800"]


@pytest.mark.parametrize("file", ["audit.head", "audit.anchors", "audit.key"])
@pytest.mark.parametrize("odd", [*ODD, "binary", "long", "short", "folder"])
async def test_a_mark_that_is_rubbish_is_a_verdict(
    access: Access, data: Path, clock: ManualClock, file: str, odd: str
) -> None:
    await access.audit.begin()
    clock.advance(3601)
    await filled(access, 3)
    path = data / file
    first, _, rest = path.read_text().strip().partition("\n") if file == "audit.key" else ("", "", path.read_text())
    words = rest.split()
    match odd:
        case "binary":
            content = bytes(range(128, 256))
        case "long":
            content = b"9" * 6000 + b" " + " ".join(words[1:]).encode()
        case "short":
            content = b"7"
        case "folder" if file != "audit.key":
            path.unlink()
            path.mkdir()
            content = b""
        case _:
            content = " ".join([*words[:-1], odd]).encode("utf-8", "surrogatepass")
    if path.is_file():
        path.write_bytes((first.encode() + b"\n" if first else b"") + content)
    assert not access.audit.check_now().ok
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("app.access.audit.log.error", lambda *_: None)
        assert not (await access.audit.check()).ok


@pytest.mark.parametrize("column", COLUMNS)
@pytest.mark.parametrize(
    "value",
    ["x'ff00fe'", "CAST(x'c3a9ff' AS TEXT)", "'é'", "1.5", "9e999", "char(55296)", "'x y'", "123456789012345678"],
)
async def test_whatever_stands_in_a_line_is_a_verdict_and_can_be_shown(
    access: Access, data: Path, column: str, value: str
) -> None:
    """Blobs, broken texts, numbers where none belong: in the middle and as the newest line, which the next one is chained to."""
    await filled(access, 3)
    tamper(data, f"UPDATE audit SET {column} = {value} WHERE seq IN (2, 3)")
    assert access.audit.check_now().bad == 2
    await access.audit.record("after", boss())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("app.access.audit.log.error", lambda *_: None)
        assert (await access.audit.check()).bad == 2
    lines = await access.audit.find(Filter())
    assert len(lines) >= 4
    assert all(
        isinstance(text, str) for line in lines for text in (line.person, line.params, *line.parameters.values())
    )


async def test_a_table_that_is_gone_ends_nothing_but_the_verifying(access: Access, data: Path) -> None:
    await filled(access, 3)
    tamper(data, "DROP TABLE audit")
    with pytest.raises(StorageError):
        await access.audit.check()


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
    access.audit._disk.submit(lambda: None).result()
    assert access.audit._buffer.read().lines == []


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


FORGED = {
    "time": 1, "kind": "command", "person_id": 7, "person": "vic", "address": "", "session": "", "object": "m1.forward",
    "old": "", "new": "", "result": "confirmed", "reason": "", "params": "{}", "id": "0123456789abcdef",
}  # fmt: skip


@pytest.mark.parametrize("where", ["alone", "before", "behind", "again", "shuffled"])
async def test_a_foreign_line_in_the_buffer_is_found_and_never_chained(
    open_access: OpenAccess, data: Path, where: str
) -> None:
    access = open_access()
    buffer, forged = data / "audit.buffer", json.dumps(FORGED).encode() + b"\n"
    genuine = []
    if where == "alone":
        await access.audit.record("x", boss())
        buffer.write_bytes(forged)
        buffer.chmod(0o600)
    else:
        broken_disk(access)
        await access.audit.record("stop", boss())
        await access.audit.record("acknowledge", boss())
        content = buffer.read_bytes()
        first, second, _ = content[HEAD:].split(b"\n", 2)
        lines = {
            "before": [forged.strip(), first, second],
            "behind": [first, second, forged.strip()],
            "again": [first, second, second],
            "shuffled": [second, first],
        }[where]
        buffer.write_bytes(content[:HEAD] + b"\n".join(lines) + b"\n\0")
        genuine = ["acknowledge", "stop"] if where != "shuffled" else ["stop"]
    assert access.audit.check_now().why == "buffer"
    again = open_access()
    await again.audit.begin()
    kinds = [line.kind for line in await again.audit.find(Filter())]
    assert kinds == ["audit.foreign", *(genuine or ["x"])]
    assert again.audit.healthy
    verdict = again.audit.check_now()  # until somebody has looked at it
    assert (verdict.ok, verdict.why) == (False, "buffer")
    assert (data / "audit.foreign").stat().st_mode & 0o777 == 0o600
    (data / "audit.foreign").unlink()
    assert again.audit.check_now().ok
    assert open_access().audit.check_now().ok


async def test_a_record_that_was_torn_off_is_none(open_access: OpenAccess, data: Path) -> None:
    access = open_access()
    broken_disk(access)
    for kind in ("one", "two"):
        await access.audit.record(kind, boss())
    content = (data / "audit.buffer").read_bytes().rstrip(b"\0")
    (data / "audit.buffer").write_bytes(content[:-40])
    again = open_access()
    await again.audit.begin()
    await again.audit.record("three", boss())
    assert [line.kind for line in await again.audit.find(Filter())] == ["three", "one"]
    assert again.audit.check_now().ok


# ---- what is told before it is done -----------------------------------------------------------------------


async def test_what_was_foretold_is_on_the_disk_and_soon_in_the_chain(open_access: OpenAccess, data: Path) -> None:
    access = open_access()
    await access.audit.begin()
    assert (data / "audit.buffer").stat().st_size >= SIZE  # allocated before it is needed
    for number in range(3):
        assert await access.audit.foretell(access.audit.entry("command.sent", boss(), f"m{number}", result="sent"))
    await access.audit.record("command", boss(), "m0", result="confirmed")
    lines = await access.audit.find(Filter())
    assert [line.kind for line in lines] == ["command", *["command.sent"] * 3]
    assert access.audit.healthy
    assert access.audit.check_now().ok


@pytest.mark.parametrize("committed", [False, True])
async def test_a_killed_server_leaves_the_line_of_what_it_had_begun(
    open_access: OpenAccess, data: Path, committed: bool
) -> None:
    """Killed after the line was on the disk: before the database had it, or before the buffer knew of that."""
    access = open_access()
    if not committed:
        broken_disk(access)
    access.audit._buffer.rewind = lambda: None  # type: ignore[method-assign]
    line: dict[str, object] = {"id": "a" * 16, **asdict(access.audit.entry("command.sent", boss()))}
    access.audit._buffer.append(line)
    if committed:
        access.audit._waiting["a" * 16] = line
        assert await access.audit.replay()
    after = open_access()
    await after.audit.begin()
    assert [line.kind for line in await after.audit.find(Filter())] == ["command.sent"]
    assert after.audit.check_now().ok
    assert after.audit.healthy


async def test_without_a_database_it_goes_to_the_buffer_and_nobody_waits(access: Access) -> None:
    mend = broken_disk(access)
    assert await access.audit.foretell(access.audit.entry("command.sent", boss()))
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    assert not access.audit.healthy
    mend()
    assert await access.audit.replay()
    assert [line.kind for line in await access.audit.find(Filter())] == ["command.sent"]


async def test_without_a_buffer_it_goes_to_the_database(access: Access, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "fdatasync", _full)
    assert await access.audit.foretell(access.audit.entry("command.sent", boss()))
    assert await access.audit.count() == 1


async def test_with_neither_it_is_kept_nowhere_and_says_so(access: Access, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "fdatasync", _full)
    mend = broken_disk(access)
    assert not await access.audit.foretell(access.audit.entry("command.sent", boss()))
    assert not access.audit.healthy
    await access.audit.record("stop", boss())  # kept in memory, at least
    mend()
    assert await access.audit.replay()
    assert [line.kind for line in await access.audit.find(Filter())] == ["stop"]


async def test_a_buffer_that_is_full_does_not_stop_the_database(
    access: Access, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.access.audit_buffer.SIZE", 2000)
    mend = broken_disk(access)
    kept = [await access.audit.foretell(access.audit.entry("command.sent", boss(), str(n))) for n in range(9)]
    assert kept == sorted(kept, reverse=True)
    assert 0 < sum(kept) < 9
    mend()
    assert await access.audit.foretell(access.audit.entry("command.sent", boss(), "x"))
    await access.audit.replay()
    assert await access.audit.count() == sum(kept) + 1
    access.audit._disk.submit(lambda: None).result()
    assert await access.audit.foretell(access.audit.entry("command.sent", boss(), "y"))  # it begins anew in front


def _full(_handle: int) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


async def test_a_change_and_its_line_happen_together_or_not_at_all(access: Access) -> None:
    await add(access, "ana", "admin")
    before = await access.audit.count()
    with pytest.raises(Refused):
        await access.people.add(boss(), "ana", "", ["operator"])
    assert await access.audit.count() == before
    assert access.audit.check_now().ok
