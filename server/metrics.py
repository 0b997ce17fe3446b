"""Figures for Prometheus: what happened to requests and jobs, and what the server holds."""

import shutil
from collections.abc import Iterator
from pathlib import Path

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, ProcessCollector, generate_latest
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector
from sqlalchemy import func, select

from server.store.database import Store
from server.store.models import JobRow, SessionRow, WaitingRow
from server.store.solves import ENDED

_SECONDS = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0)

_METHODS = ("GET", "HEAD", "POST", "PATCH", "PUT", "DELETE", "OPTIONS")
"""A label for each: others would have no end."""


class Metrics:
    """The figures of one server."""

    def __init__(self) -> None:
        self._registry = CollectorRegistry()
        ProcessCollector(registry=self._registry)
        self._requests = Counter(
            "scancell_requests",
            "Requests by what became of them.",
            ["method", "route", "status"],
            registry=self._registry,
        )
        self._seconds = Histogram(
            "scancell_request_seconds",
            "From a request's head to the end of its answer.",
            ["route"],
            buckets=_SECONDS,
            registry=self._registry,
        )
        self.in_progress = Gauge(
            "scancell_requests_in_progress",
            "Requests that are being answered, streams too.",
            registry=self._registry,
        )

    def count_request(self, method: str, route: str, status: int, seconds: float) -> None:
        """Note a request that has ended; status 0 is one that was never answered."""
        self._requests.labels(method if method in _METHODS else "other", route, str(status)).inc()
        if not route.endswith("/events"):
            self._seconds.labels(route).observe(seconds)

    def watch_store(self, store: Store, data: Path) -> None:
        """Show also what the store and its disk hold."""
        self._registry.register(_StoreCollector(store, data))

    def text(self) -> bytes:
        """Return everything in Prometheus' text format."""
        return generate_latest(self._registry)


class _StoreCollector(Collector):
    """What is asked of the store each time the figures are."""

    def __init__(self, store: Store, data: Path) -> None:
        self._store = store
        self._data = data

    def describe(self) -> Iterator[Metric]:
        """Yield nothing: the store may not be there yet when this is registered."""
        return iter(())

    def collect(self) -> Iterator[Metric]:
        """Yield the figures of this moment."""
        with self._store.read() as db:
            sessions = db.scalar(select(func.count()).select_from(SessionRow)) or 0
            waiting = db.scalar(select(func.count()).select_from(WaitingRow)) or 0
            query = select(JobRow.status, func.count()).where(JobRow.status.not_in(ENDED)).group_by(JobRow.status)
            jobs = dict(db.execute(query).all())
        yield GaugeMetricFamily("scancell_sessions", "Sessions in the store.", value=sessions)
        yield GaugeMetricFamily("scancell_captures_waiting", "Captures that wait to be measured.", value=waiting)
        unfinished = GaugeMetricFamily("scancell_jobs", "Jobs that have not ended.", labels=["status"])
        for status in ("queued", "running"):
            unfinished.add_metric([status], jobs.get(status, 0))
        yield unfinished
        free = shutil.disk_usage(self._data).free
        yield GaugeMetricFamily("scancell_disk_free_bytes", "Free on the disk with the data folder.", value=free)
