"""Comments: text that a user pinned to a pixel of a view, with a small snapshot."""

from __future__ import annotations

import json
import secrets
import time
import unicodedata
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from sqlalchemy import delete, func, select
from sqlalchemy.orm import Session, sessionmaker

from relume.core.errors import NotFoundError, ParameterError
from relume_server.persistence.tables import CommentRow
from relume_worker.jobs.job import BusyError

MAX_COMMENTS, MAX_PER_SCENE, MAX_BYTES = 10_000, 500, 256 * 1024**2


@dataclass(frozen=True)
class Comment:
    """A comment without its snapshot; times in seconds since 1970. `pin`: as it was sent."""

    id: str
    pin: dict[str, Any]
    text: str
    author: str
    created: float
    resolved: float | None
    resolved_by: str | None
    has_picture: bool


def check_text(text: str) -> str:
    """Normalize the text of a comment. Raises ParameterError if it is blank, or has control characters."""
    text = unicodedata.normalize("NFC", text).strip()
    if not text or any(unicodedata.category(each) in ("Cc", "Cs") and each not in "\n\t" for each in text):
        raise ParameterError("text", text[:80], "text, in any number of lines, without control characters")
    return text


class CommentStore:
    """Comments by scene."""

    def __init__(self, sessions: sessionmaker[Session]) -> None:
        self._sessions = sessions

    def list(self, scene: str) -> list[Comment]:
        """List the comments of a scene, oldest first."""
        with self._sessions() as session:
            query = select(CommentRow).where(CommentRow.scene == scene)
            return [_comment(row) for row in session.scalars(query.order_by(CommentRow.created, CommentRow.id))]

    def marks(self, scenes: Collection[str]) -> dict[str, tuple[object, ...]]:
        """Return for each scene a value that changes with its comments."""
        row = CommentRow
        query = (
            select(row.scene, func.count(), func.count(row.resolved), func.max(row.created), func.max(row.resolved))
            .where(row.scene.in_(scenes))
            .group_by(row.scene)
        )
        marks: dict[str, tuple[object, ...]] = dict.fromkeys(scenes, ())
        with self._sessions() as session:
            marks.update({scene: tuple(mark) for scene, *mark in session.execute(query)})
        return marks

    def add(self, scene: str, pin: Mapping[str, Any], text: str, author: str, picture: bytes | None) -> Comment:
        """Add a comment.

        Args:
            scene: id. pin: position, as JSON. text: validated. author: display name. picture: snapshot, WebP.
        Raises:
            BusyError: the limit is reached.
        """
        pin_json = json.dumps(dict(pin), allow_nan=False)
        num_bytes = len(pin_json.encode()) + len(text.encode()) + len(picture or b"")
        with self._sessions.begin() as session:
            _check_room(session, scene, num_bytes)
            row = CommentRow(
                id=secrets.token_hex(8),
                scene=scene,
                pin=pin_json,
                text=text,
                author=author,
                created=time.time(),
                picture=picture,
                has_picture=picture is not None,
                num_bytes=num_bytes,
            )
            session.add(row)
            session.flush()
            return _comment(row)

    def resolve(self, scene: str, comment: str, resolver: str | None) -> None:
        """Resolve a comment, or with None reopen it. Raises NotFoundError."""
        with self._sessions.begin() as session:
            row = _row(session, scene, comment)
            row.resolved, row.resolved_by = (None, None) if resolver is None else (time.time(), resolver)

    def picture(self, scene: str, comment: str) -> bytes:
        """Snapshot of a comment, WebP. Raises NotFoundError."""
        with self._sessions() as session:
            picture = _row(session, scene, comment).picture
        if picture is None:
            raise NotFoundError("this comment has no snapshot; view the pixel of its pin instead")
        return picture

    def delete(self, scene: str, comment: str) -> None:
        """Delete a comment. Raises NotFoundError."""
        with self._sessions.begin() as session:
            session.delete(_row(session, scene, comment))

    def delete_scene(self, scene: str) -> None:
        """Delete all comments of a deleted scene."""
        with self._sessions.begin() as session:
            session.execute(delete(CommentRow).where(CommentRow.scene == scene))


def _check_room(session: Session, scene: str, num_bytes: int) -> None:
    totals = session.execute(select(func.count(), func.coalesce(func.sum(CommentRow.num_bytes), 0))).one()
    scene_query = select(func.count()).select_from(CommentRow).where(CommentRow.scene == scene)
    if (session.scalar(scene_query) or 0) >= MAX_PER_SCENE:
        raise BusyError(f"a scene has at most {MAX_PER_SCENE} comments; delete some first")
    if totals[0] >= MAX_COMMENTS or totals[1] + num_bytes > MAX_BYTES:
        raise BusyError("the limit of stored comments is reached; delete some first")


def _row(session: Session, scene: str, comment: str) -> CommentRow:
    row = session.get(CommentRow, comment)
    if row is None or row.scene != scene:
        raise NotFoundError(f"there is no comment {comment[:40]}; it may have been deleted")
    return row


def _comment(row: CommentRow) -> Comment:
    return Comment(
        id=row.id,
        pin=json.loads(row.pin),
        text=row.text,
        author=row.author,
        created=row.created,
        resolved=row.resolved,
        resolved_by=row.resolved_by,
        has_picture=row.has_picture,
    )
