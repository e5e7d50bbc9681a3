"""Memory stays level: what a round of use leaves behind is counted in objects and blocks, not in what the allocator holds."""

import gc
import re
import sys
from collections import Counter
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from app import bundled
from app.access.access import Access
from app.access.roles import ROLES, Person, permissions_of
from app.access.tokens import GRANTABLE
from app.cli_access import terminal
from app.running.page_tags import page_tags
from app.settings import Settings
from tests.virtual import HOST, VirtualClient, house

PASSWORD = "tri plave ladice u kutu"
PAGES = (
    "/", "/alarms", "/alarms/summary", "/trends?tags=m1.speed", "/records/passage",
    "/records/run", "/records/force", "/storage", "/communication", "/forces", "/audit",
    "/users", "/equipment/m1", "/alarms.csv",
)  # fmt: skip
WARM, ROUNDS = 6, 8
LEFT_BEHIND = 20
"""Objects of a round that may stay, in all: of libraries that fill caches with a limit. Of our own classes none may."""
BLOCKS = 1000
"""Blocks of memory that a round may leave: those of its commands, of caches with a limit, of rows that wait."""
KEPT = ("app.commands.nonce._Entry", "app.commands.lifecycle.Progress")
"""Of commands that may come a second time: 10 000 at most (app/commands/nonce.py)."""


def plant(folder: Path) -> Path:
    """One drive of the demo plant."""
    text = (bundled("plants/demo") / "plant.toml").read_text("utf-8")
    head = text[: text.index("[links.line]")]
    drive = re.search(r"(?ms)^\[equipment\.m1\].*?(?=^#|^\[)", text)
    assert drive
    folder.mkdir()
    (folder / "plant.toml").write_text(re.sub(r"(?ms)^\[areas\.(conveyors|sequences)\].*?(?=^\[)", "", head) + drive[0])
    return folder


async def token_of(access: Access) -> str:
    access.people.add_now(terminal(), [("boss", "", tuple(ROLES))])
    access.people.set_password_now(terminal(), "boss", PASSWORD)
    (account,) = await access.people.all()
    boss = Person(account.id, "boss", "boss", frozenset(ROLES), permissions_of(ROLES), "")
    return (await access.tokens.create(boss, "level", sorted(permissions_of(ROLES) & set(GRANTABLE)), 1))[1]


def use(client: VirtualClient, secret: str, number: int) -> None:
    """What people do: look at every page, watch, ask for history, command, export, sign in."""
    runtime, headers = client.app.state.runtime, {"Authorization": f"Bearer {secret}"}  # type: ignore[attr-defined]
    sheet = client.get("/signin")
    csrf = re.search(r'name="csrf" value="([^"]+)"', sheet.text)
    assert csrf
    given = {"csrf": csrf[1], "name": "boss", "password": PASSWORD, "next": "/"}
    assert client.post("/signin", data=given, headers={"Origin": HOST}).status_code == 303
    for page in PAGES:
        assert client.get(page).status_code == 200, page
    for kind in ("overview", "equipment/m1"):
        watcher = runtime.live.join(kind, page_tags(kind, runtime.plant, runtime.points))
        for _ in range(5):
            client.run(watcher.next())
        runtime.live.leave(watcher)
    now = datetime.fromtimestamp(client.clock.micros() / 1e6, UTC)
    asked = {
        "tags": "m1.frequency,m1.current",
        "from": (now - timedelta(minutes=10)).isoformat(),
        "to": now.isoformat(),
    }
    assert client.get("/api/v1/history", headers=headers, params=asked | {"width": "800"}).status_code == 200
    assert client.get("/history/export.csv", headers=headers, params=asked).status_code == 200
    client.post("/api/v1/equipment/m1/control/take", headers=headers)
    for word in ("forward", "coast", "reset"):
        nonce = client.post("/api/v1/nonce", headers=headers).json()["nonce"]
        order = {"id": f"level{number:04}{word}", "nonce": nonce, "confirmed": True}
        client.post(f"/api/v1/equipment/m1/commands/{word}", headers=headers, json=order)
        client.pass_time(3)
    client.post("/api/v1/equipment/m1/control/release", headers=headers)
    client.cookies.clear()


def held() -> tuple[Counter[str], int]:
    """Objects by type, and blocks of memory in all."""
    gc.collect()
    return Counter(
        f"{type(one).__module__}.{type(one).__qualname__}" for one in gc.get_objects()
    ), sys.getallocatedblocks()


@pytest.mark.parametrize("pause", [60.0, pytest.param(900.0, marks=pytest.mark.soak)])
def test_use_leaves_nothing_behind(tmp_path: Path, pause: float) -> None:
    """A quarter of an hour with a round each minute, or with `make soak` four hours."""
    with house(Settings(plant=plant(tmp_path / "plant"), data=tmp_path / "data")) as client:
        secret = client.run(token_of(client.app.state.runtime.access))  # type: ignore[attr-defined]
        seen = []
        for number in range(WARM + ROUNDS):
            use(client, secret, number)
            client.pass_time(pause)
            seen.append(held())
    (before, blocks), (after, blocks_after) = seen[WARM - 1], seen[-1]
    more = after - before
    for name in KEPT:
        del more[name]
    grown = {name: count for name, count in more.items() if count >= ROUNDS}
    assert not [name for name in grown if name.startswith("app.")], grown
    assert sum(grown.values()) < LEFT_BEHIND * ROUNDS, grown
    if pause > 60:  # before, buffers and caches still fill
        assert blocks_after - blocks < BLOCKS * ROUNDS
