"""What a few exact samples say of a whole moving picture: by how much it is off, between them as well.

    C(p) = M(p) + β Σ_q w(p, q) D(q) ,   D = E − M ,   β = Σ_q D̂(q) · D(q) / Σ_q D̂(q)²

M is the moving picture, a control variate that is known at every pixel; E is exact, at every eighth pixel of every
eighth row, and of both the light that comes straight alone. w are weights of the four samples about a pixel, of those
on the same material, turned alike, near its plane (after Kopf, Cohen, Lischinski and Uyttendaele 2007, *Joint Bilateral
Upsampling*). D̂ is what the samples about a sample say of it, itself left out. Where that explains little, as of narrow
highlights, the moving picture of that material stands as it is (docs/free-camera.md#when-the-camera-stops).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from relume.live.free_camera.primary_visibility import GBuffer
from relume.live.free_camera.probes.stored_scene import StoredScene
from relume.scene.model import Camera

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_NORMAL_POWER = 8  # power of the cosine between normals
_PLANE_TOLERANCE = 0.1  # off the tangent plane, over the distance
_MIN_WEIGHT = 0.02  # weight below which a pixel is hardly told of
_MIN_SAMPLES = 8  # samples of a material that tell how far they can be believed
_MIN_EXPLAINED = 0.2  # share of the squares of what samples are off by, explained by those about them


class CorrectionSamples(NamedTuple):
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
    def from_gbuffer(cls, stored_scene: StoredScene, gbuffer: GBuffer, camera: Camera, width: int) -> CorrectionSamples:
        """Find them.

        Args:
            stored_scene: that is seen. gbuffer: through middles of pixels alone. camera: the eye. width: pixels.
        """
        face, is_hit = np.maximum(gbuffer.hits.face, 0), gbuffer.hits.face >= 0
        distance = np.where(is_hit, gbuffer.hits.distance, 0)[:, None]
        position = camera.to_world[:3, 3].astype(np.float32) + distance * gbuffer.directions
        material = np.where(is_hit, stored_scene.face_material[face], -1)
        return cls(position.astype(np.float32), stored_scene.face_normal[face], material.astype(np.int32), width)

    @property
    def height(self) -> int:
        """Of the picture, pixels."""
        return len(self.material) // self.width

    def exclude_edges(self, edges: NDArray[np.integer], size: tuple[int, int]) -> CorrectionSamples:
        """Leave out those near edges: what is off there, as where a shadow begins, is so for a pixel or two.

        Args:
            edges: pixels of a larger picture from the same eye. size: width and height of that, pixels.
        """
        width, height = size
        is_edge = np.zeros((height + 2, width + 2), np.bool_)
        is_edge[edges // width + 1, edges % width + 1] = True
        is_near_edge = is_edge[:-2] | is_edge[1:-1] | is_edge[2:]
        is_near_edge = is_near_edge[:, :-2] | is_near_edge[:, 1:-1] | is_near_edge[:, 2:]
        y = ((np.arange(self.height) + 0.5) * height / self.height).astype(np.int64)
        x = ((np.arange(self.width) + 0.5) * width / self.width).astype(np.int64)
        return self._replace(material=np.where(is_near_edge[y][:, x].ravel(), np.int32(-1), self.material))


def residual(radiance: F32, exact: F32, samples: CorrectionSamples, pixels: CorrectionSamples) -> F32:
    """Find by how much a moving picture is off.

    Args:
        radiance: M at the samples. exact: E there. (h, w, 3) float32
        samples: where they lie: pixels of a smaller picture from the same eye.
        pixels: where the pixels of the moving picture lie.
    Returns:
        β Σ w D, what is to be added. (height, width, 3) float32
    """
    difference = (exact - radiance).reshape(-1, 3).astype(np.float64)
    difference[samples.material < 0] = 0
    weighted_difference = _material_confidence(difference, samples)[:, None] * difference
    residual_image = _pixel_weights(samples, pixels) @ weighted_difference
    return np.asarray(residual_image.reshape(pixels.height, pixels.width, 3), np.float32)


def apply_residual(image: F32, residual_image: F32) -> F32:
    """Add what a moving picture is off by; nothing becomes darker than black. (height, width, 3) both"""
    return np.asarray(np.maximum(image + residual_image, 0), np.float32)


def _material_confidence(difference: F64, samples: CorrectionSamples) -> F64:
    """Regress what samples are off by on what those about them say: β of each one's material. (n,)"""
    predicted, confidence = _neighbor_weights(samples) @ difference, np.zeros(len(difference))
    for material in np.unique(samples.material[samples.material >= 0]):
        rows = np.flatnonzero(samples.material == material)
        cross_product, predicted_energy, total_energy = (
            float(np.sum(a * b)) for a, b in (
                (predicted[rows], difference[rows]), (predicted[rows], predicted[rows]), (difference[rows],
                difference[rows])
            )
        )  # fmt: skip
        if (
            len(rows) >= _MIN_SAMPLES
            and cross_product > 0
            and cross_product * cross_product > _MIN_EXPLAINED * predicted_energy * total_energy
        ):
            confidence[rows] = min(cross_product / predicted_energy, 1)
    return confidence


def _pixel_weights(samples: CorrectionSamples, pixels: CorrectionSamples) -> Any:
    """Weigh the four samples about each pixel. (pixels, samples) sparse"""
    y, x = np.divmod(np.arange(len(pixels.material)), pixels.width)
    # both pictures are as high; the smaller may be a little wider or narrower than the other
    step = pixels.height / samples.height
    u = (x + 0.5 - pixels.width / 2) / step + samples.width / 2 - 0.5
    v = (y + 0.5) / step - 0.5
    column, row = np.floor(u).astype(np.int64), np.floor(v).astype(np.int64)
    corners = [(column + dx, row + dy) for dy in (0, 1) for dx in (0, 1)]
    tents = [np.maximum(1 - abs(u - cx), 0) * np.maximum(1 - abs(v - cy), 0) for cx, cy in corners]
    return _bilateral_weights(pixels, samples, corners, tents)


def _neighbor_weights(samples: CorrectionSamples) -> Any:
    """Weigh the eight samples about each sample. (samples, samples) sparse"""
    y, x = np.divmod(np.arange(len(samples.material)), samples.width)
    offsets = [(dx, dy) for dy in (-1, 0, 1) for dx in (-1, 0, 1) if (dx, dy) != (0, 0)]
    tents = [np.full(len(x), 0.5 ** (abs(dx) + abs(dy) - 1)) for dx, dy in offsets]
    return _bilateral_weights(samples, samples, [(x + dx, y + dy) for dx, dy in offsets], tents)


def _bilateral_weights(
    targets: CorrectionSamples, samples: CorrectionSamples, neighbors: list[tuple[I64, I64]], tents: list[F64]
) -> Any:
    """Weigh samples for places by how near they are, and whether they are on the same surface; rows sum to one or less.

    Args:
        targets: the places. samples: what is known. neighbors: x and y of one sample for each place, several times.
        tents: by how near these are in the picture.
    """
    rows, columns, weights = [], [], []
    for (x, y), tent in zip(neighbors, tents, strict=True):
        is_inside = (x >= 0) & (x < samples.width) & (y >= 0) & (y < samples.height) & (targets.material >= 0)
        row = np.flatnonzero(is_inside & (tent > 0))
        column = y[row] * samples.width + x[row]
        is_same = targets.material[row] == samples.material[column]
        row, column = row[is_same], column[is_same]
        rows.append(row)
        columns.append(column)
        weights.append(tent[row] * _similarity(targets, row, samples, column))
    row, column, weight = np.concatenate(rows), np.concatenate(columns), np.concatenate(weights)
    total = np.bincount(row, weight, len(targets.material))
    # few weigh little even together: what is hardly told of is hardly corrected
    normalized = weight / np.maximum(total + _MIN_WEIGHT, 1e-12)[row]
    return csr_array((normalized, (row, column)), shape=(len(targets.material), len(samples.material)))


def _similarity(targets: CorrectionSamples, row: I64, samples: CorrectionSamples, column: I64) -> F64:
    """How much pairs of places are of one smooth surface, in [0, 1]. (pairs,)"""
    normal = targets.normal[row].astype(np.float64)
    offset = targets.position[row].astype(np.float64) - samples.position[column]
    alignment = np.maximum(np.einsum("nc,nc->n", normal, samples.normal[column]), 0)
    plane_distance, distance = np.abs(np.einsum("nc,nc->n", normal, offset)), np.linalg.norm(offset, axis=1)
    return np.asarray(
        alignment**_NORMAL_POWER * np.exp(-plane_distance / (_PLANE_TOLERANCE * distance + 1e-9)), np.float64
    )
