"""Memory stays level: what a round of use leaves behind is counted in objects and blocks, not in what the allocator holds."""

import gc
import re
import sys
import weakref
from collections import Counter
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta

import pytest

from app.access.access import Access
from app.access.roles import ROLES, Person, permissions_of
from app.access.tokens import GRANTABLE
from app.cli_access import terminal
from app.live.frames import Watcher
from app.running.page_tags import page_tags
from app.settings import Settings
from tests.demo_plant import plant_folder
from tests.virtual import HOST, VirtualClient, house

PASSWORD = "tri plave ladice u kutu"
PAGES = (
    "/", "/alarms", "/alarms/summary", "/trends?tags=m1.speed", "/events", "/storage", "/communication", "/audit",
    "/users", "/plant", "/equipment/m1", "/equipment/m1/parameters", "/alarms.csv", "/events/export.csv",
)  # fmt: skip
WARM, ROUNDS = 6, 8
LEFT_BEHIND = 20
"""Objects of a round that may stay, in all: of libraries that fill caches with a limit (up to 10 were seen). Of our own classes none may.
Weak references of those that have gone count as blocks alone: each connection of sqlite3 keeps some two hundred, and sweeps them then."""
BLOCKS = 1000
"""Blocks of memory that a round may leave: those of its commands, of caches with a limit, of rows that wait."""
KEPT = (
    "app.commands.nonce._Entry",
    "app.commands.lifecycle.Progress",
    "app.historian.minutes.Minute",
    "app.running.virtual_time._InTurn",
)
"""Of commands that may come a second time: 10 000 at most (app/commands/nonce.py); one for each point that was ever recorded; timers
of the loop of these tests, of which asyncio keeps up to a hundred that were cancelled until their time comes."""
PLANTED_ROUNDS = 3
"""With a leak in each."""


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
    there = (one for one in gc.get_objects() if type(one) is not weakref.ReferenceType or one() is not None)
    return Counter(f"{type(one).__module__}.{type(one).__qualname__}" for one in there), sys.getallocatedblocks()


class Use:
    """Rounds of use of one house, and what they leave behind."""

    def __init__(self, client: VirtualClient, pause: float) -> None:
        self.client, self.pause, self.number = client, pause, 0
        self.secret = client.run(token_of(client.app.state.runtime.access))  # type: ignore[attr-defined]
        self.rounds(WARM)

    def rounds(self, count: int, after: Callable[[int], object] = lambda number: None) -> None:
        for _ in range(count):
            use(self.client, self.secret, self.number)
            after(self.number)
            self.client.pass_time(self.pause)
            self.number += 1

    def left_behind(self, rounds: int, after: Callable[[int], object] = lambda number: None) -> list[str]:
        """What so many more of them leave that they should not; `after` is done in each."""
        before, blocks = held()
        self.rounds(rounds, after)
        now, blocks_now = held()
        more = now - before
        for name in KEPT:
            del more[name]
        grown = {name: count for name, count in more.items() if count >= rounds}
        found = [f"{name} +{count}" for name, count in grown.items() if name.startswith("app.")]
        if sum(grown.values()) >= LEFT_BEHIND * rounds:
            found.append(f"objects {grown}")
        if blocks_now - blocks >= BLOCKS * rounds:
            found.append(f"blocks +{blocks_now - blocks}")
        print(f"{sum(grown.values()) / rounds:.0f} objects and {(blocks_now - blocks) / rounds:.0f} blocks a round")
        return found


@pytest.fixture(scope="module", params=[60.0, pytest.param(900.0, marks=pytest.mark.soak)])
def used(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Use]:
    """A house that was used for some minutes, or with `make soak` for hours."""
    folder = tmp_path_factory.mktemp("level")
    with house(Settings(plant=plant_folder(folder / "plant", "m1"), data=folder / "data")) as client:
        yield Use(client, request.param)


@pytest.mark.sweep(20)
def test_use_leaves_nothing_behind(used: Use) -> None:
    assert used.left_behind(ROUNDS) == []


PLANTED: list[object] = []


def plant(number: int) -> None:
    """One object of ours, lists of a library, and texts, which no collector sees: each is too little for the sign of another."""
    PLANTED.append(Watcher.__new__(Watcher))
    PLANTED.extend([number] for _ in range(2 * LEFT_BEHIND + 2))  # a cache may let some of its own go meanwhile
    PLANTED.extend(f"{number} {n}" for n in range(2 * BLOCKS))


@pytest.mark.sweep(20)
def test_a_leak_that_is_planted_is_found(used: Use) -> None:
    """A test of the test above: one object of a class of ours in each round is enough."""
    try:
        found = used.left_behind(PLANTED_ROUNDS, plant)
    finally:
        PLANTED.clear()
    signs = {what.split()[0]: what for what in found}
    assert f"app.live.frames.Watcher +{PLANTED_ROUNDS}" in found
    assert {"objects", "blocks"} <= set(signs), found
    lists = re.search(r"'builtins.list': (\d+)", signs["objects"])
    assert lists and int(lists[1]) >= 2 * LEFT_BEHIND * PLANTED_ROUNDS, found
