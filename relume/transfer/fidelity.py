"""How near a picture is to its look, in words that go with every frame."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal, get_args

# worst first: interpolated between few samples; of an older look, or of its most important coefficients alone; changed
# light followed by rows; a slider followed along its nodes; the full evaluation
Fidelity = Literal["preview", "approximate", "followed", "near", "exact"]
_ORDER: tuple[Fidelity, ...] = get_args(Fidelity)


def worst(found: Iterable[Fidelity]) -> Fidelity:
    """What can be said of several together; "exact" of none."""
    return min(found, key=_ORDER.index, default="exact")
