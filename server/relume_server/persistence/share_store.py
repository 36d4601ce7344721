"""Share links: a look of a bake with views and cameras, saved once and never changed.

The id is the beginning of a hash of the content: sharing the same content twice gives the same link. The order of
members counts, because lights are listed in the order in which they were added.
"""

from __future__ import annotations

import base64
import hashlib
import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import func, select
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session, sessionmaker

from relume.core.errors import Description, NotFoundError, ParameterError, bytes_text
from relume_server.errors import TooLargeError
from relume_server.persistence.tables import ShareRow
from relume_worker.jobs.job import BusyError

MAX_SHARE_BYTES = 256 * 1024
MAX_SHARES, MAX_BYTES = 10_000, 256 * 1024**2
ID_LENGTH, MAX_ID_LENGTH = 10, 32


@dataclass(frozen=True)
class Share:
    """Content of a link; `document` as saved, `created` in seconds since 1970."""

    id: str
    document: dict[str, Any]
    created: float


@dataclass(frozen=True)
class ListedShare:
    """A link in a list, with the size of its content."""

    id: str
    created: float
    bytes: int


class ShareStore:
    """Contents of links by id."""

    def __init__(self, sessions: sessionmaker[Session]) -> None:
        self._sessions = sessions

    def put(self, document: Mapping[str, Any]) -> tuple[str, bool]:
        """Save validated content; return its id, and true if it is new.

        Raises:
            TooLargeError, BusyError: this content, or all together, would be too large. ParameterError: not finite.
        """
        text = _as_json(document)
        name = base64.b32encode(hashlib.sha256(text.encode()).digest()).decode().lower()
        for length in range(ID_LENGTH, MAX_ID_LENGTH + 1):
            identity = name[:length]
            if self._insert(identity, text):
                return identity, True
            if self._text(identity) == text:
                return identity, False
        raise BusyError("no id is available for this link; change the look slightly and share it again")

    def get(self, identity: str) -> Share:
        """Content of a link. Raises NotFoundError."""
        with self._sessions() as session:
            row = session.get(ShareRow, identity)
        if row is None:
            raise NotFoundError(f"there is no shared look {identity[:40]}; ask the sender to share it again")
        return Share(row.id, json.loads(row.document), row.created)

    def list(self, text: str = "") -> Sequence[ListedShare]:
        """All links, or those whose content contains a text."""
        query = select(ShareRow.id, ShareRow.created, ShareRow.bytes)
        with self._sessions() as session:
            rows = session.execute(query.where(ShareRow.document.contains(text, autoescape=True)))
            return [ListedShare(*row) for row in rows]

    def referencing(self, text: str) -> tuple[str, ...]:
        """Ids of links whose content contains a text, sorted; the text has no wildcards."""
        with self._sessions() as session:
            query = select(ShareRow.id).where(ShareRow.document.contains(text, autoescape=True))
            return tuple(sorted(session.scalars(query)))

    def delete(self, identity: str) -> None:
        """Delete a link. Raises NotFoundError."""
        self.get(identity)
        with self._sessions.begin() as session:
            if (row := session.get(ShareRow, identity)) is not None:
                session.delete(row)

    def _text(self, identity: str) -> str | None:
        with self._sessions() as session:
            return session.scalar(select(ShareRow.document).where(ShareRow.id == identity))

    def _insert(self, identity: str, text: str) -> bool:
        """Save under an id; false if the id is taken."""
        num_bytes = len(text.encode())
        try:
            with self._sessions.begin() as session:
                if session.get(ShareRow, identity) is not None:
                    return False
                totals = session.execute(select(func.count(), func.coalesce(func.sum(ShareRow.bytes), 0))).one()
                if totals[0] >= MAX_SHARES or totals[1] + num_bytes > MAX_BYTES:
                    raise BusyError("the limit of share links is reached; delete some with DELETE /api/shares/{id}")
                session.add(ShareRow(id=identity, document=text, bytes=num_bytes, created=time.time()))
        except IntegrityError:  # another server was faster
            return False
        return True


def _as_json(document: Mapping[str, Any]) -> str:
    try:
        text = json.dumps(document, separators=(",", ":"), allow_nan=False)
    except (ValueError, RecursionError):
        raise ParameterError("/look", Description("not JSON with finite numbers"), "a look document") from None
    if len(text.encode()) > MAX_SHARE_BYTES:
        raise TooLargeError(f"a shared look has at most {bytes_text(MAX_SHARE_BYTES)}; simplify its curves")
    return text
