"""Who a session is and what it allows now: roles, idleness, a password or a second factor that is still to be chosen. Pure."""

from collections.abc import Set
from dataclasses import replace
from typing import Any

from app.access.roles import ACTING, ENROLLING, FORCED, IDLE, Person, permissions_of
from app.access.session_times import IDLE_AFTER


def person_of(row: Any, roles: frozenset[str], address: str, quiet: float, factor_roles: Set[str]) -> Person:
    """The person of `row`, who has done nothing for `quiet` [s] and asks from `address`.

    An idle session only watches; so does one with power that moved to another address. Who has one of `factor_roles` and no second
    factor yet only enrols one, who has an initial password only chooses another.
    """
    acting = bool(roles & ACTING)
    moved = bool(roles & {"engineer", "admin"}) and address != row.address
    idle = acting and (quiet >= IDLE_AFTER or moved)
    allowed = permissions_of(roles)
    if idle:
        allowed &= IDLE
    must_enrol = bool(roles & factor_roles) and row.factor_since is None and not row.must_change
    if row.must_change:
        allowed &= FORCED
    elif must_enrol:
        allowed &= ENROLLING
    return Person(
        id=row.id,
        name=row.name,
        display=row.display,
        roles=roles,
        permissions=allowed,
        session=row.id_hash,
        language=row.language,
        theme=row.theme,
        address=address,
        idle=idle,
        must_change=bool(row.must_change),
        must_enrol=must_enrol,
        idle_in=max(0.0, IDLE_AFTER - quiet) if acting and not idle else 0.0,
    )


def watching(person: Person) -> Person:
    """`person` with what is left when nobody knows more: watching and Stop."""
    return replace(person, permissions=person.permissions & IDLE, idle=True, idle_in=0.0)
