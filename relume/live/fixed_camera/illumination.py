"""What arrives at the surfaces of a picture, as far as its operators and images depend on it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from types import MappingProxyType
from typing import NamedTuple

from relume.brdf.albedo import Reflectances, drop_normal_map, pack_reflectance, unpack_normal_map
from relume.brdf.texture_slots import NormalMap
from relume.look import EnvironmentKey, LightGeometry, LightPaths, Look
from relume.look.model import Rgb

ENVIRONMENT = "environment"  # among the names of sources: the light around, beside local lights by their own names

Solo = frozenset[str] | None
Normals = tuple[NormalMap | None, ...]
"""The image in the place of each material's normal map; None for none."""

_UNIT_GAIN: Rgb = (1.0, 1.0, 1.0)
_ZERO_GAIN: Rgb = (0.0, 0.0, 0.0)
_MAX_CACHED_LIGHTS = 64  # lights whose vectors are kept: every route asks for those of a frame, for every term


class LightSource(NamedTuple):
    """A local light. gain: of each channel, times its unit emission."""

    geometry: LightGeometry
    gain: Rgb


class Illumination(NamedTuple):
    """Pictures of equal light need the same operators.

    Attributes:
        reflectances: of all materials, for light that they reflect onto each other; none where no such light is shown.
        paths: by which light comes, those between surfaces only where they were baked.
        local: lights that give any. environment_gain: of each channel beside them; 1 where there are none, since then
            it multiplies the finished picture (`picture_gain`).
    """

    environment: EnvironmentKey
    reflectances: Reflectances
    paths: LightPaths
    local: tuple[LightSource, ...] = ()
    environment_gain: Rgb = (1.0, 1.0, 1.0)

    @property
    def normals(self) -> Normals:
        """How images lean the materials that reflect light onto each other."""
        return tuple(map(unpack_normal_map, self.reflectances))

    @property
    def has_environment(self) -> bool:
        """Whether the environment gives any light."""
        return any(self.environment_gain)

    @property
    def has_direct_environment(self) -> bool:
        """Whether light of the environment comes straight."""
        return self.paths.direct and self.has_environment


def single_source(light: Illumination, geometry: LightGeometry | None) -> Illumination:
    """The light of one source alone, its gain 1: a local light, or the environment where that is None."""
    if geometry is None:
        return light._replace(local=(), environment_gain=_UNIT_GAIN)
    return light._replace(local=(LightSource(geometry, _UNIT_GAIN),), environment_gain=_ZERO_GAIN)


def direct_from(light: Illumination, local: tuple[LightSource, ...]) -> Illumination:
    """Some local lights of a light, as their light comes straight to the eye's samples."""
    dark = light._replace(environment_gain=(0.0, 0.0, 0.0), reflectances=(), local=local)
    return dark._replace(paths=light.paths.without_reflections())


def split_for_shading(light: Illumination) -> dict[Illumination, Rgb]:
    """A light as the sum of what is shaded at once: straight from the environment, from local lights, from surfaces.

    An edit seldom changes more than one of them.

    Returns:
        The gain of each part, (R, G, B).
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
    """A light as a vector over its elements: one source each, one kind of way (straight, or over surfaces), gain 1.

    Transport is linear in it: an image is Σ_e g_e R_e, and brightness, colour, solo and dim are arithmetic on g.

    Returns:
        The gain g of each element that has any, (R, G, B).
    """
    sources: dict[LightGeometry | None, Rgb] = {None: light.environment_gain} if light.has_environment else {}
    for geometry, gain in light.local:
        sources[geometry] = _sum(sources.get(geometry, _ZERO_GAIN), gain)  # two lights in one place are one source
    gains: dict[Illumination, Rgb] = {}
    for source, gain in sources.items():
        element = single_source(light, source)
        if light.paths.direct:
            gains[direct_only(element)] = gain
        if light.paths.has_indirect:
            gains[_indirect_only(element)] = gain
    return MappingProxyType(gains)


@lru_cache(maxsize=_MAX_CACHED_LIGHTS)
def element_gain_changes(before: Illumination, after: Illumination) -> Mapping[Illumination, Rgb]:
    """The difference of two lights as vectors, elements that are in both alike left out."""
    old, new = element_gains(before), element_gains(after)
    change = {e: _sum(new.get(e, _ZERO_GAIN), old.get(e, _ZERO_GAIN), -1.0) for e in {**old, **new}}
    return MappingProxyType({element: gain for element, gain in change.items() if any(gain)})


def direct_only(light: Illumination) -> Illumination:
    """What of a light comes straight from its sources."""
    return light._replace(paths=light.paths.without_reflections(), reflectances=())


def _indirect_only(light: Illumination) -> Illumination:
    return light._replace(paths=light.paths.without_direct())


def _sum(base: Rgb, added: Rgb, factor: float = 1.0) -> Rgb:
    red, green, blue = (a + factor * b for a, b in zip(base, added, strict=True))
    return red, green, blue


@lru_cache(maxsize=_MAX_CACHED_LIGHTS)
def equal_up_to_gains(before: Illumination, after: Illumination) -> bool:
    """Whether no light has moved; some may have been added or taken away."""
    is_rest_equal = before._replace(local=after.local, environment_gain=after.environment_gain) == after
    geometries_before, geometries_after = ({geometry for geometry, _ in light.local} for light in (before, after))
    return is_rest_equal and (geometries_before <= geometries_after or geometries_after <= geometries_before)


def picture_gain(look: Look, solo: Solo = None) -> Rgb:
    """What multiplies the finished picture: the environment's gain, where no light is beside it; `solo` as in
    `light_of`."""
    solo_sources = _solo_sources(look, solo)
    return (1.0, 1.0, 1.0) if tuple(_lit_local_lights(look, solo_sources)) else _environment_gain(look, solo_sources)


def is_solo(look: Look, solo: Solo) -> bool:
    """Whether some of the look's sources alone are shown; `solo` as in `light_of`."""
    return _solo_sources(look, solo) is not None


def _solo_sources(look: Look, solo: Solo) -> frozenset[str] | None:
    """Which of the look's sources alone are shown; None: all that are on."""
    return None if solo is None else solo & {ENVIRONMENT, *look.lights} or None


def _environment_gain(look: Look, solo_sources: frozenset[str] | None) -> Rgb:
    return look.environment.gain if solo_sources is None or ENVIRONMENT in solo_sources else (0.0, 0.0, 0.0)


def _lit_local_lights(look: Look, solo_sources: frozenset[str] | None) -> Iterator[LightSource]:
    """Local lights that give any light."""
    for name, light in look.lights.items():
        gain = light.gain if solo_sources is None else light.model_copy(update={"enabled": name in solo_sources}).gain
        if any(gain):
            yield LightSource(light.geometry, gain)


def material_emission(light: Illumination, material: str) -> Rgb:
    """Radiance that the surfaces of a material send to the eye themselves."""
    gains = [gain for geometry, gain in light.local if geometry.material == material and light.paths.direct]
    red, green, blue = (sum(channel) for channel in zip((0.0, 0.0, 0.0), *gains, strict=True))
    return red, green, blue


def is_same_environment(before: Illumination, after: Illumination) -> bool:
    """Whether the environment's own light is as before: only local lights differ, and light between surfaces."""
    is_rest_equal = before._replace(reflectances=after.reflectances, paths=after.paths, local=after.local) == after
    return is_rest_equal and before.paths.direct == after.paths.direct


@lru_cache(maxsize=_MAX_CACHED_LIGHTS)
def equal_up_to_reflectances(before: Illumination, after: Illumination) -> bool:
    """Whether lights differ in what surfaces reflect onto each other alone, and both have such light."""
    is_rest_equal = before._replace(reflectances=after.reflectances, paths=after.paths) == after
    return (
        is_rest_equal
        and before.paths.direct == after.paths.direct
        and bool(before.paths.has_indirect and after.paths.has_indirect)
    )


@lru_cache(maxsize=_MAX_CACHED_LIGHTS)
def with_baked_normals(light: Illumination) -> Illumination:
    """The same light, where surfaces that images of normals lean send what they did as they were baked."""
    return light._replace(reflectances=tuple(map(drop_normal_map, light.reflectances)))


def illumination_from_look(
    look: Look, material_names: Sequence[str], *, has_bounces: bool, solo: Solo = None
) -> Illumination:
    """The light of a look.

    Args:
        material_names: in the scene's order. has_bounces: whether light between surfaces was baked.
        solo: names of sources that alone are shown, lit even where the look has them off; all others get gain zero.
            None: all that are on. So it is where the look has none of those sources, as after one was removed.
    """
    paths = look.transport.paths
    if not has_bounces:
        paths = paths.without_reflections()
    solo_sources = _solo_sources(look, solo)
    local = tuple(_lit_local_lights(look, solo_sources))
    gain = _environment_gain(look, solo_sources) if local else (1.0, 1.0, 1.0)
    light = Illumination(look.environment.key, (), paths, local, gain)
    if not paths.has_indirect:
        return light
    materials = (look.materials[name] for name in material_names)
    return light._replace(
        reflectances=tuple(pack_reflectance(material.terms, material.normals) for material in materials)
    )
