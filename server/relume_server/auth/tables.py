"""Tables of tokens, ownership and audit."""

from __future__ import annotations

from sqlalchemy import BigInteger, Text
from sqlalchemy.orm import Mapped, mapped_column

from relume_worker.database.models import Base


class TokenRow(Base):
    """A token. Times in seconds since 1970; of the secret only a hash is stored."""

    __tablename__ = "tokens"

    id: Mapped[str] = mapped_column(primary_key=True)
    name: Mapped[str] = mapped_column(index=True)
    role: Mapped[str]
    digest: Mapped[str]
    created: Mapped[float]
    expires: Mapped[float | None]
    revoked: Mapped[float | None]


class OwnedRow(Base):
    """Ownership: an upload or finished job of so many bytes, or a job planned to take so many."""

    __tablename__ = "owned"

    kind: Mapped[str] = mapped_column(primary_key=True)
    object: Mapped[str] = mapped_column(primary_key=True)
    owner: Mapped[str] = mapped_column(index=True)
    bytes: Mapped[int] = mapped_column(BigInteger)


class AuditRow(Base):
    """A change; rows are only added, and the oldest are deleted. See `relume_server.auth.audit`."""

    __tablename__ = "audit"

    number: Mapped[int] = mapped_column(primary_key=True, autoincrement=True)
    at: Mapped[float] = mapped_column(index=True)
    who: Mapped[str] = mapped_column(index=True)
    role: Mapped[str]
    address: Mapped[str]
    what: Mapped[str]
    object: Mapped[str] = mapped_column(Text)
    status: Mapped[int]
    request: Mapped[str]
