"""Gather cells, and what arrives at them: the light that gather rays bring back from the surfaces they hit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from relume.brdf.albedo import Reflectances, unpack_images
from relume.images.image_store import load_texture
from relume.lights.spherical_triangles import TriangleLights
from relume.math.zernike import OUTGOING_DEGREE, recurrence
from relume.radiosity.bounce import irradiance
from relume.radiosity.highlight_tables import HighlightTables
from relume.radiosity.mean_transfer import mean_incoming
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
from relume.transport.outgoing_patch_light import NUM_OUTGOING, OutgoingLight
from relume.transport.shading_points import GatherRays

F32 = NDArray[np.float32]

_RAY_STRIDE = 16  # one ray in so many is enough for a moving hand, but for the first bounce
_ROOT_PI = np.float32(np.sqrt(np.pi))


@dataclass(frozen=True)
class PatchLight:
    """The gather cells of a bake, shared by all its pictures.

    Attributes:
        points: that stand for them, those of a cell one after another. C · points a cell
        visible: lights that those points see. (C, points a cell, bytes) uint8
        gather_hits: of their gather rays. (C, rays) uint16. pattern: the directions of a point's.
        material: index into the scene's materials. (C,) uint16
        textures: multipliers of each of `relume.brdf.texture_slots.TEXTURES`. (2, C, 3) float32
        uv: where points lie in textures, for images that looks name, see `relume.patches.patches`; None in stores that
            do not say so. (C, points a cell, ≥ 3) float32
        surface_normal: normals without bumps, which images of others lean; None likewise. (C, points a cell, 3) float32
    """

    points: SurfacePoints
    visible: NDArray[np.uint8]
    gather_hits: NDArray[np.uint16]
    pattern: RayPattern
    material: NDArray[np.uint16]
    textures: F32
    uv: F32 | None = None
    surface_normal: F32 | None = None

    @cached_property
    def few_rays(self) -> NDArray[np.uint16]:
        """Other rays for each of the cells beside each other: a stretch of the pattern would see one side alone."""
        patch, num = np.arange(self.num_patches)[:, None], max(1, self.gather_hits.shape[1] // _RAY_STRIDE)
        return np.ascontiguousarray(
            self.gather_hits[patch, (patch % _RAY_STRIDE + _RAY_STRIDE * np.arange(num)) % self.gather_hits.shape[1]]
        )

    @property
    def num_patches(self) -> int:
        """C."""
        return len(self.material)

    @property
    def points_per_patch(self) -> int:
        """How many stand for each."""
        return int(self.visible.shape[1])

    @cached_property
    def frames(self) -> F32:
        """Tangents and bitangents of cells, across the mean normals of their points. (C, 2, 3) float32"""
        normal = self.points.normal.reshape(-1, self.points_per_patch, 3)
        mean = normal.mean(axis=1)
        length = np.linalg.norm(mean, axis=1, keepdims=True)
        mean = np.where(length > 0.1, mean / np.maximum(length, 1e-6), normal[:, 0]).astype(np.float32)
        tangent = any_tangent(mean)
        return np.stack([tangent, np.cross(mean, tangent)], axis=1).astype(np.float32)

    def reflectance_operator(self, reflectances: Reflectances) -> ReflectanceOperator:
        """What the cells make of light in a look."""
        return ReflectanceOperator.from_materials(reflectances, self.material, self._texture_multipliers(reflectances))

    def highlight_tables(
        self, reflectances: Reflectances, reflectance_operator: ReflectanceOperator
    ) -> HighlightTables:
        """The highlights of cells in a look that few functions do not tell. reflecting: what cells make of light"""
        highlights = HighlightTables.from_materials(
            reflectances, self.material, self._texture_multipliers(reflectances), reflectance_operator.energy_scale
        )
        return highlights.subset(np.isin(highlights.rows, reflectance_operator.rows))

    def _texture_multipliers(self, reflectances: Reflectances) -> F32:
        """Multipliers of cells, those of images that a look names in their place. (2, C, 3) float32"""
        image_names = [unpack_images(material_reflectance) for material_reflectance in reflectances]
        if not any(map(any, image_names)):
            return self.textures
        multipliers = self.textures.copy()
        for material, images in enumerate(image_names):
            rows = np.flatnonzero(self.material == material)
            for channel, name in enumerate(images):
                if name is not None:
                    multipliers[channel, rows] = self._mean_texture(load_texture(name), rows)
        return multipliers

    def _mean_texture(self, texture: Texture, rows: NDArray[np.intp]) -> F32:
        """What some cells show of a texture: its own mean where nobody knows where they lie in it. (rows or 1, 3)"""
        if self.uv is None:
            return mean_value(texture)[None].astype(np.float32)
        point_values = sample_image(texture, self.uv[rows].reshape(-1, self.uv.shape[2]))
        return np.asarray(point_values.reshape(len(rows), -1, 3).mean(axis=1), np.float32)

    def irradiance(self, lights: TriangleLights, light_indices: NDArray[np.intp] | None = None) -> F32:
        """What comes to every cell from the lights themselves, the mean over its points. (C, 3) float32

        Args:
            lights: triangles of the environment. light_indices: which of the bake's they are, (M,); None: all.
        """
        visible = self._select_visible(self.visible.reshape(-1, self.visible.shape[2]), light_indices)
        point_irradiance = irradiance(self.points.normal, visible, lights).reshape(*self.visible.shape[:2], 3)
        return np.asarray(point_irradiance.mean(axis=1, dtype=np.float64), np.float32)

    def visibility_bits(
        self, rows: NDArray[np.intp], light_indices: NDArray[np.intp] | None = None
    ) -> NDArray[np.uint8]:
        """What the points of some cells see. rows: the cells. (G,)

        Args:
            light_indices: which of the bake's lights, (M,); None: all.
        Returns:
            (G, points a cell, bytes) uint8
        """
        visible = self._select_visible(self.visible[rows].reshape(-1, self.visible.shape[2]), light_indices)
        return np.ascontiguousarray(visible.reshape(len(rows), self.points_per_patch, visible.shape[1]))

    @staticmethod
    def _select_visible(visible: NDArray[np.uint8], light_indices: NDArray[np.intp] | None) -> NDArray[np.uint8]:
        return visible if light_indices is None else select_visibility(visible, np.arange(len(visible)), light_indices)

    def incident_coefficients(
        self, rows: NDArray[np.intp], lights: TriangleLights, degree: int, light_indices: NDArray[np.intp] | None = None
    ) -> F32:
        """The same as light vectors, of cells that ask where light comes from; at the first of their points.

        Args:
            rows: the cells. (G,). lights: triangles of the environment.
            degree: at most `OUTGOING_DEGREE`; the numbers of higher functions are left at nothing.
            light_indices: which of the bake's lights they are, (M,); None: all.
        Returns:
            t. (G, 3, J) float32
        """
        points, visible = (
            self.first_points(rows),
            self._select_visible(np.ascontiguousarray(self.visible[rows, 0]), light_indices),
        )
        return self.mean_coefficients(rows, points, incident_coefficients(points, visible, lights, (), degree))

    def first_points(self, rows: NDArray[np.intp]) -> SurfacePoints:
        """The first of the points of each of some cells."""
        return self.points.rows(rows * self.points_per_patch)

    def points_of(self, rows: NDArray[np.intp]) -> SurfacePoints:
        """The points that stand for some cells."""
        return self.points.rows((rows[:, None] * self.points_per_patch + np.arange(self.points_per_patch)).ravel())

    def mean_coefficients(self, rows: NDArray[np.intp], points: SurfacePoints, point_coefficients: F32) -> F32:
        """Light vectors of cells from those of their points.

        Args:
            rows: the cells. (G,). points: equally many of each, those of a cell one after another. (n,)
            point_coefficients: at the points, in their own frames, of any number of functions. (n, 3, …) float32
        Returns:
            The mean over a cell's points, in its own frame. (G, 3, J) float32
        """
        if len(rows) == 0:
            return np.zeros((0, 3, NUM_OUTGOING), np.float32)
        patch_tangent = np.repeat(self.frames[rows, 0], points.num_points // len(rows), axis=0)
        bitangent = np.cross(points.normal, points.tangent)
        angle = np.arctan2(
            np.einsum("nc,nc->n", patch_tangent, bitangent), np.einsum("nc,nc->n", patch_tangent, points.tangent)
        )
        rotated, recurrence_table = (
            np.zeros((*point_coefficients.shape[:2], NUM_OUTGOING), np.float32),
            recurrence(OUTGOING_DEGREE),
        )
        width = min(NUM_OUTGOING, point_coefficients.shape[2])
        rotated[..., :width] = point_coefficients[..., :width]
        for m, cosine, sine in zip(recurrence_table.order, recurrence_table.cosine, recurrence_table.sine, strict=True):
            if m and sine < width:
                c, s = np.cos(m * angle)[:, None].astype(np.float32), np.sin(m * angle)[:, None].astype(np.float32)
                rotated[..., cosine] = c * point_coefficients[..., cosine] + s * point_coefficients[..., sine]
                rotated[..., sine] = c * point_coefficients[..., sine] - s * point_coefficients[..., cosine]
        return np.asarray(rotated.reshape(len(rows), -1, 3, NUM_OUTGOING).mean(axis=1), np.float32)

    @property
    def _gather_hits_by_point(self) -> NDArray[np.uint16]:
        return self.gather_hits.reshape(self.points.num_points, self.pattern.num_rays)

    def incident_light(self, outgoing: OutgoingLight, rows: NDArray[np.intp]) -> IncidentLight:
        """What arrives from other cells, whose light differs by direction.

        Args:
            outgoing: by all cells. rows: those of which light vectors are wanted. (G,)
        """
        gather_hits = self._gather_hits_by_point
        point_values = ray_incident_coefficients(self.points, [GatherRays(gather_hits, self.pattern, outgoing)], 0)[
            ..., 0
        ]
        # of the first function, 1 / √π
        patch_irradiance = _ROOT_PI * point_values.reshape(-1, self.points_per_patch, 3).mean(axis=1)
        points = self.points_of(rows)
        row_hits = self.gather_hits[rows].reshape(points.num_points, self.pattern.num_rays)
        point_coefficients = ray_incident_coefficients(
            points, [GatherRays(row_hits, self.pattern, outgoing)], OUTGOING_DEGREE
        )
        return IncidentLight(
            patch_irradiance.astype(np.float32), self.mean_coefficients(rows, points, point_coefficients)
        )

    def mean_to_others(self, isotropic: F32, coefficients: F32, rows: NDArray[np.intp]) -> F32:
        """What other cells see of each in the mean. (C, 3) float32

        Args:
            isotropic: the part that cells send everywhere. (C, 3) float32
            coefficients: L_j of some beside it, (G, 3, J) float32. rows: which those are. (G,)
        """
        radiance = isotropic.copy()
        radiance[rows] += np.einsum("gj,gcj->gc", self._mean_outgoing_basis[rows], coefficients) if len(rows) else 0
        return radiance

    @cached_property
    def _mean_outgoing_basis(self) -> F32:
        """The mean of all functions over the directions that others see a cell in. (C, J) float32"""
        return mean_incoming(self.gather_hits, self.outgoing_bins, self.num_patches)

    @cached_property
    def outgoing_bins(self) -> DirectionBins:
        """In which squares light leaves the cells that rays hit. (C, rays) uint8"""
        bins = outgoing_bins(self.points, self._gather_hits_by_point, self.pattern, self.frames)
        return bins.reshape(self.gather_hits.shape)

    @cached_property
    def incident_bins(self) -> DirectionBins:
        """In which squares it comes in by them. (C, rays) uint8"""
        bins = incoming_bins(self.points, self.points_per_patch, self.pattern, self.frames)
        return bins.reshape(self.gather_hits.shape)
