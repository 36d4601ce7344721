"""Names of lights as programs number them: "Downlight", "Downlight.001", "Downlight 2"."""

from __future__ import annotations

import re

_NUMBER = re.compile(r"[\s._-]*\d+$")


def name_prefix(name: str) -> str:
    """Return a light's name without the numbers at its end: "Downlight" for "Downlight.001"."""
    prefix = _NUMBER.sub("", name)
    return name_prefix(prefix) if prefix not in ("", name) else prefix or name
