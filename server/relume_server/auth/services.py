"""All that lives as long as the server and knows who may do what."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from anyio.to_thread import run_sync
from sqlalchemy.orm import Session, sessionmaker

from relume_server.auth.audit import Audit, Change
from relume_server.auth.identity import Identity
from relume_server.auth.quotas import Quotas
from relume_server.auth.roles import Caller
from relume_server.auth.tokens import TOKEN_CACHE_S, TokenStore
from relume_server.errors import LoginError
from relume_worker.database.failures import DATABASE_ERRORS

if TYPE_CHECKING:
    from relume_server.settings import Settings

PROXY_REVALIDATION_S = 900.0
"""Only the proxy knows whether somebody whom it named may still be here: after this time they come by it again."""


class AuthServices:
    """Tokens and who they are, quotas, and the audit, of one database."""

    def __init__(self, sessions: sessionmaker[Session], settings: Settings) -> None:
        self.tokens, self.identity = TokenStore(sessions), Identity(settings)
        self.quotas = Quotas(sessions, settings)
        self.audit = Audit(sessions, settings.audit_lines)

    async def record(self, change: Change) -> None:
        """Write a line of the audit, beside the event loop."""
        await run_sync(self.audit.add, change)

    async def until_revoked(self, caller: Caller) -> None:
        """Wait for as long as a caller may stay.

        Raises:
            LoginError: the token has run out or was revoked.
        """
        while await self.may_stay(caller):
            await asyncio.sleep(TOKEN_CACHE_S)
        raise LoginError("your token has run out or was revoked; log in with another one")

    async def may_stay(self, caller: Caller) -> bool:
        """Whether what a caller has open may go on; while the database is away it does."""
        try:
            return caller.token is None or await run_sync(self.tokens.is_valid, caller.token)
        except DATABASE_ERRORS:
            return True
