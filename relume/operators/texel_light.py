"""Incident light at samples with a BTF, cached while texels are summed again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Shaped
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
_MAX_CLUSTERS_PER_SAMPLE = 8  # maximum number of clusters of a sample's texels
_MAX_TABLE_ROWS = 12_000_000  # rows of tables: half a second on two cores


@dataclass(frozen=True, eq=False)
class BtfIncidentLight:
    """Incident light of n samples in the direction basis of a BTF.

    Attributes:
        light: see `relume.transport.texture_light`.
        rotation: rotation of the texture that defines the frames, radians.
    """

    light: Shaped[F32, "n 3 L"]
    rotation: float

    @property
    def num_bytes(self) -> int:
        """Memory in use."""
        return self.light.nbytes

    def shade(self, btf_ref: BtfRef, receivers: ShadingPoints) -> ShadedTerm:
        """Return the image of a BTF with the same directions, in the threads of the caller.

        After a rotation of the texture it is approximate: light is blurred by up to one step of a ring.

        Args:
            btf_ref: the BTF and its mapping. receivers: the samples; their light is not used.
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
    """Return True if texels can be summed again within a frame: each sample sums the tables of nearby clusters."""
    clusters = min(btf_ref.btf.mean.shape[1], _MAX_CLUSTERS_PER_SAMPLE)
    return bool(num_samples * clusters * (1 + btf_ref.btf.num_components) <= _MAX_TABLE_ROWS)


def incident_light_bytes(btf_ref: BtfRef, num_samples: int) -> int:
    """Return the memory of `BtfIncidentLight`."""
    return 4 * 3 * btf_ref.btf.grid.num_directions * num_samples


def collect_light(
    btf_ref: BtfRef,
    lights: TriangleLights,
    receivers: ShadingPoints,
    progress: Callable[[float], None],
    is_canceled: Callable[[], bool],
) -> BtfIncidentLight:
    """Project incident light onto the direction basis of a BTF.

    Args:
        btf_ref: the BTF and its mapping. lights, receivers: incident light, and its receivers.
        progress: called with the completed fraction. is_canceled: polled.
    Raises:
        CancelledError: `is_canceled` returned True.
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
    """Return the image of a BTF with light interpolated from few samples; texels are those of each sample.

    Args:
        btf_ref: the BTF and its mapping at all samples. sampled: incident light at few samples.
        weights: interpolation weights. (samples, few samples) sparse float32
        receivers: all samples; their light is not used.
    """
    num_samples, num_sampled = weights.shape
    flat_light = sampled.light.reshape(num_sampled, -1)
    rows = np.empty((num_samples, 3), np.float32)

    def shade_range(start: int, stop: int) -> None:
        light = (weights[start:stop] @ flat_light).reshape(stop - start, *sampled.light.shape[1:])
        rows[start:stop] = outgoing_rows(btf_ref, btf_ref.tables, light, receivers, start)

    for_ranges(shade_range, num_samples, _SAMPLES_PER_RANGE)
    return ShadedTerm.from_rows(rows)
