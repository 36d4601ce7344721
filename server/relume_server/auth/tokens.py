"""Tokens: create, list, revoke and check. `relume_<id>_<secret>`; the database stores a hash of the secret.

The secret is 256 random bits, so a plain hash is as good as a slow one, and a salt would add nothing.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
import time
from collections import OrderedDict
from collections.abc import Collection
from dataclasses import dataclass

from sqlalchemy import select
from sqlalchemy.orm import Session, sessionmaker

from relume.core.errors import NotFoundError, ParameterError, RelumeError
from relume_server.auth.roles import PROXY, ROLES, Role
from relume_server.auth.tables import TokenRow

MAX_TOKENS = 10_000
MAX_UNKNOWN_IDS = 10_000
"""Number of unknown ids that are cached."""
TOKEN_CACHE_S = 2.0
"""Time for which a token that another process revoked may still be accepted."""
_ID_DIGITS, _MAX_LENGTH = 12, 120


@dataclass(frozen=True)
class Token:
    """A token without its secret; times in seconds since 1970."""

    id: str
    name: str
    role: Role
    created: float
    expires: float | None
    revoked: float | None

    def is_valid(self, now: float) -> bool:
        """True if the token is neither expired nor revoked."""
        return self.revoked is None and (self.expires is None or now < self.expires)


class TokenStore:
    """Tokens in the database. Thread-safe."""

    def __init__(self, sessions: sessionmaker[Session]) -> None:
        self._sessions = sessions
        self._cached: dict[str, tuple[float, Token, str]] = {}
        self._unknown_ids: OrderedDict[str, float] = OrderedDict()

    def add(self, name: str, role: str, days: float | None = None) -> str:
        """Create a token, and return its text, which is not stored.

        Raises:
            ParameterError: unknown role, invalid name, or name of a valid token.
        """
        if role not in ROLES:
            raise ParameterError("role", role, "one of " + ", ".join(ROLES))
        if not (name.isprintable() and name == name.strip() and 1 <= len(name) <= 80):
            raise ParameterError("name", name, "1 to 80 printable characters")
        if name.startswith(PROXY):
            raise ParameterError(
                "name", name, f"a name that does not begin with {PROXY}, which is for names from proxies"
            )
        if days is not None and not 0 < days <= 36_500:
            raise ParameterError("days", days, "a number above 0, at most 36500")
        now, tokens = time.time(), self.all()
        if any(token.name == name and token.is_valid(now) for token in tokens):
            raise ParameterError("name", name, "another name, or revoke the valid token of this name first")
        if len(tokens) >= MAX_TOKENS:
            raise RelumeError(f"the limit of {MAX_TOKENS:,} tokens, revoked ones included, is reached; use a valid one")
        identity, secret = secrets.token_hex(_ID_DIGITS // 2), secrets.token_urlsafe(32)
        expires = None if days is None else now + days * 86_400
        with self._sessions.begin() as session:
            session.add(
                TokenRow(id=identity, name=name, role=role, digest=_digest(secret), created=now, expires=expires)
            )
        return f"relume_{identity}_{secret}"

    def all(self) -> list[Token]:
        """All tokens, oldest first."""
        with self._sessions() as session:
            return [_token(row) for row in session.scalars(select(TokenRow).order_by(TokenRow.created))]

    def revoke(self, name: str) -> None:
        """Revoke the valid token with this name or id. Raises NotFoundError."""
        now = time.time()
        matches = [token for token in self.all() if name in (token.name, token.id) and token.is_valid(now)]
        if not matches:
            raise NotFoundError(f"there is no valid token {name[:80]!r}; relume token list shows them")
        with self._sessions.begin() as session:
            for token in matches:
                row = session.get(TokenRow, token.id)
                if row is not None:
                    row.revoked = now
                self._cached.pop(token.id, None)

    def authenticate(self, text: str) -> Token | None:
        """Return the valid token of a text; asks the database, unless the result is cached."""
        identity, secret = _split_token(text)
        cached = self._fetch(identity) if identity else None
        is_right = cached is not None and _is_secret(secret, cached[1])
        return cached[0] if cached is not None and is_right and cached[0].is_valid(time.time()) else None

    def is_cached(self, text: str) -> bool:
        """True if a token was valid at its last lookup, however long ago; does not ask the database."""
        identity, secret = _split_token(text)
        cached = self._cached.get(identity)
        return cached is not None and _is_secret(secret, cached[2])

    def is_valid(self, identity: str) -> bool:
        """True if the token with this id is still valid."""
        cached = self._fetch(identity)
        return cached is not None and cached[0].is_valid(time.time())

    def are_valid(self, identities: Collection[str]) -> dict[str, bool]:
        """Validity of the tokens with these ids now; asks the database once."""
        with self._sessions() as session:
            rows = session.scalars(select(TokenRow).where(TokenRow.id.in_(identities)))
            valid = {row.id for row in rows if _token(row).is_valid(time.time())}
        return {identity: identity in valid for identity in identities}

    def _fetch(self, identity: str) -> tuple[Token, str] | None:
        now_s, cached = time.monotonic(), self._cached.get(identity)
        if cached is not None and now_s < cached[0]:
            return cached[1:]
        if now_s < self._unknown_ids.get(identity, 0.0):
            return None
        with self._sessions() as session:
            row = session.get(TokenRow, identity)
        if row is None:
            self._unknown_ids[identity] = now_s + TOKEN_CACHE_S
            if len(self._unknown_ids) > MAX_UNKNOWN_IDS:
                self._unknown_ids.popitem(last=False)
            return None
        self._cached[identity] = now_s + TOKEN_CACHE_S, _token(row), row.digest
        return _token(row), row.digest


def _split_token(text: str) -> tuple[str, str]:
    """Split a token into id and secret; both empty if it is malformed."""
    fields = text.split("_", 2)
    if len(text) > _MAX_LENGTH or len(fields) != 3 or fields[0] != "relume" or len(fields[1]) != _ID_DIGITS:
        return "", ""
    return fields[1], fields[2]


def _is_secret(secret: str, digest: str) -> bool:
    return hmac.compare_digest(digest.encode(), _digest(secret).encode())


def _digest(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()


def _token(row: TokenRow) -> Token:
    return Token(row.id, row.name, ROLES[row.role], row.created, row.expires, row.revoked)
