"""Metrics for Prometheus; one registry per app."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, ProcessCollector
from prometheus_client.core import GaugeMetricFamily
from prometheus_client.registry import Collector

from relume.core.cache import CacheOwner
from relume_worker.database.failures import DATABASE_ERRORS

METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "DELETE", "OPTIONS"})
LATENCY_S = (0.001, 0.002, 0.004, 0.006, 0.008, 0.010, 0.015, 0.020, 0.033, 0.060, 0.100, 0.250, 1.0, 4.0)


class _CacheCollector(Collector):
    """Cache size by kind and bake, which change at run time."""

    def __init__(self, bytes_by_owner: Callable[[], Mapping[CacheOwner, int]]) -> None:
        self._bytes_by_owner = bytes_by_owner

    def collect(self) -> Iterator[GaugeMetricFamily]:
        """Yield one gauge."""
        gauge = GaugeMetricFamily("relume_cache_bytes", "Bytes in the cache, by kind and bake", labels=["kind", "bake"])
        for owner, num_bytes in self._bytes_by_owner().items():
            gauge.add_metric(owner, num_bytes)
        yield gauge


class _JobCollector(Collector):
    """Number of jobs by kind and state; none while the database is unavailable."""

    def __init__(self, count_jobs: Callable[[], Mapping[tuple[str, str], int]]) -> None:
        self._count_jobs = count_jobs

    def collect(self) -> Iterator[GaugeMetricFamily]:
        """Yield one gauge."""
        gauge = GaugeMetricFamily("relume_jobs", "Jobs by kind and state", labels=["kind", "state"])
        with suppress(*DATABASE_ERRORS):
            for labels, count in self._count_jobs().items():
                gauge.add_metric(labels, count)
        yield gauge


class Metrics:
    """Metrics by name, with Prometheus' conventions: seconds and bytes, counters end in _total."""

    def __init__(self) -> None:
        self.registry = registry = CollectorRegistry()
        self.sessions = Gauge("relume_sessions", "Live sessions", registry=registry)
        self.frames = Counter("relume_frames", "Frames sent", ["kind", "format"], registry=registry)
        self.frame_bytes = Counter("relume_frame_bytes", "Bytes of frames sent", registry=registry)
        self.edits = Counter("relume_edits", "Edits received", ["outcome"], registry=registry)
        self.bakes = Counter("relume_bakes", "Bakes submitted", registry=registry)
        self.requests = Counter("relume_http_requests", "HTTP requests", ["method", "status"], registry=registry)
        self.refused_sessions = Counter(
            "relume_refused_sessions", "Sessions that were refused", ["reason"], registry=registry
        )
        self.refused_sessions.labels("busy")  # create all labels now, so that `increase` sees the first event
        self.request_seconds = self._histogram("relume_http_request_seconds", "Request received to response started")
        self._draining = Gauge(
            "relume_draining", "Drain state: 1 while the server is draining, otherwise 0", registry=registry
        )
        self._free = Gauge("relume_disk_free_bytes", "Free disk space of the data directory", registry=registry)
        self._least_free = Gauge(
            "relume_disk_min_free_bytes", "Free disk space below which /readyz fails", registry=registry
        )
        self.edit_to_socket = self._histogram("relume_edit_to_socket_seconds", "Edit received to frame sent")
        self.update = self._histogram("relume_frame_update_seconds", "Updating the image")
        self.encode = self._histogram("relume_frame_encode_seconds", "Encoding a frame")
        self.freeze = self._histogram("relume_freeze_seconds", "Precomputing a curve")
        self._cache = Gauge(
            "relume_frozen_cache_bytes", "Bytes in the cache of results computed from bakes", registry=registry
        )
        self._live_bytes = Gauge(
            "relume_component_bytes", "Bytes of arrays by component of the server", ["component"], registry=registry
        )
        self._workers = Gauge(
            "relume_workers_resident_bytes", "Memory of the server's own worker processes", registry=registry
        )
        ProcessCollector(registry=registry)  # process_resident_memory_bytes and others

    def watch_cache(
        self, used_bytes: Callable[[], int], bytes_by_owner: Callable[[], Mapping[CacheOwner, int]]
    ) -> None:
        """Set the source of the cache size, in total and by kind and bake."""
        self._cache.set_function(used_bytes)
        self.registry.register(_CacheCollector(bytes_by_owner))

    def watch_owners(self, owners: Mapping[str, Callable[[], int]]) -> None:
        """Set the sources of memory by component of this process; shared memory is counted once."""
        for owner, get_bytes in owners.items():
            self._live_bytes.labels(owner).set_function(get_bytes)

    def watch_workers(self, resident_bytes: Callable[[], int]) -> None:
        """Set the source of the worker processes' memory."""
        self._workers.set_function(resident_bytes)

    def watch_jobs(self, count_jobs: Callable[[], Mapping[tuple[str, str], int]]) -> None:
        """Set the source of the number of jobs, by kind and state."""
        self.registry.register(_JobCollector(count_jobs))

    def watch_readiness(self, is_draining: Callable[[], bool], free_bytes: Callable[[], int], least_bytes: int) -> None:
        """Set the sources of the readiness metrics."""
        self._draining.set_function(is_draining)
        self._free.set_function(free_bytes)
        self._least_free.set(least_bytes)

    def count_request(self, method: str, status: int, seconds: float) -> None:
        """Count an HTTP response; unknown methods share one label."""
        self.request_seconds.observe(seconds)
        self.requests.labels(method if method in METHODS else "other", str(status)).inc()

    def _histogram(self, name: str, text: str) -> Histogram:
        return Histogram(name, text, buckets=LATENCY_S, registry=self.registry)
