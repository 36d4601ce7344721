"""Residual correction of the free-camera image by sparse exact samples.

    C(p) = M(p) + β Σ_q w(p, q) D(q) ,   D = E − M ,   β = Σ_q D̂(q) · D(q) / Σ_q D̂(q)²

M is the free-camera image, a control variate that is available at every pixel. E is exact, at every eighth pixel of
every eighth row; both are of direct light only. The w are bilateral weights of the four surrounding samples: same
material, similar normal, near the tangent plane (after Kopf, Cohen, Lischinski and Uyttendaele 2007, *Joint Bilateral
Upsampling*). D̂ is the value predicted at a sample by its neighbors. If that explains little, as for narrow highlights,
the material is not corrected (docs/free-camera.md#when-the-camera-stops).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.sparse import csr_array

from relume.live.free_camera.primary_visibility import GBuffer
from relume.probes.stored_scene import StoredScene
from relume.scene.model import Camera

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_NORMAL_POWER = 8  # of the cosine between normals
_PLANE_TOLERANCE = 0.1  # distance from the tangent plane over the distance of the points
_MIN_WEIGHT = 0.02  # total weight below which a pixel is hardly corrected
_MIN_SAMPLES = 8  # samples of a material that its β needs
_MIN_EXPLAINED = 0.2  # fraction of the squared residuals that neighbors explain


class CorrectionSamples(NamedTuple):
    """Hits of the rays through pixel centers, row by row.

    Attributes:
        position: undefined for rays that miss. normal: normal of the triangle. material: −1 for rays that miss.
        width: width of the
            image, pixels.
    """

    position: Shaped[F32, "n 3"]
    normal: Shaped[F32, "n 3"]
    material: Shaped[NDArray[np.int32], " n"]
    width: int

    @classmethod
    def from_gbuffer(cls, stored_scene: StoredScene, gbuffer: GBuffer, camera: Camera, width: int) -> CorrectionSamples:
        """Collect the hits.

        Args:
            stored_scene: that is hit. gbuffer: G-buffer of rays through pixel centers only. camera: camera of the rays.
            width: pixels.
        """
        face, is_hit = np.maximum(gbuffer.hits.face, 0), gbuffer.hits.face >= 0
        distance = np.where(is_hit, gbuffer.hits.distance, 0)[:, None]
        position = camera.to_world[:3, 3].astype(np.float32) + distance * gbuffer.directions
        material = np.where(is_hit, stored_scene.face_material[face], -1)
        return cls(position.astype(np.float32), stored_scene.face_normal[face], material.astype(np.int32), width)

    @property
    def height(self) -> int:
        """Height of the image, pixels."""
        return len(self.material) // self.width

    def exclude_edges(self, edges: NDArray[np.integer], size: tuple[int, int]) -> CorrectionSamples:
        """Exclude samples near edges: residuals there, as at the border of a shadow, hold for a pixel or two only.

        Args:
            edges: pixels of a larger image from the same camera. size: its width and height, pixels.
        """
        width, height = size
        is_edge = np.zeros((height + 2, width + 2), np.bool_)
        is_edge[edges // width + 1, edges % width + 1] = True
        is_near_edge = is_edge[:-2] | is_edge[1:-1] | is_edge[2:]
        is_near_edge = is_near_edge[:, :-2] | is_near_edge[:, 1:-1] | is_near_edge[:, 2:]
        y = ((np.arange(self.height) + 0.5) * height / self.height).astype(np.int64)
        x = ((np.arange(self.width) + 0.5) * width / self.width).astype(np.int64)
        return self._replace(material=np.where(is_near_edge[y][:, x].ravel(), np.int32(-1), self.material))

    def exclude_materials(self, materials: Shaped[NDArray[np.integer], " m"]) -> CorrectionSamples:
        """Exclude samples of some materials."""
        return self._replace(material=np.where(np.isin(self.material, materials), np.int32(-1), self.material))


def residual(
    radiance: Shaped[F32, "h w 3"], exact: Shaped[F32, "h w 3"], samples: CorrectionSamples, pixels: CorrectionSamples
) -> Shaped[F32, "height width 3"]:
    """Estimate the residual of a free-camera image.

    Args:
        radiance: M at the samples. exact: E there. samples: pixels of a smaller image from the same camera.
        pixels: pixels of the free-camera image.
    Returns:
        β Σ w D, to be added to the image.
    """
    difference = (exact - radiance).reshape(-1, 3).astype(np.float64)
    difference[samples.material < 0] = 0
    weighted_difference = _material_confidence(difference, samples)[:, None] * difference
    residual_image = _pixel_weights(samples, pixels) @ weighted_difference
    return np.asarray(residual_image.reshape(pixels.height, pixels.width, 3), np.float32)


def apply_residual(
    image: Shaped[F32, "height width 3"], residual_image: Shaped[F32, "height width 3"]
) -> Shaped[F32, "height width 3"]:
    """Add a residual to an image; clamped at zero."""
    return np.asarray(np.maximum(image + residual_image, 0), np.float32)


def _material_confidence(difference: F64, samples: CorrectionSamples) -> F64:
    """Regress the residuals of samples on those predicted by their neighbors: β of each sample's material. (n,)"""
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
    """Weights of the four samples around each pixel. (pixels, samples) sparse"""
    y, x = np.divmod(np.arange(len(pixels.material)), pixels.width)
    # both images have the same field of view vertically; aspect ratios may differ by rounding
    step = pixels.height / samples.height
    u = (x + 0.5 - pixels.width / 2) / step + samples.width / 2 - 0.5
    v = (y + 0.5) / step - 0.5
    column, row = np.floor(u).astype(np.int64), np.floor(v).astype(np.int64)
    corners = [(column + dx, row + dy) for dy in (0, 1) for dx in (0, 1)]
    spatial_weights = [np.maximum(1 - abs(u - cx), 0) * np.maximum(1 - abs(v - cy), 0) for cx, cy in corners]
    return _bilateral_weights(pixels, samples, corners, spatial_weights)


def _neighbor_weights(samples: CorrectionSamples) -> Any:
    """Weights of the eight samples around each sample. (samples, samples) sparse"""
    y, x = np.divmod(np.arange(len(samples.material)), samples.width)
    offsets = [(dx, dy) for dy in (-1, 0, 1) for dx in (-1, 0, 1) if (dx, dy) != (0, 0)]
    spatial_weights = [np.full(len(x), 0.5 ** (abs(dx) + abs(dy) - 1)) for dx, dy in offsets]
    return _bilateral_weights(samples, samples, [(x + dx, y + dy) for dx, dy in offsets], spatial_weights)


def _bilateral_weights(
    targets: CorrectionSamples, samples: CorrectionSamples, neighbors: list[tuple[I64, I64]], spatial_weights: list[F64]
) -> Any:
    """Bilateral weights of samples for target points; rows sum to one or less.

    Args:
        targets: points. samples: that are weighted. neighbors: x and y of one sample per target, several times.
        spatial_weights: spatial weight of each.
    """
    rows, columns, weights = [], [], []
    for (x, y), spatial_weight in zip(neighbors, spatial_weights, strict=True):
        is_inside = (x >= 0) & (x < samples.width) & (y >= 0) & (y < samples.height) & (targets.material >= 0)
        row = np.flatnonzero(is_inside & (spatial_weight > 0))
        column = y[row] * samples.width + x[row]
        is_same = targets.material[row] == samples.material[column]
        row, column = row[is_same], column[is_same]
        rows.append(row)
        columns.append(column)
        weights.append(spatial_weight[row] * _similarity(targets, row, samples, column))
    row, column, weight = np.concatenate(rows), np.concatenate(columns), np.concatenate(weights)
    total = np.bincount(row, weight, len(targets.material))
    # a small total weight stays small: a pixel without similar samples is hardly corrected
    normalized = weight / np.maximum(total + _MIN_WEIGHT, 1e-12)[row]
    return csr_array((normalized, (row, column)), shape=(len(targets.material), len(samples.material)))


def _similarity(targets: CorrectionSamples, row: I64, samples: CorrectionSamples, column: I64) -> F64:
    """Similarity of pairs of points, in [0, 1]: 1 on one smooth surface. (pairs,)"""
    normal = targets.normal[row].astype(np.float64)
    offset = targets.position[row].astype(np.float64) - samples.position[column]
    alignment = np.maximum(np.einsum("nc,nc->n", normal, samples.normal[column]), 0)
    plane_distance, distance = np.abs(np.einsum("nc,nc->n", normal, offset)), np.linalg.norm(offset, axis=1)
    return np.asarray(
        alignment**_NORMAL_POWER * np.exp(-plane_distance / (_PLANE_TOLERANCE * distance + 1e-9)), np.float64
    )
