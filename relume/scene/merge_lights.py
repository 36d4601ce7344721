"""Sources of many lights: what a file has beyond the limit of a look is merged, so that an import leaves no light out.

The lights of one group with one color and one kind of shape are one source. The brightest sources stay as they are, and
the lights of all others are merged into one more source per kind.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from relume.core.import_warnings import ImporterWarning, approximated, quote, unsupported
from relume.scene.light_members import MEMBER_KINDS, members_of
from relume.scene.model import Light
from relume.scene.validate import MAX_LIGHTS

Lights = Sequence[Light]

_REST_NAME = "Other lights"
_COLOR_DIGITS = 3  # to which the colors of a source are equal


def merge_lights(
    lights: Lights, powers: Sequence[float], new_name: Callable[[str], str], warnings: list[ImporterWarning]
) -> list[Light]:
    """Merge lights if a look cannot have them singly; directional lights and emissive materials stay single.

    Args:
        lights: lights of a file. powers: power of each, W.
        new_name: makes a name unique in the file. warnings: added to.
    """
    if len(lights) <= MAX_LIGHTS:
        return list(lights)
    power = dict(zip((light.name for light in lights), powers, strict=True))
    sources = sorted(_equal_lights(lights), key=lambda source: -sum(power[light.name] for light in source))
    num_bright = len(sources) if len(sources) <= MAX_LIGHTS else MAX_LIGHTS - len(MEMBER_KINDS)
    dim = [light for source in sources[num_bright:] for light in source]
    merged = [_merge(source, source[0].group or source[0].name, new_name) for source in sources[:num_bright]]
    for kind in (*MEMBER_KINDS, None):
        rest = [light for light in dim if _member_kind(light) == kind]
        merged += [_merge_rest(rest, new_name, warnings)] if kind is not None and rest else rest
    merged = _without_dimmest(merged, power, warnings)
    of_many = [light for light in merged if light.members is not None]
    if of_many:
        num = sum(len(light.members.position) for light in of_many if light.members is not None)
        sources_text = f"{len(of_many)} source{'s' if len(of_many) > 1 else ''}, for example {quote(of_many[0].name)}"
        message = (
            f"{num:,} of {len(lights):,} lights were merged into {sources_text}: each source is edited as one light."
        )
        warnings.append(approximated(message))
    return merged


def _without_dimmest(lights: list[Light], power: Mapping[str, float], warnings: list[ImporterWarning]) -> list[Light]:
    """Omit the dimmest directional lights and emissive materials beyond the limit, with a warning."""
    single = sorted(
        (light for light in lights if _member_kind(light) is None and light.members is None),
        key=lambda light: power[light.name],
    )
    omitted = single[: max(0, len(lights) - MAX_LIGHTS)]
    if omitted:
        message = f"{len(omitted):,} emissive materials or directional lights, the dimmest, were left out, for example"
        limit = f"at most {MAX_LIGHTS} are possible."
        warnings.append(unsupported(f"{message} {quote(omitted[0].name)}; {limit}"))
    names = {light.name for light in omitted}
    return [light for light in lights if light.name not in names]


def _member_kind(light: Light) -> str | None:
    """Kind of a source that can have a light; None for a light that stays alone."""
    return next((kind for kind, kinds in MEMBER_KINDS.items() if light.fields["kind"] in kinds), None)


def _color(light: Light) -> tuple[float, ...]:
    emission = np.array(light.fields["emission"], np.float64)
    return tuple(np.round(emission / max(emission.max(), 1e-300), _COLOR_DIGITS).tolist())


def _equal_lights(lights: Lights) -> list[list[Light]]:
    """Lights that one source represents exactly: of one group, kind and color."""
    sources: dict[Any, list[Light]] = {}
    for light in lights:
        kind = _member_kind(light)
        key = (light.group, kind, _color(light)) if light.group and kind is not None else light.name
        sources.setdefault(key, []).append(light)
    return list(sources.values())


def _merge_rest(lights: Lights, new_name: Callable[[str], str], warnings: list[ImporterWarning]) -> Light:
    """Merge lights of one kind and any color."""
    merged = _merge([replace(light, group="") for light in lights], _REST_NAME, new_name)
    num_colors = len(set(map(_color, lights)))
    if num_colors > 1:
        text = (
            f"The {len(lights):,} lights of {quote(merged.name)} have {num_colors:,} colors; all get their mean color."
        )
        warnings.append(approximated(text))
    return merged


def _merge(lights: Lights, name: str, new_name: Callable[[str], str]) -> Light:
    """Merge lights of one kind; a single one stays as it is."""
    kind, fields = _member_kind(lights[0]), [light.fields for light in lights]
    if len(lights) == 1:
        return lights[0]
    emission = np.array([each["emission"] for each in fields], np.float64)
    weights = np.ones(len(lights)) if kind == "points" else np.array([np.prod(each["size"]) for each in fields])
    mean = weights @ emission / weights.sum()
    relative = emission.mean(axis=1) / mean.mean() if mean.any() else np.ones(len(lights))
    source = new_name(name)
    return Light(
        source,
        {"kind": kind, "source": source, "emission": mean.tolist()},
        lights[0].group,
        members_of(fields, relative.tolist()),
    )
