"""Light at the samples of a texture that looks different from every side, kept while texels are summed anew."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.terms.btf import Texels
from relume.light.triangles import TriangleLights
from relume.operators.shade import Shaded
from relume.parallel import for_ranges, for_steps
from relume.project.arrived import arrived_rows, turned_tables
from relume.project.receivers import Receivers
from relume.project.texels import sent_rows

F32 = NDArray[np.float32]

_SAMPLES_A_RANGE = 1024
_CLUSTERS_ABOUT = 8  # a sample, in which its texels are, at most
_QUICK = 12_000_000  # rows of tables: half a second of two cores


@dataclass(frozen=True, eq=False)
class Arrived:
    """What arrives at n samples from each direction in which a BTF is known.

    Attributes:
        light: see `relume.project.arrived`. (n, 3, L) float32
        rotation: of the texture in whose frames the directions are, radians.
    """

    light: F32
    rotation: float

    @property
    def num_bytes(self) -> int:
        """Memory it holds."""
        return self.light.nbytes

    def sent(self, texels: Texels, receivers: Receivers) -> Shaded:
        """The image of a BTF of the same directions, in the threads of the caller.

        A texture that was turned since is lit nearly: light is spread by up to a step of a ring.

        Args:
            texels: how the samples are covered. receivers: the samples; light need not be with them.
        """
        tables, turned = texels.tables, texels.rotation - self.rotation
        if turned:
            tables = turned_tables(texels.btf.rings, tables, turned)
        rows = np.empty((len(self.light), 3), np.float32)

        def send(start: int, stop: int) -> None:
            rows[start:stop] = sent_rows(texels, tables, self.light[start:stop], receivers, start)

        for_ranges(send, len(rows), _SAMPLES_A_RANGE)
        return Shaded.of(rows)


def is_quick(texels: Texels, num_samples: int) -> bool:
    """Whether a frame can wait for texels to be summed anew: each sample sums the tables of clusters about it."""
    clusters = min(texels.btf.mean.shape[1], _CLUSTERS_ABOUT)
    return bool(num_samples * clusters * (1 + texels.btf.num_components) <= _QUICK)


def arrived_bytes(texels: Texels, num_samples: int) -> int:
    """Memory that keeping it takes."""
    return 4 * 3 * texels.btf.rings.num_directions * num_samples


def arrive(
    texels: Texels,
    lights: TriangleLights,
    receivers: Receivers,
    progress: Callable[[float], None],
    cancelled: Callable[[], bool],
) -> Arrived:
    """Share light out to the directions of a BTF.

    Args:
        texels: how samples are covered. lights, receivers: what arrives, and where.
        progress: called with the share done. cancelled: asked now and then.
    Raises:
        CancelledError: `cancelled` said so.
    """
    num_samples = len(receivers.normal)
    light = np.empty((num_samples, 3, texels.btf.rings.num_directions), np.float32)

    def step(start: int, stop: int) -> None:
        light[start:stop] = arrived_rows(texels, lights, receivers, start, stop)

    for_steps(step, num_samples, _SAMPLES_A_RANGE, progress, cancelled, "shading")
    return Arrived(light, texels.rotation)


def sent_between(texels: Texels, few: Arrived, weights: Any, receivers: Receivers) -> Shaded:
    """The image of a BTF in light that is known at a few of its samples: texels are each sample's own.

    Args:
        texels: how all samples are covered. few: what arrives at a few of them.
        weights: of these in each. (samples, few samples) sparse float32
        receivers: all samples; light need not be with them.
    """
    num_samples, num_few = weights.shape
    flat = few.light.reshape(num_few, -1)
    rows = np.empty((num_samples, 3), np.float32)

    def send(start: int, stop: int) -> None:
        light = (weights[start:stop] @ flat).reshape(stop - start, *few.light.shape[1:])
        rows[start:stop] = sent_rows(texels, texels.tables, light, receivers, start)

    for_ranges(send, num_samples, _SAMPLES_A_RANGE)
    return Shaded.of(rows)
