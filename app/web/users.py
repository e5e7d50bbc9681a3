"""People: accounts, roles, sessions, initial passwords (administrators), and tokens for programs (engineers, administrators).

Every change asks for one's own password again (confirmation level C4 of hmi-design.md). An initial password and a token are shown once, in
the answer to the request that made them, and kept nowhere.
"""

from collections.abc import Sequence
from typing import Annotated, Any
from zoneinfo import ZoneInfo

from fastapi import APIRouter, Path, Request
from fastapi.responses import RedirectResponse, Response

from app.access.accounts import Account
from app.access.roles import ROLES, Person, permissions_of
from app.access.tokens import GRANTABLE, Token
from app.errors import Refused
from app.web import format as fmt
from app.web import lessons
from app.web.csv_lines import cells, locale_of
from app.web.guard import allow, field_list, fields, people_access, person_of
from app.web.language import language_of
from app.web.signin import SHOWN_ID, explained, moment, role_names, session_row, view_of
from app.web.trend_views import saved_views

router = APIRouter()

REVIEW = (
    "name", "display", "roles", "disabled", "initial_password", "created", "last_sign_in", "unused", "sessions", "tokens",
    "second_factor", "second_factor_missing",
)  # fmt: skip
"""Columns of the list of accounts as CSV."""

Id = Annotated[int, Path(ge=1, le=2**62)]
LIVES = (7, 30, 90, 365)
"""Days that a token may be good for."""
USUAL_LIFE = 90
"""Days that are offered first."""
UNUSED_DAYS = 90
"""An account that nobody signed in with for more than so many days is marked."""
UTC = ZoneInfo("UTC")
DONE = ("roles", "disabled", "enabled", "deleted", "unlocked", "factor", "renamed", "session", "revoked")


@router.get("/users", dependencies=[allow("administer")])
async def users(request: Request) -> Response:
    """All people, their roles and sessions."""
    return await users_page(request)


@router.get("/users/review", dependencies=[allow("administer")])
async def review(request: Request) -> Response:
    """Every account with its roles and last use, for somebody to look whether it is still needed."""
    view, access = view_of(request), people_access(request)
    now = view.runtime(request).clock.micros()
    rows = [
        {
            "account": account,
            "roles": role_names(request, account),
            "last_seen": moment(request, account.last_seen),
            "created": moment(request, account.created),
            "unused": _is_unused(account, now),
            "lacks_factor": _lacks_factor(request, account),
        }
        for account in await access.people.all()
    ]
    return view.page(
        request,
        "pages/review.html",
        export_url=f"/users/review.csv?locale={language_of(request)}",
        title=view.text(request, "access.review"),
        kind="frame",
        rows=rows,
        days=UNUSED_DAYS,
    )


@router.get("/users/review.csv", dependencies=[allow("administer")])
async def review_csv(request: Request) -> Response:
    """The same as CSV, with times in UTC; `locale`: hr, en, de, cs, or machine, which it is without."""
    locale = locale_of(request)
    access, now = people_access(request), view_of(request).runtime(request).clock.micros()
    sessions, tokens = await access.sessions.of(), await access.tokens.all()
    accounts = await access.people.all()
    lines = [cells(REVIEW, locale)]
    for one in accounts:
        lines.append(
            cells(
                [
                    one.name,
                    one.display,
                    " ".join(sorted(one.roles)),
                    int(one.disabled),
                    int(one.must_change),
                    fmt.iso(one.created, UTC),
                    fmt.iso(one.last_seen, UTC) if one.last_seen else "",
                    int(_is_unused(one, now)),
                    sum(session.person == one.id for session in sessions),
                    sum(token.person == one.id and not token.revoked and token.until > now for token in tokens),
                    int(one.factor),
                    int(_lacks_factor(request, one)),
                ],
                locale,
            )
        )
    await access.audit.record("person.reviewed", person_of(request), accounts=len(accounts))
    return Response(
        "\ufeff".encode() + b"".join(lines),
        media_type="text/csv; charset=utf-8",
        headers={"Content-Disposition": 'attachment; filename="accounts.csv"'},
    )


def _is_unused(account: Account, now: int) -> bool:
    """Whether nobody has signed in with it for so long that it should be asked about."""
    return now - (account.last_seen or account.created) > UNUSED_DAYS * 86_400e6


def _lacks_factor(request: Request, account: Account) -> bool:
    """Whether a role of the account asks for a second factor and it has none."""
    asked = view_of(request).runtime(request).settings.factor_roles
    return bool(account.roles & asked) and not account.factor


@router.post("/users", dependencies=[allow("administer")])
async def add(request: Request) -> Response:
    """Make an account and show its initial password once."""
    person, access = person_of(request), people_access(request)
    given = await fields(request, ["name", "own_password"], ["display"], lists=["roles"])
    try:
        await access.own.confirm(person, given["own_password"])
        account, initial = await access.people.add(
            person, given["name"], given["display"], await field_list(request, "roles")
        )
    except Refused as refused:
        return await users_page(request, refused, typed=given, chosen=await field_list(request, "roles"))
    return await users_page(request, initial=(account, initial))


@router.post("/users/{key}/roles", dependencies=[allow("administer")])
async def set_roles(request: Request, key: Id) -> Response:
    """Give a person another set of roles."""
    return await _changed(request, "roles", ["roles"], lambda by, _: _roles(request, by, key))


@router.post("/users/{key}/name", dependencies=[allow("administer")])
async def rename(request: Request, key: Id) -> Response:
    """Change the name that others read."""
    people = people_access(request).people
    return await _changed(
        request, "renamed", [], lambda by, given: people.rename(by, key, given["display"]), ["display"]
    )


@router.post("/users/{key}/disable", dependencies=[allow("administer")])
async def disable(request: Request, key: Id) -> Response:
    """Shut a person out at once."""
    people = people_access(request).people
    return await _changed(request, "disabled", [], lambda by, _: people.disable(by, key, True))


@router.post("/users/{key}/enable", dependencies=[allow("administer")])
async def enable(request: Request, key: Id) -> Response:
    """Let a person in again."""
    people = people_access(request).people
    return await _changed(request, "enabled", [], lambda by, _: people.disable(by, key, False))


@router.post("/users/{key}/delete", dependencies=[allow("administer")])
async def delete(request: Request, key: Id) -> Response:
    """Remove an account for good, and the faults that its lessons had caused on simulated machines."""
    people = people_access(request).people

    async def work(by: Person, _: Any) -> None:
        await people.delete(by, key)
        await lessons.clear_up(request, key)

    return await _changed(request, "deleted", [], work)


@router.post("/users/{key}/password", dependencies=[allow("administer")])
async def new_password(request: Request, key: Id) -> Response:
    """A new initial password, shown once."""
    person, access = person_of(request), people_access(request)
    given = await fields(request, ["own_password"])
    try:
        await access.own.confirm(person, given["own_password"])
        initial = await access.people.new_initial(person, key)
    except Refused as refused:
        return await users_page(request, refused)
    return await users_page(request, initial=(await access.people.get(key), initial))


@router.post("/users/{key}/factor", dependencies=[allow("administer")])
async def reset_factor(request: Request, key: Id) -> Response:
    """Take the second factor of somebody away who lost it."""
    factors = people_access(request).factors
    return await _changed(request, "factor", [], lambda by, _: factors.reset(by, key))


@router.post("/users/{key}/unlock", dependencies=[allow("administer")])
async def unlock(request: Request, key: Id) -> Response:
    """Let a person try again at once after wrong passwords or codes."""
    await fields(request, [])
    await people_access(request).people.unlock(person_of(request), key)
    return RedirectResponse("/users?done=unlocked", 303)


@router.post("/users/{key}/sessions/end", dependencies=[allow("administer")])
async def end_session(request: Request, key: Id) -> Response:
    """End a session of somebody."""
    access, given = people_access(request), await fields(request, ["session"])
    for session in await access.sessions.of(key):
        if session.id_hash[:SHOWN_ID] == given["session"]:
            await access.sessions.end(person_of(request), session.id_hash)
            return RedirectResponse("/users?done=session", 303)
    raise Refused("access.no_session", 404)


@router.get("/tokens", dependencies=[allow("tokens")])
async def tokens(request: Request) -> Response:
    """Tokens for programs."""
    return await tokens_page(request)


@router.post("/tokens", dependencies=[allow("tokens")])
async def create_token(request: Request) -> Response:
    """Make a token and show it once."""
    person, access = person_of(request), people_access(request)
    given = await fields(request, ["name", "days", "own_password"], lists=["permissions"])
    try:
        if given["days"] not in map(str, LIVES):
            raise Refused("access.token_days", 422, most=max(LIVES))
        await access.own.confirm(person, given["own_password"])
        token, secret = await access.tokens.create(
            person, given["name"], await field_list(request, "permissions"), int(given["days"])
        )
    except Refused as refused:
        return await tokens_page(request, refused, typed=given, chosen=await field_list(request, "permissions"))
    return await tokens_page(request, made=(token, secret))


@router.post("/tokens/{key}/revoke", dependencies=[allow("tokens")])
async def revoke_token(request: Request, key: Id) -> Response:
    """End a token at once."""
    await fields(request, [])
    await people_access(request).tokens.revoke(person_of(request), key)
    return RedirectResponse("/tokens?done=revoked", 303)


async def users_page(
    request: Request,
    refused: Refused | None = None,
    *,
    typed: dict[str, str] | None = None,
    chosen: Sequence[str] = ("operator",),
    initial: tuple[Account, str] | None = None,
) -> Response:
    """The page of people, with what was wrong or the initial password that was made."""
    view, access, me = view_of(request), people_access(request), person_of(request)
    sessions = await access.sessions.of()
    shared = await saved_views(request).shared_by()
    rows = [
        {
            "account": account,
            "shared": shared.get(account.id, 0),
            "roles": role_names(request, account),
            "me": account.id == me.id,
            "lacks_factor": _lacks_factor(request, account),
            "locked": round(access.people.locked(account.name)),
            "last_seen": moment(request, account.last_seen),
            "created": moment(request, account.created),
            "initial_until": moment(request, account.initial_until) if account.must_change else "",
            "sessions": [session_row(request, session) for session in sessions if session.person == account.id],
        }
        for account in await access.people.all()
    ]
    return view.page(
        request,
        "pages/users.html",
        status=refused.status if refused else 200,
        title=view.text(request, "access.users"),
        kind="frame",
        rows=rows,
        all_roles=[
            (role, view.text(request, f"access.role.{role}"), view.text(request, f"access.may.{role}"))
            for role in ROLES
        ],
        typed=typed or {},
        chosen=chosen,
        initial=initial,
        error=explained(request, refused),
        done=_done(request, refused),
        tokens_visible=me.may("tokens"),
    )


async def tokens_page(
    request: Request,
    refused: Refused | None = None,
    *,
    typed: dict[str, str] | None = None,
    chosen: Sequence[str] = ("view",),
    made: tuple[Token, str] | None = None,
) -> Response:
    """The page of tokens, with what was wrong or the token that was made."""
    view, access, me = view_of(request), people_access(request), person_of(request)
    names = {account.id: account.name for account in await access.people.all()}
    now = view.runtime(request).clock.micros()
    rows = [
        {
            "token": token,
            "by": names.get(token.person, ""),
            "permissions": [view.text(request, f"access.permission.{name}") for name in sorted(token.permissions)],
            "until": moment(request, token.until),
            "last_used": moment(request, token.last_used),
            "over": token.revoked or token.until <= now,
            "mine": token.person == me.id or "admin" in me.roles,
        }
        for token in await access.tokens.all()
    ]
    mine = permissions_of(me.roles)
    return view.page(
        request,
        "pages/tokens.html",
        status=refused.status if refused else 200,
        title=view.text(request, "access.tokens"),
        kind="frame",
        rows=rows,
        grantable=[(name, view.text(request, f"access.permission.{name}")) for name in GRANTABLE if name in mine],
        lives=LIVES,
        typed={"days": str(USUAL_LIFE)} | (typed or {}),
        chosen=chosen,
        made=made,
        error=explained(request, refused),
        done=_done(request, refused),
    )


def _done(request: Request, refused: Refused | None) -> str:
    done = request.query_params.get("done", "")
    return view_of(request).text(request, f"access.done.{done}") if done in DONE and refused is None else ""


async def _roles(request: Request, by: Person, key: int) -> None:
    await people_access(request).people.set_roles(by, key, await field_list(request, "roles"))


async def _changed(
    request: Request, done: str, lists: list[str], change: Any, required: list[str] | None = None
) -> Response:
    """Confirm with one's own password, change, and go back to the list."""
    person, access = person_of(request), people_access(request)
    given = await fields(request, ["own_password", *(required or [])], lists=lists)
    try:
        await access.own.confirm(person, given["own_password"])
        await change(person, given)
    except Refused as refused:
        return await users_page(request, refused)
    return RedirectResponse(f"/users?done={done}", 303)
