"""Freezing: a term's transport along one curve, everything dormant contracted, in the wavelet basis.

T_D4 = T_box · S, with S the orthonormal Daubechies-4 synthesis (appendix B, Ben-Artzi 2006).
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.basis.daubechies import forward
from relume.brdf.term import Term
from relume.light.triangles import TriangleLights
from relume.operators.stream import TILE_SAMPLES, columns_of, stream
from relume.parallel import for_steps
from relume.project.contraction import contract
from relume.project.projector import Projector
from relume.project.receivers import Receivers

F32 = NDArray[np.float32]

_SAMPLES_A_STEP = 512


@dataclass(frozen=True)
class Frozen:
    """The linear operator from one curve to the image of one term.

    Attributes:
        transport: wavelet coefficients, samples padded with zeros to whole tiles. (tiles, 3, J, samples) float32
        importance: length of each column over all samples; what a coefficient moves in the picture. (3, J) float64
    """

    transport: F32
    importance: NDArray[np.float64]

    @property
    def num_bytes(self) -> int:
        """Memory it holds."""
        return self.transport.nbytes

    def write_image(self, coefficients: NDArray[np.float64], image: F32) -> None:
        """Write Σ_j c_j T_j over an image.

        Args:
            coefficients: c of all columns. (3, J). image: (tiles, 3, samples) float32, overwritten
        """
        image[:] = 0
        stream(self.transport, columns_of(coefficients), image)


def tiles_of(num_samples: int) -> tuple[int, int]:
    """Number of tiles, and samples a tile, that hold so many samples: tiles alike, none much larger than needed."""
    tiles = max(1, -(-num_samples // TILE_SAMPLES))
    samples = -(-num_samples // tiles)
    return tiles, -(-max(1, samples) // 16) * 16


def frozen_bytes(num_samples: int, num_bands: int) -> int:
    """Memory that freezing needs to keep."""
    tiles, samples = tiles_of(num_samples)
    return tiles * samples * 3 * num_bands * 4


def freeze(
    term: Term,
    bands: Mapping[str, NDArray[np.float64]],
    active: str,
    lights: TriangleLights,
    receivers: Receivers,
    progress: Callable[[float], None],
    cancelled: Callable[[], bool],
) -> Frozen:
    """Project all receivers along a curve.

    Args:
        bands: of all the term's curves, (3, J) each; the active one's values do not matter.
        lights, receivers: what arrives, and where.
        progress: called with the share done. cancelled: asked now and then.
    Raises:
        CancelledError: `cancelled` said so.
    """
    contraction = contract(term, bands, active)
    num_samples, num_bands = len(receivers.normal), contraction.num_columns
    tiles, samples = tiles_of(num_samples)
    transport = np.empty((tiles, 3, num_bands, samples), np.float32)
    squares = np.zeros((3, num_bands))
    lock = threading.Lock()

    def step(first: int, last: int) -> None:
        """Project, transform and lay out padded samples [first, last)."""
        projector = Projector(term, contraction, lights, receivers)
        for begin, end in _within_tiles(first, last, samples):
            filled = max(begin, min(end, num_samples))
            rows = np.zeros((3, end - begin, num_bands), np.float32)
            if filled > begin:
                rows[:, : filled - begin] = projector.project(begin, filled).transpose(2, 0, 1)
            forward(rows.reshape(-1, num_bands))
            tile, offset = divmod(begin, samples)
            transport[tile, :, :, offset : offset + end - begin] = rows.transpose(0, 2, 1)
            with lock:
                np.add(squares, np.einsum("csj,csj->cj", rows, rows, dtype=np.float64), out=squares)

    for_steps(step, tiles * samples, _SAMPLES_A_STEP, progress, cancelled, "freezing")
    return Frozen(transport, np.sqrt(squares))


def _within_tiles(first: int, last: int, samples: int) -> Iterator[tuple[int, int]]:
    """[first, last) cut where a tile of so many samples ends."""
    while first < last:
        end = min(last, (first // samples + 1) * samples)
        yield first, end
        first = end
