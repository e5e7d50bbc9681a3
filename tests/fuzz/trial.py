"""One seed at one plant: what was asked, what was wrong with it, and the shortest list of requests that still shows it."""

import json
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from random import Random

from tests.fuzz.asking import Request
from tests.fuzz.drawing import Drawer
from tests.fuzz.house import PASSWORD, PEOPLE, Fault, House, opened
from tests.fuzz.pages import links_in
from tests.fuzz.routes import Routes
from tests.fuzz.walking import Walker
from tests.shortest import shortest

TRIES = 60
"""Lists that are tried to shorten one."""
CRAWLED = 400
"""No more pages of a plant are looked at, to learn what there is."""


@dataclass
class Verdict:
    """What became of a seed."""

    seed: int
    plant: str
    faults: dict[str, tuple[str, int]] = field(default_factory=dict)
    """Name → what, and how many requests had been played by then."""
    requests: list[Request] = field(default_factory=list)
    longest: dict[str, tuple[float, str]] = field(default_factory=dict)
    statuses: Counter[tuple[str, int]] = field(default_factory=Counter)
    seconds: float = 0.0
    """Of a processor [s]."""

    def note(self, faults: Sequence[Fault]) -> None:
        for one in faults:
            self.faults.setdefault(one.name, (one.what, len(self.requests)))


async def crawl(one: House, most: int = CRAWLED) -> list[Fault]:
    """Follow every address from the first page on, as everybody; returns what was wrong."""
    faults: list[Fault] = []
    queue, had = ["/"], {"/"}
    for asked in range(most):
        if asked >= len(queue):
            break
        answer, wrong = await one.play(Request("ada", "GET", queue[asked]))
        faults += wrong
        if answer is not None and answer.content == "text/html":
            links = set(one.page.links) if one.page is not None and answer.status == 200 else set()
        else:
            if answer is not None and answer.content == "application/json" and answer.status == 200:
                one.routes.read(json.loads(answer.body))
            links = links_in(answer.text) if answer is not None and answer.content == "application/json" else set()
        if answer is not None and "location" in answer.headers:
            links.add(answer.headers["location"])
        for address in sorted(links):
            if address not in had and one.routes.link(address):
                had.add(address)
                queue.append(address)
        if asked == len(queue) - 1:  # then what no page leads to
            for address in one.routes.addresses():
                if address not in had:
                    had.add(address)
                    queue.append(address)
    return faults


@cache
def known(plant: str) -> Routes:
    """What there is at `plant`, seen by one who may see all; looked at once for all seeds."""
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder, opened(plant, Path(folder), 0) as one:
        one.client.run(crawl(one))
        return one.routes


def explore(seed: int, plant: str, count: int, about: tuple[str, ...] = ()) -> Verdict:
    """Draw and play some `count` requests, then look at everything, before and after a start anew.

    Half of them are drawn without looking, half are forms of pages with one field that is wrong; `about`: these alone, of such addresses.
    """

    def drawn(one: House) -> Iterator[Request]:
        random = Random(f"requests {seed}")
        drawer, walker = Drawer(random, one.routes, tuple(PEOPLE), PASSWORD), Walker(random, one, about, PASSWORD)
        asked = 0
        while asked < count:
            asked += 1
            if not about and random.random() < 0.7:
                yield drawer.request()
                continue
            for request in walker.requests():
                asked += 1
                yield request

    return played(seed, plant, drawn)


def played(seed: int, plant: str, requests: Callable[[House], Iterable[Request]]) -> Verdict:
    """What becomes of a house that is asked all of `requests`."""
    began, verdict = time.process_time(), Verdict(seed, plant)
    routes = known(plant)
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
        with opened(plant, Path(folder), seed) as one:
            one.routes.take(routes)

            async def all_of_it(one: House) -> None:
                for request in requests(one):
                    verdict.requests.append(request)
                    _, wrong = await one.play(request)
                    verdict.note(wrong)
                verdict.note(await one.after())

            one.client.run(all_of_it(one))
            verdict.statuses, seen = one.statuses, one.routes
            verdict.longest = {route: (spent, str(request)) for route, (spent, request) in one.longest.items()}
        with opened(plant, Path(folder), seed + 1) as one:  # what was kept is read by the next start
            one.routes.take(seen)
            verdict.note(one.client.run(one.after(brief=True)))
    verdict.seconds = time.process_time() - began
    return verdict


def replay(seed: int, plant: str, requests: Sequence[Request], name: str) -> bool:
    """Whether `requests` alone show the fault `name`."""
    late = name.startswith(("after", "the chain", "task"))

    async def go(one: House) -> bool:
        for request in requests:
            _, wrong = await one.play(request)
            if name in {found.name for found in wrong}:
                return True
        return late and name in {found.name for found in await one.after(fault=name)}

    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
        with opened(plant, Path(folder), seed) as one:
            one.routes.take(known(plant))
            if one.client.run(go(one)):
                return True
        if not late:
            return False
        with opened(plant, Path(folder), seed + 1) as one:
            one.routes.take(known(plant))
            return name in {found.name for found in one.client.run(one.after(brief=True, fault=name))}


def shortened(verdict: Verdict, name: str, tries: int = TRIES) -> list[Request]:
    """The shortest list found that shows the fault `name` of `verdict`."""
    requests = verdict.requests[: verdict.faults[name][1]]

    def shows(some: Sequence[Request]) -> bool:
        return replay(verdict.seed, verdict.plant, some, name)

    if shows(requests[-1:]):
        return requests[-1:]
    return list(shortest(requests, shows, tries))


def told(verdict: Verdict, name: str, tries: int = TRIES) -> str:
    """The fault with the requests that show it."""
    what, _ = verdict.faults[name]
    lines = "\n".join(f"  {one}" for one in shortened(verdict, name, tries))
    return (
        f"seed {verdict.seed} at {verdict.plant}: {name}\n{what}\nThe shortest list of requests that shows it:\n{lines}"
    )
