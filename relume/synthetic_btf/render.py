"""Rendering of a tileable geometry for all view and light directions: the values of its BTF.

    B_x(v, l) = ∫_texel [ f(l, v) cos θ_l V(l) + ρ/π · E_l ] dx ,

with parallel view rays toward v through the texel. Direct illumination is traced for many directions ω_j, uniform over
the hemisphere and different for each sample of a texel; values are a regularized least-squares fit to it,

    B(v, ·) → argmin Σ_j ( Σ_l hat_l(ω_j) B(v, l) − f(ω_j, v) cos θ_j V(ω_j) )² ,

with hat_l of `relume.assets.btf.direction_rings` (docs/btf.md#against-the-geometry). View directions are exact, without
blur: between them, parallax is computed from the height (`relume.assets.btf.parallax`). E_l is the irradiance by
indirect illumination, from diffuse reflection with the same reflectance ρ: solved once for the centers of all faces,
with form factors from random rays, over several bounces.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.sparse import csr_array

from relume.assets.btf.direction_rings import DirectionGrid, directions, interpolation_weights_numpy
from relume.brdf.albedo import reflectance
from relume.brdf.evaluate import eval_brdf
from relume.math.polar import polar
from relume.raytrace.camera_rays import Hits, trace_rays
from relume.raytrace.embree import EmbreeScene
from relume.raytrace.tangents import any_tangent
from relume.raytrace.texture import MipMap
from relume.raytrace.visibility import trace_visibility
from relume.synthetic_btf.tileable_geometry import COLOR_CHANNELS, I64, Tile, centered_height, repeat_tile

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_GRAZING = np.radians(82.5)  # θ of the lowest rays
_SURFACE_OFFSET = 1e-5  # of ray origins, in periods
_RAYS_PER_FACE = 96  # for form factors
_BOUNCES = 5
_CAMERA_HEIGHT = 4.0  # periods from the plane to the origins of view rays
_MAX_PAIRS = 1 << 19
_STEPS = 2  # of the least-squares iteration; more would fit the noise of single samples
_GOLDEN = np.pi * (3 - 5**0.5)


class _SurfaceSamples(NamedTuple):
    """Points offset from the geometry, with shading normals.

    Attributes:
        position, normal: (n, 3) float32. material: (n,).
        color: one, and the colors of the textures of `COLOR_CHANNELS`. (n, 3, rgb)
    """

    position: F32
    normal: F32
    material: I64
    color: F64

    def rows(self, rows: slice) -> _SurfaceSamples:
        return _SurfaceSamples(self.position[rows], self.normal[rows], self.material[rows], self.color[rows])


class _LightSamples(NamedTuple):
    """Light directions for one sample of each texel, and their contributions to the values of all l.

    Attributes:
        directions: ω. (L, 3). weights: weights in the texel's values. (L of values, L of ω)
    """

    directions: F64
    weights: F64


class TileGeometry:
    """A tile with its repetitions, as a ray-tracing scene.

    Args:
        tile: one period. grid: grid of light and view directions. size: height and width of the texture, texels.
        samples_per_side: samples along each side of a texel, each with different light directions.
        seed: seed of the rays for form factors.
    """

    def __init__(
        self, tile: Tile, grid: DirectionGrid, size: tuple[int, int], samples_per_side: int, seed: int
    ) -> None:
        self.grid, self.size, self._samples_per_side, self._seed = grid, size, samples_per_side, seed
        self._materials = [
            [{"params": {}, "curves": {}, "texture": None, **term} for term in terms] for terms in tile.materials
        ]
        self._textures = tile.textures
        self._num_faces, self._material = len(tile.faces), tile.material
        centered = centered_height(tile)
        # periods that rays cross, and geometry that extends over the square's sides
        self._num_repeats = max(1, int(np.ceil(np.ptp(centered.positions[:, 2]) * np.tan(_GRAZING))))
        self._repeated_tile = repeat_tile(centered, self._num_repeats)
        self._positions = self._repeated_tile.positions.astype(np.float32)
        self._embree = EmbreeScene.build(self._positions, self._repeated_tile.faces.astype(np.uint32))
        self._directions = directions(grid)

    def get_view(self, view: int) -> Shaped[F32, "lights texels 3"]:
        """Values of all texels from one view direction."""
        wo = self._directions[view]
        out = np.zeros((self.grid.num_directions, self.size[0] * self.size[1], 3))
        for subsample, light_samples in enumerate(self._light_samples):
            out += self._shade_hits(self._trace_view(subsample, wo), wo, light_samples)
        return np.maximum(out, 0).astype(np.float32)

    def height(self) -> Shaped[F32, "height width"]:
        """Height of the geometry above the texture's plane, in side lengths of the texture; lowest vertex at holes."""
        up, samples_per_side, deepest = np.array([0.0, 0.0, 1.0]), self._samples_per_side, self._positions[:, 2].min()
        above = [
            _CAMERA_HEIGHT - self._trace_view(subsample, up).distance
            for subsample in range(samples_per_side * samples_per_side)
        ]
        return np.asarray(np.maximum(above, deepest).mean(axis=0), np.float32).reshape(self.size)

    def _trace_view(self, subsample: int, wo: F64) -> Hits:
        """Trace view rays for one sample of each texel."""
        (height, width), samples_per_side = self.size, self._samples_per_side
        row, column = np.divmod(np.arange(height * width), width)
        x = (column + (subsample % samples_per_side + 0.5) / samples_per_side) / width
        y = 1 - (row + (subsample // samples_per_side + 0.5) / samples_per_side) / height
        origin = np.stack([x, y, np.zeros_like(x)], axis=1) + _CAMERA_HEIGHT * wo / wo[2]
        return trace_rays(self._embree, origin.astype(np.float32), np.tile(-wo.astype(np.float32), (len(x), 1)))

    @cached_property
    def _light_samples(self) -> list[_LightSamples]:
        """Light directions for each sample; equal for all texels, so that errors are not noise."""
        num_subsamples = self._samples_per_side**2
        if num_subsamples == 1:
            return [_LightSamples(self._directions, np.eye(len(self._directions)))]
        all_directions = _uniform_hemisphere(num_subsamples * self.grid.num_directions)
        index, weight, cosine_ratio = interpolation_weights_numpy(self.grid, all_directions)
        hat = np.zeros((len(all_directions), self.grid.num_directions))
        np.add.at(hat, (np.arange(len(all_directions))[:, None], index), weight * cosine_ratio[:, None])
        gram, mass = hat.T @ hat, (hat.T @ hat.sum(axis=1))[:, None]
        weights = hat.T / mass
        for _ in range(_STEPS):
            weights += (hat.T - gram @ weights) / mass
        return [
            _LightSamples(all_directions[subsample::num_subsamples], weights[:, subsample::num_subsamples])
            for subsample in range(num_subsamples)
        ]

    def _shade_hits(self, hits: Hits, wo: F64, light_samples: _LightSamples) -> F64:
        """Contribution of hits to the values toward wo, by light. (lights, hits, 3)"""
        is_hit, values = hits.face >= 0, np.zeros((self.grid.num_directions, len(hits.face), 3))
        surface_hits = hits.rows(is_hit)
        samples = self._surface_samples(surface_hits, wo, 1 / (max(self.size) * self._samples_per_side))
        step = max(1, _MAX_PAIRS // self.grid.num_directions)
        rows = np.flatnonzero(is_hit)
        for start in range(0, len(rows), step):
            direct = self._direct(samples.rows(slice(start, start + step)), wo, light_samples.directions)
            values[:, rows[start : start + step]] = np.tensordot(light_samples.weights, direct, (1, 1))
        face, sample_weight = surface_hits.face % self._num_faces, 1 / (np.pi * len(self._light_samples))
        reflected = sample_weight * self._reflectance(samples)[:, None] * self._indirect_irradiance[face]
        values[:, rows] += reflected.transpose(1, 0, 2)
        return values

    def _direct(self, samples: _SurfaceSamples, wo: F64, lights: F64) -> F64:
        """f cos θ V of all pairs of points and lights. (points, lights, 3)"""
        n = samples.normal.astype(np.float64)
        t = any_tangent(samples.normal).astype(np.float64)
        frame = np.stack([t, np.cross(n, t), n], axis=1)
        cosine = np.maximum(n @ lights.T, 0) * self._visible(samples, lights)
        sample_index, light_index = np.nonzero(cosine)  # half of the pairs are unlit
        local = np.einsum("nij,nj->ni", frame[sample_index], lights[light_index])
        wo_local = np.einsum("pij,j->pi", frame, wo)[sample_index]
        out = np.zeros((*cosine.shape, 3))
        for material_index, terms in enumerate(self._materials):
            has_material = samples.material[sample_index] == material_index
            color = samples.color[sample_index[has_material]]
            out[sample_index[has_material], light_index[has_material]] = sum(
                color[:, _channel(term)] * eval_brdf(term, local[has_material], wo_local[has_material])
                for term in terms
            )
        return np.asarray(out * cosine[..., None])

    def _visible(self, samples: _SurfaceSamples, lights: F64) -> F64:
        visibility_bits = trace_visibility(
            self._embree, samples.position, samples.normal, lights.astype(np.float32)
        ).visible
        return np.unpackbits(visibility_bits, axis=1, count=len(lights), bitorder="little").astype(np.float64)

    def _surface_samples(self, hits: Hits, wo: F64, side: float | F64) -> _SurfaceSamples:
        """Surface at hits, seen toward wo. side: width of the surface over which textures are averaged, periods."""
        corners = self._repeated_tile.faces[hits.face]
        p, n = self._positions[corners].astype(np.float64), self._repeated_tile.normals[corners]
        b = np.column_stack([1 - hits.uv.sum(axis=1), hits.uv])[..., None]
        face_normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        face_normal /= np.linalg.norm(face_normal, axis=1, keepdims=True)
        face_normal *= np.where(face_normal @ wo < 0, -1, 1)[:, None]
        normal = (n * b).sum(axis=1)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        normal = np.where(np.einsum("nc,nc->n", normal, face_normal)[:, None] < 0, -normal, normal)
        deficit = np.maximum(0.01 - normal @ wo, 0)[:, None]  # shading normals must face the viewer
        normal += deficit * wo
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        position = (p * b).sum(axis=1) + _SURFACE_OFFSET * face_normal
        material = self._repeated_tile.material[hits.face]
        uv = (self._repeated_tile.uvs[corners] * b).sum(axis=1)
        color = self._texture_colors(material, uv, side * self._uv_scale[hits.face % self._num_faces])
        return _SurfaceSamples(position.astype(np.float32), normal.astype(np.float32), material, color)

    def _texture_colors(self, material: I64, uv: F64, footprint: F64) -> F64:
        """Colors that multiply terms, see `_SurfaceSamples`. uv: (n, 2). footprint: side in UV space, (n,)."""
        out = np.ones((len(uv), 1 + len(COLOR_CHANNELS), 3))
        for index, textures in enumerate(self._textures):
            rows = np.flatnonzero(material == index)
            for channel in set(textures) & set(COLOR_CHANNELS) if len(rows) else ():
                mip_map = MipMap.for_texture(textures[channel])
                out[rows, 1 + COLOR_CHANNELS.index(channel)] = mip_map.sample(
                    uv[rows].astype(np.float32), footprint[rows].astype(np.float32)
                )
        return out

    @cached_property
    def _face_side(self) -> F64:
        """Square root of twice the area of each face of the tile, in periods. (faces,)"""
        p = self._repeated_tile.positions[self._repeated_tile.faces[: self._num_faces]]
        return np.asarray(np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1) ** 0.5)

    @cached_property
    def _uv_scale(self) -> F64:
        """Length in UV space of a period on each face of the tile. (faces,)"""
        uv = self._repeated_tile.uvs[self._repeated_tile.faces[: self._num_faces]]
        (au, av), (bu, bv) = (uv[:, 1] - uv[:, 0]).T, (uv[:, 2] - uv[:, 0]).T
        return np.asarray(np.abs(au * bv - av * bu) ** 0.5 / np.maximum(self._face_side, 1e-12))

    def _reflectance(self, samples: _SurfaceSamples) -> F64:
        """ρ of samples. (n, 3)"""
        by_channel = np.zeros((len(self._materials), 1 + len(COLOR_CHANNELS), 3))
        for index, terms in enumerate(self._materials):
            for term in terms:
                by_channel[index, _channel(term)] += reflectance(term)
        return np.asarray((samples.color * by_channel[samples.material]).sum(axis=1))

    @cached_property
    def _indirect_irradiance(self) -> F64:
        """E of each face of the tile, by light: irradiance after at least one bounce. (faces, lights, 3)"""
        face_centers = Hits(
            np.arange(self._num_faces, dtype=np.int32)
            + self._num_faces * (2 * self._num_repeats + 2) * self._num_repeats,
            np.full((self._num_faces, 2), 1 / 3, np.float32),
            np.ones(self._num_faces, np.float32),
        )
        samples = self._surface_samples(face_centers, np.array([0.0, 0.0, 1.0]), self._face_side)
        cosine = np.maximum(np.einsum("nc,lc->nl", samples.normal.astype(np.float64), self._directions), 0)
        direct = (cosine * self._visible(samples, self._directions))[..., None] * np.ones(3)
        form_factors = self._form_factors(samples)
        num, lights = direct.shape[:2]
        incident, indirect, reflectances = direct, np.zeros_like(direct), self._reflectance(samples)[:, None]
        for _ in range(_BOUNCES):
            incident = (form_factors @ (reflectances * incident).reshape(num, -1)).reshape(num, lights, 3)
            indirect += incident
        return np.asarray(indirect)

    def _form_factors(self, samples: _SurfaceSamples) -> csr_array:
        """Form factors: fractions of the hemisphere over each face that other faces cover. (faces, faces)"""
        rng, num = np.random.default_rng(self._seed), self._num_faces
        u, azimuth_sample = rng.random((2, num, _RAYS_PER_FACE))
        u = (np.arange(_RAYS_PER_FACE) + u) / _RAYS_PER_FACE
        radius, phi = np.sqrt(u)[..., None], (2 * np.pi * azimuth_sample)[..., None]
        n = samples.normal.astype(np.float64)[:, None]
        t = any_tangent(samples.normal).astype(np.float64)[:, None]
        w = radius * (np.cos(phi) * t + np.sin(phi) * np.cross(n, t)) + np.sqrt(1 - u)[..., None] * n
        origin = np.repeat(samples.position, _RAYS_PER_FACE, axis=0)
        hits = trace_rays(self._embree, origin, w.reshape(-1, 3).astype(np.float32))
        hit = hits.face >= 0
        row = np.repeat(np.arange(num), _RAYS_PER_FACE)[hit]
        weight = np.full(len(row), 1 / _RAYS_PER_FACE)
        return csr_array((weight, (row, hits.face[hit] % num)), (num, num))


def _channel(term: Mapping[str, Any]) -> int:
    """Index of the color that multiplies a term, see `_SurfaceSamples`."""
    return (None, *COLOR_CHANNELS).index(term["texture"])


def _uniform_hemisphere(num: int) -> F64:
    """Uniform directions over the hemisphere, on a spiral. (num, 3)"""
    k = np.arange(num, dtype=np.float64)
    return polar(np.arccos(1 - (k + 0.5) / num), k * _GOLDEN)
