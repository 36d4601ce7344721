"""What a small geometry sends from each place of its plane to each side, lit from each: the values of its BTF.

    B_x(v, l) = ∫_texel [ f(l, v) cos θ_l V(l) + ρ/π · E_l ] dx ,

where an eye far off towards v sees the geometry through the texel. Straight light is traced from many directions ω_j,
evenly over the hemisphere, others at each place of a texel; values are on the way to those that tell it best,

    B(v, ·) → argmin Σ_j ( Σ_l hat_l(ω_j) B(v, l) − f(ω_j, v) cos θ_j V(ω_j) )² ,

with hat_l of `relume.btf.rings` (ADR 87). Eyes are points, as far lenses are: between them relief is found by its
height (`relume.btf.parallax`), which a blur would only hide. E_l is the irradiance by light that other faces have sent
on, which do so as matt surfaces of the same reflectance ρ: found once for the middles of all faces, by rays to other
faces, as often as it takes.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from relume.brdf.albedo import reflectance
from relume.brdf.evaluate import eval_brdf
from relume.btf.rings import Rings, directions, polar, taps_numpy
from relume.synthetic.tile import I64, Tile, levelled, repeated
from relume.trace.embree import EmbreeScene
from relume.trace.primary import Hits, trace_from
from relume.trace.tangents import any_tangent
from relume.trace.visibility import trace_visibility

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_GRAZING = np.radians(82.5)  # θ of the lowest rays
_OFF = 1e-5  # periods that rays begin off surfaces
_RAYS_A_FACE = 96  # to other faces
_BOUNCES = 5
_ABOVE = 4.0  # periods above the plane that eyes' rays begin
_PAIRS_AT_ONCE = 1 << 19
_STEPS = 2  # towards the least squares: all the way, what single places see by chance would be kept, too
_GOLDEN = np.pi * (3 - 5**0.5)


class _Places(NamedTuple):
    """Places on the geometry. position: off it. (n, 3) float32. normal: shading. (n, 3) float32. material: (n,)"""

    position: F32
    normal: F32
    material: I64

    def rows(self, rows: slice) -> _Places:
        return _Places(self.position[rows], self.normal[rows], self.material[rows])


class _Lit(NamedTuple):
    """Light at one place of each texel: where it comes from, and what its light adds to the values of all l.

    Attributes:
        directions: ω. (L, 3). share: of the texel's values. (L of values, L of ω)
    """

    directions: F64
    share: F64


class SmallGeometry:
    """A tile and what is beside it, ready to be lit and looked at.

    Args:
        tile: one period. rings: of directions to lights and to eyes. size: height and width of the texture, texels.
        grid: places along each side of a texel that are looked at, each in light from other directions.
        seed: of the rays between faces.
    """

    def __init__(self, tile: Tile, rings: Rings, size: tuple[int, int], grid: int, seed: int) -> None:
        self.rings, self.size, self._grid, self._seed = rings, size, grid, seed
        self._materials = [
            [{"params": {}, "curves": {}, "texture": None, **term} for term in terms] for terms in tile.materials
        ]
        self._num_faces, self._material = len(tile.faces), tile.material
        flat = levelled(tile)
        # that rays pass on their way, and what reaches over the square's sides
        self._times = max(1, int(np.ceil(np.ptp(flat.positions[:, 2]) * np.tan(_GRAZING))))
        self._around = repeated(flat, self._times)
        self._positions = self._around.positions.astype(np.float32)
        self._embree = EmbreeScene.build(self._positions, self._around.faces.astype(np.uint32))
        self._directions = directions(rings)

    def seen_from(self, view: int) -> F32:
        """Every texel's values from one direction. (lights, texels, 3) float32"""
        wo = self._directions[view]
        out = np.zeros((self.rings.num_directions, self.size[0] * self.size[1], 3))
        for part, lit in enumerate(self._lit):
            out += self._sent(self._seen(part, wo), wo, lit)
        return np.maximum(out, 0).astype(np.float32)

    def height(self) -> F32:
        """How far over the texture's plane the geometry reaches at each texel; in holes, as far as it reaches down.

        Returns:
            In sides of the texture. (height, width) float32
        """
        up, grid, deepest = np.array([0.0, 0.0, 1.0]), self._grid, self._positions[:, 2].min()
        above = [_ABOVE - self._seen(part, up).distance for part in range(grid * grid)]
        return np.asarray(np.maximum(above, deepest).mean(axis=0), np.float32).reshape(self.size)

    def _seen(self, part: int, wo: F64) -> Hits:
        """What is seen from afar at one place of each texel."""
        (height, width), grid = self.size, self._grid
        row, column = np.divmod(np.arange(height * width), width)
        x = (column + (part % grid + 0.5) / grid) / width
        y = 1 - (row + (part // grid + 0.5) / grid) / height
        origin = np.stack([x, y, np.zeros_like(x)], axis=1) + _ABOVE * wo / wo[2]
        return trace_from(self._embree, origin.astype(np.float32), np.tile(-wo.astype(np.float32), (len(x), 1)))

    @cached_property
    def _lit(self) -> list[_Lit]:
        """The light of each place: the same for all texels, so that what it misses is no noise."""
        parts = self._grid**2
        if parts == 1:
            return [_Lit(self._directions, np.eye(len(self._directions)))]
        every = _evenly(parts * self.rings.num_directions)
        index, weight, left = taps_numpy(self.rings, every)
        hat = np.zeros((len(every), self.rings.num_directions))
        np.add.at(hat, (np.arange(len(every))[:, None], index), weight * left[:, None])
        gram, mass = hat.T @ hat, (hat.T @ hat.sum(axis=1))[:, None]
        share = hat.T / mass
        for _ in range(_STEPS):
            share += (hat.T - gram @ share) / mass
        return [_Lit(every[part::parts], share[:, part::parts]) for part in range(parts)]

    def _sent(self, hits: Hits, wo: F64, lit: _Lit) -> F64:
        """What hits add to values towards wo, by light. (lights, hits, 3)"""
        found, seen = hits.face >= 0, np.zeros((self.rings.num_directions, len(hits.face), 3))
        some = hits.rows(found)
        places = self._places(some, wo)
        step = max(1, _PAIRS_AT_ONCE // self.rings.num_directions)
        rows = np.flatnonzero(found)
        for start in range(0, len(rows), step):
            direct = self._direct(places.rows(slice(start, start + step)), wo, lit.directions)
            seen[:, rows[start : start + step]] = np.tensordot(lit.share, direct, (1, 1))
        face, of_place = some.face % self._num_faces, 1 / (np.pi * len(self._lit))
        seen[:, rows] += (of_place * self._reflectance[face, None] * self._irradiance[face]).transpose(1, 0, 2)
        return seen

    def _direct(self, places: _Places, wo: F64, lights: F64) -> F64:
        """f cos θ V of all pairs of places and lights. (places, lights, 3)"""
        n = places.normal.astype(np.float64)
        t = any_tangent(places.normal).astype(np.float64)
        frame = np.stack([t, np.cross(n, t), n], axis=1)
        cosine = np.maximum(n @ lights.T, 0) * self._visible(places, lights)
        place, light = np.nonzero(cosine)  # half of all pairs are dark
        local = np.einsum("nij,nj->ni", frame[place], lights[light])
        towards = np.einsum("pij,j->pi", frame, wo)[place]
        out = np.zeros((*cosine.shape, 3))
        for number, terms in enumerate(self._materials):
            mine = places.material[place] == number
            out[place[mine], light[mine]] = sum(eval_brdf(term, local[mine], towards[mine]) for term in terms)
        return np.asarray(out * cosine[..., None])

    def _visible(self, places: _Places, lights: F64) -> F64:
        seen = trace_visibility(self._embree, places.position, places.normal, lights.astype(np.float32)).visible
        return np.unpackbits(seen, axis=1, count=len(lights), bitorder="little").astype(np.float64)

    def _places(self, hits: Hits, wo: F64) -> _Places:
        corners = self._around.faces[hits.face]
        p, n = self._positions[corners].astype(np.float64), self._around.normals[corners]
        b = np.column_stack([1 - hits.uv.sum(axis=1), hits.uv])[..., None]
        face_normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        face_normal /= np.linalg.norm(face_normal, axis=1, keepdims=True)
        face_normal *= np.where(face_normal @ wo < 0, -1, 1)[:, None]
        normal = (n * b).sum(axis=1)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        normal = np.where(np.einsum("nc,nc->n", normal, face_normal)[:, None] < 0, -normal, normal)
        lacking = np.maximum(0.01 - normal @ wo, 0)[:, None]  # what is seen faces the eye
        normal += lacking * wo
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        position = (p * b).sum(axis=1) + _OFF * face_normal
        return _Places(position.astype(np.float32), normal.astype(np.float32), self._around.material[hits.face])

    @cached_property
    def _reflectance(self) -> F64:
        """ρ of each face of the tile. (faces, 3)"""
        of = [sum((reflectance(term) for term in terms), np.zeros(3)) for terms in self._materials]
        return np.asarray(of, np.float64)[self._material]

    @cached_property
    def _irradiance(self) -> F64:
        """E of each face of the tile, by light: what has been sent on at least once. (faces, lights, 3)"""
        middle = Hits(
            np.arange(self._num_faces, dtype=np.int32) + self._num_faces * (2 * self._times + 2) * self._times,
            np.full((self._num_faces, 2), 1 / 3, np.float32),
            np.ones(self._num_faces, np.float32),
        )
        places = self._places(middle, np.array([0.0, 0.0, 1.0]))
        cosine = np.maximum(np.einsum("nc,lc->nl", places.normal.astype(np.float64), self._directions), 0)
        straight = (cosine * self._visible(places, self._directions))[..., None] * np.ones(3)
        between = self._between(places)
        num, lights = straight.shape[:2]
        arriving, sent_on = straight, np.zeros_like(straight)
        for _ in range(_BOUNCES):
            arriving = (between @ (self._reflectance[:, None] * arriving).reshape(num, -1)).reshape(num, lights, 3)
            sent_on += arriving
        return np.asarray(sent_on)

    def _between(self, places: _Places) -> csr_array:
        """Form factors: what share of the hemisphere over each face others take. (faces, faces)"""
        rng, num = np.random.default_rng(self._seed), self._num_faces
        u, turn = rng.random((2, num, _RAYS_A_FACE))
        u = (np.arange(_RAYS_A_FACE) + u) / _RAYS_A_FACE
        radius, phi = np.sqrt(u)[..., None], (2 * np.pi * turn)[..., None]
        n = places.normal.astype(np.float64)[:, None]
        t = any_tangent(places.normal).astype(np.float64)[:, None]
        w = radius * (np.cos(phi) * t + np.sin(phi) * np.cross(n, t)) + np.sqrt(1 - u)[..., None] * n
        origin = np.repeat(places.position, _RAYS_A_FACE, axis=0)
        hits = trace_from(self._embree, origin, w.reshape(-1, 3).astype(np.float32))
        hit = hits.face >= 0
        row = np.repeat(np.arange(num), _RAYS_A_FACE)[hit]
        weight = np.full(len(row), 1 / _RAYS_A_FACE)
        return csr_array((weight, (row, hits.face[hit] % num)), (num, num))


def _evenly(num: int) -> F64:
    """Directions evenly over the hemisphere, on a spiral. (num, 3)"""
    k = np.arange(num, dtype=np.float64)
    return polar(np.arccos(1 - (k + 0.5) / num), k * _GOLDEN)
