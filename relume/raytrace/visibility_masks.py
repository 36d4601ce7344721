"""Which light triangles each view sample of a bake sees, with a fraction of the rays.

After Ben-Artzi et al. 2006b, "Efficient shadows from sampled environment maps": few samples are traced, the others are
predicted, rays go where neighbours disagree, and a prediction found wrong floods its neighbours. Neighbours are samples
that follow each other, and lights beside each other on the sphere (docs/direct-light.md#algorithm). Nothing is
random, and blocks know nothing of each other: the same samples give the same bits whatever the threads.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.core.color import luminance
from relume.core.thread_pools import for_ranges
from relume.lights.neighbors import find_neighbors
from relume.raytrace.embree import EmbreeScene, occluded, packet_arguments
from relume.raytrace.surface_points import FIXED_ALPHA_SAMPLE
from relume.raytrace.visibility_kernel import BLOCK, trace_blocks

F32 = NDArray[np.float32]

_SAMPLES_PER_RANGE = 8 * BLOCK
_STRONG_LIGHT_FRACTION = (
    5e-3  # of all the light; a triangle with more is not predicted: one wrong bit of it could be seen
)


@dataclass(frozen=True)
class RayCounts:
    """What prediction saved, and how far it can be believed.

    Attributes:
        num_traced: shadow rays. num_full: those that a full trace takes, all pairs above the horizon.
        num_checked: predicted bits that were traced all the same, spread evenly. num_wrong: those of them that were
            wrong.
    """

    num_traced: int
    num_full: int
    num_checked: int
    num_wrong: int

    @property
    def error_rate(self) -> float:
        """The wrong share of checked bits times the share of predicted ones: an estimate of all wrong bits."""
        return self.num_wrong / max(1, self.num_checked) * (1 - self.num_traced / max(1, self.num_full))


@dataclass(frozen=True)
class VisibilityMasks:
    """What n view samples see, and what it cost to find out.

    Attributes:
        visible: light m of a sample in bit m & 7 of byte m >> 3. (n, ceil(m / 8)) uint8
        rays: what prediction saved. trace_s: wall time of the tracing and predicting alone.
    """

    visible: NDArray[np.uint8]
    rays: RayCounts
    trace_s: float


class LightTargets(NamedTuple):
    """What shadow rays are sent to.

    Attributes:
        directions: unit, towards the lights. (m, 3) float32
        first, neighbors: `relume.lights.light_neighbors.LightNeighbors` of them.
        is_strong: so much of the light that nothing is predicted. (m,)
    """

    directions: F32
    first: NDArray[np.int32]
    neighbors: NDArray[np.int32]
    is_strong: NDArray[np.bool_]


def make_light_targets(directions: F32, irradiance: F32) -> LightTargets:
    """Make lights what `trace_visibility_masks` wants.

    Args:
        directions: unit, towards the lights. (m, 3) float32. irradiance: of each light, per channel. (m, 3) float32
    """
    luminous = luminance(irradiance)
    return LightTargets(directions, *find_neighbors(directions), luminous > _STRONG_LIGHT_FRACTION * luminous.sum())


def trace_visibility_masks(
    scene: EmbreeScene, origins: F32, normals: F32, targets: LightTargets, alpha_sample: F32 = FIXED_ALPHA_SAMPLE
) -> VisibilityMasks:
    """Find what samples see, tracing where it changes and predicting where it does not.

    Args:
        scene: the triangles that may be in the way.
        origins: off the surface already, neighbours in the picture mostly next to each other. (n, 3) float32
        normals: shading normals; lights below their horizon are not traced and count as hidden. (n, 3) float32
        targets: the lights, from `make_light_targets`.
        alpha_sample: of the rays of each sample, or of all, at surfaces that blend; see `SurfacePoints`. (n,) or (1,)
            float32
    Cost: O(n · m) time, O(m · log triangles) of it for each sample that lies on a shadow's edge.
    """
    bits = np.zeros((len(origins), (len(targets.directions) + 7) // 8), np.uint8)
    mixed_arguments, single_light_arguments = (packet_arguments(coherent=is_coherent) for is_coherent in (False, True))
    range_counts = [np.zeros(4, np.int64)]

    def kernel(start: int, stop: int) -> None:
        counts = np.zeros(4, np.int64)
        trace_blocks(
            occluded,
            scene.handle,
            mixed_arguments.ctypes.data,
            single_light_arguments.ctypes.data,
            origins,
            normals,
            alpha_sample,
            targets,
            start,
            stop,
            bits,
            counts,
        )
        range_counts.append(counts)

    start_time = time.perf_counter()
    for_ranges(kernel, len(origins), _SAMPLES_PER_RANGE)
    trace_s = time.perf_counter() - start_time
    return VisibilityMasks(bits, RayCounts(*(int(count) for count in np.sum(range_counts, axis=0))), trace_s)
