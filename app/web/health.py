"""Is the server well (`/healthz`), does it reach its devices (`/readyz`), how is it doing in numbers (`/metrics`)."""

import secrets
from collections import Counter
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse, PlainTextResponse, Response
from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, ProcessCollector, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from app import __version__
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
    return Response(generate_latest(_registry(runtime)), media_type=CONTENT_TYPE_LATEST)


def _registry(runtime: "Runtime") -> CollectorRegistry:
    registry = CollectorRegistry()
    registry.register(_Figures(runtime))
    ProcessCollector(registry=registry)
    return registry


class _Figures(Collector):
    """What the runtime has counted and measured, as it stands."""

    def __init__(self, runtime: "Runtime") -> None:
        self._runtime = runtime

    def collect(self) -> Iterable[Metric]:
        """Every figure with its kind: a counter only grows from the start of the server on, a gauge goes both ways."""
        found: dict[str, Metric] = {}
        for kind, name, text, value, labels in self._rows():
            family = found.get(name)
            if family is None:
                family = found[name] = kind(f"pogon_{name}", text, labels=list(labels))
            assert isinstance(family, GaugeMetricFamily | CounterMetricFamily)
            family.add_metric(list(labels.values()), value)
        return found.values()

    def _rows(
        self,
    ) -> Iterator[tuple[type[GaugeMetricFamily] | type[CounterMetricFamily], str, str, float, dict[str, str]]]:
        runtime, gauge, counter = self._runtime, GaugeMetricFamily, CounterMetricFamily
        yield gauge, "info", "Version of the server", 1, {"version": __version__}
        yield gauge, "loop_lag_seconds", "How late the event loop is", runtime.sweep.loop_lag, {}
        yield gauge, "tags", "Tags of the plant", len(runtime.tags), {}
        yield gauge, "watchers", "Browser tabs with live values", runtime.live.watchers, {}
        for task in runtime.supervisor.tasks.values():
            yield gauge, "task_alive", "1 while the task runs", float(task.alive), {"task": task.name}
            yield counter, "task_failures", "How often it failed", task.failures, {"task": task.name}
        for name, link in runtime.links.items():
            numbers, of = link.statistics, {"link": name}
            yield gauge, "link_up", "1 when every unit answers", float(numbers.state is LinkState.UP), of
            yield gauge, "link_polls_per_second", "Telegrams answered", numbers.polls, of
            yield gauge, "link_scan_seconds", "Achieved time of a fast scan", numbers.scan_time, of
            yield gauge, "link_bus_share", "Share of the time with a telegram on its way", numbers.bus_share, of
            yield counter, "link_timeouts", "Telegrams without an answer", numbers.timeouts, of
            yield counter, "link_exceptions", "Answers that were exceptions", numbers.exceptions, of
            yield counter, "link_retries", "Telegrams sent again", numbers.retries, of
        if runtime.sim:
            yield gauge, "simulation_lag_seconds", "How late the simulated plant is", runtime.sim.lag, {}
            yield counter, "simulation_overruns", "Rounds that gave time up", runtime.sim.overruns, {}
        alarms = Counter(
            (str(one.priority), "unacknowledged" if one.unacked else "other") for one in runtime.alarms.list.active()
        )
        for priority in ("1", "2", "3", "4"):
            for state in ("unacknowledged", "other"):
                yield (
                    gauge,
                    "alarms",
                    "Alarms that stand",
                    alarms[priority, state],
                    {"priority": priority, "state": state},
                )
        for outcome, count in sorted(runtime.command_ends.counts.items()):
            yield counter, "commands", "Commands that came to an end", count, {"state": outcome}
        yield from self._storage()

    def _storage(
        self,
    ) -> Iterator[tuple[type[GaugeMetricFamily] | type[CounterMetricFamily], str, str, float, dict[str, str]]]:
        recorder, gauge = self._runtime.recorder, GaugeMetricFamily
        yield gauge, "history_rows_per_second", "Rows that the history takes", recorder.rows_per_second, {}
        yield CounterMetricFamily, "history_dropped_rows", "Rows that the history could not take", recorder.dropped, {}
        yield gauge, "history_full", "1 while nothing can be stored", float(recorder.full), {}
        yield gauge, "history_fill_ratio", "How much of its quota the history uses", recorder.upkeep.fill, {}
        if recorder.upkeep.size is not None:
            yield gauge, "history_bytes", "Size of the history", recorder.upkeep.size.used, {}
            yield gauge, "history_rows_today", "Rows stored since midnight", recorder.upkeep.size.rows_today, {}
            yield gauge, "disk_free_bytes", "Free on the disk of the history", recorder.upkeep.size.free, {}
