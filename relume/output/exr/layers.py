"""Layers of an image: one per light and one per class of light paths, where each of the two sets sums to the image; or
light groups, the direct and the indirect light of each, which together sum to the image. A light in no group is one of
its own.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Literal

from relume.look import Look
from relume.look.model import PathFilter
from relume.scene.validate import ENVIRONMENT

BACKGROUND = "background"
_MAX_NAME_LENGTH = 29  # plus ".R", 31 characters, which every OpenEXR reader accepts
_PATH_KINDS: tuple[PathFilter, ...] = ("direct", "first_bounce", "further_bounces")
Layering = bool | Literal["light_groups"]
"""Selection of layers: none, those of lights and those of paths, or light groups."""


@dataclass(frozen=True)
class Layer:
    """A layer of an image.

    Attributes:
        name: name in the file: letters, digits and underscores, at most 29.
        source: light or light path, by its name in the look.
        look: look that renders the layer.
    """

    name: str
    source: str
    look: Look


def make_layers(layering: Layering, look: Look, *, has_indirect: bool) -> list[Layer]:
    """Make the requested layers; none with a shadow catcher, whose ratio is not additive.

    Args:
        layering: selection. look: look of the image. has_indirect: the bake has indirect light.
    """
    if not layering or any(material.shadow_catcher for material in look.materials.values()):
        return []
    return (light_group_layers if layering == "light_groups" else light_and_path_layers)(
        look, has_indirect=has_indirect
    )


def light_and_path_layers(look: Look, *, has_indirect: bool) -> list[Layer]:
    """Make one layer per light with emission, then one per class of light paths; a set of one layer is omitted.

    Args:
        look, has_indirect: as in `make_layers`.
    """
    light_looks = _source_looks(look, [(name, (name,)) for name in look.lights])
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
    """Make one layer per light group for each of direct and indirect light; together they sum to the image.

    Args:
        look, has_indirect: as in `make_layers`.
    """
    paths = look.transport.supported_by(has_indirect=has_indirect)
    included: dict[PathFilter, bool] = {"direct": paths.direct, "indirect": paths.has_indirect}
    classes = [path_kind for path_kind, is_included in included.items() if is_included]
    whole = look.transport.show == "all"
    unnamed_layers = [
        _UnnamedLayer("light", source, f"_{path_kind}", _only_path_kind(light_look, path_kind) if whole else light_look)
        for source, light_look in _source_looks(look, _light_groups(look))
        for path_kind in classes
    ]
    return _name_layers([*unnamed_layers, *_background_layers(look)])


@dataclass(frozen=True)
class _UnnamedLayer:
    """A layer whose name is still to be made from `group`, `source` and `ending`."""

    group: str
    source: str
    ending: str
    look: Look


_Source = tuple[str, Sequence[str]]
"""Name of a source of light, and of its lights."""


def _light_groups(look: Look) -> list[_Source]:
    """Each group with its lights, then each of the other lights by itself."""
    groups: list[_Source] = [(name, group.lights) for name, group in look.light_groups.items()]
    grouped = {name for _, names in groups for name in names}
    return [*groups, *((name, (name,)) for name in look.lights if name not in grouped)]


def _source_looks(look: Look, sources: Sequence[_Source]) -> list[tuple[str, Look]]:
    """The environment and each source with emission, and the look with only its lights; a background color is black.

    Args:
        look: look of the image. sources: of its local light.
    """
    light_looks: list[tuple[str, Look]] = (
        [(ENVIRONMENT, _lit_only_by(look, None))] if any(look.environment.gain) else []
    )
    light_looks += [
        (source, _lit_only_by(look, names))
        for source, names in sources
        if any(any(look.lights[name].gain) for name in names)
    ]
    return (
        [(source, _with_black_background(light_look)) for source, light_look in light_looks]
        if look.background.kind == "color"
        else light_looks
    )


def _background_layers(look: Look) -> list[_UnnamedLayer]:
    """Layer of a background color, which belongs to no light."""
    return [_UnnamedLayer("light", BACKGROUND, "", _lit_only_by(look, ()))] if look.background.kind == "color" else []


def _lit_only_by(look: Look, names: Collection[str] | None) -> Look:
    """Return the look with only some of its lights; None: its environment."""
    lights = {
        name: light.model_copy(update={"enabled": light.enabled and name in (names or ())})
        for name, light in look.lights.items()
    }
    environment = look.environment if names is None else look.environment.model_copy(update={"intensity": 0.0})
    return look.model_copy(update={"lights": lights, "environment": environment})


def _with_black_background(look: Look) -> Look:
    return look.model_copy(update={"background": look.background.model_copy(update={"color": (0.0, 0.0, 0.0)})})


def _only_path_kind(look: Look, path_kind: PathFilter) -> Look:
    return look.model_copy(update={"transport": look.transport.model_copy(update={"show": path_kind})})


def _path_kinds(look: Look) -> list[PathFilter]:
    """Classes of light paths in a look."""
    kinds = _PATH_KINDS[: 1 + min(look.transport.bounces, 2)]
    return {"all": list(kinds), "indirect": list(kinds[1:])}.get(look.transport.show, [look.transport.show])


def _name_layers(unnamed_layers: list[_UnnamedLayer]) -> list[Layer]:
    """Name layers uniquely, also for readers that ignore case, whatever the names of the lights."""
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
    """Convert a name to ASCII letters and digits, with single underscores for other characters."""
    ascii_only = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    return re.sub(r"[^A-Za-z0-9]+", "_", ascii_only).strip("_") or "unnamed"
