"""Points on surfaces, whoever owns them: a pixel's samples, a gather cell, a vertex or a texel."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]

FIXED_ALPHA_SAMPLE = np.zeros(1, np.float32)
"""The chance of rays that are given none: that all of one direction pass what they meet, or none."""


class SurfacePoints(NamedTuple):
    """n points on surfaces, as the kernels want them.

    Attributes:
        position: off the surface already, so that rays may begin there; metres. (n, 3) float32
        normal: unit shading normals, on the side that the points are seen from. (n, 3) float32
        tangent: unit, across the normals; n × t completes the shading frame. (n, 3) float32
        seed: number of each point in what owns it; decides how patterns of rays are shifted there. (n,) uint32
        alpha_sample: of the rays of each at surfaces that blend: `relume.raytrace.alpha_filter`. (n,) float32, or (1,)
            of all
    """

    position: F32
    normal: F32
    tangent: F32
    seed: NDArray[np.uint32]
    alpha_sample: F32 = FIXED_ALPHA_SAMPLE

    @property
    def num_points(self) -> int:
        """Their number n."""
        return len(self.position)

    def rows(self, index: slice | NDArray[np.integer] | NDArray[np.bool_]) -> SurfacePoints:
        """Choose some of the points, which keep their seeds."""
        position, normal, tangent = (np.ascontiguousarray(array[index]) for array in self[:3])
        alpha_sample = (
            self.alpha_sample if len(self.alpha_sample) == 1 else np.ascontiguousarray(self.alpha_sample[index])
        )
        return SurfacePoints(position, normal, tangent, np.ascontiguousarray(self.seed[index]), alpha_sample)
