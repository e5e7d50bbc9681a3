"""The written table of rights, and what is left of them in special states."""

import pytest

from app.access.roles import (
    FORCED,
    GUEST,
    IDLE,
    PERMISSIONS,
    ROLES,
    Person,
    known_roles,
    may_watch,
    permissions_of,
    permitted,
)

TABLE = {
    #                viewer operator engineer admin
    "view": (True, True, True, True),
    "account": (True, True, True, True),
    "factor": (True, True, True, True),
    "export": (True, True, True, True),
    "views": (True, True, True, True),
    "annotate": (False, True, True, False),
    "share": (False, True, True, True),
    "stop": (False, True, True, False),
    "acknowledge": (False, True, True, False),
    "operate": (False, True, True, False),
    "shelve": (False, True, True, False),
    "diagnose": (False, True, True, True),
    "configure": (False, False, True, False),
    "instruct": (False, False, True, False),
    "audit.own": (False, True, True, True),
    "audit": (False, False, True, True),
    "tokens": (False, False, True, True),
    "administer": (False, False, False, True),
}


def person(*roles: str) -> Person:
    return Person(1, "ana", "Ana", frozenset(roles), permissions_of(roles), "hash")


def test_the_table_is_whole() -> None:
    assert set(TABLE) == set(PERMISSIONS)


@pytest.mark.parametrize("permission", TABLE)
def test_each_role_has_exactly_these_permissions(permission: str) -> None:
    assert tuple(person(role).may(permission) for role in ROLES) == TABLE[permission]


def test_an_administrator_is_not_an_operator_but_a_person_may_be_both() -> None:
    assert not person("admin").may("stop")
    assert person("admin", "operator").may("stop")


def test_a_guest_watches_only_while_all_is_simulated() -> None:
    assert permitted(None, "view", simulated=True)
    assert not permitted(None, "view", simulated=False)
    assert [p for p in PERMISSIONS if permitted(None, p, simulated=True)] == sorted(GUEST)


def test_nobody_has_a_permission_that_is_not_in_the_table() -> None:
    assert not permitted(person(*ROLES), "fly", simulated=True)


def test_idling_leaves_watching_and_stop_and_an_initial_password_leaves_the_own_account() -> None:
    assert frozenset({"view", "account", "stop"}) == IDLE
    assert frozenset({"account"}) == FORCED


@pytest.mark.parametrize(
    ("kind", "viewer", "engineer", "guest"),
    [
        ("overview", True, True, True),
        ("equipment/m1", True, True, True),
        ("parameters/m1", False, True, False),
        ("communication", False, True, False),
        ("instructor", False, True, False),
        ("frame", True, True, True),
    ],
)
def test_a_socket_asks_for_the_rights_of_its_page(kind: str, viewer: bool, engineer: bool, guest: bool) -> None:
    assert may_watch(person("viewer"), kind, simulated=False) is viewer
    assert may_watch(person("engineer"), kind, simulated=False) is engineer
    assert may_watch(None, kind, simulated=True) is guest


def test_an_unknown_role_is_refused() -> None:
    with pytest.raises(ValueError, match="boss is not a role"):
        known_roles(["operator", "boss"])
