"""Images of single light sources at strength 1, and looks with changed strengths."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Shaped
from jsonpointer import JsonPointer
from numpy.typing import NDArray

from relume.core.errors import EditError, ParameterError
from relume.core.validation import names_text
from relume.look import LightLook, Look
from relume.look.light_validation import MAX_INTENSITY
from relume.look.model import EnvironmentLook

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
RenderLook = Callable[[Look], Shaped[F32, "height width channels"]]

ENVIRONMENT_POINTER = "/environment"
LOCKED_POINTER = "/locked"
"""Pointer of the source of all locked lights together, which no look has."""
_UNIT_STRENGTH = {"intensity": 1.0, "color": (1.0, 1.0, 1.0)}
_DISPLAY_FIELDS = {"display"}
_NUM_COLORS = 3
_VISIBLE = 1e-4  # RMS change of the image, relative to that of its brightest source


@dataclass(frozen=True)
class Sources:
    """Light sources of a look, with strength s = intensity · color per channel; image = Σ strength · image + constant.

    Attributes:
        pointers: JSON pointers of the enabled lights and of the environment in the look, or `LOCKED_POINTER`.
        images: linear radiance of each at strength 1, by channel. constant: radiance of no light, such as a
            background color.
        intensities, colors: current ones.
    """

    pointers: tuple[str, ...]
    images: Shaped[F32, "3 sources height width"]
    constant: Shaped[F32, "height width 3"]
    intensities: Shaped[F64, " sources"]
    colors: Shaped[F64, "sources 3"]

    @property
    def strengths(self) -> Shaped[F64, "sources 3"]:
        """Current strengths."""
        return self.intensities[:, None] * self.colors

    @property
    def color_scales(self) -> Shaped[F64, "sources 1"]:
        """The largest component of each color, which stays while the color changes; 1 for black."""
        largest = self.colors.max(axis=1, keepdims=True)
        return np.where(largest > 0.0, largest, 1.0)

    def image(self, strengths: Shaped[F64, "sources 3"]) -> Shaped[F32, "height width 3"]:
        """Radiance of the image with these strengths."""
        pixels = self.images.reshape(*self.images.shape[:2], -1)
        channels = strengths.T[:, None].astype(np.float32) @ pixels
        return channels.reshape(_NUM_COLORS, -1).T.reshape(self.constant.shape) + self.constant

    @cached_property
    def mean_squares(self) -> Shaped[F64, "3 sources"]:
        """Mean square n² of each image."""
        return np.asarray(np.mean(np.square(self.images), axis=(2, 3), dtype=np.float64))


def source_lights(look: Look) -> dict[str, LightLook | EnvironmentLook]:
    """Return the enabled lights of a look and its environment by their JSON pointers."""
    lights: dict[str, LightLook | EnvironmentLook] = {ENVIRONMENT_POINTER: look.environment}
    return lights | {pointer_of("lights", name): light for name, light in look.lights.items() if light.enabled}


def pointer_of(section: str, name: str) -> str:
    """Return the JSON pointer of a light or a material in a look."""
    return str(JsonPointer.from_parts([section, name]).path)


def load_sources(look: Look, render: RenderLook, locked: Collection[str] = ()) -> Sources:
    """Render the images of a look's sources.

    Args:
        look: the look. render: renders a look; called once for each source, with a look that depends on no other.
        locked: pointers of lights that stay; together they are one source of strength 1.
    Raises:
        EditError: the look has a shadow catcher, whose ratio is not linear in the lights.
        ParameterError: a pointer in `locked` is no source.
    """
    if any(material.shadow_catcher for material in look.materials.values()):
        raise EditError("lights cannot be matched with a shadow catcher; turn it off while you match")
    lights, dark = source_lights(look), _dark_look(look)
    if unknown := set(locked) - set(lights):
        raise ParameterError("locked", min(unknown), f"pointers of enabled lights: {names_text(lights)}")
    free = {pointer: light for pointer, light in lights.items() if pointer not in locked}
    images = [render(_single_source_look(dark, pointer, light)) for pointer, light in free.items()]
    strengths = [(pointer, light.intensity, light.color) for pointer, light in free.items()]
    if locked:
        images.append(render(_with_lights(dark, {pointer: lights[pointer] for pointer in lights if pointer in locked})))
        strengths.append((LOCKED_POINTER, 1.0, (1.0, 1.0, 1.0)))
    pointers, intensities, colors = zip(*strengths, strict=True)
    has_constant = look.background.kind == "color"
    constant = render(look_without_lights(look)) if has_constant else np.zeros_like(images[0])
    return Sources(
        pointers,
        np.ascontiguousarray(np.moveaxis(np.stack(images)[..., :_NUM_COLORS], -1, 0), np.float32),
        np.ascontiguousarray(constant[..., :_NUM_COLORS], np.float32),
        np.array(intensities, np.float64),
        np.array(colors, np.float64),
    )


def image_key(look: Look) -> str:
    """Identify the image of a look in a cache: everything except its conversion to display values."""
    return look.model_dump_json(exclude=_DISPLAY_FIELDS)


def look_without_lights(look: Look) -> Look:
    """Return the look with no light but its background color."""
    return look.model_copy(update={"lights": {}, "environment": look.environment.model_copy(update={"intensity": 0.0})})


def _dark_look(look: Look) -> Look:
    black = look.background.model_copy(update={"color": (0.0, 0.0, 0.0)})
    return look_without_lights(look).model_copy(update={"background": black})


def _single_source_look(dark: Look, pointer: str, light: LightLook | EnvironmentLook) -> Look:
    return _with_lights(dark, {pointer: light.model_copy(update=_UNIT_STRENGTH)})


def _with_lights(dark: Look, sources: Mapping[str, LightLook | EnvironmentLook]) -> Look:
    """Return a dark look with sources."""
    environment = sources.get(ENVIRONMENT_POINTER, dark.environment)
    lights = {JsonPointer(each).parts[1]: light for each, light in sources.items() if each != ENVIRONMENT_POINTER}
    return dark.model_copy(update={"environment": environment, "lights": lights})


def strength_changes(
    sources: Sources, strengths: Shaped[F64, "sources 3"], *, changes_color: bool
) -> dict[str, dict[str, Any]]:
    """Return the fields of each source whose strength changes, by pointer: intensity, and color if it changes.

    The largest component of a color stays. A black source keeps its color, which its strength does not determine.
    Changes without a visible effect are omitted.

    Args:
        sources: the sources. strengths: new ones. changes_color: whether colors change, too.
    """
    changes: dict[str, dict[str, Any]] = {}
    rms = np.sqrt(sources.mean_squares).T
    is_visible = (rms * np.abs(strengths - sources.strengths)).max(axis=1) > _VISIBLE * (rms * strengths).max()
    scales = sources.color_scales[:, 0]
    for k in np.flatnonzero(is_visible):
        pointer, after, scale = sources.pointers[k], strengths[k], scales[k]
        intensity = min(float(after.max() / scale), MAX_INTENSITY)
        changes[pointer] = {"intensity": intensity}
        if changes_color and intensity > 0.0:
            changes[pointer]["color"] = (after / intensity).tolist()
    return changes


def replace_operations(changes: Mapping[str, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return changed fields as the operations of a JSON Patch."""
    return [
        {"op": "replace", "path": f"{pointer}/{field}", "value": value}
        for pointer, fields in changes.items()
        for field, value in fields.items()
    ]


def merge_changes(partial: Mapping[str, Any], operations: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """Return a partial look with changed fields, which it may not have had."""
    merged = dict(partial)
    for operation in operations:
        *parents, field = JsonPointer(operation["path"]).parts
        node = merged
        for parent in parents:
            node[parent] = dict(node.get(parent, {}))
            node = node[parent]
        node[field] = operation["value"]
    return merged
