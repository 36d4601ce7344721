"""What a session edits, for the audit: a line about every minute while edits come, and one when it ends."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable

from anyio.to_thread import run_sync

from server.access.audit import Audit, Change
from server.access.roles import Caller

EVERY_S = 60.0
"""What a server that is killed had not written down yet is not in the audit."""

_MAX_PLACES, _MAX_SHOWN, _SWITCHING = 100, 160, 101


class EditNotes:
    """Counts edits, and the places in the look that they change; used from the event loop.

    Args:
        where: the session, as the audit names it.
    """

    def __init__(self, audit: Audit, caller: Caller, where: str) -> None:
        self._audit, self._caller, self._where = audit, caller, where
        self._num, self._places = 0, dict[str, None]()

    def note(self, pointers: Iterable[str]) -> None:
        """An edit was accepted that changes what these point at: of each the first two names count."""
        self._num += 1
        for pointer in pointers:
            if len(self._places) < _MAX_PLACES:
                place = "/".join(pointer.split("/")[:3])  # names of a file's materials may hold anything
                self._places["".join(each if each.isprintable() else "?" for each in place)] = None

    async def run(self) -> None:
        """Write as long as the session runs."""
        while True:
            await asyncio.sleep(EVERY_S)
            await self.write()

    async def write(self) -> None:
        """A line of what has come since the last one, if anything has; written even where this is cancelled."""
        if not self._num:
            return
        what = f"{self._num} edits in a session{_told(list(self._places))}"
        self._num, self._places = 0, {}
        change = Change.by(self._caller, what, self._where, _SWITCHING)
        await asyncio.shield(run_sync(self._audit.add, change))


def _told(places: list[str]) -> str:
    """As many of them as a line has room for."""
    text = ""
    for k, place in enumerate(places):
        if len(text) + len(place) > _MAX_SHOWN:
            return f"{text} and {len(places) - k} more" if text else f": {place[:_MAX_SHOWN]}…"
        text += f"{', ' if text else ': '}{place}"
    return text
