"""The same house, but its people sit at browsers: everything they do goes through the application, as forms and over sockets."""

import asyncio
import json
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial

from pyotp import TOTP

from app.access.sessions import hash_of
from app.commands.lifecycle import ProgressState
from app.errors import PogonError, Refused
from app.main import create_app
from app.runtime import Runtime
from app.settings import Settings
from app.web import socket
from app.web.guard import permissions
from tests.storm.browser import Answer, Browser
from tests.storm.world import ADDRESS, AGENT, PASSWORD, World
from tests.virtual import inline

KEY = re.compile(r'<p class="mono u-key"[^>]*>([A-Z2-7 ]+)</p>')
CODES = re.compile(r"<li>([0-9A-Z]{4}(?:-[0-9A-Z]{4}){3})</li>")
"""As the page of the second factor shows them."""
FORMS = {
    "shelve": "shelve",
    "once": "shelve",
    "unshelve": "unshelve",
    "take_out": "take-out",
    "put_back": "put-back",
}
"""How somebody hides an alarm → the form for it."""
REFUSED = {401, 403, 404}
"""Answers to a Stop of somebody who may not, or of a machine that is not there."""


@dataclass
class WebWorld(World):
    """A world of browsers."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.browsers: dict[str, Browser] = {}
        self.looked = self.enrolled = 0
        self.codes: dict[str, list[str]] = {}
        """Recovery codes of whoever has a second factor."""

    def _build(self) -> Runtime:
        self.app = create_app(Settings(plant=self.plant_folder, data=self.data), self.clock, inline)
        self.app.state.runtime = runtime = Runtime(
            Settings(plant=self.plant_folder, data=self.data), self.clock, inline
        )
        for browser in self.browsers.values():
            browser.app = self.app
        return runtime

    def _started(self) -> None:
        sockets = socket.sockets_of(self.app)
        self.runtime.access.subscribe(sockets.end, sockets.end)

    async def stop(self) -> None:
        """As systemd does."""
        self._forget_unwritten()
        self.down = True
        await socket.sockets_of(self.app).close()
        await self.runtime.stop()

    def _browser(self, who: str) -> Browser | None:
        if self.down:
            return None
        if who not in self.browsers:
            self.browsers[who] = Browser(self.app, AGENT, ADDRESS)
        return self.browsers[who]

    def _note(self, what: str, answer: Answer) -> Answer:
        self.trace(f"{self.now:.6f} {what} -> {answer.status}")
        if answer.status == 500:
            self.errors.append(f"{what}: 500 {answer.text[:200]}")
        return answer

    async def _send(self, who: str, path: str, **form: str | list[str]) -> Answer | None:
        browser = self._browser(who)
        if browser is None:
            return None
        return self._note(f"{who} {path}", await browser.post(path, form))

    async def _nonce(self, who: str) -> str | None:
        browser = self._browser(who)
        if browser is None:
            return None
        answer = self._note(f"{who} nonce", await browser.get("/nonce"))
        return str(json.loads(answer.body)["nonce"]) if answer.status == 200 else None

    # ---- people

    async def _do_enter(self, who: str) -> None:
        codes = self.codes.get(who)
        browser = self._browser(who)
        if browser is not None and await browser.sign_in(who, PASSWORD, codes.pop(0) if codes else ""):
            self.sids[who] = browser.cookies["sid"]

    async def _do_factor(self, who: str, seconds: float) -> None:
        """Somebody turns the second factor on, signs in with it, and turns it off."""
        browser = self._browser(who)
        if browser is None or not self.sids.get(who) or self.codes.get(who):
            return
        page = await self._send(who, "/account/factor/begin", own_password=PASSWORD)
        shown = KEY.search(page.text) if page else None
        if shown is None:
            return
        code = TOTP(shown[1].replace(" ", "")).at(self.clock.micros() // 1_000_000)
        page = await self._send(who, "/account/factor/confirm", code=code)
        if page is None or page.status != 200:
            return
        self.codes[who] = CODES.findall(page.text)
        self.sids[who] = browser.cookies.get("sid", "")
        self.enrolled += 1
        await asyncio.sleep(seconds)
        await self._do_leave(who)
        await self._do_enter(who)
        left = self.codes[who]
        gone = await self._send(who, "/account/factor/remove", own_password=PASSWORD, code=left.pop(0) if left else "")
        if gone is not None and gone.status == 303:
            self.codes[who] = []

    async def _do_leave(self, who: str) -> None:
        browser = self._browser(who)
        if browser is None or not self.sids.get(who):
            return
        sid, known = browser.cookies.get("sid", ""), await self.person(who)
        answer = await self._send(who, "/signout")
        mine = known is not None and known.session == hash_of(sid)
        told = answer is not None and answer.status == 303 and not self.down
        if mine and told:
            self.rights.end(who, sid)

    async def _do_look(self, who: str) -> None:
        browser = self._browser(who)
        if browser is None or not self.sids.get(who):
            return
        self.looked += 1
        pages = list(self._pages())
        for path in ("/", pages[self.looked % len(pages)], pages[(7 * self.looked + 3) % len(pages)]):
            self._note(f"{who} {path}", await browser.get(path))
        async with browser.socket() as page:
            page.say(subscribe="overview", rev=0)
            await asyncio.sleep(5)
            self.trace(f"{who} saw {page.frames} frames")

    def _pages(self) -> Iterator[str]:
        """Every page, list and file that is read by its address alone, for each machine that there is."""
        for route in sorted(permissions(self.app)):
            method, _, path = route.partition(" ")
            if method != "GET" or path.startswith("/static"):
                continue
            found = {path}
            for name, values in self._given().items():
                found = {one.replace(name, value) for one in found for value in values}
            yield from sorted(one for one in found if "{" not in one)

    def _given(self) -> dict[str, tuple[str, ...]]:
        """What parts of an address may be here."""
        kinds = ("passage", "run", "coil")
        return {
            "{key}": self.machines, "{id}": self.machines, "{kind}": kinds, "{number}": ("1",), "{occurrence}": ("1",),
            "{unit}": ("1",), "{part}": ("commands", "alarms"), "{command}": ("stop", "reset"),
            "{table}": ("products", "steps"), "{name}": ("hall", "m1.speed"),
        }  # fmt: skip

    async def _do_program(self, who: str, machine: str, number: int, seconds: float) -> None:
        person, app = await self.person(who), self.app
        if person is None:
            return
        allowed = [one for one in ("view", "operate", "stop", "export") if person.may(one)]
        token, secret = await self.runtime.access.tokens.create(person, f"{number} {self.now}", allowed, 1.0)
        program = Browser(app, AGENT, ADDRESS, secret)
        async with program.socket() as page:
            page.say(subscribe=f"tags/{','.join(list(self.runtime.points)[number % 50 :: 97])}", rev=0)
            for path in ("/api/v1/tags", "/api/v1/alarms", f"/api/v1/equipment/{machine}/commands", "/api/v1/records"):
                self._note(f"program of {who} {path}", await program.get(path))
            await self._order_as(program, who, machine, number)
            await asyncio.sleep(seconds)
            if self.down or self.app is not app:
                return
            again = await self.person(who)
            if again is None:
                return
            await self.runtime.access.tokens.revoke(again, token.id)
            answer = self._note(f"program of {who} is over", await program.get("/api/v1/tags"))
            await asyncio.sleep(1.0)
            if answer.status == 200 or not (page.closed or self.down or self.app is not app):
                self.errors.append(f"a token that was revoked: {answer.status}, its socket closed: {page.closed}")

    async def _order_as(self, program: Browser, who: str, machine: str, number: int) -> None:
        command = self._choose(machine, number, hold=False)
        nonce = await program.order("/api/v1/nonce")
        if command is None or nonce.status != 200:
            return
        if number % 2:
            self._note("program takes", await program.order(f"/api/v1/equipment/{machine}/control/take"))
        given = {
            "id": self._order(who, machine, command.key),
            "nonce": json.loads(nonce.body)["nonce"],
            "confirmed": True,
        }
        answer = await program.order(f"/api/v1/equipment/{machine}/commands/{command.key}", **given)
        self._note(f"program orders {command.key}", answer)
        self._note("program gives", await program.order(f"/api/v1/equipment/{machine}/control/release"))

    async def _do_take(self, who: str, machine: str) -> None:
        await self._send(who, f"/equipment/{machine}/token/take")

    async def _do_give(self, who: str, machine: str) -> None:
        await self._send(who, f"/equipment/{machine}/token/release")

    async def _do_want(self, who: str, machine: str) -> None:
        await self._send(who, f"/equipment/{machine}/token/request")

    async def _do_stop(self, who: str, machine: str) -> None:
        if not self.sids.get(who) or self.down or self.runtime.plant is None:
            return
        item = self.runtime.plant.equipment.get(machine)
        stop = next((c for c in item.type.commands.values() if c.stop), None) if item else None
        if stop is None:
            return
        id = self._order(who, machine, stop.key)
        answer = await self._send(who, f"/equipment/{machine}/stop", id=id)
        refused = answer is not None and answer.status >= 400 and 'data-kind="info"' not in answer.text
        if any(one.id == id and one.state is not ProgressState.REFUSED for _, one in self.ended):
            return  # it was taken, and what became of it while the server stood still is told
        if answer is not None and refused and answer.status not in REFUSED:
            self.refused_stops.append((machine, answer.text[:200], answer.status))

    async def _do_command(self, who: str, machine: str, number: int, part: float, twice: bool) -> None:
        command = self._choose(machine, number, hold=False)
        if command is None or self.runtime.gate is None or not self.sids.get(who):
            return
        if self.runtime.gate.control.holder(machine) is None and number % 4:
            await self._send(who, f"/equipment/{machine}/token/take")
        nonce = await self._nonce(who)
        if nonce is None:
            return
        form = {f"arg_{one.name}": str(round(part * 100)) for one in command.arguments}
        form |= {"argument": f"{part * 60:.2f}"} if command.argument else {}
        form |= {"id": self._order(who, machine, command.key), "nonce": nonce, "confirmed": "1", "reason": "storm"}
        form |= {"password": PASSWORD} if number % 2 else {}
        if twice:  # the same press once more: a double click, a proxy that sends again
            path = f"/equipment/{machine}/command/{command.key}"
            if number % 3:
                self.beside(self._again(who, path, form), acting=True)
            else:  # another one with what the page has used already
                again = form | {"id": self._order(who, machine, command.key)}
                self.nonces[again["id"]] = nonce
                self.beside(self._later(partial(self._again, who, path, again)), acting=True)
        self.nonces[form["id"]] = nonce
        await self._send(who, f"/equipment/{machine}/command/{command.key}", **form)

    async def _again(self, who: str, path: str, form: dict[str, str]) -> None:
        await self._send(who, path, **form)

    async def _do_set(self, who: str, machine: str, number: int, part: float) -> None:
        plant = None if self.down else self.runtime.plant
        item = plant.equipment.get(machine) if plant else None
        if item is None or not item.type.setpoints or not self.sids.get(who):
            return
        key = list(item.type.setpoints)[number % len(item.type.setpoints)]
        nonce = await self._nonce(who)
        if nonce is not None:
            await self._send(
                who, f"/equipment/{machine}/setpoint/{key}", id=self._order(who, machine, key), nonce=nonce,
                argument=self._typed(item, key, part), confirmed="1", reason="storm", password=PASSWORD,
            )  # fmt: skip

    async def _do_sets(self, who: str, machine: str, number: int, parts: list[float]) -> None:
        found = self._some_setpoints(machine, number, parts)
        nonce = await self._nonce(who) if found and self.sids.get(who) else None
        if nonce is not None:
            now = [self._held(machine, key) for key in found]
            await self._send(
                who, f"/equipment/{machine}/parameters", id=self._order_set(who, machine, found), nonce=nonce, reason="storm",
                key=list(found), value=list(found.values()), expected=now, confirmed="1", password=PASSWORD,
            )  # fmt: skip

    def _held(self, machine: str, key: str) -> str:
        """A setpoint as the page shows it."""
        tags = self.runtime.tags
        handle = tags.handles.get(f"{machine}.{key}")
        value = None if handle is None else tags.value(handle)
        return f"{value:g}" if isinstance(value, int | float) else ""

    async def _do_hold(self, who: str, machine: str, number: int, how: str, seconds: float) -> None:
        command, browser = self._choose(machine, number, hold=True), self._browser(who)
        if command is None or browser is None or not self.sids.get(who):
            return
        if self.runtime.gate is not None and self.runtime.gate.control.holder(machine) is None:
            await self._send(who, f"/equipment/{machine}/token/take")
        async with browser.socket() as page:
            page.say(subscribe="overview", rev=0)
            nonce = await self._nonce(who)
            if nonce is None:
                return
            form = {"id": self._order(who, machine, command.key), "nonce": nonce, "confirmed": "1"}
            answer = await self._send(who, f"/equipment/{machine}/hold/{command.key}", **form)
            if answer is None or answer.status != 200 or "lease" not in answer.text:
                return
            lease = json.loads(answer.body)["lease"]
            for counter in range(1, round(seconds / 0.2) + 1):
                told = -counter if how == "backwards" and counter > 3 else counter
                if told > 0:  # what does not rise is no word
                    self.kept[lease] = self.now
                page.say(hold={"equipment": machine, "lease": lease, "counter": told})
                await asyncio.sleep(0.7 if how == "late" and counter > 3 else 0.2)
                if how == "ends" and counter > 3:
                    return
            self.let_go[lease] = self.now
            if how == "gone":
                await self._do_leave(who)
            elif number % 2:
                page.say(hold={"equipment": machine, "lease": lease, "release": "released"})
            else:
                await self._send(who, f"/equipment/{machine}/release", lease=lease)
            await asyncio.sleep(0.05)

    async def _do_acknowledge(self, who: str, number: int) -> None:
        standing = [] if self.down else self.runtime.alarms.list.active()
        if standing and self.sids.get(who):
            occurrence = standing[number % len(standing)].occurrence
            await self._send(who, "/alarms/acknowledge", occurrence=[str(occurrence)])

    async def _do_hide(self, who: str, number: int, how: str, minutes: int) -> None:
        id = self._hidable(number, how)
        if not id or not self.sids.get(who):
            return
        form = {"alarm": id}
        if how not in ("unshelve", "put_back"):
            form["reason"] = "a storm comes"
        if how in ("shelve", "once"):
            form |= {"minutes": str(minutes), "once": "1" if how == "once" else ""}
        await self._send(who, f"/alarms/{FORMS[how]}", **form)

    async def _do_roles(self, who: str, roles: tuple[str, ...]) -> None:
        if who != "ada":
            with suppress(PogonError), self.rights.change(who, "roles", roles):
                done = await self._send(
                    "ada", f"/users/{self.ids[who]}/roles", roles=list(roles), own_password=PASSWORD
                )
                self._done(done)

    async def _do_bar(self, who: str, seconds: float) -> None:
        if who == "ada":
            return
        sid = self.sids.get(who, "")
        with suppress(PogonError):
            with self.rights.change(who, "barred", True):
                self._done(await self._send("ada", f"/users/{self.ids[who]}/disable", own_password=PASSWORD))
            self.rights.end(who, sid)
        await asyncio.sleep(seconds)
        with suppress(PogonError), self.rights.change(who, "barred", False):
            self._done(await self._send("ada", f"/users/{self.ids[who]}/enable", own_password=PASSWORD))

    def _done(self, answer: Answer | None) -> None:
        """
        Raises:
            Refused: an administrator was not told that it is done.
        """
        self._told()
        if answer is None or answer.status != 303:
            raise Refused("storm")
