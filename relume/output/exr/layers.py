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
from relume.look.model import PathFilter

ENVIRONMENT, BACKGROUND = "environment", "background"
_MAX_NAME_LENGTH = 29  # with ".R" the 31 characters that every reader of OpenEXR takes
_PATH_KINDS: tuple[PathFilter, ...] = ("direct", "first_bounce", "further_bounces")
Layering = bool | Literal["light_groups"]
"""Which layers: none, those of lights and those of paths, or those of both at once."""


@dataclass(frozen=True)
class Layer:
    """A part of a picture.

    Attributes:
        name: of the layer in the file: letters, digits and underscores, at most 29 of them.
        source: what it shows, as the look calls it.
        look: of which it is the picture.
    """

    name: str
    source: str
    look: Look


def make_layers(layering: Layering, look: Look, *, has_indirect: bool) -> list[Layer]:
    """The layers that are asked for; none where a ground only catches shadows: what it shows is a ratio, which does not
    add up.

    Args:
        layering: which. look: of which they are parts. has_indirect: whether light between surfaces was baked.
    """
    if not layering or any(material.shadow_catcher for material in look.materials.values()):
        return []
    return (light_group_layers if layering == "light_groups" else light_and_path_layers)(
        look, has_indirect=has_indirect
    )


def light_and_path_layers(look: Look, *, has_indirect: bool) -> list[Layer]:
    """One layer for each light that gives any, then one for each kind of light path; none of a group of one.

    Args:
        look, has_indirect: as of `make_layers`.
    """
    light_looks = _single_light_looks(look)
    unnamed_layers = (
        [_UnnamedLayer("light", source, "", light_look) for source, light_look in light_looks]
        if len(light_looks) > 1
        else []
    )
    if unnamed_layers:
        unnamed_layers += _background_layers(look)
    path_kinds = _path_kinds(look) if has_indirect else []
    unnamed_layers += (
        [_UnnamedLayer("path", path_kind, "", _only_path_kind(look, path_kind)) for path_kind in path_kinds]
        if len(path_kinds) > 1
        else []
    )
    return _name_layers(unnamed_layers)


def light_group_layers(look: Look, *, has_indirect: bool) -> list[Layer]:
    """One layer for each light and each of direct and indirect light; all of them together are the picture.

    Args:
        look, has_indirect: as of `make_layers`.
    """
    paths = look.transport.supported_by(has_indirect=has_indirect)
    included: dict[PathFilter, bool] = {"direct": paths.direct, "indirect": paths.has_indirect}
    classes = [path_kind for path_kind, is_included in included.items() if is_included]
    whole = look.transport.show == "all"
    unnamed_layers = [
        _UnnamedLayer("light", source, f"_{path_kind}", _only_path_kind(light_look, path_kind) if whole else light_look)
        for source, light_look in _single_light_looks(look)
        for path_kind in classes
    ]
    return _name_layers([*unnamed_layers, *_background_layers(look)])


@dataclass(frozen=True)
class _UnnamedLayer:
    """A layer without its name: `group`, `source` and `ending` are what it is made of."""

    group: str
    source: str
    ending: str
    look: Look


def _single_light_looks(look: Look) -> list[tuple[str, Look]]:
    """Each light that gives any, and the look that it alone lights, before black where the background has a colour."""
    names = [name for name, light in look.lights.items() if any(light.gain)]
    light_looks: list[tuple[str, Look]] = (
        [(ENVIRONMENT, _lit_only_by(look, None))] if any(look.environment.gain) else []
    )
    light_looks += [(name, _lit_only_by(look, name)) for name in names]
    return (
        [(source, _with_black_background(light_look)) for source, light_look in light_looks]
        if look.background.kind == "color"
        else light_looks
    )


def _background_layers(look: Look) -> list[_UnnamedLayer]:
    """A background of one colour, which is no light's."""
    return [_UnnamedLayer("light", BACKGROUND, "", _lit_only_by(look, ""))] if look.background.kind == "color" else []


def _lit_only_by(look: Look, source: str | None) -> Look:
    """The look with one of its lights alone; None: its environment."""
    lights = {
        name: light.model_copy(update={"enabled": light.enabled and name == source})
        for name, light in look.lights.items()
    }
    environment = look.environment if source is None else look.environment.model_copy(update={"intensity": 0.0})
    return look.model_copy(update={"lights": lights, "environment": environment})


def _with_black_background(look: Look) -> Look:
    return look.model_copy(update={"background": look.background.model_copy(update={"color": (0.0, 0.0, 0.0)})})


def _only_path_kind(look: Look, path_kind: PathFilter) -> Look:
    return look.model_copy(update={"transport": look.transport.model_copy(update={"show": path_kind})})


def _path_kinds(look: Look) -> list[PathFilter]:
    """The kinds of light paths that a look shows."""
    kinds = _PATH_KINDS[: 1 + min(look.transport.bounces, 2)]
    return {"all": list(kinds), "indirect": list(kinds[1:])}.get(look.transport.show, [look.transport.show])


def _name_layers(unnamed_layers: list[_UnnamedLayer]) -> list[Layer]:
    """Layers whose names no program mistakes for each other's, however the lights are called."""
    layers: list[Layer] = []
    used_names: set[str] = set()
    for unnamed_layer in unnamed_layers:
        prefix = f"{unnamed_layer.group}_{_ascii_name(unnamed_layer.source)}"
        name, count = _with_ending(prefix, unnamed_layer.ending), 1
        while name.casefold() in used_names:
            count += 1
            name = _with_ending(prefix, f"_{count}{unnamed_layer.ending}")
        used_names.add(name.casefold())
        layers.append(Layer(name, unnamed_layer.source, unnamed_layer.look))
    return layers


def _with_ending(prefix: str, ending: str) -> str:
    return prefix[: _MAX_NAME_LENGTH - len(ending)].rstrip("_") + ending


def _ascii_name(name: str) -> str:
    """The letters and digits of ASCII that are in a name, other characters as single underscores."""
    ascii_only = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    return re.sub(r"[^A-Za-z0-9]+", "_", ascii_only).strip("_") or "unnamed"
