"""Who changed a setting stands with the event by which the machine tells it, whichever way it was changed."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from app.access.access import Access
from app.access.roles import Person, permissions_of
from app.access.tokens import GRANTABLE
from app.cli_access import terminal
from app.settings import Settings
from tests.reloading import DEMO, Plant
from tests.virtual import VirtualClient, house

SETTINGS = {
    "c1": ("settings_changed", {"automatic_speed": 41.0, "manual_speed": 12.0, "gap_margin": 55.0}),
    "cc1": ("settings_changed", {"automatic_horizontal": 310.0, "manual_horizontal": 90.0}),
}
PEOPLE = ("eva", "mira")


async def tokens(access: Access) -> dict[str, str]:
    """A token of each."""
    access.people.add_now(terminal(), [(name, name.title(), ("operator", "engineer", "viewer")) for name in PEOPLE])
    found = {}
    for one in await access.people.all():
        rights = permissions_of(one.roles)
        who = Person(one.id, one.name, one.display, frozenset(one.roles), rights, "")
        found[one.name] = (await access.tokens.create(who, one.display, sorted(rights & set(GRANTABLE)), 1))[1]
    return found


class Program:
    """What a person does through the interface for programs."""

    def __init__(self, client: VirtualClient, secret: str) -> None:
        self.client, self.headers = client, {"Authorization": f"Bearer {secret}"}

    def ask(self, what: str, **order: Any) -> Any:
        answer = self.client.post(f"/api/v1/{what}", headers=self.headers, json=order or None)
        assert answer.status_code < 300, answer.text
        return answer.json() if answer.content else None

    def write(self, equipment: str, what: str, **order: Any) -> None:
        self.ask(f"equipment/{equipment}/control/take")
        self.ask(f"equipment/{equipment}/{what}", nonce=self.ask("nonce")["nonce"], confirmed=True, **order)
        self.client.pass_time(5)
        self.ask(f"equipment/{equipment}/control/release")

    def events(self, equipment: str, key: str) -> list[dict[str, Any]]:
        asked = {"equipment": equipment, "event": key}
        found: list[dict[str, Any]] = self.client.get("/api/v1/events", headers=self.headers, params=asked).json()[
            "events"
        ]
        return found


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[VirtualClient]:
    folder: Path = tmp_path_factory.mktemp("settings")
    plant = Plant(folder / "plant")
    plant.write(DEMO)
    with house(Settings(plant=plant.folder, data=folder / "data")) as found:
        found.pass_time(10)
        yield found


@pytest.fixture(scope="module")
def programs(client: VirtualClient) -> list[Program]:
    secrets = client.run(tokens(client.app.state.runtime.access))  # type: ignore[attr-defined]
    return [Program(client, secrets[name]) for name in PEOPLE]


@pytest.mark.sweep(8)
@pytest.mark.parametrize("equipment", SETTINGS)
def test_the_person_who_changed_a_setting_is_told(programs: list[Program], equipment: str) -> None:
    eva, mira = programs
    key, values = SETTINGS[equipment]
    first = next(iter(values))
    eva.write(equipment, f"setpoints/{first}", id=f"settings-one-{equipment}", value=values[first], reason="tuning")
    (one,) = eva.events(equipment, key)
    assert (one["person"], one["reason"]) == ("Eva", "tuning")
    wanted = {name: value + 1 for name, value in values.items()}
    mira.write(equipment, "setpoints", id=f"settings-two-{equipment}", values=wanted, reason="all of them")
    two, one = eva.events(equipment, key)
    assert (two["person"], two["reason"]) == ("Mira", "all of them")
    assert (one["person"], one["reason"]) == ("Eva", "tuning")
