"""Names that are printable and unique."""

from __future__ import annotations

from relume.core.import_warnings import UNREADABLE

INHERITED_NAMES = (
    "__defineGetter__", "__defineSetter__", "__lookupGetter__", "__lookupSetter__", "__proto__", "constructor",
    "hasOwnProperty", "isPrototypeOf", "propertyIsEnumerable", "toLocaleString", "toString", "valueOf",
)  # fmt: skip
"""Properties that every object of JavaScript has: the editor would find them where it looks for a removed light."""


def unique_name(preferred: str, used_names: dict[str, int]) -> str:
    """Return a unique name of at most 80 characters, without characters special to JSON pointers or terminals."""
    plain = UNREADABLE.sub("", preferred[:1000]).replace("/", "-").replace("~", "-").strip()[:68].strip()
    if plain in INHERITED_NAMES:
        used_names.setdefault(plain, 1)
    return append_number(plain or "unnamed", " ", used_names)


def append_number(plain: str, separator: str, used_names: dict[str, int]) -> str:
    """Return an unused name: `plain`, or `plain` with the first free number from 2.

    Args:
        plain: the preferred name.
        separator: text between the name and the number.
        used_names: the last number tried for each name; the new name is added.
    """
    name = plain
    while name in used_names:
        used_names[plain] += 1
        name = f"{plain}{separator}{used_names[plain]}"
    used_names[name] = 1
    return name
