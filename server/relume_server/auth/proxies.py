"""Trusted proxies: by address, by network, or by host name."""

from __future__ import annotations

import asyncio
import ipaddress
import socket
from collections.abc import Callable, Sequence

RESOLVE_INTERVAL_S = 2.0
"""Shortest interval between lookups of a name, if a connection comes from an unknown address."""

Network = ipaddress.IPv4Network | ipaddress.IPv6Network


class Proxies:
    """The trusted proxies. Event loop only.

    A proxy in a cluster has a constant name and a changing address, so names are resolved again if a connection comes
    from an unknown address.

    Args:
        texts: addresses, networks such as 10.0.0.0/8, or names. clock: monotonic seconds.
    """

    def __init__(self, texts: Sequence[str], clock: Callable[[], float]) -> None:
        self._networks = [network for text in texts if (network := parse_network(text)) is not None]
        self._names = [text for text in texts if parse_network(text) is None]
        self._resolved_addresses: frozenset[str] = frozenset()
        self._clock, self._resolved_s = clock, -RESOLVE_INTERVAL_S

    async def resolve(self, peer: str) -> None:
        """Resolve the names if a connection comes from an unknown address."""
        is_due = self._clock() - self._resolved_s >= RESOLVE_INTERVAL_S
        if not self._names or not is_due or self.has(peer):
            return
        self._resolved_s = self._clock()
        address_sets = [await _resolve_name(name) for name in self._names]
        self._resolved_addresses = frozenset().union(*address_sets)

    def has(self, peer: str) -> bool:
        """True if the peer is a trusted proxy."""
        try:
            address = ipaddress.ip_address(peer)
        except ValueError:  # a Unix socket, or a test
            return False
        return str(address) in self._resolved_addresses or any(address in network for network in self._networks)


def parse_network(text: str) -> Network | None:
    """Parse an address or network; None for a name."""
    try:
        return ipaddress.ip_network(text, strict=False)
    except ValueError:
        return None


async def _resolve_name(name: str) -> frozenset[str]:
    """Addresses of a name; none if it does not resolve, such as a proxy that has not started yet."""
    try:
        address_infos = await asyncio.get_running_loop().getaddrinfo(name, None, type=socket.SOCK_STREAM)
    except OSError:
        return frozenset()
    return frozenset(str(address[0]) for *_, address in address_infos)
