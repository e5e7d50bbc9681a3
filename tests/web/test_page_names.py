"""Whatever address may be refused has the name of its page, in every language."""

import pytest
from fastapi.testclient import TestClient

from app.access.roles import PUBLIC
from app.web.guard import permissions
from app.web.page_names import PAGES, name_of
from tests.web.operating import runtime_of
from tests.web.test_alarms import LANGUAGES

FREE = ("", PUBLIC)
"""Permissions of routes that nobody is refused."""
OF_A_MACHINE = {
    f"/equipment/{{key}}{part}" for part in ("", "/faceplate", "/page/{name}", "/part/{part}", "/table/{table}/{id}")
}
"""What has the name of its machine, and no other."""


@pytest.mark.parametrize("lang", LANGUAGES)
def test_every_page_has_its_name(client: TestClient, lang: str) -> None:
    texts = runtime_of(client).texts
    assert [key for key in PAGES.values() if not texts.has(lang, key)] == []


def test_every_address_that_may_be_refused_is_of_a_page(client: TestClient) -> None:
    asked = {route.split(" ", 1)[1] for route, permission in permissions(client.app).items() if permission not in FREE}  # type: ignore[arg-type]
    assert len(asked) > 100
    assert {path for path in asked if not name_of(path)} == OF_A_MACHINE


@pytest.mark.parametrize(
    ("path", "key"),
    [
        ("/equipment/{key}/encoder/start", "enc.title"),
        ("/equipment/m1/encoder", "enc.title"),
        ("/equipment/{id}/events", "events.title"),
        ("/equipment/{key}/drive-parameters/compare/take", "dcmp.title"),
        ("/equipment/{key}/drive-parameters/rows", "dpar.title"),
        ("/users/{key}/roles", "access.users"),
        ("/users/review.csv", "access.review"),
        ("/alarms.csv", "alarm.list"),
        ("/", "nav.overview"),
        ("/equipment/{key}", ""),
    ],
)
def test_an_address_belongs_to_the_page_with_the_longest_beginning(path: str, key: str) -> None:
    assert name_of(path) == key
