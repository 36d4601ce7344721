"""Points on surfaces, for any purpose: view samples, patches, vertices or texels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

F32 = NDArray[np.float32]

FIXED_ALPHA_SAMPLE = np.zeros(1, np.float32)
"""Alpha sample of rays that use the hash of their direction: rays of one direction pass or stop together."""


class SurfacePoints(NamedTuple):
    """n points on surfaces, for kernels.

    Attributes:
        position: positions, meters, offset from the surface so that rays can start there.
        normal: unit shading normals, on the visible side.
        tangent: unit, orthogonal to the normals; n × t completes the shading frame.
        seed: index of each point in its set; it determines the shift of ray patterns.
        alpha_sample: alpha samples for rays at blended surfaces, see `relume.raytrace.alpha_filter`; one each, or one
            for all.
    """

    position: Shaped[F32, "n 3"]
    normal: Shaped[F32, "n 3"]
    tangent: Shaped[F32, "n 3"]
    seed: Shaped[NDArray[np.uint32], " n"]
    alpha_sample: Shaped[F32, " #n"] = FIXED_ALPHA_SAMPLE

    @property
    def num_points(self) -> int:
        """Number of points n."""
        return len(self.position)

    def rows(self, index: slice | NDArray[np.integer] | NDArray[np.bool_]) -> SurfacePoints:
        """Select points, which keep their seeds."""
        position, normal, tangent = (np.ascontiguousarray(array[index]) for array in self[:3])
        alpha_sample = (
            self.alpha_sample if len(self.alpha_sample) == 1 else np.ascontiguousarray(self.alpha_sample[index])
        )
        return SurfacePoints(position, normal, tangent, np.ascontiguousarray(self.seed[index]), alpha_sample)
