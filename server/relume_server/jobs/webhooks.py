"""Webhooks: a signed POST to an allowed address when a job has ended.

Addresses come from requests, so the server must not be led to its own network: hosts are listed by the operator, names
are resolved once, and the connection is made to an address that was checked. Redirects are not followed.
"""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import logging
import socket
import ssl
import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from http.client import HTTPConnection, HTTPException
from typing import NamedTuple
from urllib.parse import SplitResult, urlsplit

from relume.core.errors import Description, ParameterError

log = logging.getLogger(__name__)
TIMEOUT_S = 10.0
RETRY_DELAYS_S = (2.0, 15.0, 60.0)
_NUM_THREADS = 4
_DEFAULT_PORTS = {"http": 80, "https": 443}
_PUBLIC_V6 = ipaddress.ip_network("2000::/3")

Address = ipaddress.IPv4Address | ipaddress.IPv6Address
Network = ipaddress.IPv4Network | ipaddress.IPv6Network


class _UndeliveredError(Exception):
    """A message was not accepted; with the reason."""


class WebhookHosts(NamedTuple):
    """Hosts to which messages may go.

    Attributes:
        names: host names in lower case. networks: allowed addresses that are not public.
    """

    names: frozenset[str]
    networks: tuple[Network, ...]

    @classmethod
    def parse(cls, hosts: Sequence[str]) -> WebhookHosts:
        """Parse host names, addresses and networks such as 10.1.0.0/16."""
        names, networks = set(), []
        for host in hosts:
            try:
                networks.append(ipaddress.ip_network(host, strict=False))
            except ValueError:
                names.add(host.lower().rstrip("."))
        return cls(frozenset(names), tuple(networks))

    def allows_host(self, host: str) -> bool:
        """True if a host of an URL is listed: its name, or a network with its address."""
        try:
            return self._contains(ipaddress.ip_address(host))
        except ValueError:
            return host in self.names

    def allows_address(self, address: Address) -> bool:
        """True if the address of an allowed host is public, or in a listed network."""
        return is_public(address) or self._contains(address)

    def _contains(self, address: Address) -> bool:
        return any(address in network for network in self.networks)


def is_public(address: Address) -> bool:
    """True for unicast addresses of the internet; false for those that embed another address."""
    if isinstance(address, ipaddress.IPv6Address):
        is_tunnel = address.sixtofour is not None or address.teredo is not None
        return address in _PUBLIC_V6 and address.is_global and not is_tunnel
    return address.is_global and not address.is_multicast


class Webhooks:
    """Sends messages in the background, each up to four times. Messages of a server that stops are lost.

    Args:
        hosts: allowed hosts, see `WebhookHosts`; none: webhooks are off. secret: key of signatures.
    """

    def __init__(self, hosts: Sequence[str], secret: str) -> None:
        self._hosts, self._secret = WebhookHosts.parse(hosts), secret.encode()
        self._threads = ThreadPoolExecutor(_NUM_THREADS, "relume-webhook")
        self._closing = threading.Event()

    def close(self) -> None:
        """Stop; waiting messages are dropped."""
        self._closing.set()
        self._threads.shutdown(wait=False, cancel_futures=True)

    def check(self, url: str | None) -> None:
        """Raise ParameterError unless messages may go to this address; None is allowed."""
        if url is None:
            return
        if self._hosts == WebhookHosts(frozenset(), ()):
            raise ParameterError("/webhook", url, "none, because this server allows no hosts (RELUME_WEBHOOK_HOSTS)")
        parts = _split(url)
        if parts is None:
            raise ParameterError("/webhook", url, "an http or https address with a host, without user and fragment")
        if not self._hosts.allows_host(_host(parts)):
            allowed = "an address with a host that this server allows (RELUME_WEBHOOK_HOSTS)"
            raise ParameterError("/webhook", Description(f"of host {_host(parts)[:80]!r}"), allowed)

    def send(self, url: str, body: bytes) -> None:
        """Send a JSON document in the background; a failure is logged."""
        with suppress(RuntimeError):  # the server is closing
            self._threads.submit(self._deliver, url, body)

    def _deliver(self, url: str, body: bytes) -> None:
        reason = ""
        for delay_s in (0.0, *RETRY_DELAYS_S):
            if self._closing.wait(delay_s):
                return
            try:
                self._post(url, body)
            except (_UndeliveredError, OSError, HTTPException, ValueError) as error:
                is_own_text = isinstance(error, _UndeliveredError | OSError)  # others may quote the target
                reason = str(error) if is_own_text else type(error).__name__
            else:
                return
        parts = _split(url)
        log.warning(
            "a webhook of %s was not accepted: %s", "an unknown host" if parts is None else _host(parts), reason
        )

    def _post(self, url: str, body: bytes) -> None:
        """Send one message. Raises _UndeliveredError, OSError, HTTPException: it was not accepted."""
        parts = _split(url)
        if parts is None or not self._hosts.allows_host(_host(parts)):  # settings may have changed
            raise _UndeliveredError("its host is not allowed")
        port = parts.port or _DEFAULT_PORTS[parts.scheme]
        context = ssl.create_default_context() if parts.scheme == "https" else None
        connection = _PinnedConnection(_host(parts), port, self._resolve(_host(parts), port), context)
        deadline = threading.Timer(TIMEOUT_S, connection.abort)  # also for answers that drip in
        deadline.daemon = True
        deadline.start()
        try:
            target = (parts.path or "/") + (f"?{parts.query}" if parts.query else "")
            connection.request("POST", target, body, self._headers(body) | {"Host": parts.netloc})
            status = connection.getresponse().status
        finally:
            deadline.cancel()
            connection.close()
        if not 200 <= status < 300:
            raise _UndeliveredError(
                f"status {status}" + (", redirects are not followed" if 300 <= status < 400 else "")
            )

    def _headers(self, body: bytes) -> dict[str, str]:
        return {
            "Content-Type": "application/json",
            "User-Agent": "relume",
            "X-Relume-Signature": sign(self._secret, int(time.time()), body),
        }

    def _resolve(self, host: str, port: int) -> str:
        """Return an address of a host, all of whose addresses are allowed. Raises _UndeliveredError."""
        addresses = [info[4][0] for info in socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)]
        for text in addresses:
            if not self._hosts.allows_address(ipaddress.ip_address(str(text))):
                raise _UndeliveredError("its host has an address that is not public and not in RELUME_WEBHOOK_HOSTS")
        return str(addresses[0])


def sign(secret: bytes, time_s: int, body: bytes) -> str:
    """Return the header of a message: its time, in seconds since 1970, and the HMAC-SHA256 of "time.body"."""
    digest = hmac.new(secret, f"{time_s}.".encode() + body, hashlib.sha256).hexdigest()
    return f"t={time_s},v1={digest}"


class _PinnedConnection(HTTPConnection):
    """A connection to an address that was checked, with the host's name in TLS."""

    def __init__(self, host: str, port: int, address: str, context: ssl.SSLContext | None) -> None:
        super().__init__(host, port, timeout=TIMEOUT_S)
        self._address, self._context = address, context

    def connect(self) -> None:
        """Connect without asking for the host's address again."""
        self.sock = socket.create_connection((self._address, self.port), TIMEOUT_S)
        if self._context is not None:
            self.sock = self._context.wrap_socket(self.sock, server_hostname=self.host)

    def abort(self) -> None:
        """End all waiting of another thread."""
        if self.sock is not None:
            with suppress(OSError):
                self.sock.shutdown(socket.SHUT_RDWR)


def _split(url: str) -> SplitResult | None:
    """Parts of an address; None if it is none for webhooks."""
    try:
        parts = urlsplit(url)
        _ = parts.port  # raises ValueError if it is no port
    except ValueError:
        return None
    is_plain = url.isascii() and url.isprintable() and not set(" \\") & set(url)
    is_allowed = parts.scheme in _DEFAULT_PORTS and parts.hostname and "@" not in parts.netloc and not parts.fragment
    return parts if is_plain and is_allowed else None


def _host(parts: SplitResult) -> str:
    return (parts.hostname or "").rstrip(".")
