"""Stations of a plant: a browser at which somebody sits, what hands do there, and a Pogon for all stories of a module."""

import re
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from playwright.sync_api import Browser, ConsoleMessage, Error, Page, Route, StorageState, TimeoutError, expect

from app import bundled
from app.plant.texts import Texts
from tests.alarms.test_alarms_survive import MACHINE_FAULT, write
from tests.conftest import ROOT, PogonServer, enroll
from tests.warm import stem

PASSWORD = "tri plave ladice u kutu"
AXE = ROOT / "tests" / ".vendor" / "axe.min.js"
LANGUAGES = ("hr", "en", "de", "cs")
SIZES = {"panel": (1280, 800), "small": (800, 480), "phone": (390, 844)}
NO_ANSWER = [Texts.read().text(lang, "link.error.no_answer") for lang in LANGUAGES]
PEOPLE = {"ivana": ("engineer", "operator"), "ivo": ("operator",)}
HEARD = """() => { // all that the message line says from now on; it is still known when the page is another
  const line = document.getElementById('message');
  const hear = () => { sessionStorage.said = `${sessionStorage.said ?? ''}${line.innerText}\\n`; };
  new MutationObserver(hear).observe(line, { childList: true, subtree: true, characterData: true });
}"""


@contextmanager
def serving(folder: Path, people: Mapping[str, Sequence[str]] = PEOPLE, **settings: Any) -> Iterator[PogonServer]:
    """A Pogon whose data are in `folder`; its plant too when there is one; `people` may sign in there with PASSWORD."""
    if people:
        enroll(folder / "data", people, PASSWORD)
    if (folder / "plant").is_dir():
        settings = {"plant": folder / "plant"} | settings
    server = PogonServer.start(folder / "data", folder / "pogon.log", stem=stem(), **settings)
    try:
        yield server
    finally:
        if server.process.poll() is None:
            server.stop()


def some_of_the_demo(*machines: str) -> str:
    """The demo plant's file with these machines only: a plant that is not there costs no processor."""
    whole = re.sub(r"^#.*\n", "", (bundled("plants/demo") / "plant.toml").read_text("utf-8"), flags=re.MULTILINE)
    tables = re.split(r"\n(?=\[)", whole)
    used = {
        found[1]
        for name in machines
        for found in re.finditer(rf"\[equipment\.{name}\]\n(?:.+\n)*?link = \"(\w+)\"", whole)
    }
    kept = {"equipment": set(machines), "links": used}
    head = re.compile(r"^\[(equipment|links)\.(\w+)\]", re.MULTILINE)
    return "\n".join(one for one in tables if not (found := head.search(one)) or found[2] in kept[found[1]])


def small(folder: Path, *machines: str) -> Path:
    """A plant folder in `folder`, which `serving` takes, with these machines of the demo plant."""
    (folder / "plant").mkdir()
    (folder / "plant" / "plant.toml").write_text(some_of_the_demo(*machines), "utf-8")
    return folder


PLACE = {"locale": "en-GB", "timezone_id": "Europe/Zagreb"}
"""Where browsers are."""
LOOKS: dict[str, Any] = {"viewport": {"width": 1280, "height": 800}, "reduced_motion": "reduce"}
"""How big a page is, and that nothing glides there, unless something else is said: what glides is drawn sixty times a second."""


ITS_OWN = """() => [Date, setTimeout, performance.now, OscillatorNode.prototype.start].every(
  (one) => Function.prototype.toString.call(one).includes("[native code]"))"""
"""Whether a page has what its browser gave it: a clock that a test set, or a script put in front of each page, stays for good."""


class Stations:
    """The browsers of this process. Who gets up leaves his to the next: one that was just started costs as much as several pages."""

    def __init__(self, browser: Browser) -> None:
        self._browser = browser
        self._free: list[Page] = []

    def sit(self, **how: Any) -> Page:
        """An empty page of a browser that knows nobody; one that is to be other than all (`how`) is started for that."""
        looks = LOOKS | {name: how.pop(name) for name in LOOKS if name in how}
        page = self._browser.new_context(**PLACE, **how).new_page() if how or not self._free else self._free.pop()
        page.set_viewport_size(looks["viewport"])
        page.emulate_media(media="null", reduced_motion=looks["reduced_motion"])
        return page

    def leave(self, page: Page, *, again: bool = True) -> None:
        """Nobody looks at this page and its neighbours any more. What its browser knows is forgotten before somebody has it `again`."""
        context = page.context
        if not again or page.is_closed():
            context.close()
            return
        for other in context.pages:
            if other is not page:
                other.close()
        page.unroute_all()
        if page.url.startswith("http"):
            page.evaluate("() => { localStorage.clear(); sessionStorage.clear(); }")
        page.goto("about:blank")
        if not page.evaluate(ITS_OWN):
            context.close()
            return
        context.set_offline(False)
        context.clear_cookies()
        self._free.append(page)


class Sit:
    """`sit("ivana")`: a browser in which this person is signed in and looks at a page; `sit("")` is a guest.

    `complaints` is what consoles said and pages threw.
    """

    def __init__(
        self,
        stations: Stations,
        server: PogonServer,
        sessions: dict[str, StorageState],
        who: str,
        home: str,
    ) -> None:
        self.complaints: list[str] = []
        self._stations = stations
        self._server = server
        self._sessions = sessions
        self._who = who
        self._home = home
        self._pages: dict[Page, bool] = {}

    def __call__(self, name: str | None = None, path: str = "", lang: str = "en", **how: Any) -> Page:
        name = self._who if name is None else name
        page = self._stations.sit(**how)
        self._pages[page] = not how.keys() - LOOKS
        if name in self._sessions:
            page.context.add_cookies(self._sessions[name]["cookies"])
        speak(page, lang, self._server.url)
        if name and name not in self._sessions:
            page.goto(f"{self._server.url}/signin")
            page.fill("[name=name]", name)
            page.fill("[name=password]", PASSWORD)
            page.click("form.sheet-form button.cmd")
            expect(page.locator(".head .who")).to_contain_text(name)
            self._sessions[name] = page.context.storage_state()
        page.on("pageerror", self._threw)
        page.on("console", self._said)
        page.goto(self._server.url + (path or self._home))
        expect(page.locator("body")).to_have_attribute("data-live", "live")
        return page

    @property
    def pages(self) -> list[Page]:
        """Where somebody sits now."""
        return [*self._pages]

    def leave(self) -> None:
        """Everybody lets go of the machine and leaves the browser to others."""
        for one, again in self._pages.items():
            for page in one.context.pages:
                let_go(page)
            one.remove_listener("pageerror", self._threw)
            one.remove_listener("console", self._said)
            self._stations.leave(one, again=again)
        self._pages.clear()

    def _threw(self, error: Error) -> None:
        self.complaints.append(str(error))

    def _said(self, message: ConsoleMessage) -> None:
        """An answer that refuses is no fault of the page."""
        if message.type in ("error", "warning") and "status of 4" not in message.text:
            self.complaints.append(message.text)


def speak(page: Page, lang: str, url: str) -> None:
    """From the next page on this browser speaks another language."""
    page.context.add_cookies([{"name": "pogon_lang", "value": lang, "url": url}])


def lay_out(page: Page, width: int, height: int, profile: str = "") -> None:
    """The page on another screen, drawn anew; if somebody chose a `profile` there, with that."""
    page.set_viewport_size({"width": width, "height": height})
    page.evaluate(
        """(profile) => { if (profile) document.documentElement.dataset.profile = profile;
           return new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(1)))); }""",
        profile,
    )


def hold_back(page: Page, what: str) -> list[Route]:
    """What is asked for at such addresses from now on; nobody answers until each is continued."""
    held: list[Route] = []
    page.route(what, lambda route: held.append(route))
    return held


def wait_for(page: Page, held: list[Route], number: int) -> None:
    end = time.monotonic() + 15
    while len(held) < number:
        assert time.monotonic() < end, [route.request.url for route in held]
        page.wait_for_timeout(50)


class Operator:
    """Somebody at a running plant who can also break it."""

    def __init__(self, page: Page, server: PogonServer) -> None:
        self.page = page
        self.server = server
        found = re.search(r"Modbus TCP at [\d.]+:(\d+)", server.log())
        assert found, server.log()
        self.modbus = int(found[1])

    def trip(self, unit: int, code: int) -> None:
        """Cause a fault of the drive with this unit, as a master on its line does."""
        write(self.modbus, unit, MACHINE_FAULT, code)

    def go(self, path: str) -> None:
        """Look at another page of ours."""
        self.page.goto(self.server.url + path)
        expect(self.page.locator("body")).to_have_attribute("data-live", "live")

    def rebuild(self, *machines: str) -> None:
        """The simulated devices as when they were built, and no alarm that is left of what was."""
        for machine in machines:
            built(self.page, machine)
        acknowledge(self.page)


def let_go(page: Page) -> None:
    """Release the machine on the page as soon as it may be released."""
    page.mouse.up()
    if page.locator("dialog").count():
        page.reload()
    release = page.locator(".token [data-token=release]")
    end = time.monotonic() + 30
    while release.count():
        assert time.monotonic() < end, page.inner_text("#message")
        # the panel may be drawn anew, without it, between the look and the press
        with suppress(TimeoutError):
            release.first.click(timeout=2_000)
        page.wait_for_timeout(300)


def take(page: Page) -> None:
    """Take control of the machine on the page."""
    expect(page.locator("[data-token=take], [data-token=release]").first).to_be_visible()
    if page.locator("[data-token=take]").count():
        page.locator("[data-token=take]").first.click()
    expect(page.locator(".token").first).to_have_attribute("data-holding", "mine")


def stopped(page: Page) -> None:
    """Press Stop of the machine on the page, and wait until it is at rest: this Stop is done, not one of before."""
    with page.expect_response(lambda answer: answer.url.endswith("/stop")) as answer:
        page.click(".op > .stop")
    begun, done = time.monotonic(), re.compile(rf'data-id="{answer.value.headers["x-command"]}[^>]*data-kind="done"')
    machine = answer.value.url.removesuffix("/stop")
    while not done.search(page.request.get(f"{machine}/commands", max_retries=1).text()):
        assert time.monotonic() < begun + 30, f"{machine} has not stopped"
        page.wait_for_timeout(50)
    expect(page.locator(".op > .stop")).to_have_attribute("data-state", "done")


def origin(page: Page) -> str:
    """The server whose page this is, as `http://127.0.0.1:8000`."""
    return "{0.scheme}://{0.netloc}".format(urlsplit(page.url))


def acknowledge(page: Page) -> None:
    """Go to the alarms and acknowledge them until none is left."""
    url, end = origin(page), time.monotonic() + 60
    while True:
        page.goto(f"{url}/alarms")
        left = page.locator("#content [name=occurrence]").evaluate_all("rows => rows.map(row => row.value)")
        if not left and page.locator("#alarms", has_text="No active alarms").count():
            return
        assert time.monotonic() < end, page.inner_text("#content")
        for one in left:
            csrf = page.locator("[name=csrf]").first.get_attribute("value") or ""
            form = {"occurrence": str(one), "csrf": csrf}
            page.request.post(f"{url}/alarms/acknowledge", form=form, headers={"Origin": url}, max_retries=1)
        page.wait_for_timeout(200)


def fault(page: Page, machine: str, code: int) -> None:
    """Cause a fault of a machine as the instructor's page does."""
    instruct(page, f"{machine}/fault", code=str(code))


def built(page: Page, machine: str) -> None:
    """The simulated device as when it was built."""
    instruct(page, f"{machine}/reset")


def heard(page: Page, tag: str) -> None:
    """Wait until the server has heard of `tag` anew: a page that is loaded then shows what is true after this call."""
    began = time.monotonic()
    root = origin(page)
    while True:
        asked = time.monotonic()
        age = page.request.get(f"{root}/api/v1/tags/{tag}", max_retries=1).json()["age"]
        if age is not None and age < asked - began:
            return
        assert asked < began + 30, f"{tag} is {age} s old: expected one that was read after the reset"
        page.wait_for_timeout(50)


def pace(page: Page, speed: int) -> None:
    """Have the simulated plant run so many times as fast as the clock; reading, watchdogs and hands stay as they are."""
    instructed(page, "simulation/speed", speed=str(speed))


def instruct(page: Page, what: str, **form: str) -> None:
    """Post a form of the instructor's page: `instruct(page, "m1/fault", code="4")`."""
    instructed(page, f"instructor/{what}", **form)


def instructed(page: Page, where: str, **form: str) -> None:
    """Post what an instructor asks for.

    A line that has no time to answer is asked again, as an instructor does who reads that. A connection that was not used for a while
    may be closed by the server in the moment in which it is used: then it is sent on a new one, as a browser does (RFC 9112, 9.3.1).
    """
    root = origin(page)
    form |= {"csrf": page.locator("[name=csrf]").first.get_attribute("value") or ""}
    end = time.monotonic() + 30
    while True:
        answer = page.request.post(
            f"{root}/{where}", form=form, headers={"Origin": root}, max_redirects=0, max_retries=1
        )
        if answer.status == 303:
            return
        assert any(said in answer.text() for said in NO_ANSWER) and time.monotonic() < end, answer.text()


def review(page: Page) -> None:
    """Have the list of new values compared with the drive. One that had no time to answer is asked again, as by a person who reads that."""
    written = page.locator("#dw form[action$='/write'] [name=password]")
    for _ in range(5):
        with page.expect_response(lambda answer: answer.url.endswith("/review")):
            page.locator("#dw-form button.edge").click()
        expect(page.locator("#dw[hx-get]")).to_have_count(0, timeout=30_000)
        told = page.locator("#dw .dw-bad")
        expect(written.or_(told).first).to_be_visible()
        if written.count():
            return
        assert "No answer" in told.inner_text(), told.inner_text()
    raise AssertionError(f"the drive does not answer: {told.inner_text()}")
