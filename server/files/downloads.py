"""What downloaded files are called: words that every system takes as part of a name."""

from __future__ import annotations

import re

_LONGEST = 120


def safe_stem(text: str) -> str:
    """Letters and digits of any script, dots, dashes and underscores of a text; anything else becomes dashes."""
    return re.sub(r"[^\w.-]+", "-", text)[:_LONGEST].strip(".-") or "picture"
