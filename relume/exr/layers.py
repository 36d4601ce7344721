"""The layers of a picture: what each light gives, and what comes by each kind of light path, each of the two groups
summing to the picture, since light adds up; or light groups, what each light gives directly and by reflection, all of
them together the picture.
"""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
from typing import Literal

from relume.look import Look
from relume.look.model import Show

ENVIRONMENT, BACKGROUND = "environment", "background"
_LONGEST = 29  # with ".R" the 31 characters that every reader of OpenEXR takes
_KINDS: tuple[Show, ...] = ("direct", "first_bounce", "further_bounces")
Layering = bool | Literal["light_groups"]
"""Which layers: none, those of lights and those of paths, or those of both at once."""


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


def layers_for(layering: Layering, look: Look, *, reflects: bool) -> list[Layer]:
    """The layers that are asked for; none where a ground only catches shadows: what it shows is a ratio, which does not
    add up.

    Args:
        layering: which. look: of which they are parts. reflects: whether light between surfaces was baked.
    """
    if not layering or any(material.catcher for material in look.materials.values()):
        return []
    return (light_groups_of if layering == "light_groups" else layers_of)(look, reflects=reflects)


def layers_of(look: Look, *, reflects: bool) -> list[Layer]:
    """One layer for each light that gives any, then one for each kind of light path; none of a group of one.

    Args:
        look, reflects: as of `layers_for`.
    """
    lights = _lights_of(look)
    parts = [_Part("light", of, "", lit) for of, lit in lights] if len(lights) > 1 else []
    if parts:
        parts += _background_of(look)
    paths = _paths_of(look) if reflects else []
    parts += [_Part("path", show, "", _by_paths(look, show)) for show in paths] if len(paths) > 1 else []
    return _named(parts)


def light_groups_of(look: Look, *, reflects: bool) -> list[Layer]:
    """One layer for each light and each of direct and reflected light; all of them together are the picture.

    Args:
        look, reflects: as of `layers_for`.
    """
    paths = look.transport.followed(reflects=reflects)
    shown: dict[Show, bool] = {"direct": paths.direct, "reflected": paths.reflect}
    classes = [show for show, is_shown in shown.items() if is_shown]
    whole = look.transport.show == "all"
    parts = [
        _Part("light", of, f"_{show}", _by_paths(lit, show) if whole else lit)
        for of, lit in _lights_of(look)
        for show in classes
    ]
    return _named([*parts, *_background_of(look)])


@dataclass(frozen=True)
class _Part:
    """A layer without its name: `group`, `of` and `ending` are what it is made of."""

    group: str
    of: str
    ending: str
    look: Look


def _lights_of(look: Look) -> list[tuple[str, Look]]:
    """Each light that gives any, and the look that it alone lights, before black where the background has a colour."""
    names = [name for name, light in look.lights.items() if any(light.gain)]
    lit: list[tuple[str, Look]] = [(ENVIRONMENT, _lit_by(look, None))] if any(look.environment.gain) else []
    lit += [(name, _lit_by(look, name)) for name in names]
    return [(of, _before_black(alone)) for of, alone in lit] if look.background.kind == "color" else lit


def _background_of(look: Look) -> list[_Part]:
    """A background of one colour, which is no light's."""
    return [_Part("light", BACKGROUND, "", _lit_by(look, ""))] if look.background.kind == "color" else []


def _lit_by(look: Look, source: str | None) -> Look:
    """The look with one of its lights alone; None: its environment."""
    lights = {name: light.model_copy(update={"on": light.on and name == source}) for name, light in look.lights.items()}
    environment = look.environment if source is None else look.environment.model_copy(update={"scale": 0.0})
    return look.model_copy(update={"lights": lights, "environment": environment})


def _before_black(look: Look) -> Look:
    return look.model_copy(update={"background": look.background.model_copy(update={"color": (0.0, 0.0, 0.0)})})


def _by_paths(look: Look, show: Show) -> Look:
    return look.model_copy(update={"transport": look.transport.model_copy(update={"show": show})})


def _paths_of(look: Look) -> list[Show]:
    """The kinds of light paths that a look shows."""
    kinds = _KINDS[: 1 + min(look.transport.bounces, 2)]
    return {"all": list(kinds), "reflected": list(kinds[1:])}.get(look.transport.show, [look.transport.show])


def _named(parts: list[_Part]) -> list[Layer]:
    """Layers whose names no program mistakes for each other's, however the lights are called."""
    layers: list[Layer] = []
    taken: set[str] = set()
    for part in parts:
        begin = f"{part.group}_{_plain(part.of)}"
        name, count = _ended(begin, part.ending), 1
        while name.casefold() in taken:
            count += 1
            name = _ended(begin, f"_{count}{part.ending}")
        taken.add(name.casefold())
        layers.append(Layer(name, part.of, part.look))
    return layers


def _ended(begin: str, ending: str) -> str:
    return begin[: _LONGEST - len(ending)].rstrip("_") + ending


def _plain(name: str) -> str:
    """The letters and digits of ASCII that are in a name, other characters as single underscores."""
    ascii_only = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    return re.sub(r"[^A-Za-z0-9]+", "_", ascii_only).strip("_") or "unnamed"
