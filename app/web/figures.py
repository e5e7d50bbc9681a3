"""The numbers of a server as Prometheus reads them (`/metrics`).

Loaded when somebody asks for them first: the library brings a web server and a client of its own along, 2 MB that others need not carry.
"""

from collections import Counter
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from fastapi.responses import Response
from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, ProcessCollector, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from app import __version__
from app.links.statistics import LinkState

if TYPE_CHECKING:
    from app.runtime import Runtime


def answer_in_figures(runtime: "Runtime") -> Response:
    """All figures as they stand, in the text that Prometheus reads."""
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
