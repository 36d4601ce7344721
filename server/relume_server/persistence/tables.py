"""Tables of the server, in the same database as the worker's."""

from __future__ import annotations

from sqlalchemy import LargeBinary, Text
from sqlalchemy.orm import Mapped, mapped_column

from relume_worker.database.models import Base


class LookRow(Base):
    """A saved look.

    Attributes:
        created, modified: seconds since 1970; `created` is None in rows of older versions.
        thumbnail: WebP. thumbnail_of: its version; None if there is none.
        view: JSON of a `LookView`; None if there is none.
    """

    __tablename__ = "looks"

    name: Mapped[str] = mapped_column(primary_key=True)
    document: Mapped[str] = mapped_column(Text)
    etag: Mapped[str]
    modified: Mapped[float]
    created: Mapped[float | None]
    thumbnail: Mapped[bytes | None] = mapped_column(LargeBinary, deferred=True)
    thumbnail_of: Mapped[str | None]
    view: Mapped[str | None] = mapped_column(Text)


class ShareRow(Base):
    """Content of a share link; never changed. `document` is JSON of so many bytes, `created` in seconds since 1970."""

    __tablename__ = "shares"

    id: Mapped[str] = mapped_column(primary_key=True)
    document: Mapped[str] = mapped_column(Text)
    bytes: Mapped[int]
    created: Mapped[float]


class RoomRow(Base):
    """Lease of rooms, see `relume_server.persistence.leases`; deleted when they are empty.

    Attributes:
        prefix: prefix of their ids. owner, heartbeat: as for the lease of a job.
    """

    __tablename__ = "rooms"

    prefix: Mapped[str] = mapped_column("watch", primary_key=True)  # formerly the whole id
    owner: Mapped[str]
    heartbeat: Mapped[float]


class CommentRow(Base):
    """A comment, see `relume_server.persistence.comment_store`.

    Attributes:
        pin: JSON: bake, view, x, y, size, camera. picture: WebP. num_bytes: total size in bytes.
        created, resolved: seconds since 1970; None: open.
    """

    __tablename__ = "comments"

    id: Mapped[str] = mapped_column(primary_key=True)
    scene: Mapped[str] = mapped_column(index=True)
    pin: Mapped[str] = mapped_column(Text)
    text: Mapped[str] = mapped_column(Text)
    author: Mapped[str]
    created: Mapped[float]
    resolved: Mapped[float | None]
    resolved_by: Mapped[str | None]
    picture: Mapped[bytes | None] = mapped_column(LargeBinary, deferred=True)
    has_picture: Mapped[bool]
    num_bytes: Mapped[int]


class IdempotencyRow(Base):
    """A call with an idempotency key and its response, see `relume_server.persistence.idempotency`.

    Attributes:
        client, key: caller, and the caller's key. digest: digest of the whole request.
        owner: the process that runs it; see `relume_worker.lease`. created: seconds since 1970 by the database's clock.
        status: status of the response; None: not yet.
        location, media_type, body: location, media type and body of the response.
    """

    __tablename__ = "idempotency"

    client: Mapped[str] = mapped_column(primary_key=True)
    key: Mapped[str] = mapped_column(primary_key=True)
    digest: Mapped[str]
    owner: Mapped[str]
    created: Mapped[float] = mapped_column(index=True)
    status: Mapped[int | None]
    location: Mapped[str | None] = mapped_column(Text)
    media_type: Mapped[str | None]
    body: Mapped[bytes | None] = mapped_column(LargeBinary)
