"""Token buckets: a mean rate of calls with bursts per caller, for a bounded number of callers.

The libraries for this (slowapi, limits) keep counts in a store of their own and wrap each route; this is twenty lines,
and applies to all requests.
"""

from __future__ import annotations

import ipaddress
import math
from collections import OrderedDict
from collections.abc import Callable

MAX_BUCKETS = 10_000
IPV6_BITS = 64
"""Prefix length of an IPv6 network, which identifies a customer: its owner controls all addresses in it."""


def bucket_name(address: str) -> str:
    """Bucket name of an address: IPv6 by /64 network."""
    try:
        parsed = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:  # a name from a proxy, a Unix socket, or a test
        return address
    if parsed.version == 4:
        return str(parsed)
    mapped = parsed.ipv4_mapped
    return str(mapped or ipaddress.ip_network((parsed, IPV6_BITS), strict=False))


class TokenBuckets:
    """One bucket per name. Event loop only.

    Args:
        per_second: mean rate. burst: calls at once after a pause. clock: monotonic seconds.
    """

    def __init__(self, per_second: float, burst: float, clock: Callable[[], float]) -> None:
        self._per_second, self._burst, self._clock = per_second, burst, clock
        self._levels: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def wait_s(self, name: str) -> float:
        """Seconds until the next call is allowed; 0: now."""
        return max(0.0, (1.0 - self.level(name)) / self._per_second)

    def take(self, name: str) -> float:
        """Take one call; if there is none, take nothing and return the seconds to wait."""
        wait_s = self.wait_s(name)
        if wait_s == 0.0:
            self._levels[name] = self.level(name) - 1.0, self._clock()
            self._levels.move_to_end(name)
            if len(self._levels) > MAX_BUCKETS:
                self._levels.popitem(last=False)
        return wait_s

    def refund(self, name: str) -> None:
        """Give back the last call taken."""
        self._levels[name] = min(self._burst, self.level(name) + 1.0), self._clock()

    def level(self, name: str) -> float:
        """Calls that are allowed at once."""
        level, at_s = self._levels.get(name, (self._burst, -math.inf))
        return min(self._burst, level + (self._clock() - at_s) * self._per_second)
