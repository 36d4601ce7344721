"""The list of scenes made by code. To add one: write it beside this and add it here."""

from __future__ import annotations

from collections.abc import Callable

from relume.errors import ParameterError
from relume.scene.cornell import cornell_box, lamplit_cornell_box
from relume.scene.demo import demo_scene
from relume.scene.interior import interior
from relume.scene.model import Scene
from relume.scene.tableau import tableau

BUILT_IN: dict[str, Callable[[], Scene]] = {
    "still_life": demo_scene,
    "cornell_box": cornell_box,
    "lamplit_cornell_box": lamplit_cornell_box,
    "tableau": tableau,
    "interior": interior,
}


def built_in(name: str) -> Scene:
    """One of them. Raises ParameterError for any other name."""
    if name not in BUILT_IN:
        raise ParameterError("--built-in", name, ", ".join(BUILT_IN))
    return BUILT_IN[name]()
