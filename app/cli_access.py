"""pogon user and pogon audit: people and the audit from the terminal of the server, also beside a running one.

Whoever may read POGON_DATA may do all this: the terminal of the server is the last resort when every password is forgotten.
"""

import csv
import getpass
import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from app import logs
from app.access.roles import ROLES, Person
from app.errors import ConfigurationError, PogonError, Refused
from app.files import read_text

if TYPE_CHECKING:
    from app.access.access import Access
    from app.access.accounts import Account

user_cli = typer.Typer(
    no_args_is_help=True, help="People: add, passwd, role, factor-reset, list. Works beside a running server."
)
audit_cli = typer.Typer(no_args_is_help=True, help="The audit: verify. Works beside a running server.")

COLUMNS = ("name", "display", "roles")
"""Columns of the file of a class; `roles` are separated by spaces, empty means operator."""

LARGEST_LIST = 1024 * 1024
"""Of that file [bytes]."""
MOST_PEOPLE = 1000
"""In that file: each costs a password hash."""

BROKEN = {
    "changed": "was changed",
    "removed": "is missing",
    "inserted": "was put in",
    "cut": "and all after it were cut off",
    "head": "does not agree with audit.head",
    "anchor": "does not agree with audit.anchors",
    "copied": "does not agree with the anchors in {anchors}",
    "mark": "does not agree with the mark in audit.key",
    "wiped": "and all others were wiped",
    "buffer": "was put into audit.buffer by somebody else (see audit.foreign)",
    "unread": "may be in audit.buffer, which is no file that can be read",
}
"""What is wrong with a line of a chain, in words."""

Data = Annotated[Path | None, typer.Option("--data", help="Data folder; else POGON_DATA.")]


@user_cli.command()
def add(
    name: Annotated[str, typer.Argument(help="Name to sign in with.")] = "",
    role: Annotated[
        list[str] | None, typer.Option("--role", "-r", help=f"{', '.join(ROLES)}; may be repeated.")
    ] = None,
    display: Annotated[str, typer.Option(help="Name that others read.")] = "",
    file: Annotated[
        Path | None,
        typer.Option("--file", help="CSV with the columns name, display, roles: a whole class, all or none."),
    ] = None,
    data: Data = None,
) -> None:
    """Make accounts and print their initial passwords, which are good for one sign-in within 24 hours."""
    if bool(name) == bool(file):
        fail("give a NAME, or --file FILE")
    rows = _rows(file) if file else [(name, display, tuple(role or ("operator",)))]
    with opened(data) as access:
        made = access.people.add_now(terminal(), rows)
        out = csv.writer(sys.stdout, lineterminator="\n")
        if file:
            out.writerow(["name", "display", "roles", "initial password"])
        for account, initial in made:
            if file:
                out.writerow([account.name, account.display, " ".join(sorted(account.roles)), initial])
            else:
                typer.echo(f"{account.name} ({', '.join(sorted(account.roles))}) initial password: {initial}")
        if not any("admin" in account.roles and not account.disabled for account in access.people.now()):
            typer.echo(
                "pogon: nobody is an administrator, and with accounts there is no one-time code any more: "
                f"pogon user role {made[0][0].name} admin engineer operator",
                err=True,
            )


@user_cli.command()
def passwd(
    name: Annotated[str, typer.Argument(help="Whose password.")],
    initial: Annotated[bool, typer.Option("--initial", help="Print a new initial password instead of asking.")] = False,
    stdin: Annotated[bool, typer.Option("--stdin", help="Read the password from the first line of the input.")] = False,
    data: Data = None,
) -> None:
    """Set a password; all sessions of the person end."""
    with opened(data, existing=True) as access:
        if initial:
            typer.echo(f"{name} initial password: {access.people.set_password_now(terminal(), name, None)}")
        else:
            password = sys.stdin.readline().rstrip("\n") if stdin else _asked()
            access.people.set_password_now(terminal(), name, password)
            typer.echo(f"{name}: the password is changed, all sessions have ended")
        if any(account.disabled for account in access.people.now() if account.name == name):
            typer.echo(
                f"pogon: {name} is disabled and cannot sign in: an administrator enables people on Users", err=True
            )


@user_cli.command("role")
def role_(
    name: Annotated[str, typer.Argument(help="Whose roles.")],
    roles: Annotated[list[str], typer.Argument(help=f"All roles of the person from now on: {', '.join(ROLES)}.")],
    data: Data = None,
) -> None:
    """Give a person another set of roles; it counts from the next request on."""
    with opened(data, existing=True) as access:
        account = access.people.set_roles_now(terminal(), name, roles)
        typer.echo(f"{account.name}: {', '.join(sorted(account.roles))}")


@user_cli.command("factor-reset")
def factor_reset(
    name: Annotated[str, typer.Argument(help="Whose second factor.")],
    data: Data = None,
) -> None:
    """Take the second factor away from somebody who lost it; all sessions of the person end."""
    with opened(data, existing=True) as access:
        access.factors.reset_now(terminal(), name)
        typer.echo(f"{name}: the second factor is reset, all sessions have ended")


@user_cli.command("list")
def list_(data: Data = None) -> None:
    """Print all accounts."""
    with opened(data, existing=True, reading=True) as access:
        accounts = access.people.now()
        width = max((len(account.name) for account in accounts), default=4)
        for account in accounts:
            typer.echo(
                f"{account.name:<{width}}  {_state(account):<17}  {', '.join(sorted(account.roles)):<35}  "
                f"{'2nd factor' if account.factor else '':<10}  {account.display}"
            )
        if not accounts:
            typer.echo("no account yet: start the server and type the code that it prints")


@audit_cli.command()
def verify(
    data: Data = None,
    anchors: Annotated[
        Path | None, typer.Option("--anchors", exists=True, dir_okay=False, help="Anchors that were kept elsewhere.")
    ] = None,
) -> None:
    """Check the chains of audit and alarm journal: exit code 0 and their lengths, or 1 and the first line that is not in order."""
    from app.alarms import journal

    with opened(data, existing=True, reading=True) as access:
        chains = {
            "audit": access.audit.check_now(anchors),
            "alarm journal": access.audit.check_other_now(
                lambda connection, key: journal.verify(connection, journal.journal_key(key))
            ),
        }
    for name, verdict in chains.items():
        if verdict.ok:
            typer.echo(f"{name} ok: {verdict.count} lines")
        else:
            typer.echo(
                f"{name} broken: line {verdict.bad} {BROKEN[verdict.why].format(anchors=anchors)}; "
                f"{verdict.count} lines before it are in order",
                err=True,
            )
    if not all(verdict.ok for verdict in chains.values()):
        raise typer.Exit(1)


def _state(account: "Account") -> str:
    from app.clock import to_datetime

    if account.disabled:
        return "disabled"
    if account.must_change:
        return "initial password"
    return f"seen {to_datetime(account.last_seen):%Y-%m-%d}" if account.last_seen else "never seen"


@contextmanager
def opened(
    data: Path | None, *, existing: bool = False, as_is: bool = False, reading: bool = False
) -> Iterator["Access"]:
    """People and audit of a data folder; every error of ours is one line and exit code 2.

    `existing`: the database has to be there. `as_is`: and at the revision of this program; no other is touched. `reading`: a folder that
    can only be read, such as a copy that was put away, will do.
    """
    from app.access.access import Access, prepare
    from app.access.former import check_former
    from app.access.restoring import finish_restore
    from app.clock import SystemClock
    from app.db import Database
    from app.plant.texts import Texts
    from app.settings import read_settings

    db: Database | None = None
    access: Access | None = None
    ends = ExitStack()
    try:
        settings = read_settings()
        folder = data or settings.data
        ends.callback(logs.forward(settings.syslog))  # what is done here is a security event, too
        finish_restore(folder)
        if existing and not (folder / "pogon.db").is_file():
            check_former(folder)
            raise ConfigurationError(f"{folder / 'pogon.db'} is not there: start the server once, or give --data")
        if reading and not all(os.access(path, os.W_OK) for path in (folder, folder / "pogon.db")):
            typer.echo(f"pogon: {folder} can only be read: a copy of it is looked at", err=True)
            folder = ends.enter_context(_copied(folder))
        prepare(folder)
        db = Database(folder / "pogon.db", "pogon")
        if as_is and not db.is_newest():
            raise ConfigurationError(f"{db.path} is of another version, or broken")
        db.migrate()
        access = Access(db, SystemClock(), folder)
        yield access
    except Refused as refused:
        fail(Texts.read().text("en", refused.reason, **refused.params))
    except PogonError as error:
        fail(str(error))
    finally:
        if access:
            access.close()
        if db:
            db.close()
        ends.close()


@contextmanager
def _copied(folder: Path) -> Iterator[Path]:
    """A private copy of what stands in a data folder of people and audit, while the context lasts.

    Raises:
        ConfigurationError: a file of it cannot be read, or there is no room for the copy.
    """
    from app.access.keys import OPENED

    with TemporaryDirectory(prefix="pogon-") as name:
        copy = Path(name)
        for path in (folder / one for one in OPENED if one not in ("pogon.db-shm", "history.db")):
            try:
                if path.is_file():
                    (copy / path.name).touch(0o600)
                    shutil.copyfile(path, copy / path.name)
            except OSError as error:
                raise ConfigurationError(f"{path} cannot be copied to {copy}: {error.strerror}") from error
        yield copy


def fail(text: str) -> NoReturn:
    for line in text.splitlines():
        typer.echo(f"pogon: {line}", err=True)
    raise typer.Exit(2)


def terminal() -> Person:
    """Who is named in the audit: the user of the operating system."""
    from app.access.audit.line import printable

    try:
        name = getpass.getuser()
    except (OSError, KeyError):
        name = "?"
    label = printable(f"terminal:{name}", 64)
    return Person(0, label, label, frozenset(), frozenset(), "", address="terminal")


def _asked() -> str:
    first = typer.prompt("New password", hide_input=True)
    if first != typer.prompt("Again", hide_input=True):
        fail("the two passwords differ")
    return str(first)


def _rows(file: Path) -> list[tuple[str, str, tuple[str, ...]]]:
    """The people of a CSV file; comma or semicolon, a heading with at least `name`."""
    try:
        text = read_text(file, LARGEST_LIST)
    except ConfigurationError as error:
        fail(f"{error}, in a CSV file of people")
    first = text.partition("\n")[0]
    lines = text.splitlines()
    reader = csv.DictReader(lines, delimiter=";" if first.count(";") > first.count(",") else ",", restval="")
    try:
        heading = [name.strip().lower() for name in reader.fieldnames or ()]
        reader.fieldnames = heading
        if "name" not in heading or set(heading) - set(COLUMNS):
            fail(f"{file}:1: heading {_cut(', '.join(heading)) or 'is empty'}, expected {', '.join(COLUMNS)}")
        rows: list[tuple[str, str, tuple[str, ...]]] = []
        for row in reader:
            if None in row or not all(text.isprintable() for text in row.values()):
                fail(f"{file}:{reader.line_num}: expected {len(heading)} columns of letters that can be printed")
            if len(rows) == MOST_PEOPLE:
                fail(f"{file}:{reader.line_num}: expected at most {MOST_PEOPLE} people")
            roles = tuple((row.get("roles") or "operator").replace(",", " ").split())
            if row["name"].strip():
                rows.append((row["name"].strip(), row.get("display", "").strip(), roles))
    except csv.Error as error:
        fail(f"{file}:{reader.line_num}: {error}, expected a CSV file of people")
    if not rows:
        fail(f"{file}: nobody in it")
    return rows


def _cut(text: str) -> str:
    shown = "".join(sign if sign.isprintable() else "?" for sign in text[:120])
    return shown + "…" * (len(text) > 120)
