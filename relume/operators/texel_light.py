"""Light at the samples of a texture that looks different from every side, kept while texels are summed anew."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.terms.btf import BtfRef
from relume.core.thread_pools import for_ranges, parallel_for_cancellable
from relume.lights.spherical_triangles import TriangleLights
from relume.operators.shade import ShadedTerm
from relume.transport.btf_kernel import outgoing_rows
from relume.transport.shading_points import ShadingPoints
from relume.transport.texture_light import rotated_tables, texture_light_rows

F32 = NDArray[np.float32]

_SAMPLES_PER_RANGE = 1024
_MAX_CLUSTERS_PER_SAMPLE = 8  # a sample, in which its texels are, at most
_MAX_TABLE_ROWS = 12_000_000  # rows of tables: half a second of two cores


@dataclass(frozen=True, eq=False)
class BtfIncidentLight:
    """What arrives at n samples from each direction in which a BTF is known.

    Attributes:
        light: see `relume.transport.texture_light`. (n, 3, L) float32
        rotation: of the texture in whose frames the directions are, radians.
    """

    light: F32
    rotation: float

    @property
    def num_bytes(self) -> int:
        """Memory it holds."""
        return self.light.nbytes

    def shade(self, btf_ref: BtfRef, receivers: ShadingPoints) -> ShadedTerm:
        """The image of a BTF of the same directions, in the threads of the caller.

        A texture that was turned since is lit nearly: light is spread by up to a step of a ring.

        Args:
            btf_ref: how the samples are covered. receivers: the samples; light need not be with them.
        """
        tables, rotation_delta = btf_ref.tables, btf_ref.rotation - self.rotation
        if rotation_delta:
            tables = rotated_tables(btf_ref.btf.grid, tables, rotation_delta)
        rows = np.empty((len(self.light), 3), np.float32)

        def shade_range(start: int, stop: int) -> None:
            rows[start:stop] = outgoing_rows(btf_ref, tables, self.light[start:stop], receivers, start)

        for_ranges(shade_range, len(rows), _SAMPLES_PER_RANGE)
        return ShadedTerm.from_rows(rows)


def fits_budget(btf_ref: BtfRef, num_samples: int) -> bool:
    """Whether a frame can wait for texels to be summed anew: each sample sums the tables of clusters about it."""
    clusters = min(btf_ref.btf.mean.shape[1], _MAX_CLUSTERS_PER_SAMPLE)
    return bool(num_samples * clusters * (1 + btf_ref.btf.num_components) <= _MAX_TABLE_ROWS)


def incident_light_bytes(btf_ref: BtfRef, num_samples: int) -> int:
    """Memory that keeping it takes."""
    return 4 * 3 * btf_ref.btf.grid.num_directions * num_samples


def collect_light(
    btf_ref: BtfRef,
    lights: TriangleLights,
    receivers: ShadingPoints,
    progress: Callable[[float], None],
    is_canceled: Callable[[], bool],
) -> BtfIncidentLight:
    """Share light out to the directions of a BTF.

    Args:
        btf_ref: how samples are covered. lights, receivers: what arrives, and where.
        progress: called with the share done. is_canceled: asked now and then.
    Raises:
        CancelledError: `is_canceled` said so.
    """
    num_samples = len(receivers.normal)
    light = np.empty((num_samples, 3, btf_ref.btf.grid.num_directions), np.float32)

    def step(start: int, stop: int) -> None:
        light[start:stop] = texture_light_rows(btf_ref, lights, receivers, start, stop)

    parallel_for_cancellable(step, num_samples, _SAMPLES_PER_RANGE, progress, is_canceled, "shading")
    return BtfIncidentLight(light, btf_ref.rotation)


def indirect_texel_light(
    btf_ref: BtfRef, sampled: BtfIncidentLight, weights: Any, receivers: ShadingPoints
) -> ShadedTerm:
    """The image of a BTF in light that is known at a few of its samples: texels are each sample's own.

    Args:
        btf_ref: how all samples are covered. sampled: what arrives at a few of them.
        weights: of these in each. (samples, few samples) sparse float32
        receivers: all samples; light need not be with them.
    """
    num_samples, num_sampled = weights.shape
    flat_light = sampled.light.reshape(num_sampled, -1)
    rows = np.empty((num_samples, 3), np.float32)

    def shade_range(start: int, stop: int) -> None:
        light = (weights[start:stop] @ flat_light).reshape(stop - start, *sampled.light.shape[1:])
        rows[start:stop] = outgoing_rows(btf_ref, btf_ref.tables, light, receivers, start)

    for_ranges(shade_range, num_samples, _SAMPLES_PER_RANGE)
    return ShadedTerm.from_rows(rows)
