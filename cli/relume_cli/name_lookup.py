"""Match names as people type them: case and separators do not matter."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence

from relume.core.errors import NotFoundError

MIN_ID_LENGTH = 4  # shortest prefix of an id that is accepted
_MAX_LISTED = 10


def fold_name(name: str) -> str:
    """Fold a name for comparison: case, underscores, hyphens and spaces do not count."""
    folded = unicodedata.normalize("NFKC", name).casefold()
    return re.sub(r"[\s_\u2010-\u2015-]+", " ", folded).strip()


def pick(kind: str, query: str, candidates: Sequence[tuple[str, str]], remedy: str) -> str:
    """Return the id that matches a query: an id, a name, the start of an id, or another spelling of a name.

    Args:
        kind: kind of the things, in messages. query: as typed. candidates: all ids and names.
        remedy: what to do if nothing matches, in messages.
    Raises:
        NotFoundError: there is none, or more than one.
    """
    match_lists = (
        [identity for identity, _ in candidates if identity == query],
        [identity for identity, name in candidates if name == query],
        [identity for identity, _ in candidates if len(query) >= MIN_ID_LENGTH and identity.startswith(query)],
        [identity for identity, name in candidates if fold_name(name) == fold_name(query)],
    )
    matches = next((ids for ids in match_lists if ids), [])
    if len(matches) == 1:
        return matches[0]
    if matches:
        names = dict(candidates)
        labels = ", ".join(_label(identity, names[identity]) for identity in matches)
        raise NotFoundError(f"{query[:80]!r} names {len(matches)} {kind}s; give one of {labels}")
    labels = ", ".join(_label(identity, name) for identity, name in candidates[:_MAX_LISTED]) or "none yet"
    suffix = f" and {len(candidates) - _MAX_LISTED} more" if len(candidates) > _MAX_LISTED else ""
    raise NotFoundError(f"there is no {kind} {query[:80]!r}; choose from {labels}{suffix}; {remedy}")


def match_name(query: str, candidates: Iterable[str]) -> str:
    """Return the candidate that a query is a spelling of; the query itself if there is none, or more than one."""
    names = list(dict.fromkeys(candidates))
    matches = [name for name in names if fold_name(name) == fold_name(query)]
    return matches[0] if query not in names and len(matches) == 1 else query


def _label(identity: str, name: str) -> str:
    return identity if identity == name else f"{identity} ({name[:80]})"
