"""Audit of a session's edits: one row per minute with edits, and one at its end."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable

from anyio.to_thread import run_sync

from relume_server.auth.audit import Audit, Change
from relume_server.auth.roles import Caller

WRITE_INTERVAL_S = 60.0
"""Interval between rows; a killed server loses the edits since the last one."""

_MAX_PATHS, _MAX_CHARS, _SWITCHING = 100, 160, 101


class AuditWriter:
    """Counts edits and the pointers that they change. Event loop only.

    Args:
        audit: audit to write to. caller: caller of the session. session_name: session name in the audit.
    """

    def __init__(self, audit: Audit, caller: Caller, session_name: str) -> None:
        self._audit, self._caller, self._session_name = audit, caller, session_name
        self._num_edits, self._paths = 0, dict[str, None]()

    def add_edit(self, pointers: Iterable[str]) -> None:
        """Count an accepted edit of these pointers; the first two names of each are kept."""
        self._num_edits += 1
        for pointer in pointers:
            if len(self._paths) < _MAX_PATHS:
                path = "/".join(pointer.split("/")[:3])  # names of a file's materials may contain anything
                self._paths["".join(each if each.isprintable() else "?" for each in path)] = None

    async def run(self) -> None:
        """Write rows while the session runs."""
        while True:
            await asyncio.sleep(WRITE_INTERVAL_S)
            await self.write()

    async def write(self) -> None:
        """Write a row for the edits since the last one, if any; also when canceled."""
        if not self._num_edits:
            return
        action = f"{self._num_edits} edits in a session{_format_paths(list(self._paths))}"
        self._num_edits, self._paths = 0, {}
        change = Change.by(self._caller, action, self._session_name, _SWITCHING)
        await asyncio.shield(run_sync(self._audit.add, change))


def _format_paths(paths: list[str]) -> str:
    """As many pointers as fit into a row."""
    text = ""
    for k, path in enumerate(paths):
        if len(text) + len(path) > _MAX_CHARS:
            return f"{text} and {len(paths) - k} more" if text else f": {path[:_MAX_CHARS]}…"
        text += f"{', ' if text else ': '}{path}"
    return text
