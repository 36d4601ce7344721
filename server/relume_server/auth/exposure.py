"""Whether the settings let in whom somebody means to let in; asked once, before a server starts."""

from __future__ import annotations

import ipaddress
from typing import TYPE_CHECKING

from relume_server.errors import OpennessError

if TYPE_CHECKING:
    from relume_server.settings import Settings


def check_openness(settings: Settings) -> None:
    """Raise OpennessError where a server would be open to more people than its settings sound like."""
    names_people = settings.user_header or settings.proxy_roles or "proxy_role" in settings.model_fields_set
    if names_people and not settings.login:
        raise OpennessError(
            "RELUME_USER_HEADER, RELUME_PROXY_ROLE or RELUME_PROXY_ROLES is set, but nobody logs in, so that everybody "
            "may do everything; set RELUME_LOGIN=true, or take those away"
        )
    if names_people and not settings.user_header:
        raise OpennessError(
            "RELUME_PROXY_ROLE or RELUME_PROXY_ROLES is set, but no header in which a proxy says who calls; set "
            "RELUME_USER_HEADER=X-Forwarded-User, or take those away"
        )
    if settings.user_header and not settings.trusted_proxies:
        raise OpennessError(
            "RELUME_USER_HEADER is set, but no proxy whose word counts; name its address in RELUME_TRUSTED_PROXIES"
        )
    if "login" not in settings.model_fields_set and not _is_loopback(settings.host):
        raise OpennessError(
            f"on {settings.host} whoever reaches this machine could read, import and delete everything; set "
            "RELUME_LOGIN=true, or RELUME_LOGIN=false if that is what you want"
        )


def _is_loopback(host: str) -> bool:
    """Whether nobody outside reaches an address to listen on."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
