"""Tokens, quotas and audit of one database, for the lifetime of the server."""

from __future__ import annotations

import asyncio
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

from anyio.to_thread import run_sync
from sqlalchemy.orm import Session, sessionmaker

from relume_server.auth.audit import Audit, Change
from relume_server.auth.identity import Identity
from relume_server.auth.quotas import Quotas
from relume_server.auth.roles import Caller
from relume_server.auth.tokens import TOKEN_CACHE_S, TokenStore
from relume_server.errors import LoginError
from relume_server.runtime.shared_poll import SharedPoll
from relume_worker.database.failures import DATABASE_ERRORS

if TYPE_CHECKING:
    from relume_server.settings import Settings

PROXY_REVALIDATION_S = 900.0
"""Only the proxy knows whether its users are still authorized: after this time they must connect again."""


class AuthServices:
    """Tokens and identities, quotas, and the audit of one database."""

    def __init__(self, sessions: sessionmaker[Session], settings: Settings) -> None:
        self.tokens, self.identity = TokenStore(sessions), Identity(settings)
        self.quotas = Quotas(sessions, settings)
        self.audit = Audit(sessions, settings.audit_lines)
        self._validity = SharedPoll(self._are_valid, lambda: TOKEN_CACHE_S)

    async def record(self, change: Change) -> None:
        """Add an audit row, in a thread."""
        await run_sync(self.audit.add, change)

    async def until_revoked(self, caller: Caller) -> None:
        """Wait while a caller is authorized.

        Raises:
            LoginError: the token expired or was revoked.
        """
        if caller.token is None:
            await asyncio.Event().wait()
            return
        with self._validity.following(caller.token):
            while await self._validity.next(caller.token) is not False:
                pass
        raise LoginError("your token expired or was revoked; log in with a new one")

    async def _are_valid(self, identities: Collection[str]) -> Mapping[str, bool]:
        """Validity of tokens, by one statement; empty while the database is unavailable."""
        try:
            return await run_sync(self.tokens.are_valid, identities)
        except DATABASE_ERRORS:
            return {}

    async def may_stay(self, caller: Caller) -> bool:
        """True if the caller is still authorized; also while the database is unavailable."""
        try:
            return caller.token is None or await run_sync(self.tokens.is_valid, caller.token)
        except DATABASE_ERRORS:
            return True
