"""The list of scenes made by code. To add one: write it beside this and add it here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from relume.core.errors import ParameterError
from relume.scene.examples.cornell import cornell_box, lamplit_cornell_box
from relume.scene.examples.interior import interior
from relume.scene.examples.still_life import demo_scene
from relume.scene.examples.tableau import tableau
from relume.scene.model import Scene


@dataclass(frozen=True)
class BuiltIn:
    """A scene made by code, and how it is shown best.

    Attributes:
        label, description: for people. size: of a good picture, in pixels. method: of transfer.
    """

    label: str
    description: str
    make: Callable[[], Scene]
    size: tuple[int, int] = (640, 480)
    method: str = "gather"


BUILT_IN: dict[str, BuiltIn] = {
    "still_life": BuiltIn(
        "Still life",
        "Teapot, bowl, cloth and pearls in a studio: highlights and textures.",
        demo_scene,
    ),
    "cornell_box": BuiltIn(
        "Cornell box",
        "Red and green walls colour two blocks; the sky comes in from above.",
        cornell_box,
        size=(480, 480),
    ),
    "lamplit_cornell_box": BuiltIn(
        "Cornell box by lamplight",
        "The same room by night, lit by the lamp in its ceiling.",
        lamplit_cornell_box,
        size=(480, 480),
    ),
    "tableau": BuiltIn(
        "Tableau",
        "Two smooth shapes on a polished floor, and what they throw onto it.",
        tableau,
    ),
    "interior": BuiltIn(
        "Interior",
        "A room lit through one window, almost all of it by reflected light.",
        interior,
    ),
}


def built_in(name: str) -> Scene:
    """The scene of that name in `BUILT_IN`. Raises ParameterError for any other name."""
    if name not in BUILT_IN:
        raise ParameterError("--built-in", name, ", ".join(BUILT_IN))
    return BUILT_IN[name].make()
