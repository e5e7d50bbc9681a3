"""Who may do what: a set of roles per person, a written table from permission to roles, and nothing else.

Sources: reference/security.md section 5, precedence.md. An administrator is not an operator (separation of duties): administering
people gives no command over the plant. The first account has three roles and so may do everything.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

ROLES = ("viewer", "operator", "engineer", "admin")
"""All roles; a person has a set of them."""
FIRST_ROLES = frozenset({"admin", "engineer", "operator"})
"""Roles of the first account."""

ALL = frozenset(ROLES)
OPERATING = frozenset({"operator", "engineer"})

PERMISSIONS: Mapping[str, frozenset[str]] = {
    "view": ALL,  # levels 1-3: plant, machines, alarms, trends, live values
    "account": ALL,  # one's own password, sessions, language
    "factor": ALL,  # one's own second factor
    "export": ALL,
    "views": ALL,  # one's own views of trends, and those that others share
    "annotate": OPERATING,  # notes on trends
    "share": frozenset({"operator", "engineer", "admin"}),  # one's own view of trends with all
    "stop": OPERATING,  # Stop and release; also after idling
    "acknowledge": OPERATING,  # acknowledge, silence, comment
    "operate": OPERATING,  # start, setpoint, mode, sequence, hold-to-run
    "shelve": OPERATING,
    "diagnose": frozenset({"operator", "engineer", "admin"}),  # communication, storage
    "configure": frozenset({"engineer"}),  # level 4: parameters, forcing, alarm limits, import, reload, API pages
    "instruct": frozenset({"engineer"}),  # faults of the simulated plant
    "audit.own": frozenset({"operator", "engineer", "admin"}),  # what one has done oneself
    "audit": frozenset({"engineer", "admin"}),
    "tokens": frozenset({"engineer", "admin"}),
    "administer": frozenset({"admin"}),  # people, roles, network, backup, verifying the audit
}
"""Permission → roles that have it. A permission that is not here is nobody's."""

PUBLIC = "open"
"""What a route declares that needs no sign-in (sign-in itself, static files, health)."""
GUEST = frozenset({"view"})
"""What a visitor without sign-in may do, and only while every link of the plant is simulated."""
IDLE = frozenset({"view", "account", "stop"})
"""What is left of somebody's permissions after idling: watching goes on, and Stop is never hindered."""
FORCED = frozenset({"account"})
"""What is left while an initial password still has to be changed."""
ENROLLING = frozenset({"factor", "stop"})
"""What is left while somebody whose role asks for a second factor has none."""
ACTING = OPERATING | {"admin"}
"""Roles whose idle session is downgraded; a viewer just goes on watching."""
ROLE_PERMISSION: Mapping[str, str] = {
    "viewer": "view",
    "operator": "operate",
    "engineer": "configure",
    "admin": "administer",
}
"""The permission that a command or a setpoint of an equipment type asks for with `role = "…"`."""
RECORDED = frozenset({"configure", "instruct", "administer", "tokens"})
"""Changes under these are refused with 503 while the audit cannot be written; Stop and acknowledge go on."""


def permissions_of(roles: Iterable[str]) -> frozenset[str]:
    """Everything that somebody with `roles` may do."""
    held = frozenset(roles)
    return frozenset(permission for permission, allowed in PERMISSIONS.items() if held & allowed)


def known_roles(roles: Iterable[str]) -> frozenset[str]:
    """`roles` as a set.

    Raises:
        ValueError: one of them is not a role.
    """
    held = frozenset(roles)
    if unknown := sorted(held - ALL):
        raise ValueError(f"{', '.join(unknown)} is not a role: {', '.join(ROLES)}")
    return held


@dataclass(frozen=True, slots=True)
class Person:
    """Whoever makes a request: signed in, or a program with an API token."""

    id: int
    """Never used again for another person; 0 for a token."""
    name: str
    display: str
    roles: frozenset[str]
    permissions: frozenset[str]
    """What is allowed now: less than the roles give after idling or before an initial password is changed."""
    session: str
    """SHA-256 of the session id [hex], or `token-<id>`: never the id itself."""
    language: str = ""
    theme: str = ""
    address: str = ""
    idle: bool = False
    """True after 15 min without a deed: the session watches until the password is given again."""
    must_change: bool = False
    """True while an initial password still has to be changed."""
    must_enrol: bool = False
    """True while a role asks for a second factor and there is none."""
    idle_in: float = 0.0
    """Seconds until this session is downgraded; 0 when it never is, or is already."""

    def may(self, permission: str) -> bool:
        """Whether this person may do `permission` now."""
        return permission in self.permissions


Rights = Callable[[Person], Person | None]
"""A person as of now, without waiting; None when the session is over."""
SYSTEM = Person(0, "system", "system", frozenset(), frozenset(), "")
"""Who is named in the audit for what the server does by itself."""


def permitted(person: Person | None, permission: str, *, simulated: bool) -> bool:
    """Whether `person` (None: not signed in) may do `permission`; a guest only while the plant is `simulated`."""
    if permission == PUBLIC:
        return True
    if person is None:
        return simulated and permission in GUEST
    return person.may(permission)


def may_watch(person: Person | None, kind: str, *, simulated: bool) -> bool:
    """Whether `person` may have a socket for pages of this `kind` (`overview`, `equipment/m1`, `parameters/m1` …)."""
    return permitted(person, KIND_PERMISSION.get(kind.partition("/")[0], "view"), simulated=simulated)


KIND_PERMISSION: Mapping[str, str] = {
    "frame": PUBLIC,  # whether the server lives and how many alarms there are: also beside the sign-in form
    "parameters": "diagnose",  # to read; writing asks for "configure"
    "communication": "diagnose",
    "storage": "diagnose",
    "lessons": "operate",
    "instructor": "instruct",
    "users": "administer",
    "audit": "audit",
}
"""Kinds of pages whose values need more than `view`."""
