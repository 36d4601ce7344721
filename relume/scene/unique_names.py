"""Names that are safe to show, to point at and to tell apart."""

from __future__ import annotations

import re

UNREADABLE = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


def unique_name(preferred: str, used_names: dict[str, int]) -> str:
    """At most 80 characters, none that JSON Pointers or terminals mind, and not taken before."""
    plain = UNREADABLE.sub("", preferred[:1000]).replace("/", "-").replace("~", "-").strip()[:68].strip()
    return append_number(plain or "unnamed", " ", used_names)


def append_number(plain: str, separator: str, used_names: dict[str, int]) -> str:
    """A name that is not taken: the plain one, or it with the first free number from 2.

    Args:
        plain: the wanted name.
        separator: stands between the name and the number.
        used_names: the last number tried for each name; the new name is added.
    """
    name = plain
    while name in used_names:
        used_names[plain] += 1
        name = f"{plain}{separator}{used_names[plain]}"
    used_names[name] = 1
    return name
