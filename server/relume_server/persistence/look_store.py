"""Saved looks: named JSON documents in the database; a change must name the current version."""

from __future__ import annotations

import hashlib
import json
import time
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NoReturn, cast

from sqlalchemy import CursorResult, delete, func, select, update
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session, sessionmaker

from relume.core.errors import Description, NotFoundError, ParameterError, bytes_text
from relume.look import Look
from relume_server.errors import PreconditionFailedError, PreconditionRequiredError, TooLargeError
from relume_server.persistence.tables import LookRow
from relume_worker.jobs.job import BusyError

MAX_LOOK_BYTES = 256 * 1024
MAX_LOOKS = 10_000
SECTIONS = tuple(Look.model_fields)


@dataclass(frozen=True)
class SavedLook:
    """A saved look; times in seconds since 1970.

    Attributes:
        document: JSON, with the members in the given order.
        etag: quoted, as in the header.
        has_thumbnail: true if there is a thumbnail of this version.
        view: JSON of the view that was saved with it; None without one.
    """

    name: str
    document: str
    etag: str
    modified: float
    created: float
    has_thumbnail: bool = False
    view: str | None = None

    @property
    def num_bytes(self) -> int:
        """Size of the document, which is ASCII."""
        return len(self.document)


@dataclass(frozen=True)
class ListedLook:
    """A look in a list; `num_bytes` of its document. `view`: as of a saved look."""

    name: str
    etag: str
    modified: float
    created: float
    has_thumbnail: bool
    num_bytes: int
    view: str | None


def check_name(name: str) -> str:
    """Normalize a name. Raises ParameterError unless it is 1 to 80 printable characters."""
    name = unicodedata.normalize("NFC", name)
    is_plain = name.isprintable() and name == name.strip() and not set("/\\") & set(name) and name not in (".", "..")
    if not is_plain or not 1 <= len(name) <= 80:
        raise ParameterError("name", name, "1 to 80 printable characters without slashes")
    return name


def parse_document(body: bytes) -> str:
    """Parse a look document into compact JSON with its own order, which lists of lights need.

    Raises TooLargeError, ParameterError.
    """
    if len(body) > MAX_LOOK_BYTES:
        raise TooLargeError(f"a look has at most {bytes_text(MAX_LOOK_BYTES)}; simplify its curves")
    try:
        document: Any = json.loads(body, parse_constant=_refuse_constant)
        text = json.dumps(document, separators=(",", ":"), allow_nan=False)
    except (ValueError, RecursionError):
        raise ParameterError("look", Description("not JSON with finite numbers"), "a look document") from None
    if not isinstance(document, dict):
        raise ParameterError("look", document, "an object with some of " + ", ".join(SECTIONS))
    for section, value in document.items():
        if section not in SECTIONS:
            raise ParameterError(f"/{section[:80]}", value, "one of the sections of a look: " + ", ".join(SECTIONS))
        if not isinstance(value, dict):
            raise ParameterError(f"/{section}", value, "an object")
    return text


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(name)


class LookStore:
    """Saved looks by name."""

    def __init__(self, sessions: sessionmaker[Session]) -> None:
        self._sessions = sessions

    def list(self) -> Sequence[ListedLook]:
        """All looks, newest first, without their documents, which may take gigabytes."""
        has_thumbnail = func.coalesce(LookRow.thumbnail_of == LookRow.etag, False)
        created = func.coalesce(LookRow.created, LookRow.modified)
        num_bytes = func.length(LookRow.document)
        columns = LookRow.name, LookRow.etag, LookRow.modified, created, has_thumbnail, num_bytes, LookRow.view
        with self._sessions() as session:
            rows = session.execute(select(*columns).order_by(LookRow.modified.desc(), LookRow.name))
            return [ListedLook(*row) for row in rows]

    def get(self, name: str) -> SavedLook:
        """Return a look. Raises NotFoundError."""
        with self._sessions() as session:
            row = session.get(LookRow, name)
        if row is None:
            raise NotFoundError(f"there is no look {name!r}; save it first")
        return _saved(row)

    def referencing(self, text: str) -> tuple[str, ...]:
        """Names of looks whose documents contain a text, sorted; the text has no wildcards."""
        with self._sessions() as session:
            query = select(LookRow.name).where(LookRow.document.contains(text, autoescape=True))
            return tuple(sorted(session.scalars(query)))

    def put(
        self,
        name: str,
        document: str,
        if_match: str | None,
        if_none_match: str | None,
        created: float | None = None,
    ) -> tuple[SavedLook, bool]:
        """Save a look; return it, and true if it is new.

        Args:
            name, document: validated. if_match, if_none_match: the headers.
            created: time of a new look, for example of a renamed one; None: now.
        Raises:
            ParameterError: `created` is in the future, or before 1970.
            PreconditionRequiredError: the look exists and the caller does not name the version to replace.
            PreconditionFailedError: the look has another version.
        """
        etag = '"' + hashlib.sha256(document.encode()).hexdigest()[:32] + '"'
        now = time.time()
        if created is not None and not 0.0 <= created <= now:
            raise ParameterError("created", created, "a time since 1970 that is not in the future")
        saved = SavedLook(name, document, etag, now, now if created is None else created)
        if if_match is None:
            if self._insert(saved):
                return saved, True
            if if_none_match is not None:
                raise PreconditionFailedError(f"there is a look {name!r} already; take another name")
            raise PreconditionRequiredError(f"look {name!r} exists; send If-Match with the version that you replace")
        values = {"document": document, "etag": etag, "modified": saved.modified}
        self._change(name, if_match, update(LookRow).values(**values))
        return saved, False

    def thumbnail(self, name: str) -> bytes:
        """Thumbnail of the current version, WebP. Raises NotFoundError."""
        with self._sessions() as session:
            row = session.get(LookRow, name)
            if row is None or row.thumbnail is None or row.thumbnail_of != row.etag:
                raise NotFoundError(f"there is no thumbnail of look {name!r}; send one first")
            return row.thumbnail

    def put_thumbnail(self, name: str, picture: bytes, if_match: str | None) -> None:
        """Store a thumbnail of a version, WebP. Raises as `put` if the look has another version."""
        if if_match is None:
            raise PreconditionRequiredError("send If-Match with the version of the look that the thumbnail shows")
        self._change(name, if_match, update(LookRow).values(thumbnail=picture, thumbnail_of=LookRow.etag))

    def put_view(self, name: str, view: str | None, if_match: str | None) -> None:
        """Store the view of a look, JSON; later versions keep it. Raises as `put` if the look has another version."""
        if if_match is None:
            raise PreconditionRequiredError("send If-Match with the version of the look that the view belongs to")
        self._change(name, if_match, update(LookRow).values(view=view))

    def delete(self, name: str, if_match: str | None) -> None:
        """Delete a look. Raises as `put`."""
        if if_match is None:
            self.get(name)
            raise PreconditionRequiredError("send If-Match with the version of the look that you delete")
        self._change(name, if_match, delete(LookRow))

    def _insert(self, saved: SavedLook) -> bool:
        try:
            with self._sessions.begin() as session:
                if (session.scalar(select(func.count()).select_from(LookRow)) or 0) >= MAX_LOOKS:
                    raise BusyError(f"the limit of {MAX_LOOKS:,} saved looks is reached; delete some first")
                row = LookRow(name=saved.name, document=saved.document, etag=saved.etag)
                row.modified, row.created = saved.modified, saved.created
                session.add(row)
        except IntegrityError:
            return False
        return True

    def _change(self, name: str, if_match: str, statement: Any) -> None:
        """Update or delete the row if it still has one of those versions, in one statement."""
        statement = statement.where(LookRow.name == name)
        etags = [etag.strip() for etag in if_match.split(",")]
        if etags != ["*"]:
            statement = statement.where(LookRow.etag.in_(etags))
        with self._sessions.begin() as session:
            result = cast("CursorResult[Any]", session.execute(statement))
            num_changed = result.rowcount
        if num_changed == 0:
            raise PreconditionFailedError(f"look {name!r} has been changed or deleted since; read it again")


def _saved(row: LookRow) -> SavedLook:
    created = row.modified if row.created is None else row.created
    has_thumbnail = row.thumbnail_of == row.etag
    return SavedLook(row.name, row.document, row.etag, row.modified, created, has_thumbnail, row.view)
