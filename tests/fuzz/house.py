"""A whole house in virtual time, five people at it, and what is looked at after each request."""

import asyncio
import json
import logging
import re
import shutil
import traceback
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from random import Random

from fastapi import FastAPI

from app import bundled, chance
from app.access.passwords import Cost, Passwords
from app.access.roles import Person, permissions_of
from app.access.signin import SignedIn
from app.runtime import Runtime
from app.settings import Settings
from tests.asgi import Unanswered
from tests.fuzz.asking import FORM, Answer, Request, ask, body_of, needs, talk
from tests.fuzz.pages import Page, broken_csv, broken_json
from tests.fuzz.routes import Routes
from tests.fuzz.values import CSRF, FRESH, NONCE
from tests.own_types import write_own
from tests.virtual import VirtualClient, house
from tests.web.work import Spent, timed

PASSWORD = "tri plave ladice u kutu"
AGENT = "Mozilla/5.0 (X11; Linux x86_64; rv:140.0) Gecko/20100101 Firefox/140.0"
PEOPLE: dict[str, tuple[str, ...]] = {
    "guest": (),
    "ivo": ("operator",),
    "eva": ("engineer",),
    "ada": ("admin", "engineer", "operator"),
    "program": ("engineer", "operator"),
}
"""Who asks; a program has a token and no cookies."""
BESIDE = {"vit": ("viewer",), "tko": ("operator",)}
"""Who has an account only so that something can be done to it."""
BOSS = Person(0, "boss", "boss", frozenset({"admin"}), permissions_of({"admin", "engineer", "operator"}), "")
PLANTS = ("demo", "crane", "epos", "sinamics", "own", "belts", "feeding", "hall", "drive_steps")
OWN = "own"
"""A plant of machines that Pogon does not know (tests/own_types.py)."""
SILENT = re.compile(r"^/(?:readyz|healthz)")
"""Says by its status how the links are."""


@dataclass(frozen=True)
class Fault:
    """What must not be."""

    name: str
    """The same for the same mistake, whoever asks and with whatever values."""
    what: str


class Watch(logging.Handler):
    """Hears errors in the log."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.heard: list[tuple[str, str]] = []

    def emit(self, record: logging.LogRecord) -> None:
        if record.levelno < logging.ERROR and not record.exc_info:
            return
        text, name = record.getMessage(), f"{record.name}: {record.msg}"
        if record.exc_info and record.exc_info[1] is not None:
            error = record.exc_info[1]
            frames = traceback.extract_tb(error.__traceback__)
            own = [one for one in frames if "/app/" in one.filename and "site-packages" not in one.filename]
            place = (own or frames)[-1]
            name = f"{type(error).__name__} {Path(place.filename).name} {place.name}"
            text += "\n" + "".join(traceback.format_exception(error))[-1500:]
        self.heard.append((name, text))


@contextmanager
def _watched() -> Iterator[Watch]:
    watch, root = Watch(), logging.getLogger()
    root.addHandler(watch)
    try:
        yield watch
    finally:
        root.removeHandler(watch)


@contextmanager
def opened(plant: str, folder: Path, seed: int) -> Iterator["House"]:
    """A house with `plant` in a folder of its own, everything random from `seed`."""
    place = folder / "plant"
    if not place.exists():
        if plant == OWN:
            write_own(place)
        else:
            shutil.copytree(bundled("plants") / plant, place)
    chance.use(Random(f"fuzz {seed}"))
    try:
        with _watched() as watch, timed() as spent, house(Settings(plant=place, data=folder / "data")) as client:
            one = House(client, watch, spent)
            client.pass_time(1)
            client.run(one.settle())
            with one.routes.listening():
                yield one
    finally:
        chance.use()


@dataclass
class House:
    """Plays requests and says what is wrong with the answers."""

    client: VirtualClient
    watch: Watch
    spent: Spent
    cookies: dict[str, dict[str, str]] = field(default_factory=dict)
    secret: str = ""
    longest: dict[str, tuple[float, Request]] = field(default_factory=dict)
    """Route → processor time of its longest turn [s], and the request."""
    statuses: Counter[tuple[str, int]] = field(default_factory=Counter)
    page: Page | None = None
    """What the last answer held."""
    whole: dict[str, int] = field(default_factory=dict)
    """Route → the landmarks that its pages have."""

    def __post_init__(self) -> None:
        self.app: FastAPI = self.client.app  # type: ignore[assignment]
        self.runtime: Runtime = self.app.state.runtime
        self.routes = Routes(self.app)
        access = self.runtime.access
        access.passwords._hasher = Passwords(Cost(1, 64, 1))._hasher
        access.throttle.take = lambda _address: True  # type: ignore[method-assign]

    async def settle(self) -> None:
        """Everybody has an account and sits at a browser."""
        for who, roles in (PEOPLE | BESIDE).items():
            if roles:
                await self._enrol(who, roles)
        for who in PEOPLE:
            await self._enter(who)

    async def _enrol(self, who: str, roles: tuple[str, ...]) -> int:
        people = self.runtime.access.people
        account = next((one for one in await people.all() if one.name == who), None)
        if account is None:
            account, _ = await people.add(BOSS, who, "", roles)
        if account.disabled:
            await people.disable(BOSS, account.id, False)
        if account.roles != frozenset(roles):
            await people.set_roles(BOSS, account.id, roles)
        people.set_password_now(BOSS, who, PASSWORD)
        await people.unlock(BOSS, account.id)
        return account.id

    async def _enter(self, who: str) -> None:
        """A session, whatever was done to the account before."""
        if who == "guest":
            self.cookies[who] = {}
            return
        access = self.runtime.access
        await self._enrol(who, PEOPLE[who])
        signed = await access.sign_in.with_password(who, PASSWORD, "127.0.0.1", AGENT)
        if not isinstance(signed, SignedIn):  # somebody turned the second factor on
            raise Unanswered(f"{who} has a second factor")
        self.cookies[who] = {"sid": signed.sid}
        if who == "program":
            person = await access.sessions.find(signed.sid, "127.0.0.1", AGENT)
            assert person is not None
            may = [one for one in ("view", "operate", "stop", "export", "acknowledge") if person.may(one)]
            _, self.secret = await access.tokens.create(person, f"fuzz {self.client.clock.micros()}", may, 30.0)

    def _headers(self, request: Request) -> list[tuple[str, str]]:
        headers = [("user-agent", AGENT)]
        if request.who == "program" and request.address.startswith(("/api/", "/live")):
            return [*headers, ("authorization", f"Bearer {self.secret}")]
        kept = self.cookies[request.who] | {"pogon_lang": request.language}
        headers.append(("cookie", "; ".join(f"{name}={value}" for name, value in kept.items())))
        if request.fragment:
            headers.append(("hx-request", "true"))
        return headers

    async def _made(self, request: Request) -> dict[str, str]:
        """What stands in for the marks of `request`."""
        wanted, made = needs(request), {FRESH: chance.token_hex(16), NONCE: "none"}
        kept = self.cookies[request.who]
        made[CSRF] = self.runtime.access.form_token(kept.get("sid") or kept.get("pre", ""))
        if NONCE in wanted:
            program = request.who == "program"
            asking = Request(request.who, "POST", "/api/v1/nonce") if program else Request(request.who, "GET", "/nonce")
            answer = await ask(self.app, asking, self._headers(asking), b"")
            if answer.status == 200:
                made[NONCE] = json.loads(answer.body)["nonce"]
        return made

    async def play(self, request: Request) -> tuple[Answer | None, list[Fault]]:
        """What came back, and what is wrong with it."""
        if request.wait:
            await asyncio.sleep(request.wait)
        self.watch.heard.clear()
        self.page = None
        template = self.routes.of(request.method, request.address) or "nowhere"
        route = f"{request.method} {template}"
        if request.method == "LIVE":
            return None, [*await self._talk(request, route), *self._overheard(route, request)]
        made = await self._made(request)
        headers = self._headers(request)
        if request.method != "GET":
            headers.append(("content-type", request.kind))
            if request.kind != FORM:
                headers.append(("x-csrf-token", made[CSRF]))
        self.spent.longest = 0.0
        try:
            self.routes.asking = template
            answer = await ask(self.app, request, headers, body_of(request, made))
        except Unanswered as error:
            return None, [Fault(f"{route}: {error}"[:100], str(error)), *self._overheard(route, request)]
        finally:
            self.routes.asking = ""
        self._note_time(route, request)
        self._keep(request.who, answer)
        self.statuses[route, answer.status] += 1
        wrong = [*self._overheard(route, request), *self._wrong(route, request, answer)]
        if answer.status == 401 or answer.headers.get("location", "").startswith(("/signin", "/account")):
            await self._enter(request.who)
        return answer, wrong

    async def _talk(self, request: Request, route: str) -> Iterator[Fault]:
        self.spent.longest = 0.0
        try:
            heard = await talk(self.app, request, self._headers(request))
        except Unanswered as error:
            return iter([Fault(f"{route}: {error}"[:100], str(error))])
        return iter([Fault(f"{route}: {wrong}"[:60], one[:300]) for one in heard for wrong in broken_json(one)])

    def _note_time(self, route: str, request: Request) -> None:
        if self.spent.longest > self.longest.get(route, (0.0, request))[0]:
            self.longest[route] = (self.spent.longest, request)

    def _overheard(self, route: str, request: Request) -> list[Fault]:
        found = [Fault(name, f"{route}: {text}") for name, text in self.watch.heard]
        self.watch.heard.clear()
        return found

    def _keep(self, who: str, answer: Answer) -> None:
        for cookie in answer.cookies:
            name, _, value = cookie.partition(";")[0].partition("=")
            if name in ("sid", "pre") and who in self.cookies:
                if not value or value == '""' or "max-age=0" in cookie.lower():
                    self.cookies[who].pop(name, None)
                else:
                    self.cookies[who][name] = value

    def _wrong(self, route: str, request: Request, answer: Answer) -> Iterator[Fault]:
        if answer.status >= 500 and not (
            answer.status == 503 and (SILENT.match(request.address) or request.method == "POST")
        ):
            yield Fault(f"{route}: {answer.status}", answer.body[-600:].decode("utf-8", "replace"))
        location = answer.headers.get("location", "/")
        if not location.startswith("/") or location.startswith(("//", "/\\")):
            yield Fault(f"{route}: leads elsewhere", location[:200])
        if any(ord(letter) < 32 and letter != "\t" for value in answer.headers.values() for letter in value):
            yield Fault(f"{route}: a control sign in a header", str(answer.headers)[:300])
        try:
            text = answer.text
        except UnicodeDecodeError as error:
            if answer.content.startswith(("text/", "application/json")):
                yield Fault(f"{route}: no text", str(error))
            return
        if answer.content == "text/html":
            yield from self._wrong_page(route, request, answer, text)
        elif answer.content == "application/json":
            yield from (Fault(f"{route}: {wrong}"[:60], f"{wrong}: {text[:300]}") for wrong in broken_json(text))
        elif answer.content == "text/csv" and answer.status == 200:
            yield from (Fault(f"{route}: in a file", wrong) for wrong in broken_csv(text, request.address))

    def _wrong_page(self, route: str, request: Request, answer: Answer, text: str) -> Iterator[Fault]:
        page = self.page = Page(text)
        if answer.status == 200:
            self.routes.learn(page, request.address)
        yield from (Fault(f"{route}: text became a part of the page", wrong) for wrong in page.wrong)
        if "\x00" in text:
            yield Fault(f"{route}: a nul in the page", text[max(0, text.index("\x00") - 200) :][:300])
        if not page.marks["html"]:
            return
        if page.marks["html"] != 1 or not text.rstrip().endswith("</html>"):
            yield Fault(f"{route}: the page does not end", text[-300:])
        if answer.status == 200 and request.method == "GET":
            lost = [name for name in ("header", "main", "footer") if not page.marks[name]]
            had = self.whole.setdefault(route, sum(1 for name in page.marks if page.marks[name]))
            if lost and had > sum(1 for name in page.marks if page.marks[name]):
                yield Fault(f"{route}: lost its frame", f"{lost}: {text[:300]}")

    async def after(self, brief: bool = False, fault: str = "") -> list[Fault]:
        """Look at all pages, files and routes, the audit's chain, the tasks; `brief`: at two of a kind; or for one `fault`."""
        found: list[Fault] = []
        for number, address in enumerate(self.routes.addresses(2) if brief else self.routes.addresses()):
            if " GET /" in fault and f" GET {self.routes.of('GET', address)}:" not in fault:
                continue
            once = brief or number % 2 or self.routes.costly(address)
            for who in ("ada",) if once else ("ada", ("ivo", "guest", "eva")[number % 3]):
                _, wrong = await self.play(Request(who, "GET", address))
                found += [Fault(f"after: {one.name}", f"{address}\n{one.what}") for one in wrong]
        await asyncio.sleep(1.0)
        found += [Fault(f"after: {one.name}", one.what) for one in self._overheard("after", Request("", "", ""))]
        verdict = await self.runtime.access.audit.check()
        if not verdict.ok:
            found.append(Fault("the chain of the audit", str(verdict)))
        for kept in self.runtime.supervisor.tasks.values():
            if kept.failures or kept.task is None or kept.task.done():
                found.append(Fault(f"task {kept.name}", kept.error or "over"))
        return found
