"""Gather cells, and what arrives at them: the light that gather rays bring back from the surfaces they hit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from relume.basis.zernike import SENT_DEGREE, ladder
from relume.brdf.albedo import Reflectances, images_in
from relume.images.shelf import texture_of
from relume.light.gather_rays import Pattern
from relume.light.triangles import TriangleLights
from relume.methods.cells.bounces import irradiance
from relume.methods.cells.lobes import Lobes
from relume.methods.cells.reflecting import Arrived, Reflecting
from relume.methods.cells.seen_from import seen_from
from relume.points import Points
from relume.project.light_vectors import light_vectors, ray_vectors
from relume.project.receivers import GatherRays
from relume.project.sent import NUM_SENT, Sent
from relume.project.squares import Squares, coming_squares, leaving_squares
from relume.scene.coding import mean_of
from relume.scene.model import Texture
from relume.trace.tangents import any_tangent
from relume.trace.texture import sample_image
from relume.trace.visibility import visible_of

F32 = NDArray[np.float32]

_FEW = 16  # one ray in so many is enough for a moving hand, but for the first bounce
_ROOT_PI = np.float32(np.sqrt(np.pi))


@dataclass(frozen=True)
class CellLight:
    """The gather cells of a bake, shared by all its pictures.

    Attributes:
        points: that stand for them, those of a cell one after another. C · points a cell
        visible: lights that those points see. (C, points a cell, bytes) uint8
        links: of their gather rays. (C, rays) uint16. pattern: the directions of a point's.
        material: index into the scene's materials. (C,) uint16
        textures: multipliers of each of `relume.brdf.channels.TEXTURES`. (2, C, 3) float32
        uv: where points lie in textures, for images that looks name, see `relume.trace.cells`; None in stores that do
            not say so. (C, points a cell, ≥ 3) float32
        surface_normal: normals without bumps, which images of others lean; None likewise. (C, points a cell, 3) float32
    """

    points: Points
    visible: NDArray[np.uint8]
    links: NDArray[np.uint16]
    pattern: Pattern
    material: NDArray[np.uint16]
    textures: F32
    uv: F32 | None = None
    surface_normal: F32 | None = None

    @cached_property
    def few_links(self) -> NDArray[np.uint16]:
        """Other rays for each of the cells beside each other: a stretch of the pattern would see one side alone."""
        cell, num = np.arange(self.num_cells)[:, None], max(1, self.links.shape[1] // _FEW)
        return np.ascontiguousarray(self.links[cell, (cell % _FEW + _FEW * np.arange(num)) % self.links.shape[1]])

    @property
    def num_cells(self) -> int:
        """C."""
        return len(self.material)

    @property
    def points_a_cell(self) -> int:
        """How many stand for each."""
        return int(self.visible.shape[1])

    @cached_property
    def frames(self) -> F32:
        """Tangents and bitangents of cells, across the mean normals of their points. (C, 2, 3) float32"""
        normal = self.points.normal.reshape(-1, self.points_a_cell, 3)
        mean = normal.mean(axis=1)
        length = np.linalg.norm(mean, axis=1, keepdims=True)
        mean = np.where(length > 0.1, mean / np.maximum(length, 1e-6), normal[:, 0]).astype(np.float32)
        tangent = any_tangent(mean)
        return np.stack([tangent, np.cross(mean, tangent)], axis=1).astype(np.float32)

    def reflecting(self, reflectances: Reflectances) -> Reflecting:
        """What the cells make of light in a look."""
        return Reflecting.of(reflectances, self.material, self._textures_in(reflectances))

    def lobes(self, reflectances: Reflectances, reflecting: Reflecting) -> Lobes:
        """The highlights of cells in a look that few functions do not tell. reflecting: what cells make of light"""
        found = Lobes.of(reflectances, self.material, self._textures_in(reflectances), reflecting.held)
        return found.some(np.isin(found.rows, reflecting.rows))

    def _textures_in(self, reflectances: Reflectances) -> F32:
        """Multipliers of cells, those of images that a look names in their place. (2, C, 3) float32"""
        named = [images_in(of_material) for of_material in reflectances]
        if not any(map(any, named)):
            return self.textures
        found = self.textures.copy()
        for material, images in enumerate(named):
            rows = np.flatnonzero(self.material == material)
            for channel, name in enumerate(images):
                if name is not None:
                    found[channel, rows] = self._mean_of(texture_of(name), rows)
        return found

    def _mean_of(self, texture: Texture, rows: NDArray[np.intp]) -> F32:
        """What some cells show of a texture: its own mean where nobody knows where they lie in it. (rows or 1, 3)"""
        if self.uv is None:
            return mean_of(texture)[None].astype(np.float32)
        of_points = sample_image(texture, self.uv[rows].reshape(-1, self.uv.shape[2]))
        return np.asarray(of_points.reshape(len(rows), -1, 3).mean(axis=1), np.float32)

    def irradiance(self, lights: TriangleLights, among: NDArray[np.intp] | None = None) -> F32:
        """What comes to every cell from the lights themselves, the mean over its points. (C, 3) float32

        Args:
            lights: triangles of the environment. among: which of the bake's they are, (M,); None: all.
        """
        of_points = self._seen(self.visible.reshape(-1, self.visible.shape[2]), among)
        arriving = irradiance(self.points.normal, of_points, lights).reshape(*self.visible.shape[:2], 3)
        return np.asarray(arriving.mean(axis=1, dtype=np.float64), np.float32)

    def seen_by(self, rows: NDArray[np.intp], among: NDArray[np.intp] | None = None) -> NDArray[np.uint8]:
        """What the points of some cells see. rows: the cells. (G,)

        Args:
            among: which of the bake's lights, (M,); None: all.
        Returns:
            (G, points a cell, bytes) uint8
        """
        seen = self._seen(self.visible[rows].reshape(-1, self.visible.shape[2]), among)
        return np.ascontiguousarray(seen.reshape(len(rows), self.points_a_cell, seen.shape[1]))

    @staticmethod
    def _seen(visible: NDArray[np.uint8], among: NDArray[np.intp] | None) -> NDArray[np.uint8]:
        return visible if among is None else visible_of(visible, np.arange(len(visible)), among)

    def vectors(
        self, rows: NDArray[np.intp], lights: TriangleLights, degree: int, among: NDArray[np.intp] | None = None
    ) -> F32:
        """The same as light vectors, of cells that ask where light comes from; at the first of their points.

        Args:
            rows: the cells. (G,). lights: triangles of the environment.
            degree: at most `SENT_DEGREE`; the numbers of higher functions are left at nothing.
            among: which of the bake's lights they are, (M,); None: all.
        Returns:
            t. (G, 3, J) float32
        """
        points, visible = self.first_points(rows), self._seen(np.ascontiguousarray(self.visible[rows, 0]), among)
        return self.vectors_of(rows, points, light_vectors(points, visible, lights, (), degree))

    def first_points(self, rows: NDArray[np.intp]) -> Points:
        """The first of the points of each of some cells."""
        return self.points.rows(rows * self.points_a_cell)

    def points_of(self, rows: NDArray[np.intp]) -> Points:
        """The points that stand for some cells."""
        return self.points.rows((rows[:, None] * self.points_a_cell + np.arange(self.points_a_cell)).ravel())

    def vectors_of(self, rows: NDArray[np.intp], points: Points, arriving: F32) -> F32:
        """Light vectors of cells from those of their points.

        Args:
            rows: the cells. (G,). points: equally many of each, those of a cell one after another. (n,)
            arriving: at the points, in their own frames, of any number of functions. (n, 3, …) float32
        Returns:
            The mean over a cell's points, in its own frame. (G, 3, J) float32
        """
        if len(rows) == 0:
            return np.zeros((0, 3, NUM_SENT), np.float32)
        along = np.repeat(self.frames[rows, 0], points.num_points // len(rows), axis=0)
        bitangent = np.cross(points.normal, points.tangent)
        angle = np.arctan2(np.einsum("nc,nc->n", along, bitangent), np.einsum("nc,nc->n", along, points.tangent))
        turned, rungs = np.zeros((*arriving.shape[:2], NUM_SENT), np.float32), ladder(SENT_DEGREE)
        width = min(NUM_SENT, arriving.shape[2])
        turned[..., :width] = arriving[..., :width]
        for m, cosine, sine in zip(rungs.order, rungs.cosine, rungs.sine, strict=True):
            if m and sine < width:
                c, s = np.cos(m * angle)[:, None].astype(np.float32), np.sin(m * angle)[:, None].astype(np.float32)
                turned[..., cosine] = c * arriving[..., cosine] + s * arriving[..., sine]
                turned[..., sine] = c * arriving[..., sine] - s * arriving[..., cosine]
        return np.asarray(turned.reshape(len(rows), -1, 3, NUM_SENT).mean(axis=1), np.float32)

    @property
    def _links_of_points(self) -> NDArray[np.uint16]:
        return self.links.reshape(self.points.num_points, self.pattern.num_rays)

    def arriving(self, sent: Sent, rows: NDArray[np.intp]) -> Arrived:
        """What arrives from other cells, whose light differs by direction.

        Args:
            sent: by all cells. rows: those of which light vectors are wanted. (G,)
        """
        links = self._links_of_points
        of_points = ray_vectors(self.points, [GatherRays(links, self.pattern, sent)], 0)[..., 0]
        whole = _ROOT_PI * of_points.reshape(-1, self.points_a_cell, 3).mean(axis=1)  # of the first function, 1 / √π
        points = self.points_of(rows)
        some = self.links[rows].reshape(points.num_points, self.pattern.num_rays)
        vectors = ray_vectors(points, [GatherRays(some, self.pattern, sent)], SENT_DEGREE)
        return Arrived(whole.astype(np.float32), self.vectors_of(rows, points, vectors))

    def seen(self, even: F32, vectors: F32, rows: NDArray[np.intp]) -> F32:
        """What other cells see of each in the mean. (C, 3) float32

        Args:
            even: the part that cells send everywhere. (C, 3) float32
            vectors: L_j of some beside it, (G, 3, J) float32. rows: which those are. (G,)
        """
        found = even.copy()
        found[rows] += np.einsum("gj,gcj->gc", self._seen_from[rows], vectors) if len(rows) else 0
        return found

    @cached_property
    def _seen_from(self) -> F32:
        """The mean of all functions over the directions that others see a cell in. (C, J) float32"""
        return seen_from(self.links, self.leaving, self.num_cells)

    @cached_property
    def leaving(self) -> Squares:
        """In which squares light leaves the cells that rays hit. (C, rays) uint8"""
        found = leaving_squares(self.points, self._links_of_points, self.pattern, self.frames)
        return found.reshape(self.links.shape)

    @cached_property
    def coming(self) -> Squares:
        """In which squares it comes in by them. (C, rays) uint8"""
        found = coming_squares(self.points, self.points_a_cell, self.pattern, self.frames)
        return found.reshape(self.links.shape)
