"""The image of a term with all its curves contracted: what a picture shows before anybody touches a curve.

    Σ_j c_j T_j = Σ_m V L_m Ω_m cos θi · q · Π_f mean_m(f)

The same sums as freezing makes, in another order, so that a picture does not change when a curve is frozen.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.errors import CancelledError
from relume.light.triangles import TriangleLights
from relume.parallel import for_ranges
from relume.transfer.contraction import contract
from relume.transfer.frozen import tiles_of
from relume.transfer.projector import Projector
from relume.transfer.receivers import Receivers

F32 = NDArray[np.float32]

_SAMPLES_A_STEP = 512


@dataclass(frozen=True)
class Shaded:
    """An image of one term, before colour, texture and outgoing curves. (tiles, 3, samples) float32"""

    image: F32

    @property
    def num_bytes(self) -> int:
        """Memory it holds."""
        return self.image.nbytes


def shaded_bytes(num_samples: int) -> int:
    """Memory that shading needs to keep."""
    tiles, samples = tiles_of(num_samples)
    return tiles * samples * 3 * 4


def shade(
    term: Term,
    bands: Mapping[str, NDArray[np.float64]],
    lights: TriangleLights,
    receivers: Receivers,
    progress: Callable[[float], None],
    cancelled: Callable[[], bool],
) -> Shaded:
    """Contract all curves of a term.

    Args:
        bands: of each curve that depends on wi. (3, J) each
        progress: called with the share done. cancelled: asked now and then.
    Raises:
        CancelledError: `cancelled` said so.
    """
    num_samples = len(receivers.normal)
    tiles, samples = tiles_of(num_samples)
    rows = np.zeros((tiles * samples, 3), np.float32)
    contraction = contract(term, bands, None)
    lock, done = threading.Lock(), [0]

    def step(start: int, stop: int) -> None:
        if cancelled():
            raise CancelledError("shading was cancelled")
        rows[start:stop] = Projector(term, contraction, lights, receivers).project(start, stop)[:, 0]
        with lock:
            done[0] += stop - start
            progress(done[0] / num_samples)

    for_ranges(step, num_samples, _SAMPLES_A_STEP)
    return Shaded(np.ascontiguousarray(rows.reshape(tiles, samples, 3).transpose(0, 2, 1)))
