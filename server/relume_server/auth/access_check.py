"""Check before startup that the settings do not give access to more people than intended."""

from __future__ import annotations

import ipaddress
from typing import TYPE_CHECKING

from relume_server.errors import UnsafeAccessError

if TYPE_CHECKING:
    from relume_server.settings import Settings


def check_access_settings(settings: Settings) -> None:
    """Raise UnsafeAccessError if a server would be open to more people than its settings suggest."""
    names_people = settings.user_header or settings.proxy_roles or "proxy_role" in settings.model_fields_set
    if names_people and not settings.login:
        raise UnsafeAccessError(
            "RELUME_USER_HEADER, RELUME_PROXY_ROLE or RELUME_PROXY_ROLES is set, but there is no login, so everyone "
            "is admin; set RELUME_LOGIN=true, or remove these settings"
        )
    if names_people and not settings.user_header:
        raise UnsafeAccessError(
            "RELUME_PROXY_ROLE or RELUME_PROXY_ROLES is set, but no header with the user's name; set "
            "RELUME_USER_HEADER=X-Forwarded-User, or remove these settings"
        )
    if settings.user_header and not settings.trusted_proxies:
        raise UnsafeAccessError(
            "RELUME_USER_HEADER is set, but no trusted proxy; add its address to RELUME_TRUSTED_PROXIES"
        )
    if "login" not in settings.model_fields_set and not _is_loopback(settings.host):
        raise UnsafeAccessError(
            f"on {settings.host} anyone who reaches this machine could read, import and delete everything; set "
            "RELUME_LOGIN=true, or RELUME_LOGIN=false if that is intended"
        )


def _is_loopback(host: str) -> bool:
    """True if a listening address is not reachable from other machines."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
