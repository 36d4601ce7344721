"""Light of planar mirrors: exact, sharp reflections of the lights whose mirrored shadow rays were traced.

The light that a patch on a mirror reflects excludes that of the traced lights to samples that store their mirrored
visibility (`relume.methods.mirror_lights`): these receive

    E m c F(θ)   from the direction v = d − 2 (d · n) n,   cos θ = |d · n|,

with the irradiance E of a group of lights in direction d, and the mirror's reflectance in the look
(`relume.brdf.specular`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

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
from relume.look import EnvironmentKey
from relume.math.zernike import OUTGOING_DEGREE
from relume.methods.mirror_lights import NO_PLANE, MirrorLights
from relume.radiosity.highlight_transport import DirectLobes, outgoing_in_highlights
from relume.radiosity.outgoing_radiance import OutgoingRadiance, first_bounce
from relume.radiosity.patch_irradiance import PatchLight
from relume.radiosity.reflectance_operator import IncidentLight, ReflectanceOperator
from relume.transport.shading_points import MirrorRays

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class AddedMirrorLights:
    """Change of the light of planar mirrors; a `relume.live.fixed_camera.protocols.MirrorLightsDelta`.

    Attributes:
        direction: direction of the virtual lights. normal_irradiance: change of irradiance perpendicular to it.
        patch_radiance: change of the mean radiance to other patches, which samples do not receive.
    """

    direction: Shaped[F32, "K 3"]
    normal_irradiance: Shaped[F32, "K 3"]
    patch_radiance: Shaped[F32, "patches 3"]

    def rays(self, visible: Shaped[NDArray[np.uint8], "n bytes"]) -> MirrorRays:
        """Return the rays to samples. visible: visibility of the virtual lights."""
        return MirrorRays(self.direction, self.normal_irradiance, visible)


class MirrorLightTransfer:
    """Light of planar mirrors of one bake, in any look; thread-safe.

    Args:
        mirror_lights: the traced lights. patches: patches of the bake.
        find_lights: returns the triangles of an environment.
        cache: cache of results computed from the bake. key: key of the bake in it.
    """

    def __init__(
        self,
        mirror_lights: MirrorLights,
        patches: PatchLight,
        find_lights: Callable[[EnvironmentKey], TriangleLights],
        cache: Cache,
        key: str,
    ) -> None:
        self._mirror_lights, self._patches, self._find_lights = mirror_lights, patches, find_lights
        self._cache, self._key = cache, key
        self._directions = mirrored_lights(mirror_lights.mirrors.normal, mirror_lights.direction).reshape(-1, 3)

    @staticmethod
    def is_in(light: Illumination) -> bool:
        """True if a light includes light of mirrors: environment light with one or more bounces."""
        return light.paths.has_indirect and light.paths.first == 1 and light.has_environment

    def rays(self, light: Illumination, visible: Shaped[NDArray[np.uint8], "n bytes"]) -> MirrorRays:
        """Return the rays to samples.

        Args:
            light: for which `is_in` is true.
            visible: visibility of the virtual lights, see `lights_visible_in_mirrors`.
        """
        return MirrorRays(self._directions, self._reflected_irradiance(light), visible)

    def delta(self, before: Illumination, after: Illumination) -> AddedMirrorLights | None:
        """Return the change after an edit of surfaces, such as a mirror's color; None if there is none.

        Args:
            before, after: in the same environment.
        """
        irradiance_before, irradiance_after = (
            self._reflected_irradiance(light) if self.is_in(light) else np.float32(0) for light in (before, after)
        )
        change = np.asarray(irradiance_after - irradiance_before, np.float32)
        if not change.any():
            return None
        patch_radiances = [
            self._fast_patch_part(light).mean_to_others(self._patches) if self.is_in(light) else 0
            for light in (before, after)
        ]
        return AddedMirrorLights(
            self._directions, change, np.asarray(patch_radiances[1] - patch_radiances[0], np.float32)
        )

    def _reflected_irradiance(self, light: Illumination) -> F32:
        """Irradiance of each virtual light, perpendicular to its direction. (P G, 3) float32"""
        mirror_lights, gain = self._mirror_lights, np.array(light.environment_gain)
        incident = np.zeros((len(mirror_lights.direction), 3))
        np.add.at(
            incident, mirror_lights.group, gain * self._find_lights(light.environment).irradiance[mirror_lights.lights]
        )
        cosine, tints = np.abs(mirror_lights.mirrors.normal @ mirror_lights.direction.T), self._patches.textures[1]
        mirror_reflectance = np.zeros((*cosine.shape, 3))
        for p, material in enumerate(mirror_lights.mirrors.material):
            on_plane = mirror_lights.plane == p
            tint = tints[on_plane].mean(axis=0) if on_plane.any() else np.ones(3)
            terms = light.reflectances[material].planar_mirrors
            mirror_reflectance[p] = specular_terms(terms, cosine[p], np.broadcast_to(tint, (len(cosine[p]), 3)))
        return np.asarray((mirror_reflectance * incident).reshape(-1, 3), np.float32)

    def patch_part(self, light: Illumination) -> OutgoingRadiance:
        """Return the part of the patches' outgoing radiance, as in exact images, that mirror lights replace."""
        mirror_reflectances, lights = _mirror_reflectances(light.reflectances), self._bright_lights(light.environment)
        reflectance_operator, incident = self._patch_light(light, mirror_reflectances)
        highlights = self._patches.highlight_tables(mirror_reflectances, reflectance_operator)
        lights = replace(lights, irradiance=np.array(light.environment_gain, np.float32) * lights.irradiance)
        direct_lobes = DirectLobes(lights, self._patches.visibility_bits(highlights.rows, self._light_indices))
        return first_bounce(
            reflectance_operator,
            incident,
            (highlights, outgoing_in_highlights(self._patches, highlights, direct_lobes)),
        )

    def _fast_patch_part(self, light: Illumination) -> OutgoingRadiance:
        """Return `patch_part` in the low-degree basis."""
        return first_bounce(*self._patch_light(light, _mirror_reflectances(light.reflectances)))

    def _patch_light(
        self, light: Illumination, mirror_reflectances: Reflectances
    ) -> tuple[ReflectanceOperator, IncidentLight]:
        """Return reflectance and incident light of patches in the planes, for the mirrors' reflectances alone."""
        all_patches = self._patches.reflectance_operator(mirror_reflectances)
        is_on_plane = self._mirror_lights.plane[all_patches.rows] != NO_PLANE
        rows = all_patches.rows[is_on_plane]
        incident, gain = self._incident_light(light.environment, rows), np.array(light.environment_gain, np.float32)
        reflectance = all_patches.reflectance * (self._mirror_lights.plane != NO_PLANE)[:, None]
        plane_patches = replace(
            all_patches,
            reflectance=reflectance,
            rows=rows,
            reflectance_matrix=all_patches.reflectance_matrix[:, is_on_plane],
        )
        return plane_patches, IncidentLight(gain * incident.irradiance, gain[:, None] * incident.coefficients)

    @property
    def _light_indices(self) -> NDArray[np.intp]:
        return self._mirror_lights.lights.astype(np.intp)

    def _bright_lights(self, environment: EnvironmentKey) -> TriangleLights:
        """Return the traced lights in an environment."""
        all_lights = self._find_lights(environment)
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
