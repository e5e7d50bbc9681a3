"""Whatever is done to a line, to the chain or to what stands outside the database is found."""

import os
from pathlib import Path

import pytest

from app.access.access import Access
from app.access.audit.chain import signed
from app.access.audit.search import Filter
from app.clock import ManualClock
from app.errors import StorageError
from tests.access.audit.filled import LINES, filled, older, tamper
from tests.access.conftest import boss

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


async def test_an_untouched_chain_is_in_order(access: Access) -> None:
    await filled(access)
    verdict = access.audit.check_now()
    assert (verdict.ok, verdict.count) == (True, LINES)


@pytest.mark.sweep(8)
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


@pytest.mark.sweep(8)
@pytest.mark.parametrize("column", COLUMNS)
async def test_every_column_is_in_the_chain(access: Access, data: Path, column: str) -> None:
    await filled(access, 3)
    tamper(data, f"UPDATE audit SET {column} = '1234' WHERE seq = 2")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("app.access.audit.audit.log.error", lambda *_: None)
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


ODD = ["é" * 64, "", "0" * 63 + "é", "zz" * 32, "\u2028", "1e5", "\ud800"]


@pytest.mark.sweep(8)
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
        patch.setattr("app.access.audit.audit.log.error", lambda *_: None)
        assert not (await access.audit.check()).ok


@pytest.mark.sweep(8)
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
        patch.setattr("app.access.audit.audit.log.error", lambda *_: None)
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


@pytest.mark.parametrize("wrong", ["of another plant", "changed", "rubbish", "pipe"])
async def test_anchors_from_elsewhere_that_do_not_agree_are_named_as_such(
    access: Access, data: Path, clock: ManualClock, tmp_path: Path, wrong: str
) -> None:
    """Not audit.anchors, which is in order."""
    await access.audit.begin()
    clock.advance(3601)
    await filled(access, 3)
    copy = tmp_path / "elsewhere"
    seq, time, mac, before, sign = (data / "audit.anchors").read_text().splitlines()[0].split()
    key = access.audit._key
    match wrong:
        case "of another plant":  # signed with this key, but of a chain that is another
            mac = "ab" * 32
            copy.write_text(f"{seq} {time} {mac} {before} {signed(key, 'anchor', int(seq), mac, int(time), before)}\n")
        case "changed":
            copy.write_text(f"{seq} {int(time) + 1} {mac} {before} {sign}\n")
        case "rubbish":
            copy.write_text("no anchor\n")
        case "pipe":
            os.mkfifo(copy)
    assert access.audit.check_now().ok
    verdict = access.audit.check_now(copy)
    assert (verdict.ok, verdict.why) == (False, "copied")
    assert verdict.bad == (1 if wrong in ("rubbish", "pipe") else int(seq))


@pytest.mark.parametrize("what", ["folder", "pipe"])
async def test_a_buffer_that_is_no_file_is_a_verdict_and_keeps_nobody_waiting(
    access: Access, data: Path, what: str
) -> None:
    await filled(access, 3)
    access.audit.close()
    (data / "audit.buffer").unlink(missing_ok=True)
    (data / "audit.buffer").mkdir() if what == "folder" else os.mkfifo(data / "audit.buffer")
    verdict = access.audit.check_now()
    assert (verdict.count, verdict.bad, verdict.why) == (3, 4, "unread")
