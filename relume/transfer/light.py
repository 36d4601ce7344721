"""What arrives at the surfaces of a picture, as far as its operators and images depend on it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from relume.brdf.albedo import reflectances_of
from relume.look import EnvironmentKey, LightGeometry, Look, Paths
from relume.look.model import Rgb
from relume.transfer.gathered import Reflectances


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
    def is_environment_lit(self) -> bool:
        """Whether the environment gives any light."""
        return any(self.environment_gain)


def of_source(light: Light, geometry: LightGeometry | None) -> Light:
    """The light of one source alone, its gain 1: a local light, or the environment where that is None."""
    one = (1.0, 1.0, 1.0)
    if geometry is None:
        return light._replace(local=(), environment_gain=one)
    return light._replace(local=(Source(geometry, one),), environment_gain=(0.0, 0.0, 0.0))


def straight_from(light: Light, local: tuple[Source, ...]) -> Light:
    """Some local lights of a light, as they come straight."""
    dark = light._replace(environment_gain=(0.0, 0.0, 0.0), reflectances=(), local=local)
    return dark._replace(paths=light.paths.without_reflections())


def parts_of(light: Light) -> dict[Light, Rgb]:
    """How much of each part is in a light: straight from the environment, straight from local lights, from surfaces.

    An edit seldom changes more than one of them.
    """
    one, parts = (1.0, 1.0, 1.0), {}
    if light.paths.direct and light.is_environment_lit:
        straight = light._replace(paths=light.paths.without_reflections(), reflectances=())
        parts[of_source(straight, None)] = light.environment_gain
    if light.paths.direct and light.local:
        parts[straight_from(light, light.local)] = one
    if light.paths.reflect:
        parts[light._replace(paths=light.paths.without_straight())] = one
    return parts


def gains_of(light: Light) -> dict[Light, Rgb]:
    """The gain of each source of a light by the light of that source alone, its gain 1."""
    alone: dict[Light, Rgb] = {}
    if light.is_environment_lit:
        alone[of_source(light, None)] = light.environment_gain
    for geometry, (red, green, blue) in light.local:
        source = of_source(light, geometry)
        r, g, b = alone.get(source, (0.0, 0.0, 0.0))  # two lights in one place are one source
        alone[source] = (r + red, g + green, b + blue)
    return alone


def is_same_but_for_gains(before: Light, after: Light) -> bool:
    """Whether no light has moved; some may have been added or taken away."""
    alike = before._replace(local=after.local, environment_gain=after.environment_gain) == after
    here, there = ({geometry for geometry, _ in light.local} for light in (before, after))
    return alike and (here <= there or there <= here)


def gain_of(look: Look) -> Rgb:
    """What multiplies the finished picture: the environment's gain, where no light is beside it."""
    return (1.0, 1.0, 1.0) if _local(look) else look.environment.gain


def _local(look: Look) -> tuple[Source, ...]:
    return tuple(Source(light.geometry, light.gain) for light in look.lights.values() if any(light.gain))


def emission_of(light: Light, material: str) -> Rgb:
    """Radiance that the surfaces of a material send to the eye themselves."""
    gains = [gain for geometry, gain in light.local if geometry.material == material and light.paths.direct]
    red, green, blue = (sum(channel) for channel in zip((0.0, 0.0, 0.0), *gains, strict=True))
    return red, green, blue


def is_moved_by_hand(before: Light, after: Light) -> bool:
    """Whether one thing alone differs, a light or what one material reflects, as where a hand is on it: many things at
    once are another look."""
    num_lights = len(set(before.local) ^ set(after.local))  # one that has moved counts twice
    pairs = zip(before.reflectances, after.reflectances, strict=False)
    num_materials = sum(one != other for one, other in pairs)
    return num_lights <= 2 and num_materials <= 1 and not (num_lights and num_materials)


def is_same_environment(before: Light, after: Light) -> bool:
    """Whether the environment's own light is as before: only local lights differ, and light between surfaces."""
    alike = before._replace(reflectances=after.reflectances, paths=after.paths, local=after.local) == after
    return alike and before.paths.direct == after.paths.direct


def light_of(look: Look, material_names: Sequence[str], *, has_cells: bool) -> Light:
    """The light of a look.

    Args:
        material_names: in the scene's order. has_cells: whether light between surfaces was baked.
    """
    paths = look.transport.paths
    if not has_cells:
        paths = paths.without_reflections()
    local = _local(look)
    light = Light(look.environment.key, (), paths, local, look.environment.gain if local else (1.0, 1.0, 1.0))
    if not paths.reflect:
        return light
    terms = (look.materials[name].terms for name in material_names)
    return light._replace(reflectances=tuple(map(reflectances_of, terms)))
