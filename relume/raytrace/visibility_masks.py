"""Visibility of light triangles from the view samples of a bake, with a fraction of the rays.

After Ben-Artzi et al. 2006b, "Efficient shadows from sampled environment maps": few samples are traced and the others
predicted; rays are traced where neighbors disagree, and a wrong prediction floods to its neighbors. Neighbors are
successive samples, and adjacent lights on the sphere (docs/direct-light.md#algorithm). Nothing is random, and blocks
are independent: the result does not depend on the threads.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import luminance
from relume.core.thread_pools import for_ranges
from relume.lights.neighbors import find_neighbors
from relume.raytrace.embree import EmbreeScene
from relume.raytrace.surface_points import FIXED_ALPHA_SAMPLE
from relume.raytrace.visibility_kernel import BLOCK, trace_blocks

F32 = NDArray[np.float32]

_SAMPLES_PER_RANGE = 8 * BLOCK
_STRONG_LIGHT_FRACTION = 5e-3  # of all light; brighter triangles are always traced: a wrong bit could be visible


@dataclass(frozen=True)
class RayCounts:
    """Rays saved by prediction, and its accuracy.

    Attributes:
        num_traced: traced shadow rays. num_full: rays of a full trace, all pairs above the horizon.
        num_checked: predicted bits that were also traced, uniformly distributed.
        num_wrong: wrong predictions among the checked bits.
    """

    num_traced: int
    num_full: int
    num_checked: int
    num_wrong: int

    @property
    def error_rate(self) -> float:
        """Estimated fraction of wrong bits: the error rate of checked bits times the fraction of predicted bits."""
        return self.num_wrong / max(1, self.num_checked) * (1 - self.num_traced / max(1, self.num_full))


@dataclass(frozen=True)
class VisibilityMasks:
    """Visibility of m lights from n view samples, and its cost.

    Attributes:
        visible: light k of a sample at bit k & 7 of byte k >> 3; ceil(m / 8) bytes.
        rays: ray counts. trace_s: wall time of tracing and predicting alone.
    """

    visible: Shaped[NDArray[np.uint8], "n bytes"]
    rays: RayCounts
    trace_s: float


class LightTargets(NamedTuple):
    """Lights as targets of shadow rays.

    Attributes:
        directions: unit, toward the lights.
        first, neighbors: adjacent lights, from `relume.lights.neighbors.find_neighbors`.
        is_strong: lights so bright that their visibility is never predicted.
    """

    directions: Shaped[F32, "m 3"]
    first: NDArray[np.int32]
    neighbors: NDArray[np.int32]
    is_strong: Shaped[NDArray[np.bool_], " m"]


def make_light_targets(directions: Shaped[F32, "m 3"], irradiance: Shaped[F32, "m 3"]) -> LightTargets:
    """Prepare lights for `trace_visibility_masks`.

    Args:
        directions: unit, toward the lights. irradiance: irradiance of each light, per channel.
    """
    luminous = luminance(irradiance)
    return LightTargets(directions, *find_neighbors(directions), luminous > _STRONG_LIGHT_FRACTION * luminous.sum())


def trace_visibility_masks(
    scene: EmbreeScene,
    origins: Shaped[F32, "n 3"],
    normals: Shaped[F32, "n 3"],
    targets: LightTargets,
    alpha_sample: Shaped[F32, " #n"] = FIXED_ALPHA_SAMPLE,
) -> VisibilityMasks:
    """Compute the visibility of lights from samples, traced where it changes and predicted elsewhere.

    Args:
        scene: the occluding triangles.
        origins: positions, offset from the surface, mostly ordered by neighborhood in the image.
        normals: shading normals; lights below their horizon are not traced and count as occluded.
        targets: the lights, from `make_light_targets`.
        alpha_sample: alpha samples for the rays at blended surfaces; see `SurfacePoints`.
    Cost: O(n · m) time, plus O(m · log triangles) for each sample on a shadow edge.
    """
    bits = np.zeros((len(origins), (len(targets.directions) + 7) // 8), np.uint8)
    tracers = scene.shadow_tracer(coherent=False), scene.shadow_tracer(coherent=True)
    range_counts = [np.zeros(4, np.int64)]

    def kernel(start: int, stop: int) -> None:
        counts = np.zeros(4, np.int64)
        trace_blocks(tracers, origins, normals, alpha_sample, targets, start, stop, bits, counts)
        range_counts.append(counts)

    start_time = time.perf_counter()
    for_ranges(kernel, len(origins), _SAMPLES_PER_RANGE)
    trace_s = time.perf_counter() - start_time
    return VisibilityMasks(bits, RayCounts(*(int(count) for count in np.sum(range_counts, axis=0))), trace_s)
