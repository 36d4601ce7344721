"""What the server counts and times, as Prometheus sees it; one registry per app."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, ProcessCollector
from prometheus_client.core import GaugeMetricFamily
from prometheus_client.registry import Collector

from relume.memory import Holder

METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "DELETE", "OPTIONS"})
LATENCY_S = (0.001, 0.002, 0.004, 0.006, 0.008, 0.010, 0.015, 0.020, 0.033, 0.060, 0.100, 0.250, 1.0, 4.0)


class _MemoryCollector(Collector):
    """What is in the memory: kinds and bakes come and go."""

    def __init__(self, held: Callable[[], Mapping[Holder, int]]) -> None:
        self._held = held

    def collect(self) -> Iterator[GaugeMetricFamily]:
        """One gauge."""
        found = GaugeMetricFamily("relume_memory_bytes", "Bytes made from bakes, by kind", labels=["kind", "bake"])
        for holder, num_bytes in self._held().items():
            found.add_metric(holder, num_bytes)
        yield found


class Metrics:
    """The figures by name."""

    def __init__(self) -> None:
        self.registry = registry = CollectorRegistry()
        self.sessions = Gauge("relume_sessions", "Live sessions", registry=registry)
        self.frames = Counter("relume_frames", "Frames sent", ["kind", "format"], registry=registry)
        self.frame_bytes = Counter("relume_frame_bytes", "Bytes of frames sent", registry=registry)
        self.edits = Counter("relume_edits", "Edits received", ["outcome"], registry=registry)
        self.bakes = Counter("relume_bakes", "Bakes submitted", registry=registry)
        self.requests = Counter("relume_http_requests", "HTTP requests", ["method", "status"], registry=registry)
        self.edit_to_socket = self._histogram("relume_edit_to_socket_seconds", "Edit received to frame handed over")
        self.update = self._histogram("relume_frame_update_seconds", "Updating the picture")
        self.encode = self._histogram("relume_frame_encode_seconds", "Encoding a frame")
        self.freeze = self._histogram("relume_freeze_seconds", "Freezing a curve")
        self._cache = Gauge("relume_frozen_cache_bytes", "Bytes of all that was made from bakes", registry=registry)
        self._held = Gauge("relume_held_bytes", "Bytes of arrays that the server holds", ["holder"], registry=registry)
        self._workers = Gauge(
            "relume_workers_resident_bytes", "Memory of the server's own worker processes", registry=registry
        )
        ProcessCollector(registry=registry)  # process_resident_memory_bytes and the like

    def watch_memory(self, used_bytes: Callable[[], int], held: Callable[[], Mapping[Holder, int]]) -> None:
        """Where it is read from what the memory holds, in all and by kind and bake."""
        self._cache.set_function(used_bytes)
        self.registry.register(_MemoryCollector(held))

    def watch_holders(self, holders: Mapping[str, Callable[[], int]]) -> None:
        """Where it is read from who holds memory in this process; what two hold is counted by one."""
        for holder, held_bytes in holders.items():
            self._held.labels(holder).set_function(held_bytes)

    def watch_workers(self, resident_bytes: Callable[[], int]) -> None:
        """Where the memory of the server's own worker processes is read from."""
        self._workers.set_function(resident_bytes)

    def count_request(self, method: str, status: int) -> None:
        """One HTTP response; a method that nobody knows must not become a label of its own."""
        self.requests.labels(method if method in METHODS else "other", str(status)).inc()

    def _histogram(self, name: str, text: str) -> Histogram:
        return Histogram(name, text, buckets=LATENCY_S, registry=self.registry)
