"""Token buckets: so many calls a second on the mean, some more at once; of each caller, and of not too many callers.

The libraries for this (slowapi, limits) keep their counts in a store of their own and wrap each route; this is twenty
lines, and stands where all requests pass.
"""

from __future__ import annotations

import ipaddress
import math
from collections import OrderedDict
from collections.abc import Callable

MAX_BUCKETS = 10_000
IPV6_BITS = 64
"""Of an address of IPv6, those that tell one customer from another: who has a network has all addresses in it."""


def bucket_name(address: str) -> str:
    """Name of the bucket of an address: IPv6 counts by networks of /64."""
    try:
        parsed = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:  # what a proxy said, a socket file, or a test
        return address
    if parsed.version == 4:
        return str(parsed)
    mapped = parsed.ipv4_mapped
    return str(mapped or ipaddress.ip_network((parsed, IPV6_BITS), strict=False))


class TokenBuckets:
    """One bucket for each name; used from the event loop only.

    Args:
        per_second: calls on the mean. burst: calls at once, after a rest. clock: seconds.
    """

    def __init__(self, per_second: float, burst: float, clock: Callable[[], float]) -> None:
        self._per_second, self._burst, self._clock = per_second, burst, clock
        self._levels: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def wait_s(self, name: str) -> float:
        """Seconds until a call of this name may come; 0: now."""
        return max(0.0, (1.0 - self.level(name)) / self._per_second)

    def take(self, name: str) -> float:
        """Take one call; seconds to wait where there is none, which takes nothing."""
        wait_s = self.wait_s(name)
        if wait_s == 0.0:
            self._levels[name] = self.level(name) - 1.0, self._clock()
            self._levels.move_to_end(name)
            if len(self._levels) > MAX_BUCKETS:
                self._levels.popitem(last=False)
        return wait_s

    def refund(self, name: str) -> None:
        """What was taken last did not count after all."""
        self._levels[name] = min(self._burst, self.level(name) + 1.0), self._clock()

    def level(self, name: str) -> float:
        """How many calls of this name may come at once."""
        level, at_s = self._levels.get(name, (self._burst, -math.inf))
        return min(self._burst, level + (self._clock() - at_s) * self._per_second)
