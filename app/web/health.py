"""Is the server well (`/healthz`), does it reach its devices (`/readyz`), how is it doing in numbers (`/metrics`)."""

import secrets
from typing import TYPE_CHECKING

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse, PlainTextResponse, Response

from app.addresses import is_loopback
from app.links.statistics import LinkState
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
    dead = sorted(task.name for task in runtime.supervisor.tasks.values() if not task.alive)
    well = not dead and runtime.sweep.loop_lag < LONGEST_LAG
    return JSONResponse({"status": "ok" if well else "ill", "tasks_down": dead}, 200 if well else 503)


@router.get("/readyz", dependencies=[allow("open")])
async def readyz(request: Request) -> JSONResponse:
    """200 when the plant was read and every link has its devices; else 503 and what is missing."""
    runtime: Runtime = request.app.state.runtime
    down = sorted(name for name, link in runtime.links.items() if link.statistics.state is not LinkState.UP)
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
    from app.web.figures import answer_in_figures

    return answer_in_figures(runtime)
