"""The table of accounts: rows as they are read, and changes inside a transaction with the lines of the audit that tell of them."""

import re
import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, Connection, delete, func, insert, select, update
from sqlalchemy.exc import IntegrityError

from app.access.audit.audit import Audit
from app.access.audit.kinds import Kind
from app.access.audit.line import Entry, printable
from app.access.factors import factor_of
from app.access.roles import Person, known_roles
from app.access.sessions import end_all, roles_of
from app.access.tables import person_table, role_table
from app.access.tokens import revoke_all
from app.clock import Clock
from app.errors import Refused

INITIAL_LIFE = 24 * 3600.0
"""An initial password is good for one sign-in within so long [s]."""
RESERVED = frozenset({"system", "guest"})


@dataclass(frozen=True, slots=True)
class Account:
    """A person's account, without its password."""

    id: int
    name: str
    display: str
    roles: frozenset[str]
    disabled: bool
    must_change: bool
    initial_until: int | None
    """Until when the initial password is good [µs UTC]; None when it was changed."""
    created: int
    last_seen: int | None
    """Last sign-in [µs UTC]."""
    language: str = ""
    theme: str = ""
    factor: bool = False
    """Whether a code is asked for after the password."""


class Accounts:
    """Makes and changes accounts; each work is one inside a transaction of the caller."""

    def __init__(self, clock: Clock, audit: Audit) -> None:
        self._clock = clock
        self._audit = audit

    def add(
        self, connection: Connection, by: Person, key: str, label: str, roles: frozenset[str], kept: str
    ) -> tuple[Account, Sequence[Entry]]:
        """Make an account with an initial password, whose hash is `kept`.

        Raises:
            Refused: 409, the name is taken.
        """
        until = self._clock.micros() + round(INITIAL_LIFE * 1e6)
        account = self.insert(connection, key, label, roles, kept, until)
        return account, [self._audit.entry("person.added", by, key, new=roles, display=label)]

    def insert(
        self, connection: Connection, key: str, label: str, roles: frozenset[str], kept: str, initial_until: int | None
    ) -> Account:
        """Make an account; `initial_until` [µs UTC] says how long its password is an initial one, None that it is none.

        Raises:
            Refused: 409, the name is taken.
        """
        values = {
            "name": key,
            "display": label,
            "password": kept,
            "must_change": initial_until is not None,
            "initial_until": initial_until,
            "disabled": False,
            "language": "",
            "theme": "",
            "created": self._clock.micros(),
        }
        try:
            connection.execute(insert(person_table).values(**values))
        except IntegrityError as error:
            raise Refused("access.name_taken", 409, name=key) from error
        row = row_of(connection, person_table.c.name == key)
        connection.execute(insert(role_table), [{"person": row.id, "role": role} for role in sorted(roles)])
        return account_of(connection, row)

    def set_roles(
        self, connection: Connection, by: Person, person_id: int, roles: Iterable[str]
    ) -> tuple[Account, Sequence[Entry]]:
        """Give a person other roles.

        Raises:
            Refused: nobody of this id (404), no or unknown roles (422), or the last administrator would be gone (409).
        """
        account, held = known_account(connection, person_id), usable_roles(roles)
        with keeping_an_admin(connection):
            connection.execute(delete(role_table).where(role_table.c.person == person_id))
            connection.execute(insert(role_table), [{"person": person_id, "role": role} for role in sorted(held)])
        return known_account(connection, person_id), [
            self._audit.entry("person.roles", by, account.name, account.roles, held)
        ]

    def set_password(
        self, connection: Connection, by: Person, person_id: int, kept: str, *, initial: bool
    ) -> tuple[tuple[Account, list[str]], Sequence[Entry]]:
        """Set the password whose hash is `kept`; the account and the sessions that ended by it.

        Raises:
            Refused: 404, nobody of this id.
        """
        account = known_account(connection, person_id)
        until = self._clock.micros() + round(INITIAL_LIFE * 1e6) if initial else None
        change = update(person_table).where(person_table.c.id == person_id)
        connection.execute(change.values(password=kept, must_change=initial, initial_until=until))
        ended = end_all(connection, person_id)
        kind: Kind = "password.initial" if initial else "password.set"
        lines = [self._audit.entry(kind, by, account.name)]
        if by.id != person_id:  # reset by somebody else: what was given out under the old one ends, too
            lines += [self._audit.entry("token.revoked", by, name) for name in revoke_all(connection, person_id)]
        return (account, ended), lines


def account_name(name: str) -> str:
    """`name` as accounts are looked up: one spelling for all ways to type it."""
    return unicodedata.normalize("NFKC", name).strip().casefold()[:64]


def usable_name(name: str) -> str:
    """A name for an account: 2 to 32 letters, digits, dots, dashes, underscores.

    Raises:
        Refused: 422.
    """
    key = account_name(name)
    if not re.fullmatch(r"\w[\w.-]{1,31}", key) or key in RESERVED:
        raise Refused("access.name_unusable", 422, name=printable(name, 40))
    return key


def usable_display(display: str, name: str) -> str:
    """The name that others read, at most 80 characters; without one the account's name.

    Raises:
        Refused: 422, too long.
    """
    label = " ".join(unicodedata.normalize("NFC", display).split()) or name
    if len(label) > 80:
        raise Refused("access.display_long", 422, most=80)
    return printable(label, 80)


def count_accounts(connection: Connection) -> int:
    """Number of accounts, disabled ones too."""
    return connection.execute(select(func.count()).select_from(person_table)).scalar_one()


def all_accounts(connection: Connection) -> list[Account]:
    """All accounts by name."""
    rows = connection.execute(select(person_table).order_by(person_table.c.name)).all()
    return [account_of(connection, row) for row in rows]


def usable_roles(roles: Iterable[str]) -> frozenset[str]:
    """`roles` as a set.

    Raises:
        Refused: 422, one is unknown, or there is none.
    """
    try:
        held = known_roles(roles)
    except ValueError as error:
        raise Refused("access.no_role", 422, roles=printable(", ".join(roles), 80)) from error
    if not held:
        raise Refused("access.needs_role", 422)
    return held


def row_of(connection: Connection, condition: ColumnElement[bool]) -> Any:
    """The first account of which `condition` is true; None = there is none."""
    return connection.execute(select(person_table).where(condition)).first()


def account_of(connection: Connection, row: Any) -> Account:
    """The account of `row`, with its roles."""
    return Account(
        id=row.id,
        name=row.name,
        display=row.display,
        roles=roles_of(connection, row.id),
        disabled=bool(row.disabled),
        must_change=bool(row.must_change),
        initial_until=row.initial_until,
        created=row.created,
        last_seen=row.last_seen,
        language=row.language,
        theme=row.theme,
        factor=factor_of(connection, row.id) is not None,
    )


def find_account(connection: Connection, person_id: int) -> Account | None:
    """The account of this id; None = there is none."""
    row = row_of(connection, person_table.c.id == person_id)
    return account_of(connection, row) if row else None


def known_account(connection: Connection, person_id: int) -> Account:
    """The account of this id.

    Raises:
        Refused: 404, there is none.
    """
    account = find_account(connection, person_id)
    if account is None:
        raise Refused("access.no_person", 404, id=person_id)
    return account


def id_of(connection: Connection, name: str) -> int:
    """Id of the account `name`.

    Raises:
        Refused: 404, there is none.
    """
    row = row_of(connection, person_table.c.name == account_name(name))
    if row is None:
        raise Refused("access.no_person", 404, id=printable(name, 40))
    return int(row.id)


def admin_names(connection: Connection) -> frozenset[str]:
    """Names of the administrators who can sign in."""
    query = (
        select(person_table.c.name)
        .join(role_table, role_table.c.person == person_table.c.id)
        .where(role_table.c.role == "admin", person_table.c.disabled.is_(False))
    )
    return frozenset(connection.execute(query).scalars())


@contextmanager
def keeping_an_admin(connection: Connection) -> Iterator[None]:
    """Refuse what would leave no administrator who can sign in."""
    before = admin_names(connection)
    yield
    if before and not admin_names(connection):
        raise Refused("access.last_admin", 409)


def as_person(account: Account, session: str, address: str) -> Person:
    """Whoever has `account`, for lines of the audit: without rights."""
    return Person(account.id, account.name, account.display, account.roles, frozenset(), session, address=address)
