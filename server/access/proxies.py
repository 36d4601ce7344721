"""Proxies whose word on a request counts: by address, by network, or by a name of the network that stands for one."""

from __future__ import annotations

import asyncio
import ipaddress
import socket
from collections.abc import Callable, Sequence

LOOK_UP_EVERY_S = 2.0
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
        self._networks = [network for text in texts if (network := network_of(text)) is not None]
        self._names = [text for text in texts if network_of(text) is None]
        self._named: frozenset[str] = frozenset()
        self._clock, self._looked_up_s = clock, -LOOK_UP_EVERY_S

    async def look_up(self, peer: str) -> None:
        """Have the names' addresses where a connection comes from one that is not known."""
        is_due = self._clock() - self._looked_up_s >= LOOK_UP_EVERY_S
        if not self._names or not is_due or self.has(peer):
            return
        self._looked_up_s = self._clock()
        found = [await _addresses(name) for name in self._names]
        self._named = frozenset().union(*found)

    def has(self, peer: str) -> bool:
        """Whether a connection from an address is a trusted proxy's."""
        try:
            address = ipaddress.ip_address(peer)
        except ValueError:  # a socket file, or a test
            return False
        return str(address) in self._named or any(address in network for network in self._networks)


def network_of(text: str) -> Network | None:
    """The address or network that a text is; None: it is a name."""
    try:
        return ipaddress.ip_network(text, strict=False)
    except ValueError:
        return None


async def _addresses(name: str) -> frozenset[str]:
    """Of a name; none while it has none, as a proxy has that has not started."""
    try:
        found = await asyncio.get_running_loop().getaddrinfo(name, None, type=socket.SOCK_STREAM)
    except OSError:
        return frozenset()
    return frozenset(str(address[0]) for *_, address in found)
