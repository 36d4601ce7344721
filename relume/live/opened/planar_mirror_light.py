"""Light of planar mirrors: exact, sharp reflections of the lights whose mirrored shadow rays were traced.

The light that a patch on a mirror reflects excludes that of the traced lights to samples that store their mirrored
visibility (`relume.methods.mirror_lights`): these receive

    E m c F(θ)   from the direction v = d − 2 (d · n) n,   cos θ = |d · n|,

with the irradiance E of a group of lights in direction d, and the mirror's reflectance in the look
(`relume.brdf.specular`).
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.albedo import Reflectances, material_reflectance
from relume.brdf.specular import split_specular
from relume.brdf.specular_reflectance import specular_terms
from relume.camera.planar_mirrors import mirrored_lights
from relume.core.cache import Cache
from relume.lights.spherical_triangles import TriangleLights
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.protocols import LightQuality
from relume.live.opened.local_lights import LocalLights
from relume.look import EnvironmentKey
from relume.math.zernike import OUTGOING_DEGREE
from relume.methods.mirror_lights import NO_PLANE, MirrorLights
from relume.radiosity.highlight_transport import DirectLobes, outgoing_in_highlights
from relume.radiosity.outgoing_radiance import OutgoingRadiance, first_bounce
from relume.radiosity.patch_irradiance import PatchLight
from relume.radiosity.reflectance_operator import IncidentLight, ReflectanceOperator
from relume.transport.shading_points import MirrorRays

F32 = NDArray[np.float32]


class VirtualLights(NamedTuple):
    """Distant lights in the directions of mirror images.

    Attributes:
        direction: unit direction of each light. normal_irradiance: irradiance perpendicular to it.
    """

    direction: Shaped[F32, "K 3"]
    normal_irradiance: Shaped[F32, "K 3"]

    def beside(self, is_followed: Shaped[NDArray[np.bool_], " K"]) -> VirtualLights:
        """Return the lights without those of mirrors from which lobe rays go on. is_followed: of each light"""
        return self._replace(normal_irradiance=np.where(is_followed[:, None], np.float32(0), self.normal_irradiance))

    def rays(self, visible: Shaped[NDArray[np.uint8], "n bytes"]) -> MirrorRays:
        """Return the rays to samples. visible: visibility of these lights, see `lights_visible_in_mirrors`"""
        return MirrorRays(self.direction, self.normal_irradiance, visible)


class MirrorLightTransfer:
    """Light of planar mirrors of one bake, in any look; thread-safe.

    Args:
        mirror_lights: the traced lights. patches: patches of the bake. local: knows linked surfaces.
        find_lights: returns the triangles of an environment.
        cache: cache of results computed from the bake. key: key of the bake in it.
    """

    def __init__(
        self,
        mirror_lights: MirrorLights,
        patches: PatchLight,
        local: LocalLights,
        find_lights: Callable[[EnvironmentKey, LightQuality], TriangleLights],
        cache: Cache,
        key: str,
    ) -> None:
        self._mirror_lights, self._patches, self._find_lights = mirror_lights, patches, find_lights
        self._linked = local.linked
        self._cache, self._key = cache, key
        self._directions = mirrored_lights(mirror_lights.mirrors.normal, mirror_lights.direction).reshape(-1, 3)

    def of_materials(self, materials: Collection[int]) -> Shaped[NDArray[np.bool_], " K"]:
        """True for the virtual lights in mirrors of some materials."""
        is_chosen = np.isin(self._mirror_lights.mirrors.material, list(materials))
        return np.repeat(is_chosen, len(self._mirror_lights.direction))

    @staticmethod
    def is_in(light: Illumination) -> bool:
        """True if a light includes light of mirrors: environment light with one or more bounces."""
        return light.paths.has_indirect and light.paths.first == 1 and light.has_environment

    def virtual_lights(self, light: Illumination, start_from: Illumination | None = None) -> VirtualLights:
        """Return the virtual lights, or their change since another light of the same environment."""
        irradiance = self._reflected_irradiance(light)
        if start_from is not None:
            irradiance = irradiance - self._reflected_irradiance(start_from)
        return VirtualLights(self._directions, irradiance)

    def _reflected_irradiance(self, light: Illumination) -> F32:
        """Irradiance of each virtual light, perpendicular to its direction. (P G, 3) float32"""
        if not self.is_in(light):
            return np.zeros((len(self._directions), 3), np.float32)
        mirror_lights, gain = self._mirror_lights, np.array(light.environment_gain)
        incident = np.zeros((len(mirror_lights.direction), 3))
        np.add.at(
            incident,
            mirror_lights.group,
            gain * self._lights_of(light.environment).irradiance[mirror_lights.lights],
        )
        cosine, tints = np.abs(mirror_lights.mirrors.normal @ mirror_lights.direction.T), self._patches.textures[1]
        mirror_reflectance, is_lit = np.zeros((*cosine.shape, 3)), self._lit_patches(light.environment)
        for p, material in enumerate(mirror_lights.mirrors.material):
            on_plane = mirror_lights.plane == p
            tint = (is_lit[on_plane, None] * tints[on_plane]).mean(axis=0) if on_plane.any() else np.ones(3)
            terms = light.reflectances[material].planar_mirrors
            mirror_reflectance[p] = specular_terms(terms, cosine[p], np.broadcast_to(tint, (len(cosine[p]), 3)))
        return np.asarray((mirror_reflectance * incident).reshape(-1, 3), np.float32)

    def patch_part(self, light: Illumination, *, is_sharp: bool) -> OutgoingRadiance:
        """Return the part of the patches' outgoing radiance that virtual lights replace.

        Args:
            light: for which `is_in` is true. is_sharp: sharp highlights use tables, else the low-degree basis.
        """
        reflectances = _mirror_reflectances(light.reflectances)
        if is_sharp:
            return self._patch_part(light, reflectances, is_sharp=True)
        # equal for all colors and curves of other materials, of which an edit changes one per frame
        key = self._key, "mirror light of patches", light.environment, light.environment_gain, reflectances
        return self._cache.transient.get_value(key, lambda: self._patch_part(light, reflectances, is_sharp=False))

    def _patch_part(self, light: Illumination, reflectances: Reflectances, *, is_sharp: bool) -> OutgoingRadiance:
        reflectance_operator, incident = self._patch_light(light, reflectances)
        if not is_sharp:
            return first_bounce(reflectance_operator, incident)
        highlights = self._patches.highlight_tables(reflectances, reflectance_operator)
        lights = self._bright_lights(light.environment)
        lights = replace(lights, irradiance=np.array(light.environment_gain, np.float32) * lights.irradiance)
        visible = self._patches.visibility_bits(highlights.rows, self._light_indices)
        visible[~self._lit_patches(light.environment)[highlights.rows]] = 0
        direct_lobes = DirectLobes(lights, visible)
        return first_bounce(
            reflectance_operator,
            incident,
            (highlights, outgoing_in_highlights(self._patches, highlights, direct_lobes)),
        )

    def _patch_light(
        self, light: Illumination, mirror_reflectances: Reflectances
    ) -> tuple[ReflectanceOperator, IncidentLight]:
        """Return reflectance and incident light of patches in the planes, for the mirrors' reflectances alone."""
        all_patches = self._patches.reflectance_operator(mirror_reflectances)
        is_on_plane = self._mirror_lights.plane[all_patches.rows] != NO_PLANE
        rows = all_patches.rows[is_on_plane]
        environment, is_lit = light.environment.unlinked, self._lit_patches(light.environment)[:, None]
        incident, gain = self._incident_light(environment, rows), np.array(light.environment_gain, np.float32) * is_lit
        reflectance = all_patches.reflectance * (self._mirror_lights.plane != NO_PLANE)[:, None]
        plane_patches = replace(
            all_patches,
            reflectance=reflectance,
            rows=rows,
            reflectance_matrix=all_patches.reflectance_matrix[:, is_on_plane],
        )
        return plane_patches, IncidentLight(gain * incident.irradiance, gain[rows, :, None] * incident.coefficients)

    def _lit_patches(self, environment: EnvironmentKey) -> Shaped[NDArray[np.bool_], " patches"]:
        """True for the patches that an environment lights."""
        points = self._patches.first_points(np.arange(self._patches.num_patches))
        return self._linked.is_lit(environment.link, points.position, points.normal)

    def _lights_of(self, environment: EnvironmentKey) -> TriangleLights:
        return self._find_lights(environment, LightQuality.EXACT)

    @property
    def _light_indices(self) -> NDArray[np.intp]:
        return self._mirror_lights.lights.astype(np.intp)

    def _bright_lights(self, environment: EnvironmentKey) -> TriangleLights:
        """Return the traced lights in an environment."""
        all_lights = self._lights_of(environment)
        return all_lights.select(self._light_indices, all_lights.irradiance[self._light_indices])

    def _incident_light(self, environment: EnvironmentKey, rows: NDArray[np.intp]) -> IncidentLight:
        def compute() -> IncidentLight:
            light_indices, patches, bright_lights = self._light_indices, self._patches, self._bright_lights(environment)
            return IncidentLight(
                patches.irradiance(bright_lights, light_indices),
                patches.incident_coefficients(rows, bright_lights, OUTGOING_DEGREE, light_indices),
            )

        return self._cache.get_value((self._key, "mirror light on patches", environment, rows.tobytes()), compute)


def _mirror_reflectances(reflectances: Reflectances) -> Reflectances:
    """Return the specular part of materials."""
    return tuple(material_reflectance(list(map(split_specular, material.planar_mirrors))) for material in reflectances)
