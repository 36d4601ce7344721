"""The layers of a picture: what each light gives, and what comes by each kind of light path. Each of the two groups
sums to the picture, since light adds up."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
from typing import get_args

from relume.look import Look
from relume.look.model import Show

ENVIRONMENT, BACKGROUND = "environment", "background"
_LONGEST = 29  # with ".R" the 31 characters that every reader of OpenEXR takes
_ANY_OF = [show for show in get_args(Show) if show != "all"]


@dataclass(frozen=True)
class Layer:
    """A part of a picture.

    Attributes:
        name: of the layer in the file: letters, digits and underscores, at most 29 of them.
        of: what it shows, as the look calls it.
        look: of which it is the picture.
    """

    name: str
    of: str
    look: Look


def layers_of(look: Look, *, reflects: bool) -> list[Layer]:
    """One layer for each light that gives any, then one for each kind of light path; none of a group of one, and none
    where a ground only catches shadows: what it shows is a ratio, which does not add up.

    Args:
        reflects: whether light between surfaces was baked.
    """
    if any(material.catcher for material in look.materials.values()):
        return []
    sources = [name for name, light in look.lights.items() if any(light.gain)]
    parts = [("light", ENVIRONMENT, _lit_by(look, None))] if any(look.environment.gain) else []
    parts += [("light", name, _lit_by(look, name)) for name in sources]
    parts = parts if len(parts) > 1 else []
    if parts and look.background.kind == "color":  # no light's
        parts = [(group, of, _before_black(lit)) for group, of, lit in parts]
        parts.append(("light", BACKGROUND, _lit_by(look, "")))
    paths = _paths_of(look) if reflects else []
    parts += [("path", show, _by_paths(look, show)) for show in paths] if len(paths) > 1 else []
    return _named(parts)


def _lit_by(look: Look, source: str | None) -> Look:
    """The look with one of its lights alone; None: its environment."""
    lights = {name: light.model_copy(update={"on": light.on and name == source}) for name, light in look.lights.items()}
    environment = look.environment if source is None else look.environment.model_copy(update={"scale": 0.0})
    return look.model_copy(update={"lights": lights, "environment": environment})


def _before_black(look: Look) -> Look:
    return look.model_copy(update={"background": look.background.model_copy(update={"color": (0.0, 0.0, 0.0)})})


def _by_paths(look: Look, show: str) -> Look:
    return look.model_copy(update={"transport": look.transport.model_copy(update={"show": show})})


def _paths_of(look: Look) -> list[str]:
    """The kinds of light paths that a look shows."""
    if look.transport.show != "all":
        return [look.transport.show]
    return _ANY_OF[: 1 + min(look.transport.bounces, 2)]


def _named(parts: list[tuple[str, str, Look]]) -> list[Layer]:
    """Layers whose names no program mistakes for each other's, however the lights are called."""
    layers: list[Layer] = []
    taken: set[str] = set()
    for group, of, look in parts:
        plain = f"{group}_{_plain(of)}"[:_LONGEST].rstrip("_")
        name, count = plain, 1
        while name.casefold() in taken:
            count += 1
            ending = f"_{count}"
            name = plain[: _LONGEST - len(ending)] + ending
        taken.add(name.casefold())
        layers.append(Layer(name, of, look))
    return layers


def _plain(name: str) -> str:
    """The letters and digits of ASCII that are in a name, other characters as single underscores."""
    ascii_only = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    return re.sub(r"[^A-Za-z0-9]+", "_", ascii_only).strip("_") or "unnamed"
