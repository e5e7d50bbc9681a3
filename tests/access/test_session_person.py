"""What a session allows, for every set of roles and every state it may be in."""

from itertools import combinations, product
from types import SimpleNamespace

import pytest

from app.access.roles import ENROLLING, FORCED, IDLE, ROLES, permissions_of
from app.access.session_person import person_of, watching
from app.access.session_times import IDLE_AFTER

SETS = [frozenset(held) for count in range(len(ROLES) + 1) for held in combinations(ROLES, count)]
FACTOR = frozenset({"engineer"})


def row(must_change: bool, since: int | None) -> SimpleNamespace:
    return SimpleNamespace(
        id=3,
        name="ana",
        display="Ana",
        id_hash="ab" * 32,
        language="hr",
        theme="",
        address="10.0.0.1",
        must_change=must_change,
        factor_since=since,
    )


@pytest.mark.parametrize("roles", SETS, ids=lambda held: "+".join(sorted(held)) or "none")
def test_nothing_is_allowed_beyond_what_roles_idleness_password_and_factor_leave(roles: frozenset[str]) -> None:
    states = product((0.0, IDLE_AFTER - 1, IDLE_AFTER, 9e9), ("10.0.0.1", "10.0.0.2"), (False, True), (None, 5))
    for quiet, address, must_change, since in states:
        person = person_of(row(must_change, since), roles, address, quiet, FACTOR)
        acts, powerful = bool(roles - {"viewer"}), bool(roles & {"engineer", "admin"})
        idle = acts and (quiet >= IDLE_AFTER or (powerful and address != "10.0.0.1"))
        enrol = "engineer" in roles and since is None and not must_change
        wanted = permissions_of(roles)
        for applies, left in ((idle, IDLE), (must_change, FORCED), (enrol, ENROLLING)):
            wanted = wanted & left if applies else wanted
        assert person.permissions == wanted
        assert (person.idle, person.must_change, person.must_enrol) == (idle, must_change, enrol)
        assert person.idle_in == (IDLE_AFTER - quiet if acts and not idle else 0.0)
        assert (person.id, person.session, person.address, person.roles) == (3, "ab" * 32, address, roles)


@pytest.mark.parametrize("roles", SETS, ids=lambda held: "+".join(sorted(held)) or "none")
def test_who_only_watches_may_stop_if_they_might_and_nothing_else(roles: frozenset[str]) -> None:
    left = watching(person_of(row(False, 5), roles, "10.0.0.1", 0.0, FACTOR))
    assert left.permissions == permissions_of(roles) & IDLE
    assert left.idle
    assert left.idle_in == 0
