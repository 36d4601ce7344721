"""What a few exact samples say of a whole moving picture: by how much it is off, between them as well.

    C(p) = M(p) + β Σ_q w(p, q) D(q) ,   D = E − M ,   β = Σ_q D̂(q) · D(q) / Σ_q D̂(q)²

M is the moving picture, a control variate that is known at every pixel; E is exact, at every eighth pixel of every
eighth row, and of both the light that comes straight alone. w are weights of the four samples about a pixel, of those
on the same material, turned alike, near its plane (after Kopf, Cohen, Lischinski and Uyttendaele 2007, *Joint Bilateral
Upsampling*). D̂ is what the samples about a sample say of it, itself left out. Where that explains little, as of narrow
highlights, the moving picture of that material stands as it is (docs/adr/0061-few-exact-samples.md).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from relume.moving.look_up import Seen
from relume.moving.points.surface import Surface
from relume.scene.model import Camera

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_TURN = 8  # power of the cosine between normals
_RISE = 0.1  # off the tangent plane, over the distance
_LEAST = 0.02  # weight below which a pixel is hardly told of
_FEWEST = 8  # samples of a material that tell how far they can be believed
_LEAST_EXPLAINED = 0.2  # share of the squares of what samples are off by, explained by those about them


class Places(NamedTuple):
    """Where rays through the middles of pixels hit, row after row.

    Attributes:
        position: nothing where they leave the scene. normal: of the triangle. (n, 3) float32
        material: −1 where they leave. (n,) int32
        width: of the picture, pixels.
    """

    position: F32
    normal: F32
    material: NDArray[np.int32]
    width: int

    @classmethod
    def of(cls, surface: Surface, seen: Seen, camera: Camera, width: int) -> Places:
        """Find them.

        Args:
            surface: that is seen. seen: through middles of pixels alone. camera: the eye. width: pixels.
        """
        face, is_hit = np.maximum(seen.hits.face, 0), seen.hits.face >= 0
        distance = np.where(is_hit, seen.hits.distance, 0)[:, None]
        position = camera.to_world[:3, 3].astype(np.float32) + distance * seen.directions
        material = np.where(is_hit, surface.face_material[face], -1)
        return cls(position.astype(np.float32), surface.face_normal[face], material.astype(np.int32), width)

    @property
    def height(self) -> int:
        """Of the picture, pixels."""
        return len(self.material) // self.width

    def off_edges(self, edges: NDArray[np.integer], size: tuple[int, int]) -> Places:
        """Leave out those near edges: what is off there, as where a shadow begins, is so for a pixel or two.

        Args:
            edges: pixels of a larger picture from the same eye. size: width and height of that, pixels.
        """
        width, height = size
        is_edge = np.zeros((height + 2, width + 2), np.bool_)
        is_edge[edges // width + 1, edges % width + 1] = True
        is_near = is_edge[:-2] | is_edge[1:-1] | is_edge[2:]
        is_near = is_near[:, :-2] | is_near[:, 1:-1] | is_near[:, 2:]
        y = ((np.arange(self.height) + 0.5) * height / self.height).astype(np.int64)
        x = ((np.arange(self.width) + 0.5) * width / self.width).astype(np.int64)
        return self._replace(material=np.where(is_near[y][:, x].ravel(), np.int32(-1), self.material))


def correction(radiance: F32, exact: F32, of_samples: Places, of_pixels: Places) -> F32:
    """Find by how much a moving picture is off.

    Args:
        radiance: M at the samples. exact: E there. (h, w, 3) float32
        of_samples: where they lie: pixels of a smaller picture from the same eye.
        of_pixels: where the pixels of the moving picture lie.
    Returns:
        β Σ w D, what is to be added. (height, width, 3) float32
    """
    off = (exact - radiance).reshape(-1, 3).astype(np.float64)
    off[of_samples.material < 0] = 0
    believed = _belief(off, of_samples)[:, None] * off
    found = _between(of_samples, of_pixels) @ believed
    return np.asarray(found.reshape(of_pixels.height, of_pixels.width, 3), np.float32)


def corrected(image: F32, by: F32) -> F32:
    """Add what a moving picture is off by; nothing becomes darker than black. (height, width, 3) both"""
    return np.asarray(np.maximum(image + by, 0), np.float32)


def _belief(off: F64, samples: Places) -> F64:
    """Regress what samples are off by on what those about them say: β of each one's material. (n,)"""
    said, belief = _about(samples) @ off, np.zeros(len(off))
    for material in np.unique(samples.material[samples.material >= 0]):
        rows = np.flatnonzero(samples.material == material)
        both, size, whole = (
            float(np.sum(one * other)) for one, other in (
                (said[rows], off[rows]), (said[rows], said[rows]), (off[rows], off[rows])
            )
        )  # fmt: skip
        if len(rows) >= _FEWEST and both > 0 and both * both > _LEAST_EXPLAINED * size * whole:
            belief[rows] = min(both / size, 1)
    return belief


def _between(samples: Places, pixels: Places) -> Any:
    """Weigh the four samples about each pixel. (pixels, samples) sparse"""
    y, x = np.divmod(np.arange(len(pixels.material)), pixels.width)
    # both pictures are as high; the smaller may be a little wider or narrower than the other
    step = pixels.height / samples.height
    u = (x + 0.5 - pixels.width / 2) / step + samples.width / 2 - 0.5
    v = (y + 0.5) / step - 0.5
    left, top = np.floor(u).astype(np.int64), np.floor(v).astype(np.int64)
    corners = [(left + dx, top + dy) for dy in (0, 1) for dx in (0, 1)]
    tents = [np.maximum(1 - abs(u - cx), 0) * np.maximum(1 - abs(v - cy), 0) for cx, cy in corners]
    return _weighed(pixels, samples, corners, tents)


def _about(samples: Places) -> Any:
    """Weigh the eight samples about each sample. (samples, samples) sparse"""
    y, x = np.divmod(np.arange(len(samples.material)), samples.width)
    steps = [(dx, dy) for dy in (-1, 0, 1) for dx in (-1, 0, 1) if (dx, dy) != (0, 0)]
    tents = [np.full(len(x), 0.5 ** (abs(dx) + abs(dy) - 1)) for dx, dy in steps]
    return _weighed(samples, samples, [(x + dx, y + dy) for dx, dy in steps], tents)


def _weighed(at: Places, samples: Places, where: list[tuple[I64, I64]], tents: list[F64]) -> Any:
    """Weigh samples for places by how near they are, and whether they are on the same surface; rows sum to one or less.

    Args:
        at: the places. samples: what is known. where: x and y of one sample for each place, several times.
        tents: by how near these are in the picture.
    """
    rows, columns, weights = [], [], []
    for (x, y), tent in zip(where, tents, strict=True):
        is_inside = (x >= 0) & (x < samples.width) & (y >= 0) & (y < samples.height) & (at.material >= 0)
        row = np.flatnonzero(is_inside & (tent > 0))
        column = y[row] * samples.width + x[row]
        is_same = at.material[row] == samples.material[column]
        row, column = row[is_same], column[is_same]
        rows.append(row)
        columns.append(column)
        weights.append(tent[row] * _likeness(at, row, samples, column))
    row, column, weight = np.concatenate(rows), np.concatenate(columns), np.concatenate(weights)
    total = np.bincount(row, weight, len(at.material))
    # few weigh little even together: what is hardly told of is hardly corrected
    share = weight / np.maximum(total + _LEAST, 1e-12)[row]
    return csr_array((share, (row, column)), shape=(len(at.material), len(samples.material)))


def _likeness(at: Places, row: I64, samples: Places, column: I64) -> F64:
    """How much pairs of places are of one smooth surface, in [0, 1]. (pairs,)"""
    normal = at.normal[row].astype(np.float64)
    away = at.position[row].astype(np.float64) - samples.position[column]
    turn = np.maximum(np.einsum("nc,nc->n", normal, samples.normal[column]), 0)
    rise, distance = np.abs(np.einsum("nc,nc->n", normal, away)), np.linalg.norm(away, axis=1)
    return np.asarray(turn**_TURN * np.exp(-rise / (_RISE * distance + 1e-9)), np.float64)
