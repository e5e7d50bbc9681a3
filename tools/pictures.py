"""Photographs every screen of the demo plant into build/pictures: sizes x themes x languages, one folder per language.

    make pictures                         everything
    make pictures ARGS="--only motor --size 800x480 --lang de --theme dark"
    make pictures ARGS=--readme        only docs/motor.png: the motor after two minutes

A server of its own on a fresh data folder is started, the first account made with its code, a fault caused and an
alarm left standing, so that the pictures show a plant at work. The report lists what was cut off or not translated.
"""

import argparse
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import BrowserContext, Page, sync_playwright

ROOT = Path(__file__).resolve().parent.parent
TARGET = ROOT / "build" / "pictures"
SIZES = ("1280x800", "800x480", "390x844")
THEMES = ("light", "dark")
LANGUAGES = ("hr", "de")
PASSWORD = "tri plave ladice u kutu"
CHROMIUMS = (os.environ.get("POGON_CHROMIUM") or "chromium-headless-shell", "chromium")
PROFILES = {"1280x800": "desk", "800x480": "panel-9", "390x844": "desk"}
LOCALES = {"hr": "hr-HR", "en": "en-GB", "de": "de-DE", "cs": "cs-CZ"}
PUBLIC = {"signin": "/signin", "overview-guest": "/", "error-guest": "/no-such-page"}
"""Screens of somebody who is not signed in."""
SCREENS = {
    "overview": "/",
    "motor": "/equipment/m1",
    "motor-fault": "/equipment/m2",
    "conveyor": "/equipment/c1",
    "conveyor-ramp": "/equipment/c1/page/ramp?belt=3",
    "conveyor-faceplate": "/equipment/c1/faceplate",
    "conveyor-settings": "/equipment/c1/parameters",
    "sequence": "/equipment/seq1",
    "sequence-faceplate": "/equipment/seq1/faceplate",
    "coil-car": "/equipment/cc1",
    "axis": "/equipment/a1",
    "coil-car-faceplate": "/equipment/cc1/faceplate",
    "crane": "/equipment/cr1",
    "crane-hoist": "/equipment/cr1/page/hoist",
    "crane-trolley": "/equipment/cr1/page/trolley",
    "crane-drives": "/equipment/cr1/page/drives",
    "crane-sequence": "/equipment/cr1/page/sequence",
    "crane-thesis": "/equipment/cr1/page/thesis?run=positioner",
    "crane-thesis-arc": "/equipment/cr1/page/thesis?run=arc",
    "crane-thesis-sequence": "/equipment/cr1/page/thesis?run=sequence",
    "crane-faceplate": "/equipment/cr1/faceplate",
    "crane-settings": "/equipment/cr1/parameters",
    "records-crane-cycle": "/records/crane_cycle?equipment=cr1",
    "records-crane-cycle-last": "/records/crane_cycle?equipment=cr1&view=last",
    "instructor-crane": "/instructor/cr1",
    "forces": "/forces",
    "faceplate": "/equipment/m1/faceplate",
    "parameters": "/equipment/m1/parameters",
    "drive-parameters": "/equipment/m1/drive-parameters",
    "trends": "/trends",
    "alarms": "/alarms",
    "alarm-statistics": "/alarms/statistics?span=day",
    "events": "/events",
    "events-machine": "/equipment/c1/events",
    "records-passage": "/records/passage?equipment=c1",
    "records-run": "/records/run?equipment=seq1",
    "records-run-times": "/records/run?equipment=seq1&view=steps",
    "records-coil": "/records/coil?equipment=cc1",
    "communication": "/communication",
    "users": "/users",
    "review": "/users/review",
    "tokens": "/tokens",
    "audit": "/audit",
    "account": "/account",
    "factor": "/account/factor",
    "storage": "/storage",
    "instructor": "/instructor",
    "instructor-machine": "/instructor/m1",
    "instructor-conveyor": "/instructor/c1",
    "instructor-coil-car": "/instructor/cc1",
    "plant": "/plant",
    "error": "/no-such-page",
    "api": "/docs",
}
MARKS = re.compile(r"\[(?:[a-z]{2}\]|[a-z_]+(?:\.[a-z0-9_]+)+\])")
"""`[en]` before a text of another language, `[key.of.a.text]` where there is none."""
LOOK = (ROOT / "tools" / "faults.js").read_text("utf-8")


def main() -> int:
    wanted = _arguments()
    if not wanted.keep and not wanted.readme:
        shutil.rmtree(TARGET, ignore_errors=True)
    report: list[str] = []
    with tempfile.TemporaryDirectory() as folder, demo(Path(folder)) as (url, data), sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=next(filter(None, map(shutil.which, CHROMIUMS)), None),
            args=["--disable-gpu", "--force-color-profile=srgb", *(["--no-sandbox"] if os.geteuid() == 0 else [])],
        )

        def shoot(context: BrowserContext, screens: dict[str, str], size: str, theme: str, lang: str) -> None:
            page = context.new_page()
            page.set_viewport_size({"width": int(size.split("x")[0]), "height": int(size.split("x")[1])})
            cookies = {"pogon_lang": lang, "pogon_theme": theme, "pogon_profile": PROFILES[size]}
            context.add_cookies([{"name": name, "value": value, "url": url} for name, value in cookies.items()])
            for name, path in screens.items():
                if wanted.only and name not in wanted.only:
                    continue
                page.goto(url + path, wait_until="load")
                settle(page)
                file = TARGET / lang / f"{name}-{size}-{theme}.png"
                file.parent.mkdir(parents=True, exist_ok=True)
                page.screenshot(path=file)
                told = page.evaluate(LOOK)
                told += [f"not translated: {mark}" for mark in MARKS.findall(page.inner_text("body"))]
                report.extend(f"{lang}/{name}-{size}-{theme}: {fault}" for fault in told)
            page.close()

        every = [(size, theme, lang) for lang in wanted.lang for size in wanted.size for theme in wanted.theme]
        if wanted.readme:
            sign_in(browser.new_page(), url, data)
            readme(browser.new_context(locale=LOCALES["en"]), url)
            browser.close()
            return 0
        guests = {lang: browser.new_context(locale=LOCALES[lang]) for lang in wanted.lang}
        for each in every:
            shoot(guests[each[2]], {"first": "/first"}, *each)
        context = browser.new_context()
        sign_in(context.new_page(), url, data)
        prepare(context.new_page(), url)
        state = context.storage_state()
        for lang in wanted.lang:
            context = browser.new_context(locale=LOCALES[lang], storage_state=state)
            for each in [each for each in every if each[2] == lang]:
                shoot(guests[lang], PUBLIC, *each)
                shoot(context, SCREENS, *each)
                offline(context, url, *each, report, wanted.only)
        browser.close()
    text = "\n".join(report) or "nothing is cut off, nothing overlaps, everything is translated"
    (TARGET / "report.txt").write_text(text + "\n", "utf-8")
    print(text)
    print(f"{len(list(TARGET.rglob('*.png')))} pictures in {TARGET.relative_to(ROOT)}")
    return 0


def settle(page: Page) -> None:
    """Wait until the values of a page are live; a page without a socket is ready at once."""
    if page.locator("body[data-live]").count():
        page.wait_for_selector("body[data-live=live]", timeout=8000)
    page.wait_for_timeout(700)


def sign_in(page: Page, url: str, data: Path) -> None:
    """Make the first account with the code that the terminal printed."""
    page.goto(f"{url}/first")
    code = (data / "first-code").read_text().split()[-1]
    given = {"code": code, "name": "ana", "display": "Ana Kos", "password": PASSWORD, "again": PASSWORD}
    for name, value in given.items():
        page.fill(f"[name={name}]", value)
    page.click(".sheet-form button.cmd")
    page.wait_for_url(re.compile(r"/(welcome)?(\?.*)?$"), wait_until="commit")
    page.close()


def prepare(page: Page, url: str) -> None:
    """A drive that has tripped, so that there are alarms; m1 runs on."""
    page.goto(f"{url}/instructor/m2")
    page.check("input[name=code][value='13']")
    page.click(".in-fault button.edge")
    page.wait_for_selector(".in-on")
    page.wait_for_timeout(3000)
    page.close()


def readme(context: BrowserContext, url: str) -> None:
    """The motor as somebody sees it who operates it, when its curves have something to show."""
    page = context.new_page()
    page.set_viewport_size({"width": 1280, "height": 800})
    context.add_cookies([{"name": "pogon_lang", "value": "en", "url": url}])
    page.goto(f"{url}/signin")
    page.fill("[name=name]", "ana")
    page.fill("[name=password]", PASSWORD)
    page.click(".sheet-form button.cmd")
    page.wait_for_url(re.compile(r"/(\?.*)?$"))
    page.goto(f"{url}/equipment/m1")
    settle(page)
    page.click("[data-token=take]")
    page.wait_for_selector("[data-token=release]")
    for wait, value in ((20, "30"), (25, "45"), (75, "")):
        page.wait_for_timeout(wait * 1000)
        if value:
            page.fill("[name=argument]", value)
            page.press("[name=argument]", "Enter")
            page.wait_for_selector("[data-card] button.edge")
            page.click("[data-card] button.edge")
    page.mouse.move(1, 799)
    file = ROOT / "docs" / "motor.png"
    page.screenshot(path=file)
    print(f"{file.relative_to(ROOT)}: {file.stat().st_size // 1000} kB")


def offline(
    context: BrowserContext, url: str, size: str, theme: str, lang: str, report: list[str], only: list[str]
) -> None:
    """The motor when its server is gone: the socket is closed, and no new one opens."""
    if only and "offline" not in only:
        return
    page = context.new_page()
    page.set_viewport_size({"width": int(size.split("x")[0]), "height": int(size.split("x")[1])})
    cookies = {"pogon_lang": lang, "pogon_theme": theme, "pogon_profile": PROFILES[size]}
    context.add_cookies([{"name": name, "value": value, "url": url} for name, value in cookies.items()])
    sockets: list[Callable[[], None]] = []

    def carry(route: object) -> None:
        if sockets and sockets[0] is closed:
            return
        route.connect_to_server()  # type: ignore[attr-defined]
        sockets.append(route.close)  # type: ignore[attr-defined]

    def closed() -> None: ...

    page.route_web_socket("**/live", carry)
    page.goto(f"{url}/equipment/m1")
    settle(page)
    to_close, sockets[:] = list(sockets), [closed]
    for close in to_close:
        close()
    page.wait_for_selector("body[data-live=offline]", timeout=10000)
    page.wait_for_timeout(500)
    page.screenshot(path=TARGET / lang / f"offline-{size}-{theme}.png")
    report.extend(f"{lang}/offline-{size}-{theme}: {fault}" for fault in page.evaluate(LOOK))
    page.close()


@contextmanager
def demo(folder: Path) -> Iterator[tuple[str, Path]]:
    """The demo plant on a free port: its address and its data folder."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    url, data = f"http://127.0.0.1:{port}", folder / "data"
    clean = {name: value for name, value in os.environ.items() if not name.startswith("POGON_")}
    process = subprocess.Popen(
        [sys.executable, "-m", "app.cli", "run"],
        cwd=ROOT,
        env=clean | {"POGON_DATA": str(data), "POGON_PORT": str(port), "POGON_LOG_LEVEL": "warning"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
    )
    try:
        for _ in range(300):
            try:
                with urllib.request.urlopen(f"{url}/healthz", timeout=2):
                    break
            except (urllib.error.URLError, ConnectionError, TimeoutError):
                time.sleep(0.1)
        yield url, data
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait(15)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Photograph every screen into build/pictures.")
    parser.add_argument(
        "--only", nargs="+", default=[], choices=[*PUBLIC, *SCREENS], metavar="SCREEN", help=", ".join(SCREENS)
    )
    parser.add_argument("--size", nargs="+", default=SIZES, choices=SIZES)
    parser.add_argument("--theme", nargs="+", default=THEMES, choices=THEMES)
    parser.add_argument("--lang", nargs="+", default=LANGUAGES, choices=("hr", "en", "de", "cs"))
    parser.add_argument("--keep", action="store_true", help="keep the pictures that are there")
    parser.add_argument("--readme", action="store_true", help="only docs/motor.png")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
