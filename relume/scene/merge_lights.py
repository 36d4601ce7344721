"""Sources of many lights: what a file has beyond the limit of a look is merged, so that an import leaves no light out.

The lights of one group with one color, equal links and one kind of source are one source. The brightest sources stay as
they are, and the lights of all others are merged into one more source per kind; emissive materials keep their colors.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.core.import_warnings import ImporterWarning, approximated, quote
from relume.scene.light_members import MEMBER_KINDS, members_of
from relume.scene.model import Light
from relume.scene.validate import MAX_LIGHTS

Lights = Sequence[Light]
F64 = NDArray[np.float64]

_SURFACES = "surfaces"  # the source of emissive materials
_REST_NAME, _REST_MATERIALS = "Other lights", "Other emissive materials"
_COLOR_DIGITS = 3  # to which the colors of a source are equal
_COLOR_ROUNDING = 1e-6  # channels that differ less are equal


def merge_lights(
    lights: Lights, powers: Sequence[float], new_name: Callable[[str], str], warnings: list[ImporterWarning]
) -> list[Light]:
    """Merge lights if a look cannot have them singly; of emissive materials, only the least powerful.

    Args:
        lights: lights of a file. powers: power of each, W.
        new_name: makes a name unique in the file. warnings: added to.
    """
    if len(lights) <= MAX_LIGHTS:
        return list(lights)
    power = dict(zip((light.name for light in lights), powers, strict=True))
    sources = _equal_lights(lights)
    ranking = sorted(range(len(sources)), key=lambda k: -sum(power[light.name] for light in sources[k]))
    kinds = list(dict.fromkeys(map(_source_kind, lights)))
    num_bright = len(sources) if len(sources) <= MAX_LIGHTS else MAX_LIGHTS - len(kinds)
    bright, dim = ([sources[k] for k in sorted(part)] for part in (ranking[:num_bright], ranking[num_bright:]))
    merged = [_merge(source, power, source[0].group or source[0].name, new_name) for source in bright]
    rests = ([light for source in dim for light in source if _source_kind(light) == kind] for kind in kinds)
    merged += [_merge_rest(rest, power, new_name, warnings) for rest in rests if rest]
    of_many = [light for light in merged if _num_lights(light) > 1]
    num = sum(map(_num_lights, of_many))
    sources_text = f"{len(of_many)} source{'s' if len(of_many) > 1 else ''}, for example {quote(of_many[0].name)}"
    message = f"{num:,} of {len(lights):,} lights were merged into {sources_text}: each source is edited as one light."
    warnings.append(approximated(message))
    return merged


def surface_area(fields: Mapping[str, Any]) -> float:
    """Area of an area light, m²; 0 of any other light. fields: of the light"""
    match fields["kind"]:
        case "rectangle":
            return float(np.prod(fields["size"]))
        case "disc":
            return float(np.pi * fields["radius"] ** 2)
        case "sphere":
            return float(4 * np.pi * fields["radius"] ** 2)
        case "tube":
            return float(2 * np.pi * fields["radius"] * fields["length"])
    return 0.0


def _num_lights(light: Light) -> int:
    return len(light.fields.get("materials", ())) if light.members is None else len(light.members.shape)


def _source_kind(light: Light) -> str:
    """Kind of a source that can have a light."""
    return next((kind for kind, kinds in MEMBER_KINDS.items() if light.fields["kind"] in kinds), _SURFACES)


def _links(light: Light) -> dict[str, Any]:
    return {field: light.fields[field] for field in ("link", "shadow_link") if light.fields.get(field) is not None}


def _color(light: Light) -> tuple[float, ...]:
    emission = np.array(light.fields["emission"], np.float64)
    return tuple(np.round(emission / max(emission.max(), 1e-300), _COLOR_DIGITS).tolist())


def _equal_lights(lights: Lights) -> list[list[Light]]:
    """Lights that one source represents exactly: of one group, kind, color and links; materials stay single."""
    sources: dict[Any, list[Light]] = {}
    for light in lights:
        kind = _source_kind(light)
        is_single = not light.group or kind == _SURFACES or light.fields.get("profile") is not None
        key = light.name if is_single else (light.group, kind, _color(light), repr(_links(light)))
        sources.setdefault(key, []).append(light)
    return list(sources.values())


def _merge_rest(
    lights: Lights, power: Mapping[str, float], new_name: Callable[[str], str], warnings: list[ImporterWarning]
) -> Light:
    """Merge lights of one kind, of any color and links."""
    kind, num = _source_kind(lights[0]), f"The {len(lights):,} lights of"
    name = _REST_MATERIALS if kind == _SURFACES else _REST_NAME
    has_links = any(_links(light) != _links(lights[0]) for light in lights)
    if has_links:
        dropped = {"link": None, "shadow_link": None}
        lights = [replace(light, fields={**light.fields, **dropped}) for light in lights]
    merged = _merge([replace(light, group="") for light in lights], power, name, new_name)
    if len(lights) > 1 and any(light.fields.get("profile") is not None for light in lights):
        warnings.append(approximated(f"{num} {quote(merged.name)} emit without their IES files."))
    num_colors = len(set(map(_color, lights)))
    if num_colors > 1 and kind != _SURFACES:
        text = f"{num} {quote(merged.name)} have {num_colors:,} colors; all get their mean color."
        warnings.append(approximated(text))
    if has_links:
        warnings.append(approximated(f"{num} {quote(merged.name)} have different links; they light all objects."))
    return merged


def _merge(lights: Lights, power: Mapping[str, float], name: str, new_name: Callable[[str], str]) -> Light:
    """Merge lights of one kind and of equal links; a single one stays as it is."""
    if len(lights) == 1:
        return lights[0]
    kind, source = _source_kind(lights[0]), new_name(name)
    emission = np.array([light.fields["emission"] for light in lights], np.float64)
    weights = _weights(lights, emission, power)
    mean = weights @ emission / weights.sum()
    fields = {"kind": kind, "emission": mean.tolist(), **_links(lights[0])}
    if kind == _SURFACES:
        relative_rgb = np.divide(emission, mean, out=np.ones_like(emission), where=mean > 0)
        is_gray = np.ptp(relative_rgb, axis=1) < _COLOR_ROUNDING * relative_rgb.max(axis=1)
        relative_rgb[is_gray] = relative_rgb[is_gray].mean(axis=1, keepdims=True)
        materials = [[light.fields["material"], rgb] for light, rgb in zip(lights, relative_rgb.tolist(), strict=True)]
        return Light(source, {**fields, "materials": materials}, lights[0].group)
    relative = emission.mean(axis=1) / mean.mean() if mean.any() else np.ones(len(lights))
    members = members_of([light.fields for light in lights], relative.tolist())
    return Light(source, {**fields, "source": source}, lights[0].group, members)


def _weights(lights: Lights, emission: F64, power: Mapping[str, float]) -> F64:
    """Weights of lights in their mean emission: the areas of surfaces."""
    match _source_kind(lights[0]):
        case "panels":
            return np.array([surface_area(light.fields) for light in lights])
        case "surfaces":  # power is proportional to area and emission
            areas = np.array([power[light.name] for light in lights]) / np.maximum(emission.mean(axis=1), 1e-300)
            return areas if areas.any() else np.ones(len(lights))
    return np.ones(len(lights))
