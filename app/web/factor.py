"""One's own second factor: turned on with the QR code and a first code of it, turned off with password and code, recovery codes.

The key and the recovery codes are shown once, in the answer to the request that made them, and are in no address and no store of the
browser. Weighty changes elsewhere go on asking for the password alone: within one session, which began with both, that is enough (21 CFR
11.200); what changes the factor itself asks for both again (ASVS 7.5.1).
"""

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response

from app.errors import Refused
from app.web.guard import allow, fields, people_access, person_of, session_cookie, session_id
from app.web.language import language_of
from app.web.signin import agent_of, explained, moment, view_of

router = APIRouter()

QUIET = 4
"""White modules around a QR code (ISO/IEC 18004)."""
DONE = ("removed",)


@router.get("/account/factor", dependencies=[allow("factor")])
async def factor(request: Request) -> Response:
    """Whether there is one, and what can be done with it."""
    return await factor_page(request)


@router.post("/account/factor/begin", dependencies=[allow("factor")])
async def begin(request: Request) -> Response:
    """Show a new key to the authenticator; it counts once a code of it was given."""
    person, access = person_of(request), people_access(request)
    given = await fields(request, ["own_password"])
    try:
        await access.own.confirm(person, given["own_password"])
        if await access.factors.of(person.id) is not None:
            raise Refused("access.factor.already", 409)
    except Refused as refused:
        return await factor_page(request, refused)
    return await factor_page(request, key=access.factors.begin(person))


@router.post("/account/factor/confirm", dependencies=[allow("factor")])
async def confirm(request: Request) -> Response:
    """Turn it on with a first code; shows the recovery codes, and the browser gets a new session."""
    person, access = person_of(request), people_access(request)
    given = await fields(request, ["code"])
    try:
        sid, codes = await access.factors.enrol(person, given["code"], agent_of(request), session_id(request))
    except Refused as refused:
        return await factor_page(request, refused, key=access.factors.begun(person))
    request.state.csrf = access.form_token(sid)  # this page is already one of the new session
    request.state.person = await access.sessions.find(sid, person.address, agent_of(request))
    response = await factor_page(request, codes=codes)
    session_cookie(response, request, sid)
    return response


@router.post("/account/factor/codes", dependencies=[allow("factor")])
async def new_codes(request: Request) -> Response:
    """Ten new recovery codes; those of before are void."""
    person, access = person_of(request), people_access(request)
    given = await fields(request, ["own_password", "code"])
    try:
        await access.own.confirm(person, given["own_password"])
        codes = await access.factors.renew_codes(person, given["code"])
    except Refused as refused:
        return await factor_page(request, refused)
    return await factor_page(request, codes=codes)


@router.post("/account/factor/remove", dependencies=[allow("factor")])
async def remove(request: Request) -> Response:
    """Turn it off."""
    person, access = person_of(request), people_access(request)
    given = await fields(request, ["own_password", "code"])
    try:
        await access.own.confirm(person, given["own_password"])
        await access.factors.remove(person, given["code"])
    except Refused as refused:
        return await factor_page(request, refused)
    return RedirectResponse("/account/factor?done=removed", 303)


async def factor_page(
    request: Request, refused: Refused | None = None, *, key: str = "", codes: list[str] | None = None
) -> Response:
    """The page, with what was wrong, the key that an authenticator is to read, or the recovery codes that were made."""
    view, access, person = view_of(request), people_access(request), person_of(request)
    known = await access.factors.of(person.id)
    runtime = view.runtime(request)
    plant = runtime.texts.label(language_of(request), runtime.plant.name) if runtime.plant else ""
    path, size = qr_code(provisioning(key, person.name, f"Pogon {plant}".strip())) if key else ("", 0)
    done = request.query_params.get("done", "")
    return view.page(
        request,
        "pages/factor.html",
        status=refused.status if refused else 200,
        title=view.text(request, "access.factor.title"),
        kind="frame",
        factor=known,
        since=moment(request, known.since) if known else "",
        asked=bool(person.roles & runtime.settings.factor_roles),
        must=known is None and person.must_enrol,
        key=" ".join(key[at : at + 4] for at in range(0, len(key), 4)),
        qr_path=path,
        qr_size=size,
        codes=codes or [],
        error=explained(request, refused),
        done=view.text(request, f"access.factor.done.{done}") if done in DONE and not refused and not known else "",
    )


def provisioning(key: str, name: str, issuer: str) -> str:
    """What an authenticator reads (otpauth://totp/…)."""
    from pyotp import TOTP  # a start does not need it

    return TOTP(key, name=name, issuer=issuer.replace(":", " ")).provisioning_uri()


def qr_code(text: str) -> tuple[str, int]:
    """`text` as a QR code: the path that draws its dark modules, one unit each, and the length of a side with its margin."""
    import segno  # nor this

    rows = list(segno.make_qr(text, error="m").matrix_iter(border=QUIET))
    path = []
    for y, row in enumerate(rows):
        start = None
        for x, dark in enumerate([*row, 0]):
            if dark and start is None:
                start = x
            elif not dark and start is not None:
                path.append(f"M{start} {y}h{x - start}v1h-{x - start}z")
                start = None
    return "".join(path), len(rows)
