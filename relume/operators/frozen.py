"""Freezing: a term's transport along one curve, everything dormant contracted, in the wavelet basis.

T_D4 = T_box · S, with S the orthonormal Daubechies-4 synthesis (appendix B, Ben-Artzi 2006).
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.basis.daubechies import forward
from relume.brdf.term import Term
from relume.light.triangles import TriangleLights
from relume.operators.stream import TILE_SAMPLES, columns_of, stream
from relume.parallel import for_steps
from relume.project.levels import contract_levels, freed, num_levels, project_levels, runs
from relume.project.receivers import Receivers

F32 = NDArray[np.float32]

_SAMPLES_A_STEP = 512


@dataclass(frozen=True)
class Frozen:
    """The linear operator from one curve to the image of one term.

    Attributes:
        transport: wavelet coefficients, samples padded with zeros to whole tiles. (tiles, 3, J, samples) float32
        importance: length of each column over all samples; what a coefficient moves in the picture. (3, J) float64,
            (L, 3, J) over those of each level
        bounds: where the samples of each level begin and end, where coefficients differ from level to level.
            (L + 1,) int64
    """

    transport: F32
    importance: NDArray[np.float64]
    bounds: NDArray[np.int64] | None = None

    @property
    def num_bytes(self) -> int:
        """Memory it holds."""
        return self.transport.nbytes

    def write_image(self, coefficients: NDArray[np.float64], image: F32) -> None:
        """Write Σ_j c_j T_j over an image.

        Args:
            coefficients: c of all columns. (3, J), or (L, 3, J). image: (tiles, 3, samples) float32, overwritten
        """
        image[:] = 0
        self.add(coefficients, image)

    def add(self, change: NDArray[np.float64], image: F32) -> None:
        """Add Σ_j Δc_j T_j to an image; see `write_image`."""
        stream(self.transport, columns_of(change), image, self.bounds)


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
        bands: of all the term's curves, (3, J) each, or (L, 3, J) where one differs from level to level; the active
            one's values do not matter.
        lights, receivers: what arrives, and where.
        progress: called with the share done. cancelled: asked now and then.
    Raises:
        CancelledError: `cancelled` said so.
    """
    contractions = contract_levels(term, freed(bands, [active]), active)
    num_samples, num_bands = len(receivers.normal), contractions[0].num_columns
    tiles, samples = tiles_of(num_samples)
    transport = np.empty((tiles, 3, num_bands, samples), np.float32)
    bounds = level_bounds(receivers, bands, [active])
    squares = np.zeros((1 if bounds is None else len(bounds) - 1, 3, num_bands))
    lock = threading.Lock()

    def step(first: int, last: int) -> None:
        """Project, transform and lay out padded samples [first, last)."""
        for begin, end in _within_tiles(first, last, samples):
            filled = max(begin, min(end, num_samples))
            rows = np.zeros((3, end - begin, num_bands), np.float32)
            if filled > begin:
                projected = project_levels(term, contractions, lights, receivers, begin, filled)
                rows[:, : filled - begin] = projected.transpose(2, 0, 1)
            forward(rows.reshape(-1, num_bands))
            tile, offset = divmod(begin, samples)
            transport[tile, :, :, offset : offset + end - begin] = rows.transpose(0, 2, 1)
            for level, a, b in runs(receivers.level, len(squares), begin, filled):
                some = rows[:, a - begin : b - begin]
                lengths = np.einsum("csj,csj->cj", some, some, dtype=np.float64)
                with lock:
                    squares[level] += lengths

    for_steps(step, tiles * samples, _SAMPLES_A_STEP, progress, cancelled, "freezing")
    return Frozen(transport, np.sqrt(squares if bounds is not None else squares[0]), bounds)


def level_bounds(
    receivers: Receivers, bands: Mapping[str, NDArray[np.float64]], moved: Iterable[str]
) -> NDArray[np.int64] | None:
    """Where the samples of each level begin and end, where the curves that move differ; None where they do not.

    Args:
        receivers: sorted by level. bands: of all curves. moved: names of those that are free.
    Returns:
        (L + 1,) int64
    """
    num = num_levels({name: bands[name] for name in moved})
    if num == 1 or receivers.level is None:
        return None
    return np.searchsorted(receivers.level, np.arange(num + 1)).astype(np.int64)


def _within_tiles(first: int, last: int, samples: int) -> Iterator[tuple[int, int]]:
    """[first, last) cut where a tile of so many samples ends."""
    while first < last:
        end = min(last, (first // samples + 1) * samples)
        yield first, end
        first = end
