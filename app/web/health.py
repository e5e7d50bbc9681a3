"""Is the server well (`/healthz`), does it reach its devices (`/readyz`), how is it doing in numbers (`/metrics`)."""

import secrets
from typing import TYPE_CHECKING

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse, PlainTextResponse, Response
from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, Gauge, generate_latest

from app import __version__
from app.addresses import is_loopback
from app.links.statistics import State
from app.web.guard import allow

if TYPE_CHECKING:
    from app.runtime import Runtime

router = APIRouter()

LONGEST_LAG = 1.0
"""A loop that is later than this is not healthy [s]."""


@router.get("/healthz", dependencies=[allow("open")])
async def healthz(request: Request) -> JSONResponse:
    """200 while the loop is on time and every task alive, whatever the devices do: a pulled cable must not restart the HMI."""
    runtime: Runtime = request.app.state.runtime
    dead = sorted(kept.name for kept in runtime.keeper.kept.values() if not kept.alive)
    well = not dead and runtime.loop_lag < LONGEST_LAG
    return JSONResponse({"status": "ok" if well else "ill", "tasks_down": dead}, 200 if well else 503)


@router.get("/readyz", dependencies=[allow("open")])
async def readyz(request: Request) -> JSONResponse:
    """200 when the plant was read and every link has its devices; else 503 and what is missing."""
    runtime: Runtime = request.app.state.runtime
    down = sorted(name for name, link in runtime.links.items() if link.statistics.state is not State.UP)
    ready = runtime.plant is not None and not down
    told = {"status": "ok" if ready else "not ready", "plant": runtime.plant is not None, "links_down": down}
    return JSONResponse(told, 200 if ready else 503)


@router.get("/metrics", dependencies=[allow("open")])
async def metrics(request: Request) -> Response:
    """Numbers for Prometheus; from this machine, or with `Authorization: Bearer <POGON_METRICS_TOKEN>`."""
    runtime: Runtime = request.app.state.runtime
    token, given = runtime.settings.metrics_token, request.headers.get("authorization", "")
    known = bool(token) and secrets.compare_digest(given.encode(), f"Bearer {token}".encode())
    if not known and not (request.client and is_loopback(request.client.host) and not runtime.settings.behind_proxy):
        return PlainTextResponse("metrics are for this machine, or for the holder of POGON_METRICS_TOKEN\n", 403)
    return Response(generate_latest(_registry(runtime)), media_type=CONTENT_TYPE_LATEST)


def _registry(runtime: "Runtime") -> CollectorRegistry:
    registry = CollectorRegistry()

    def gauge(name: str, text: str, value: float, **labels: str) -> None:
        known = found.get(name) or Gauge(f"pogon_{name}", text, list(labels), registry=registry)
        found[name] = known
        (known.labels(**labels) if labels else known).set(value)

    found: dict[str, Gauge] = {}
    gauge("info", "Version of the server", 1, version=__version__)
    gauge("loop_lag_seconds", "How late the event loop is", runtime.loop_lag)
    gauge("tags", "Tags of the plant", len(runtime.tags))
    gauge("watchers", "Browser tabs with live values", runtime.live.watchers)
    for kept in runtime.keeper.kept.values():
        gauge("task_alive", "1 while the task runs", float(kept.alive), task=kept.name)
        gauge("task_failures", "How often it failed since the start", kept.failures, task=kept.name)
    for name, link in runtime.links.items():
        numbers = link.statistics
        gauge("link_up", "1 when every unit answers", float(numbers.state is State.UP), link=name)
        gauge("link_polls_per_second", "Telegrams answered", numbers.polls, link=name)
        gauge("link_scan_seconds", "Achieved time of a fast scan", numbers.scan_time, link=name)
        gauge("link_bus_share", "Share of the time with a telegram on its way", numbers.bus_share, link=name)
        gauge("link_timeouts", "Since the start", numbers.timeouts, link=name)
        gauge("link_exceptions", "Since the start", numbers.exceptions, link=name)
        gauge("link_retries", "Since the start", numbers.retries, link=name)
    if runtime.sim:
        gauge("simulation_lag_seconds", "How late the simulated plant is", runtime.sim.lag)
        gauge("simulation_overruns", "Rounds that gave time up", runtime.sim.overruns)
    return registry
