"""The web application; its lifespan starts and stops the plant."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial

from fastapi import FastAPI
from starlette.middleware.gzip import DEFAULT_EXCLUDED_CONTENT_TYPES, GZipMiddleware

from app import __version__, bundled
from app.clock import Clock
from app.runtime import Runtime
from app.settings import Settings
from app.threads import Threads, threads
from app.web import (
    alarm_filters,
    alarm_hiding,
    alarm_statistics,
    alarms,
    api_page,
    audit,
    commands,
    communication,
    drive_compare,
    drive_parameters,
    drive_writing,
    encoder_adjustment,
    errors,
    events,
    factor,
    fault_buffer,
    favourites,
    forces,
    guard,
    health,
    help,
    history,
    instructor,
    jog_speeds,
    lessons,
    overview,
    pages,
    palette,
    parameters,
    parts,
    plant,
    plant_screens,
    records,
    sequence_editor,
    sequence_taking,
    sequence_trying,
    signin,
    socket,
    storage,
    terminal,
    trend_menus,
    trend_notes,
    trend_table,
    trend_views,
    trends,
    users,
)
from app.web.api import description
from app.web.assets import Assets
from app.web.guard import check_declared
from app.web.heads import Heads
from app.web.proxy import Proxied
from app.web.security import Shield
from app.web.view import View

UNPACKED = (*DEFAULT_EXCLUDED_CONTENT_TYPES, "text/csv")
"""Kinds of answers that go as they are. All others are packed: no page holds a secret twice in the same letters (a form's token is
made anew for every answer) and the session's cookie is never sent along from other sites, so the length of a page tells nobody anything."""


def create_app(settings: Settings, clock: Clock | None = None, threads: Threads = threads) -> FastAPI:
    """The application for `settings`, ready to be served; time comes from `clock`, else from this machine.

    Raises:
        ConfigurationError: a route does not say who may use it.
    """

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        runtime = Runtime(settings, clock, threads)
        app.state.runtime = runtime
        await runtime.start()
        sockets = socket.sockets_of(app)
        runtime.access.subscribe(sockets.end, sockets.begin_anew)
        try:
            async with terminal.listening(runtime):
                yield
        finally:
            sequence_trying.end(app)
            await socket.sockets_of(app).close()
            await runtime.stop()

    app = FastAPI(
        title="Pogon", version=__version__, docs_url=None, redoc_url=None, openapi_url=None, lifespan=lifespan
    )

    dress(app, settings)
    return app


def dress(app: FastAPI, settings: Settings) -> None:
    """Give `app` our pages, our errors and the layer around everything; every route must say who may use it."""
    app.state.view = View(Assets(bundled("static")))
    app.state.view.around.append(favourites.around)
    rooms = (
        commands,  # routes are tried in this order, and nothing of a command waits for longer than it must
        overview,
        pages,
        plant_screens,
        socket,
        alarm_filters,
        alarm_hiding,
        alarm_statistics,
        alarms,
        parameters,
        drive_compare,
        drive_parameters,
        drive_writing,
        encoder_adjustment,
        jog_speeds,
        fault_buffer,
        parts,
        health,
        signin,
        factor,
        users,
        audit,
        history,
        events,
        records,
        storage,
        plant,
        sequence_editor,
        sequence_taking,
        sequence_trying,
        instructor,
        lessons,
        palette,
        favourites,
        api_page,
        help,
        communication,
        forces,
        trends,
        trend_table,
        trend_menus,
        trend_views,
        trend_notes,
    )
    for router in (*(part.router for part in rooms), *description.ROUTERS):
        app.router.routes.extend(router.routes)  # as they are: `include_router` would build each of them anew
    app.state.sockets = socket.Sockets(guard.may_watch_live)
    errors.install(app)
    guard.install(app)
    app.add_middleware(guard.Gatekeeper)
    app.add_middleware(
        GZipMiddleware, minimum_size=1024, compresslevel=4, thread_minimum_size=2**17, exclude_content_types=UNPACKED
    )
    app.add_middleware(Heads)
    app.add_middleware(partial(Shield, hosts=settings.hosts, broken=errors.internal))
    if settings.behind_proxy:
        app.add_middleware(partial(Proxied, proxies=settings.behind_proxy))
    check_declared(app)
