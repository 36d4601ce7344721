"""All that lives as long as the server and knows who may do what."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from anyio.to_thread import run_sync
from sqlalchemy.orm import Session, sessionmaker

from server.access.audit import Audit, Change
from server.access.identity import Identity
from server.access.quotas import Quotas
from server.access.roles import Caller
from server.access.tokens import REMEMBERED_S, TokenStore
from server.errors import LoginError
from worker.database.faults import AWAY

if TYPE_CHECKING:
    from server.settings import Settings


class Access:
    """Tokens and who they are, quotas, and the audit, of one database."""

    def __init__(self, sessions: sessionmaker[Session], settings: Settings) -> None:
        self.tokens, self.identity = TokenStore(sessions), Identity(settings)
        self.quotas = Quotas(sessions, settings)
        self.audit = Audit(sessions, settings.audit_lines)

    async def note(self, change: Change) -> None:
        """Write a line of the audit, beside the event loop."""
        await run_sync(self.audit.add, change)

    async def until_revoked(self, caller: Caller) -> None:
        """Wait for as long as a caller may stay.

        Raises:
            LoginError: the token has run out or was revoked.
        """
        while caller.token is None or await self._is_valid(caller.token):
            await asyncio.sleep(REMEMBERED_S)
        raise LoginError("your token has run out or was revoked; log in with another one")

    async def _is_valid(self, token: str) -> bool:
        """Whether it is; while the database is away what is open goes on."""
        try:
            return await run_sync(self.tokens.is_valid, token)
        except AWAY:
            return True
