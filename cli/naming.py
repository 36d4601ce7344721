"""Things by the names that people give them: spelled a little otherwise they are still found."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence

from relume.errors import NotFoundError

LEAST_OF_ID = 4  # characters that an id may be cut to
_SHOWN = 10


def plain(name: str) -> str:
    """What two spellings of a name have in common: neither case, nor underscores, hyphens and spaces, count."""
    folded = unicodedata.normalize("NFKC", name).casefold()
    return re.sub(r"[\s_\u2010-\u2015-]+", " ", folded).strip()


def pick(what: str, given: str, known: Sequence[tuple[str, str]], remedy: str) -> str:
    """The id of what is meant: by its id, its name, the start of its id, or a name that is spelled alike.

    Args:
        what: it is, in a message. given: what was typed. known: id and name of each that there is.
        remedy: what to do where there is none, in a message.
    Raises:
        NotFoundError: there is none, or more than one.
    """
    ways = (
        [identity for identity, _ in known if identity == given],
        [identity for identity, name in known if name == given],
        [identity for identity, _ in known if len(given) >= LEAST_OF_ID and identity.startswith(given)],
        [identity for identity, name in known if plain(name) == plain(given)],
    )
    found = next((way for way in ways if way), [])
    if len(found) == 1:
        return found[0]
    if found:
        names = dict(known)
        listed = ", ".join(_shown(identity, names[identity]) for identity in found)
        raise NotFoundError(f"{given[:80]!r} names {len(found)} {what}s; give one of {listed}")
    listed = ", ".join(_shown(identity, name) for identity, name in known[:_SHOWN]) or "none yet"
    more = f" and {len(known) - _SHOWN} more" if len(known) > _SHOWN else ""
    raise NotFoundError(f"there is no {what} {given[:80]!r}; known are: {listed}{more}; {remedy}")


def spelled(given: str, known: Iterable[str]) -> str:
    """The name that is meant, of those that there are; the given one where none is, or more than one might be."""
    names = list(dict.fromkeys(known))
    alike = [name for name in names if plain(name) == plain(given)]
    return alike[0] if given not in names and len(alike) == 1 else given


def _shown(identity: str, name: str) -> str:
    return identity if identity == name else f"{identity} ({name[:80]})"
