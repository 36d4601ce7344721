"""What arrives at the surfaces of a picture, as far as its operators and images depend on it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from types import MappingProxyType
from typing import NamedTuple

from relume.brdf.albedo import Reflectances, normals_in, reflectances_of, without_normals
from relume.brdf.channels import NormalMap
from relume.look import EnvironmentKey, LightGeometry, Look, Paths
from relume.look.model import Rgb

ENVIRONMENT = "environment"  # among the names of sources: the light around, beside local lights by their own names

Solo = frozenset[str] | None
Normals = tuple[NormalMap | None, ...]
"""The image in the place of each material's normal map; None for none."""

_ONE: Rgb = (1.0, 1.0, 1.0)
_NOTHING: Rgb = (0.0, 0.0, 0.0)
_MOST_KNOWN = 64  # lights whose vectors are kept: every route asks for those of a frame, for every term


class Source(NamedTuple):
    """A local light. gain: of each channel, times its unit emission."""

    geometry: LightGeometry
    gain: Rgb


class Light(NamedTuple):
    """Pictures of equal light need the same operators.

    Attributes:
        reflectances: of all materials, for light that they reflect onto each other; none where no such light is shown.
        paths: by which light comes, those between surfaces only where they were baked.
        local: lights that give any. environment_gain: of each channel beside them; 1 where there are none, since then
            it multiplies the finished picture (`gain_of`).
    """

    environment: EnvironmentKey
    reflectances: Reflectances
    paths: Paths
    local: tuple[Source, ...] = ()
    environment_gain: Rgb = (1.0, 1.0, 1.0)

    @property
    def normals(self) -> Normals:
        """How images lean the materials that reflect light onto each other."""
        return tuple(map(normals_in, self.reflectances))

    @property
    def is_environment_lit(self) -> bool:
        """Whether the environment gives any light."""
        return any(self.environment_gain)

    @property
    def shows_sky(self) -> bool:
        """Whether light of the environment comes straight."""
        return self.paths.direct and self.is_environment_lit


def of_source(light: Light, geometry: LightGeometry | None) -> Light:
    """The light of one source alone, its gain 1: a local light, or the environment where that is None."""
    if geometry is None:
        return light._replace(local=(), environment_gain=_ONE)
    return light._replace(local=(Source(geometry, _ONE),), environment_gain=_NOTHING)


def direct_from(light: Light, local: tuple[Source, ...]) -> Light:
    """Some local lights of a light, as their light comes straight to the eye's samples."""
    dark = light._replace(environment_gain=(0.0, 0.0, 0.0), reflectances=(), local=local)
    return dark._replace(paths=light.paths.without_reflections())


def parts_of(light: Light) -> dict[Light, Rgb]:
    """A light as the sum of what is shaded at once: straight from the environment, from local lights, from surfaces.

    An edit seldom changes more than one of them.

    Returns:
        The gain of each part, (R, G, B).
    """
    parts = {}
    if light.shows_sky:
        parts[straight(of_source(light, None))] = light.environment_gain
    if light.paths.direct and light.local:
        parts[direct_from(light, light.local)] = _ONE
    if light.paths.reflect:
        parts[_reflected(light)] = _ONE
    return parts


@lru_cache(maxsize=_MOST_KNOWN)
def vector_of(light: Light) -> Mapping[Light, Rgb]:
    """A light as a vector over its elements: one source each, one kind of way (straight, or over surfaces), gain 1.

    Transport is linear in it: an image is Σ_e g_e R_e, and brightness, colour, solo and dim are arithmetic on g.

    Returns:
        The gain g of each element that has any, (R, G, B).
    """
    sources: dict[LightGeometry | None, Rgb] = {None: light.environment_gain} if light.is_environment_lit else {}
    for geometry, gain in light.local:
        sources[geometry] = _sum(sources.get(geometry, _NOTHING), gain)  # two lights in one place are one source
    vector: dict[Light, Rgb] = {}
    for source, gain in sources.items():
        alone = of_source(light, source)
        if light.paths.direct:
            vector[straight(alone)] = gain
        if light.paths.reflect:
            vector[_reflected(alone)] = gain
    return MappingProxyType(vector)


@lru_cache(maxsize=_MOST_KNOWN)
def change_of(before: Light, after: Light) -> Mapping[Light, Rgb]:
    """The difference of two lights as vectors, elements that are in both alike left out."""
    old, new = vector_of(before), vector_of(after)
    change = {e: _sum(new.get(e, _NOTHING), old.get(e, _NOTHING), -1.0) for e in {**old, **new}}
    return MappingProxyType({element: gain for element, gain in change.items() if any(gain)})


def straight(light: Light) -> Light:
    """What of a light comes straight from its sources."""
    return light._replace(paths=light.paths.without_reflections(), reflectances=())


def _reflected(light: Light) -> Light:
    return light._replace(paths=light.paths.without_direct())


def _sum(one: Rgb, other: Rgb, factor: float = 1.0) -> Rgb:
    red, green, blue = (a + factor * b for a, b in zip(one, other, strict=True))
    return red, green, blue


@lru_cache(maxsize=_MOST_KNOWN)
def is_same_but_for_gains(before: Light, after: Light) -> bool:
    """Whether no light has moved; some may have been added or taken away."""
    alike = before._replace(local=after.local, environment_gain=after.environment_gain) == after
    here, there = ({geometry for geometry, _ in light.local} for light in (before, after))
    return alike and (here <= there or there <= here)


def gain_of(look: Look, solo: Solo = None) -> Rgb:
    """What multiplies the finished picture: the environment's gain, where no light is beside it; `solo` as in
    `light_of`."""
    alone = _alone(look, solo)
    return (1.0, 1.0, 1.0) if tuple(_local(look, alone)) else _environment_gain(look, alone)


def is_solo(look: Look, solo: Solo) -> bool:
    """Whether some of the look's sources alone are shown; `solo` as in `light_of`."""
    return _alone(look, solo) is not None


def _alone(look: Look, solo: Solo) -> frozenset[str] | None:
    """Which of the look's sources alone are shown; None: all that are on."""
    return None if solo is None else solo & {ENVIRONMENT, *look.lights} or None


def _environment_gain(look: Look, alone: frozenset[str] | None) -> Rgb:
    return look.environment.gain if alone is None or ENVIRONMENT in alone else (0.0, 0.0, 0.0)


def _local(look: Look, alone: frozenset[str] | None) -> Iterator[Source]:
    """Local lights that give any light."""
    for name, light in look.lights.items():
        gain = light.gain if alone is None else light.model_copy(update={"on": name in alone}).gain
        if any(gain):
            yield Source(light.geometry, gain)


def emission_of(light: Light, material: str) -> Rgb:
    """Radiance that the surfaces of a material send to the eye themselves."""
    gains = [gain for geometry, gain in light.local if geometry.material == material and light.paths.direct]
    red, green, blue = (sum(channel) for channel in zip((0.0, 0.0, 0.0), *gains, strict=True))
    return red, green, blue


def is_same_environment(before: Light, after: Light) -> bool:
    """Whether the environment's own light is as before: only local lights differ, and light between surfaces."""
    alike = before._replace(reflectances=after.reflectances, paths=after.paths, local=after.local) == after
    return alike and before.paths.direct == after.paths.direct


@lru_cache(maxsize=_MOST_KNOWN)
def is_same_but_for_surfaces(before: Light, after: Light) -> bool:
    """Whether lights differ in what surfaces reflect onto each other alone, and both have such light."""
    alike = before._replace(reflectances=after.reflectances, paths=after.paths) == after
    return alike and before.paths.direct == after.paths.direct and bool(before.paths.reflect and after.paths.reflect)


@lru_cache(maxsize=_MOST_KNOWN)
def leaning_as_baked(light: Light) -> Light:
    """The same light, where surfaces that images of normals lean send what they did as they were baked."""
    return light._replace(reflectances=tuple(map(without_normals, light.reflectances)))


def light_of(look: Look, material_names: Sequence[str], *, has_bounces: bool, solo: Solo = None) -> Light:
    """The light of a look.

    Args:
        material_names: in the scene's order. has_bounces: whether light between surfaces was baked.
        solo: names of sources that alone are shown, lit even where the look has them off; all others get gain zero.
            None: all that are on. So it is where the look has none of those sources, as after one was removed.
    """
    paths = look.transport.paths
    if not has_bounces:
        paths = paths.without_reflections()
    alone = _alone(look, solo)
    local = tuple(_local(look, alone))
    gain = _environment_gain(look, alone) if local else (1.0, 1.0, 1.0)
    light = Light(look.environment.key, (), paths, local, gain)
    if not paths.reflect:
        return light
    materials = (look.materials[name] for name in material_names)
    return light._replace(reflectances=tuple(reflectances_of(of.terms, of.normals) for of in materials))
