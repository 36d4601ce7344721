"""Lists by `limit` and `after`, and rejection of unknown query parameters."""

from __future__ import annotations

import base64
import binascii
import json
from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from typing import Annotated, Any, Protocol, TypeVar

from fastapi import Depends, Query, Request, Response
from fastapi.dependencies.models import Dependant
from fastapi.routing import APIRoute

from relume.core.errors import ParameterError

MAX_LISTED = 1_000
MAX_LONG = 100
"""Default page size of lists that grow without bound."""
_MAX_CURSOR = 1_000

NameFilter = Annotated[str | None, Query(max_length=200, description="only entries with this name")]


class _Stored(Protocol):
    """Common fields of asset records."""

    @property
    def id(self) -> str: ...
    @property
    def name(self) -> str: ...
    @property
    def created(self) -> float: ...


Entry = TypeVar("Entry")
Stored = TypeVar("Stored", bound=_Stored)
Key = tuple[float | str, ...]
"""Sort key of a list; unique per entry."""


class Page:
    """Requested page of a list; the header `Link` of the response has the address of the next page."""

    def __init__(
        self,
        request: Request,
        response: Response,
        limit: Annotated[int | None, Query(ge=1, le=MAX_LISTED, description="maximum number of entries")] = None,
        after: Annotated[
            str | None,
            Query(max_length=_MAX_CURSOR, description="start of the page, from the header Link of the previous page"),
        ] = None,
    ) -> None:
        self._request, self._response, self.limit = request, response, limit
        self.after = None if after is None else _decode_cursor(after)

    def default_limit(self, limit: int) -> int:
        """Requested number of entries, or the default. One entry more shows whether there is a next page."""
        self.limit = self.limit or limit
        return self.limit

    def cut(self, entries: Iterable[Entry], key: Callable[[Entry], Key]) -> list[Entry]:
        """Cut the page out of a list.

        Args:
            entries: the whole list, or at least the page and one more entry.
            key: returns the sort key of an entry; lower keys come first.
        Raises:
            ParameterError: `after` belongs to another list.
        """
        ordered = sorted(entries, key=key)
        start = 0
        if self.after is not None and ordered:
            self.check(key(ordered[0]))
            start = bisect_right(ordered, self.after, key=key)
        end = len(ordered) if self.limit is None else start + self.limit
        if end < len(ordered):
            self._set_next_link(key(ordered[end - 1]))
        return ordered[start:end]

    def in_order(self, entries: Iterable[Entry]) -> list[Entry]:
        """Cut the page out of a list with constant order."""
        return [entry for _, entry in self.cut(enumerate(entries), lambda numbered: (float(numbered[0]),))]

    def check(self, key: Key) -> None:
        """Check that `after` belongs to a list with such keys. Raises ParameterError."""
        if self.after is not None and [isinstance(value, str) for value in self.after] != [
            isinstance(value, str) for value in key
        ]:
            raise _no_cursor(str(self._request.query_params.get("after")))

    def _set_next_link(self, last: Key) -> None:
        url = self._request.url.include_query_params(limit=self.limit, after=_encode_cursor(last))
        self._response.headers["Link"] = f'<{url.path}?{url.query}>; rel="next"'


PageDep = Annotated[Page, Depends()]


def _encode_cursor(key: Key) -> str:
    return base64.urlsafe_b64encode(json.dumps(key, separators=(",", ":")).encode()).decode().rstrip("=")


def _decode_cursor(cursor: str) -> Key:
    try:
        values: Any = json.loads(base64.urlsafe_b64decode(cursor + "=" * (-len(cursor) % 4)), parse_constant=_refuse)
    except (ValueError, binascii.Error, RecursionError):
        raise _no_cursor(cursor) from None
    if not isinstance(values, list) or not all(isinstance(value, float | int | str) for value in values):
        raise _no_cursor(cursor)
    return tuple(value if isinstance(value, str) else float(value) for value in values)


def _refuse(name: str) -> float:
    raise ValueError(name)


def _no_cursor(cursor: str) -> ParameterError:
    return ParameterError("query parameter after", cursor, "the value from the header Link of the previous page")


def newest(created: float, identity: str) -> Key:
    """Sort key for newest first."""
    return -created, identity


def records_page(records: Iterable[Stored], name: str | None, page: Page) -> list[Stored]:
    """Page of asset records, newest first. name: only records with this name; None: all."""
    named = [record for record in records if name in (None, record.name)]
    return page.cut(named, lambda record: newest(record.created, record.id))


def check_query(request: Request) -> None:
    """Check that a call knows all its query parameters. Raises ParameterError.

    Otherwise a misspelled filter would silently list everything.
    """
    allowed_names = _query_names(request.scope["route"])
    for name in request.query_params:
        if name not in allowed_names:
            allowed = (
                f"only {', '.join(allowed_names)}"
                if allowed_names
                else "no query parameter, because this call has none"
            )
            raise ParameterError(f"query parameter {name[:80]}", request.query_params[name], allowed)


_QUERY_NAMES: dict[Callable[..., Any], Sequence[str]] = {}


def _query_names(route: APIRoute) -> Sequence[str]:
    """Names of a route's query parameters."""
    if route.endpoint not in _QUERY_NAMES:
        _QUERY_NAMES[route.endpoint] = _names(route.dependant)
    return _QUERY_NAMES[route.endpoint]


def _names(dependant: Dependant) -> list[str]:
    names = [param.alias for param in dependant.query_params]
    return names + [name for dependency in dependant.dependencies for name in _names(dependency)]
