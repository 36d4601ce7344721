"""Patches of a bake, and their incident light along gather rays from other surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.albedo import Reflectances
from relume.images.image_store import load_texture
from relume.lights.spherical_triangles import TriangleLights
from relume.math.uv_transform import UvTransform
from relume.math.zernike import OUTGOING_DEGREE
from relume.radiosity.binned_transport import incident_by_bins, mean_incoming
from relume.radiosity.bounce import irradiance
from relume.radiosity.highlight_tables import HighlightTables
from relume.radiosity.patch_mean import mean_coefficients
from relume.radiosity.reflectance_operator import IncidentLight, ReflectanceOperator
from relume.raytrace.gather_rays import RayPattern
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.tangents import any_tangent
from relume.raytrace.texture import sample_image
from relume.raytrace.visibility import select_visibility
from relume.scene.model import Texture
from relume.scene.texture_encoding import mean_value
from relume.transport.direction_bins import DirectionBins, incoming_bins, outgoing_bins
from relume.transport.incident_coefficients import incident_coefficients, ray_incident_coefficients
from relume.transport.outgoing_patch_light import OutgoingLight
from relume.transport.shading_points import GatherRays

F32 = NDArray[np.float32]

MIN_TEXTURE = np.float32(2**-10)
"""Least mean of a texture on a patch, whose light is divided by it: a third of the first step above black in 8 bits."""

_RAY_STRIDE = 16  # during an active edit one ray in 16 is used, except for the first bounce
_ROOT_PI = np.float32(np.sqrt(np.pi))


@dataclass(frozen=True)
class PatchLight:
    """The patches of a bake, shared by all its images.

    Attributes:
        points: sample points, patch by patch. visible: lights from these.
        gather_hits: gather hits of the points' gather rays. pattern: their directions, for one point.
        material: index into the scene's materials.
        textures: multipliers of each of `relume.brdf.texture_slots.TEXTURES`.
        uv: UV coordinates of the points, for material map overrides, see `relume.patches.patches`; None if not stored.
        surface_normal: normals without normal mapping, for overrides; None if not stored.
    """

    points: SurfacePoints
    visible: Shaped[NDArray[np.uint8], "patches points bytes"]
    gather_hits: Shaped[NDArray[np.uint16], "patches rays"]
    pattern: RayPattern
    material: Shaped[NDArray[np.uint16], " patches"]
    textures: Shaped[F32, "2 patches 3"]
    uv: Shaped[F32, "patches points coordinates"] | None = None
    surface_normal: Shaped[F32, "patches points 3"] | None = None

    @cached_property
    def few_rays(self) -> Shaped[NDArray[np.uint16], "patches few"]:
        """A subset of the rays, spread over the pattern and different for adjacent patches."""
        patch, num = np.arange(self.num_patches)[:, None], max(1, self.gather_hits.shape[1] // _RAY_STRIDE)
        return np.ascontiguousarray(
            self.gather_hits[patch, (patch % _RAY_STRIDE + _RAY_STRIDE * np.arange(num)) % self.gather_hits.shape[1]]
        )

    @property
    def num_patches(self) -> int:
        """Number of patches."""
        return len(self.material)

    @property
    def points_per_patch(self) -> int:
        """Number of sample points per patch."""
        return int(self.visible.shape[1])

    @cached_property
    def frames(self) -> Shaped[F32, "patches 2 3"]:
        """Tangents and bitangents of the patches, perpendicular to the mean normals of their points."""
        normal = self.points.normal.reshape(-1, self.points_per_patch, 3)
        mean = normal.mean(axis=1)
        length = np.linalg.norm(mean, axis=1, keepdims=True)
        mean = np.where(length > 0.1, mean / np.maximum(length, 1e-6), normal[:, 0]).astype(np.float32)
        tangent = any_tangent(mean)
        return np.stack([tangent, np.cross(mean, tangent)], axis=1).astype(np.float32)

    def reflectance_operator(self, reflectances: Reflectances) -> ReflectanceOperator:
        """Return the patches' reflectance operator in a look."""
        return ReflectanceOperator.from_materials(reflectances, self.material, self.texture_multipliers(reflectances))

    def highlight_tables(
        self, reflectances: Reflectances, reflectance_operator: ReflectanceOperator
    ) -> HighlightTables:
        """Return highlights in a look that are too sharp for the low-degree basis."""
        highlights = HighlightTables.from_materials(
            reflectances, self.material, self.texture_multipliers(reflectances), reflectance_operator.energy_scale
        )
        return highlights.subset(np.isin(highlights.rows, reflectance_operator.rows))

    def texture_multipliers(self, reflectances: Reflectances) -> F32:
        """Return texture multipliers, at least `MIN_TEXTURE`, with the look's map overrides. (2, C, 3) float32"""
        multipliers = np.maximum(self.textures, MIN_TEXTURE)
        for material, reflectance in enumerate(reflectances):
            rows = np.flatnonzero(self.material == material)
            for channel, name in enumerate(reflectance.images):
                if name is not None:
                    mean = self._mean_texture(load_texture(name), rows, reflectance.uv)
                    multipliers[channel, rows] = np.maximum(mean, MIN_TEXTURE)
        return multipliers

    def _mean_texture(self, texture: Texture, rows: NDArray[np.intp], transform: UvTransform | None) -> F32:
        """Return the texture values of patches, or the texture's mean without UV coordinates. (rows or 1, 3)"""
        if self.uv is None:
            return mean_value(texture)[None].astype(np.float32)
        uv = self.uv[rows].reshape(-1, self.uv.shape[2])
        point_values = sample_image(texture, uv if transform is None else transform.footprints(uv))
        return np.asarray(point_values.reshape(len(rows), -1, 3).mean(axis=1), np.float32)

    def irradiance(
        self,
        lights: TriangleLights,
        light_indices: Shaped[NDArray[np.intp], " M"] | None = None,
        *,
        is_preview: bool = False,
    ) -> Shaped[F32, "patches 3"]:
        """Return the direct irradiance of each patch, averaged over its points.

        Args:
            lights: triangles of the environment. light_indices: their indices in the bake; None: all.
            is_preview: only at the first points; gather rays average over many patches.
        """
        if is_preview:
            normal, bits = self._first_points
            return irradiance(normal, self._select_visible(bits, light_indices), lights)
        bits = self.visible.reshape(-1, self.visible.shape[2])
        point_irradiance = irradiance(self.points.normal, self._select_visible(bits, light_indices), lights)
        by_patch = point_irradiance.reshape(-1, self.points_per_patch, 3)
        return np.asarray(by_patch.mean(axis=1, dtype=np.float64), np.float32)

    @cached_property
    def _first_points(self) -> tuple[Shaped[F32, "patches 3"], Shaped[NDArray[np.uint8], "patches bytes"]]:
        """Normal and visibility of the first point of each patch."""
        return self.points.normal[:: self.points_per_patch].copy(), np.ascontiguousarray(self.visible[:, 0])

    def visibility_bits(
        self, rows: Shaped[NDArray[np.intp], " G"], light_indices: Shaped[NDArray[np.intp], " M"] | None = None
    ) -> Shaped[NDArray[np.uint8], "G points bytes"]:
        """Return the light visibility of the points of patches `rows`.

        Args:
            rows: the patches. light_indices: light indices of the bake's lights; None: all.
        """
        visible = self._select_visible(self.visible[rows].reshape(-1, self.visible.shape[2]), light_indices)
        return np.ascontiguousarray(visible.reshape(len(rows), self.points_per_patch, visible.shape[1]))

    @staticmethod
    def _select_visible(visible: NDArray[np.uint8], light_indices: NDArray[np.intp] | None) -> NDArray[np.uint8]:
        return visible if light_indices is None else select_visibility(visible, np.arange(len(visible)), light_indices)

    def incident_coefficients(
        self,
        rows: Shaped[NDArray[np.intp], " G"],
        lights: TriangleLights,
        degree: int,
        light_indices: Shaped[NDArray[np.intp], " M"] | None = None,
    ) -> Shaped[F32, "G 3 J"]:
        """Return the direct incident radiance coefficients of patches `rows`, at the first of their points.

        Args:
            rows: the patches. lights: triangles of the environment.
            degree: at most `OUTGOING_DEGREE`; coefficients of higher functions are zero.
            light_indices: light indices of the lights in the bake; None: all.
        """
        points, visible = (
            self.first_points(rows),
            self._select_visible(self._first_points[1][rows], light_indices),
        )
        return mean_coefficients(
            self.tangents(rows), points, incident_coefficients(points, visible, lights, (), degree)
        )

    def tangents(self, rows: Shaped[NDArray[np.intp], " G"]) -> Shaped[F32, "G 3"]:
        """Return the tangents of some patches."""
        return np.ascontiguousarray(self.frames[rows, 0])

    def first_points(self, rows: Shaped[NDArray[np.intp], " G"]) -> SurfacePoints:
        """Return the first sample point of each of some patches."""
        return self.points.rows(rows * self.points_per_patch)

    def points_of(self, rows: Shaped[NDArray[np.intp], " G"]) -> SurfacePoints:
        """Return the sample points of some patches."""
        return self.points.rows((rows[:, None] * self.points_per_patch + np.arange(self.points_per_patch)).ravel())

    @property
    def _gather_hits_by_point(self) -> NDArray[np.uint16]:
        return self.gather_hits.reshape(self.points.num_points, self.pattern.num_rays)

    def incident_light(
        self, outgoing: OutgoingLight, rows: Shaped[NDArray[np.intp], " G"], *, is_binned: bool = False
    ) -> IncidentLight:
        """Return the incident light from other patches with directional light.

        Args:
            outgoing: outgoing light of all patches. rows: patches that need coefficients.
            is_binned: approximates directions by bins, see `relume.radiosity.binned_transport`.
        """
        if is_binned:
            return incident_by_bins(self.gather_hits, self.outgoing_bins, self.incident_bins, outgoing, rows)
        others = np.setdiff1d(np.arange(self.num_patches), rows)
        coefficients = self._gathered(outgoing, rows, OUTGOING_DEGREE)
        patch_irradiance = np.empty((self.num_patches, 3), np.float32)
        # coefficient of the first function, 1 / √π
        patch_irradiance[rows] = _ROOT_PI * coefficients[..., 0]
        patch_irradiance[others] = _ROOT_PI * self._gathered(outgoing, others, 0)[..., 0]
        return IncidentLight(patch_irradiance, coefficients)

    def _gathered(self, outgoing: OutgoingLight, rows: Shaped[NDArray[np.intp], " G"], degree: int) -> F32:
        """Return coefficients of patches `rows` from their gather rays; zero beyond the degree. (G, 3, J)"""
        points = self.points_of(rows)
        hits = self.gather_hits[rows].reshape(points.num_points, self.pattern.num_rays)
        of_points = ray_incident_coefficients(points, [GatherRays(hits, self.pattern, outgoing)], degree)
        return mean_coefficients(self.tangents(rows), points, of_points)

    def mean_to_others(
        self,
        isotropic: Shaped[F32, "patches 3"],
        coefficients: Shaped[F32, "G 3 J"],
        rows: Shaped[NDArray[np.intp], " G"],
    ) -> Shaped[F32, "patches 3"]:
        """Return the mean radiance of each patch toward other patches.

        Args:
            isotropic: the isotropic part. coefficients: L_j of some patches. rows: these patches.
        """
        radiance = isotropic.copy()
        radiance[rows] += np.einsum("gj,gcj->gc", self._mean_outgoing_basis[rows], coefficients) if len(rows) else 0
        return radiance

    def mean_reflectance(self, reflectance_operator: ReflectanceOperator) -> Shaped[F32, "G 3 J"]:
        """Return the weights of directional incident light in the mean radiance toward other patches.

        L̄ = Σ_j b̄_j Σ_k F_jk t_k = Σ_k (F b̄)_k t_k, with the mean b̄ of the basis in their directions: F is symmetric.
        """
        basis = np.repeat(self._mean_outgoing_basis[reflectance_operator.rows, None], 3, axis=1)
        return reflectance_operator.apply(IncidentLight(np.zeros((self.num_patches, 3), np.float32), basis))[1]

    @cached_property
    def _mean_outgoing_basis(self) -> F32:
        """Basis functions averaged over the directions in which other patches see a patch. (C, J) float32"""
        return mean_incoming(self.gather_hits, self.outgoing_bins, self.num_patches)

    @cached_property
    def outgoing_bins(self) -> Shaped[DirectionBins, "patches rays"]:
        """Direction bins of the gather rays at the patches that they hit."""
        bins = outgoing_bins(self.points, self._gather_hits_by_point, self.pattern, self.frames)
        return bins.reshape(self.gather_hits.shape)

    @cached_property
    def incident_bins(self) -> Shaped[DirectionBins, "patches rays"]:
        """Direction bins of the gather rays at their own patches."""
        bins = incoming_bins(self.points, self.points_per_patch, self.pattern, self.frames)
        return bins.reshape(self.gather_hits.shape)
