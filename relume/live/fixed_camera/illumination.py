"""The illumination of an image, as far as its operators and images depend on it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.albedo import Reflectance, Reflectances, material_reflectance
from relume.brdf.texture_slots import EmissionImage, NormalMap
from relume.look import EnvironmentKey, LightGeometry, LightPaths, Look
from relume.look.model import Link, Rgb
from relume.scene.validate import ENVIRONMENT

F32 = NDArray[np.float32]

Solo = frozenset[str] | None
Normals = tuple[NormalMap | None, ...]
"""The image that overrides each material's normal map; None for no override."""

_UNIT_GAIN: Rgb = (1.0, 1.0, 1.0)
_ZERO_GAIN: Rgb = (0.0, 0.0, 0.0)
_NO_IMAGES: Mapping[LightGeometry, EmissionImage] = MappingProxyType({})
_FACTOR_ROUNDING = 1e-9  # relative, of products of gains in float64
_MAX_CACHED_LIGHTS = 64  # every update strategy asks for the gains of a frame's lights, for every term


class LightSource(NamedTuple):
    """A local light. gain: per channel, multiplies its unit emission."""

    geometry: LightGeometry
    gain: Rgb


class Illumination(NamedTuple):
    """The light in a scene; images in equal light need the same operators.

    Attributes:
        reflectances: reflectances of all materials, for indirect illumination; empty if that is not shown.
        paths: the light paths that are shown; indirect ones only if they were baked.
        local: the lights with a gain above zero, and those that emit black images. environment_gain: per channel; 1 if
            there are no local lights, since the gain then multiplies the finished image (`picture_gain`).
    """

    environment: EnvironmentKey
    reflectances: Reflectances
    paths: LightPaths
    local: tuple[LightSource, ...] = ()
    environment_gain: Rgb = (1.0, 1.0, 1.0)

    @property
    def normals(self) -> Normals:
        """The normal-map overrides of the materials that reflect indirect light."""
        return tuple(material.normals for material in self.reflectances)

    @property
    def has_environment(self) -> bool:
        """True if the environment emits any light."""
        return any(self.environment_gain)

    @property
    def has_direct_environment(self) -> bool:
        """True if direct light of the environment is shown."""
        return self.paths.direct and self.has_environment


def single_source(light: Illumination, geometry: LightGeometry | None) -> Illumination:
    """Return the light of one source alone with gain 1: a local light, or the environment if `geometry` is None."""
    if geometry is None:
        return light._replace(local=(), environment_gain=_UNIT_GAIN)
    return light._replace(local=(LightSource(geometry, _UNIT_GAIN),), environment_gain=_ZERO_GAIN)


def direct_from(light: Illumination, local: tuple[LightSource, ...]) -> Illumination:
    """Return the direct light of some local lights."""
    dark = light._replace(environment_gain=(0.0, 0.0, 0.0), reflectances=(), local=local)
    return dark._replace(paths=light.paths.without_reflections())


def direct_environment(light: Illumination) -> Illumination:
    """Return the direct light of the environment alone, shown or not."""
    paths = light.paths._replace(direct=True).without_reflections()
    return light._replace(paths=paths, reflectances=(), local=())


def split_for_shading(light: Illumination) -> dict[Illumination, Rgb]:
    """Split a light into components that are shaded separately: direct environment, direct local lights, indirect
    light.

    An edit rarely changes more than one component.

    Returns:
        The gain of each component, (R, G, B).
    """
    gains = {}
    if light.has_direct_environment:
        gains[direct_only(single_source(light, None))] = light.environment_gain
    if light.paths.direct and light.local:
        gains[direct_from(light, light.local)] = _UNIT_GAIN
    if light.paths.has_indirect:
        gains[_indirect_only(light)] = _UNIT_GAIN
    return gains


@lru_cache(maxsize=_MAX_CACHED_LIGHTS)
def element_gains(light: Illumination) -> Mapping[Illumination, Rgb]:
    """Expand a light as a vector over its elements: one source and one light path (direct or indirect) each, gain 1.

    Transport is linear in it: an image is Σ_e g_e R_e, so intensity, color, solo and mute are arithmetic on g.

    Returns:
        The gain g of each element that is not zero, (R, G, B).
    """
    sources: dict[LightGeometry | None, Rgb] = {None: light.environment_gain} if light.has_environment else {}
    for geometry, gain in light.local:
        sources[geometry] = _sum(sources.get(geometry, _ZERO_GAIN), gain)  # two equal lights are one source
    gains: dict[Illumination, Rgb] = {}
    for source, gain in sources.items():
        element = single_source(light, source)
        if light.paths.direct:
            gains[direct_only(element)] = gain
        if light.paths.has_indirect:
            gains[_indirect_only(element)] = gain
    return MappingProxyType(gains)


def group_lights(
    look: Look, light: Illumination, solo: Solo = None, images: Mapping[LightGeometry, EmissionImage] = _NO_IMAGES
) -> dict[str, Illumination]:
    """Return the light of each light group with several sources alone, at intensity 1.

    It stays equal while the group's fader moves, so its image serves the whole drag.

    Args:
        look, solo, images: as in `illumination_from_look`. light: its result.
    """
    solo_sources, groups = _solo_sources(look, solo), {}
    for group_name, group in look.light_groups.items():
        members = {name: look.lights[name] for name in group.lights}
        lit = (m for name, m in members.items() if (m.enabled if solo_sources is None else name in solo_sources))
        sources = (LightSource(each.geometry, each.gain_in_group) for each in lit if any(each.gain_in_group))
        local = tuple(part for source in sources for part in _emitted_parts(source, images))
        if len(local) > 1:
            groups[group_name] = light._replace(local=local, environment_gain=_ZERO_GAIN)
    return groups


@lru_cache(maxsize=_MAX_CACHED_LIGHTS)
def grouped_gains(light: Illumination, groups: tuple[Illumination, ...]) -> Mapping[Illumination, Rgb]:
    """Return `element_gains`, with one element and light path for all lights of a group if their factor is equal.

    Args:
        groups: from `group_lights`; none: every source is an element.
    """
    gains = dict(element_gains(light))
    for group in groups:
        members = element_gains(group)
        factor = _common_factor([gains.get(element, _ZERO_GAIN) for element in members], list(members.values()))
        if factor is not None and any(factor):
            gains = {element: gain for element, gain in gains.items() if element not in members}
            gains |= dict.fromkeys(split_for_shading(group), factor)
    return MappingProxyType(gains)


def _common_factor(gains: Sequence[Rgb], unit_gains: Sequence[Rgb]) -> Rgb | None:
    """Return the factor per channel between gains; None if there is none for all of them."""
    scaled, unit = np.array(gains), np.array(unit_gains)
    total = unit.sum(axis=0)
    factor = np.divide(scaled.sum(axis=0), total, out=np.zeros(3), where=total > 0)
    red, green, blue = factor.tolist()
    return (red, green, blue) if np.allclose(scaled, factor * unit, rtol=_FACTOR_ROUNDING, atol=0) else None


@lru_cache(maxsize=_MAX_CACHED_LIGHTS)
def gain_changes(
    before: Illumination, after: Illumination, groups: tuple[Illumination, ...]
) -> Mapping[Illumination, Rgb]:
    """Return the difference of two lights as vectors of `grouped_gains`, without elements that are equal.

    Args:
        before, after: the lights. groups: from `group_lights`.
    """
    old, new = grouped_gains(before, groups), grouped_gains(after, groups)
    change = {e: _sum(new.get(e, _ZERO_GAIN), old.get(e, _ZERO_GAIN), -1.0) for e in {**old, **new}}
    return MappingProxyType({element: gain for element, gain in change.items() if any(gain)})


def unlinked(element: Illumination) -> tuple[Illumination, Link | None]:
    """Return the direct light of one source as if it lit all surfaces, and its link; indirect light is unchanged."""
    if not element.paths.direct:
        return element, None
    if not element.local:
        return element._replace(environment=element.environment.unlinked), element.environment.link
    ((geometry, gain),) = element.local
    return element._replace(local=(LightSource(geometry._replace(link=None), gain),)), geometry.link


def direct_only(light: Illumination) -> Illumination:
    """Return the direct component of a light."""
    return light._replace(paths=light.paths.without_reflections(), reflectances=())


def _indirect_only(light: Illumination) -> Illumination:
    return light._replace(paths=light.paths.without_direct())


def _sum(base: Rgb, added: Rgb, factor: float = 1.0) -> Rgb:
    red, green, blue = (a + factor * b for a, b in zip(base, added, strict=True))
    return red, green, blue


@lru_cache(maxsize=_MAX_CACHED_LIGHTS)
def equal_up_to_gains(before: Illumination, after: Illumination) -> bool:
    """True if no light has moved; lights may have been added or removed."""
    is_rest_equal = before._replace(local=after.local, environment_gain=after.environment_gain) == after
    geometries_before, geometries_after = ({geometry for geometry, _ in light.local} for light in (before, after))
    return is_rest_equal and (geometries_before <= geometries_after or geometries_after <= geometries_before)


def picture_gain(look: Look, solo: Solo = None) -> Rgb:
    """Return the gain of the finished image: the environment's gain if there are no local lights, else 1. `solo` as in
    `illumination_from_look`.
    """
    solo_sources = _solo_sources(look, solo)
    return (1.0, 1.0, 1.0) if tuple(_lit_local_lights(look, solo_sources)) else _environment_gain(look, solo_sources)


def is_solo(look: Look, solo: Solo) -> bool:
    """True if some of the look's sources are shown alone; `solo` as in `illumination_from_look`."""
    return _solo_sources(look, solo) is not None


def _solo_sources(look: Look, solo: Solo) -> frozenset[str] | None:
    """Return the sources of the look that are shown alone; None for all enabled sources."""
    return None if solo is None else solo & {ENVIRONMENT, *look.lights} or None


def _environment_gain(look: Look, solo_sources: frozenset[str] | None) -> Rgb:
    return look.environment.gain if solo_sources is None or ENVIRONMENT in solo_sources else (0.0, 0.0, 0.0)


def _lit_local_lights(look: Look, solo_sources: frozenset[str] | None) -> Iterator[LightSource]:
    """Yield the local lights with a gain above zero."""
    for name, light in look.lights.items():
        gain = light.gain if solo_sources is None else light.full_gain if name in solo_sources else _ZERO_GAIN
        if any(gain):
            yield LightSource(light.geometry, gain)


def _emitted_parts(source: LightSource, images: Mapping[LightGeometry, EmissionImage]) -> Iterator[LightSource]:
    """Yield a light; one with an image or a gobo in its mean color, and if it is colored, a light for each channel."""
    geometry, gain = source
    if any(len(set(relative)) > 1 for _, relative in geometry.materials):
        yield from _channels(source)
        return
    if geometry.image is None and geometry.gobo is None:
        yield source
        return
    image = images[geometry]
    red, green, blue = (g * mean for g, mean in zip(gain, image.mean, strict=True))
    if not image.is_colored:
        yield LightSource(geometry, (red, green, blue))
        return
    yield from _channels(LightSource(geometry, (red, green, blue)))


def _channels(source: LightSource) -> Iterator[LightSource]:
    """Yield a light for each channel of a light."""
    geometry, (red, green, blue) = source
    for channel, part in enumerate(((red, 0.0, 0.0), (0.0, green, 0.0), (0.0, 0.0, blue))):
        yield LightSource(geometry._replace(channel=channel), part)


def material_emissions(
    light: Illumination, materials: Sequence[str], *, is_visible: bool = False
) -> Shaped[F32, "materials 3"]:
    """Return the radiance that the surfaces of each material emit.

    Args:
        light: the illumination. materials: names of all materials. is_visible: zeros in light that excludes direct
            illumination, as the camera sees them.
    """
    emission = np.zeros((len(materials), 3), np.float32)
    index = {name: k for k, name in enumerate(materials)}
    for geometry, gain in light.local if light.paths.direct or not is_visible else ():
        for material, relative in geometry.material_emissions:
            emission[index[material]] += np.multiply(gain, relative, dtype=np.float32)
    return emission


def geometries(look: Look) -> Iterator[LightGeometry]:
    """Yield the geometries of a look's lights."""
    return (light.geometry for light in look.lights.values())


def links(look: Look) -> list[Link]:
    """Return the links of all light of a look."""
    local = [link for light in geometries(look) for link in (light.link, light.shadow_link)]
    return [link for link in (look.environment.link, *local) if link is not None]


def emission_images(
    lights: Iterable[LightGeometry], find_image: Callable[[LightGeometry], EmissionImage | None]
) -> Mapping[LightGeometry, EmissionImage]:
    """Return the images that lights emit.

    Args:
        lights: their geometries. find_image: as `LocalLightTransport.emission_image`; its errors propagate.
    """
    return {light: image for light in lights if (image := find_image(light)) is not None}


def images_by_material(images: Mapping[LightGeometry, EmissionImage]) -> Mapping[str, EmissionImage]:
    """Return the images that surfaces emit, by material. images: from `emission_images`"""
    return {light.material: image for light, image in images.items() if light.material}


def is_same_environment(before: Illumination, after: Illumination) -> bool:
    """True if the environment's direct light is equal: only local lights and indirect light differ."""
    is_rest_equal = before._replace(reflectances=after.reflectances, paths=after.paths, local=after.local) == after
    return is_rest_equal and before.paths.direct == after.paths.direct


@lru_cache(maxsize=_MAX_CACHED_LIGHTS)
def equal_up_to_reflectances(before: Illumination, after: Illumination) -> bool:
    """True if two lights with indirect light differ only in the reflectances for it."""
    is_rest_equal = before._replace(reflectances=after.reflectances, paths=after.paths) == after
    return (
        is_rest_equal
        and before.paths.direct == after.paths.direct
        and bool(before.paths.has_indirect and after.paths.has_indirect)
    )


@lru_cache(maxsize=_MAX_CACHED_LIGHTS)
def with_baked_normals(light: Illumination) -> Illumination:
    """Return the same light without normal-map overrides in indirect illumination."""
    return light._replace(reflectances=tuple(map(Reflectance.with_baked_normals, light.reflectances)))


def illumination_from_look(
    look: Look,
    material_names: Sequence[str],
    *,
    has_bounces: bool,
    solo: Solo = None,
    images: Mapping[LightGeometry, EmissionImage] = _NO_IMAGES,
) -> Illumination:
    """Return the illumination of a look.

    Args:
        material_names: in the scene's order. has_bounces: indirect light was baked.
        solo: names of the only sources that are shown, even if the look disables them; all others get gain zero. None,
            or names of which the look has none (as after one was removed): all enabled sources.
        images: from `emission_images`; a light that emits one has its mean color.
    """
    paths = look.transport.paths
    if not has_bounces:
        paths = paths.without_reflections()
    solo_sources = _solo_sources(look, solo)
    lit = _lit_local_lights(look, solo_sources)
    local = tuple(part for source in lit for part in _emitted_parts(source, images))
    gain = _environment_gain(look, solo_sources) if local else (1.0, 1.0, 1.0)
    light = Illumination(look.environment.key, (), paths, local, gain)
    if not paths.has_indirect:
        return light
    materials = (look.materials[name] for name in material_names)
    return light._replace(
        reflectances=tuple(
            material_reflectance(material.terms, material.normals, material.uv_transform) for material in materials
        )
    )
