"""Incident light at samples that are split into points all over their pixels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.lights.spherical_triangles import TriangleLights
from relume.transport.shading_points import ShadingPoints

F32 = NDArray[np.float32]


class SplitLight(NamedTuple):
    """Incident light of split samples.

    Attributes:
        rows: the samples, counted from the material's first, ascending.
        first: begin of each one's points. lights, points: incident light at all points, sample by sample.
    """

    rows: Shaped[NDArray[np.intp], " k"]
    first: Shaped[NDArray[np.intp], " k"]
    lights: TriangleLights
    points: ShadingPoints

    @property
    def sample(self) -> Shaped[NDArray[np.intp], " points"]:
        """Index in `rows` of the sample of each point."""
        return np.repeat(np.arange(len(self.rows)), np.diff(self.first, append=self.points.points.num_points))

    def mean(self, values: Shaped[F32, "points 3"]) -> Shaped[F32, "k 3"]:
        """Average values of the points of each sample."""
        return group_means(values, self.first, 0)

    def averaged(self, at_samples: Columns, at_points: Columns) -> Columns:
        """Return the columns of an operator at samples, with the mean over the points of those that are split.

        Args:
            at_samples: columns at samples [begin, end), (3, end - begin, J). at_points: the same of points.
        """
        ends = np.append(self.first, self.points.points.num_points)

        def columns(start: int, stop: int) -> F32:
            out, (begin, end) = at_samples(start, stop), np.searchsorted(self.rows, [start, stop])
            if begin < end:
                of_points = at_points(int(ends[begin]), int(ends[end]))
                out[:, self.rows[begin:end] - start] = group_means(of_points, self.first[begin:end] - ends[begin], 1)
            return out

        return columns


Columns = Callable[[int, int], F32]


def group_means(values: NDArray[Any], first: NDArray[np.intp], axis: int) -> F32:
    """Average groups of values along an axis. first: begin of each group"""
    counts = np.diff(first, append=values.shape[axis])
    sums = np.add.reduceat(values, first, axis=axis, dtype=np.float64)
    return np.asarray(sums / counts.reshape(-1, *(1,) * (values.ndim - 1 - axis)), np.float32)
