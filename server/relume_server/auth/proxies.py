"""Proxies whose word on a request counts: by address, by network, or by a name of the network that stands for one."""

from __future__ import annotations

import asyncio
import ipaddress
import socket
from collections.abc import Callable, Sequence

RESOLVE_INTERVAL_S = 2.0
"""How often a name is looked up at most, where a connection comes from an address that is not known."""

Network = ipaddress.IPv4Network | ipaddress.IPv6Network


class Proxies:
    """The trusted ones; on the event loop.

    A proxy in a cluster has a name that stays and an address that does not, so names are looked up again whenever a
    connection comes from elsewhere.

    Args:
        texts: addresses, networks such as 10.0.0.0/8, or names. clock: seconds.
    """

    def __init__(self, texts: Sequence[str], clock: Callable[[], float]) -> None:
        self._networks = [network for text in texts if (network := parse_network(text)) is not None]
        self._names = [text for text in texts if parse_network(text) is None]
        self._resolved_addresses: frozenset[str] = frozenset()
        self._clock, self._resolved_s = clock, -RESOLVE_INTERVAL_S

    async def resolve(self, peer: str) -> None:
        """Have the names' addresses where a connection comes from one that is not known."""
        is_due = self._clock() - self._resolved_s >= RESOLVE_INTERVAL_S
        if not self._names or not is_due or self.has(peer):
            return
        self._resolved_s = self._clock()
        address_sets = [await _resolve_name(name) for name in self._names]
        self._resolved_addresses = frozenset().union(*address_sets)

    def has(self, peer: str) -> bool:
        """Whether a connection from an address is a trusted proxy's."""
        try:
            address = ipaddress.ip_address(peer)
        except ValueError:  # a socket file, or a test
            return False
        return str(address) in self._resolved_addresses or any(address in network for network in self._networks)


def parse_network(text: str) -> Network | None:
    """The address or network that a text is; None: it is a name."""
    try:
        return ipaddress.ip_network(text, strict=False)
    except ValueError:
        return None


async def _resolve_name(name: str) -> frozenset[str]:
    """Of a name; none while it has none, as a proxy has that has not started."""
    try:
        address_infos = await asyncio.get_running_loop().getaddrinfo(name, None, type=socket.SOCK_STREAM)
    except OSError:
        return frozenset()
    return frozenset(str(address[0]) for *_, address in address_infos)
