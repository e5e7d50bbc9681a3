"""Virtual time: a loop whose clock jumps to the next timer as soon as nothing is left to do, and a browser that runs on it.

Everything happens on one thread: work for a pool is done at once, where it is asked for. So a run depends on nothing but its seed, and an
hour of waiting costs what happens in it.
"""

import asyncio
import math
import selectors
from collections.abc import Awaitable, Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from datetime import UTC, datetime
from inspect import isawaitable
from typing import Any, Self, TypeVar

import anyio
import starlette.testclient
from anyio._backends._asyncio import AsyncIOBackend
from fastapi import FastAPI
from fastapi.testclient import TestClient
from httpx2 import Cookies

from app.clock import Clock, ManualClock, SystemClock
from app.main import create_app
from app.running import virtual_time
from app.settings import Settings
from tests.wires import Network

T = TypeVar("T")
HOST = "http://127.0.0.1:8000"
MORNING = datetime(2026, 3, 9, 6, 5, tzinfo=UTC)
"""When the houses of tests begin, if they don't say otherwise."""


class _Waiting(virtual_time.Waiting):
    def idle(self) -> virtual_time.Events:
        if len(self.get_map()) > 1:  # more than the pipe that every loop has: somebody may still write
            return selectors.DefaultSelector.select(self, None)
        return super().idle()


class VirtualLoop(virtual_time.VirtualLoop, Network):
    """Virtual time, and in it the wires of the tests."""

    waiting = _Waiting


class Inline(Executor):
    """A pool that does its work where it is asked for."""

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> "Future[T]":
        future: Future[T] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except BaseException as error:
            future.set_exception(error)
        return future


def inline(count: int, name: str) -> Executor:
    """What `Runtime`, `Database` and `Access` take as `threads`."""
    return Inline()


async def _run_sync_inline(func: Any, args: Any, abandon_on_cancel: bool = False, limiter: Any = None) -> Any:
    if isinstance(asyncio.get_running_loop(), VirtualLoop):
        return func(*args)
    return await _in_a_thread(func, args, abandon_on_cancel, limiter)


_in_a_thread = AsyncIOBackend.run_sync_in_worker_thread
AsyncIOBackend.run_sync_in_worker_thread = staticmethod(_run_sync_inline)  # type: ignore[method-assign, assignment]


# ---- a browser -------------------------------------------------------------------------------------------


class _Pumped(Future[Any]):
    """The result of a task: who asks for it lets the loop run until it is there."""

    loop: asyncio.AbstractEventLoop
    task: "asyncio.Task[Any]"

    def result(self, timeout: float | None = None) -> Any:
        self.pump()
        return super().result(0)

    def exception(self, timeout: float | None = None) -> BaseException | None:
        self.pump()
        return super().exception(0)

    def pump(self) -> None:
        if not self.done() and not self.loop.is_running():
            self.loop.run_until_complete(asyncio.wait([self.task]))


class _Portal:
    """As anyio's portal into the thread of a loop, on the caller's own thread: time passes only inside a call."""

    def __init__(self, loop: VirtualLoop) -> None:
        self.loop = loop

    def call(self, func: Callable[..., Any], *args: Any) -> Any:
        async def go() -> Any:
            result = func(*args)
            return await result if isawaitable(result) else result

        return self.loop.run_until_complete(go())

    def start_task_soon(self, func: Callable[..., Awaitable[Any]], *args: Any, name: object = None) -> _Pumped:
        async def go() -> Any:
            return await func(*args)

        future = _Pumped()
        future.loop, future.task = self.loop, self.loop.create_task(go())
        future.task.add_done_callback(lambda task: _settle(future, task))
        return future

    def start_task(self, func: Callable[..., Awaitable[Any]], *args: Any, name: object = None) -> tuple[_Pumped, Any]:
        started: asyncio.Future[Any] = self.loop.create_future()

        class Status:
            def started(self, value: Any = None) -> None:
                started.set_result(value)

        async def go() -> Any:
            return await func(*args, task_status=Status())

        future = self.start_task_soon(go)
        self.loop.run_until_complete(asyncio.wait([started, future.task], return_when=asyncio.FIRST_COMPLETED))
        if not started.done():
            future.result()
        return future, started.result()


def _settle(future: _Pumped, task: "asyncio.Task[Any]") -> None:
    if task.cancelled():
        future.cancel()
        future.set_running_or_notify_cancel()
    elif error := task.exception():
        future.set_exception(error)
    else:
        future.set_result(task.result())


def _wait(futures: Any, timeout: float | None = None, return_when: str = "ALL_COMPLETED") -> Any:
    for future in futures:
        if isinstance(future, _Pumped):
            future.pump()
    return _wait_for_threads(futures, timeout, return_when)


_wait_for_threads = starlette.testclient.wait_futures
starlette.testclient.wait_futures = _wait


class _Jar(Cookies):
    """Cookies as a browser keeps them: one of a name, whether a test or the house gave it."""

    def __init__(self, host: str) -> None:
        super().__init__()
        self._host = host

    def set(self, name: str, value: str, domain: str = "", path: str = "/") -> None:
        super().set(name, value, domain or self._host, path)


class VirtualClient(TestClient):
    """A browser and the house that it looks at, both in virtual time, which passes during a request and in `pass_time` only."""

    def __init__(self, app: FastAPI, clock: ManualClock, **settings: Any) -> None:
        super().__init__(app, **settings)
        self._cookies = _Jar(self.base_url.host)  # what is assigned to `cookies` becomes one of httpx' own
        self.clock = clock

    def __enter__(self) -> Self:
        self.loop = VirtualLoop(self.clock)
        with _portal_of(_Portal(self.loop)):
            super().__enter__()
        _running.append(self)
        return self

    def __exit__(self, *args: Any) -> None:
        _running.remove(self)
        try:
            super().__exit__(*args)
        finally:
            rest = asyncio.all_tasks(self.loop)
            for task in rest:
                task.cancel()
            if rest:
                self.loop.run_until_complete(asyncio.wait(rest))
            self.loop.run_until_complete(self.loop.shutdown_asyncgens())
            self.loop.close()

    def pass_time(self, seconds: float) -> None:
        """Let the house live for so long."""
        self.loop.run_until_complete(asyncio.sleep(seconds))

    def run(self, work: Awaitable[T]) -> T:
        """What `work` returns, done in the house's loop."""

        async def go() -> T:
            return await work

        return self.loop.run_until_complete(go())


_running: list[VirtualClient] = []


def house(
    settings: Settings, begin: datetime = MORNING, extend: Callable[[FastAPI], object] | None = None, **at: Any
) -> VirtualClient:
    """A Pogon with `settings` in virtual time from `begin` on, and a browser at it; `extend` may add to the application."""
    clock = ManualClock(begin)
    app = create_app(settings, clock, inline)
    if extend is not None:
        extend(app)
    at = {"base_url": HOST, "follow_redirects": False, "client": ("127.0.0.1", 50000)} | at
    return VirtualClient(app, clock, **at)


def pass_time(seconds: float) -> None:
    """Let every running house live for so long, one after the other."""
    for client in list(_running):
        client.pass_time(seconds)


def until(what: Callable[[], object], limit: float = 30.0, step: float = 0.05) -> bool:
    """Whether `what` comes true within `limit` [s] of virtual time."""
    for _ in range(math.ceil(limit / step)):
        if what():
            return True
        pass_time(step)
    return bool(what())


@contextmanager
def _portal_of(portal: _Portal) -> Iterator[None]:
    """Inside, who starts a portal gets this one."""

    @contextmanager
    def start(**options: Any) -> Iterator[_Portal]:
        yield portal

    kept = anyio.from_thread.start_blocking_portal
    anyio.from_thread.start_blocking_portal = start  # type: ignore[assignment]
    try:
        yield
    finally:
        anyio.from_thread.start_blocking_portal = kept


def virtual() -> bool:
    """Whether the loop that runs has a time of its own."""
    return isinstance(asyncio.get_running_loop(), VirtualLoop)


def loop_clock() -> Clock:
    """The clock of the loop that runs: virtual, or this machine's."""
    loop = asyncio.get_running_loop()
    return loop.clock if isinstance(loop, VirtualLoop) else SystemClock()
