"""Things by the names that people give them: spelled a little otherwise they are still found."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence

from relume.core.errors import NotFoundError

MIN_ID_LENGTH = 4  # characters that an id may be cut to
_MAX_LISTED = 10


def fold_name(name: str) -> str:
    """What two spellings of a name have in common: neither case, nor underscores, hyphens and spaces, count."""
    folded = unicodedata.normalize("NFKC", name).casefold()
    return re.sub(r"[\s_\u2010-\u2015-]+", " ", folded).strip()


def pick(kind: str, query: str, candidates: Sequence[tuple[str, str]], remedy: str) -> str:
    """The id of what is meant: by its id, its name, the start of its id, or a name that is spelled alike.

    Args:
        kind: it is, in a message. query: what was typed. candidates: id and name of each that there is.
        remedy: what to do where there is none, in a message.
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
    raise NotFoundError(f"there is no {kind} {query[:80]!r}; known are: {labels}{suffix}; {remedy}")


def match_name(query: str, candidates: Iterable[str]) -> str:
    """The name that is meant, of those that there are; the given one where none is, or more than one might be."""
    names = list(dict.fromkeys(candidates))
    matches = [name for name in names if fold_name(name) == fold_name(query)]
    return matches[0] if query not in names and len(matches) == 1 else query


def _label(identity: str, name: str) -> str:
    return identity if identity == name else f"{identity} ({name[:80]})"
