"""The image of a term with all its curves contracted: what a picture shows before anybody touches a curve.

    Σ_j c_j T_j = Σ_m V L_m Ω_m cos θi · q · Π_f mean_m(f)

The sums that freezing makes, by another quadrature (`relume.project.shading.shader`); pictures differ by a thousandth
or two.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.light.triangles import TriangleLights
from relume.operators.frozen import tiles_of
from relume.project.contraction import Contraction
from relume.project.levels import contract_levels, project_levels
from relume.project.receivers import Receivers
from relume.project.shading.shader import Shader
from relume.project.texels import texel_rows
from relume.steps import Steps

F32 = NDArray[np.float32]

_FEWEST_A_STEP, _MOST_A_STEP, _STEPS = 128, 2048, 8


@dataclass(frozen=True)
class Shaded:
    """An image of one term, before colour, texture and outgoing curves. (tiles, 3, samples) float32"""

    image: F32

    @classmethod
    def of(cls, rows: F32) -> Shaded:
        """From one row for each sample, padded with zeros to whole tiles. rows: (n, 3)"""
        tiles, samples = tiles_of(len(rows))
        padded = np.zeros((tiles * samples, 3), np.float32)
        padded[: len(rows)] = rows
        return cls(np.ascontiguousarray(padded.reshape(tiles, samples, 3).transpose(0, 2, 1)))

    def rows(self, num_samples: int) -> F32:
        """One row for each sample. (num_samples, 3)"""
        return self.image.transpose(0, 2, 1).reshape(-1, 3)[:num_samples]

    @property
    def num_bytes(self) -> int:
        """Memory it holds."""
        return self.image.nbytes


def shaded_bytes(num_samples: int) -> int:
    """Memory that shading needs to keep."""
    tiles, samples = tiles_of(num_samples)
    return tiles * samples * 3 * 4


def shaded_rows(
    term: Term,
    contractions: Sequence[Contraction],
    lights: TriangleLights,
    receivers: Receivers,
    start: int,
    stop: int,
    beside: F32 | None = None,
) -> F32:
    """Contract all curves of a term at receivers [start, stop). (stop - start, 3)

    Args:
        contractions: of the term's curves, none of them free, from `contract_levels`.
        lights, receivers: what arrives, and where. beside: as `Shader` takes it.
    """
    if term.texels is not None and receivers.uv is not None:
        return texel_rows(term.texels, lights, receivers, start, stop)
    shader = Shader if beside is None else partial(Shader, beside=beside)
    return project_levels(term, contractions, lights, receivers, start, stop, shader)[:, 0]


@dataclass(frozen=True, eq=False)
class Begun:
    """An image of one term of which some is shaded.

    Attributes:
        rows: one for each sample, nothing where it is not shaded yet. (n, 3) float32
        steps: which of them are.
    """

    rows: F32
    steps: Steps

    @classmethod
    def of(cls, num_samples: int) -> Begun:
        """Nothing of it."""
        grain = min(max(num_samples // _STEPS, _FEWEST_A_STEP), _MOST_A_STEP)
        return cls(np.zeros((num_samples, 3), np.float32), Steps.of(num_samples, grain))

    @property
    def num_bytes(self) -> int:
        """Memory it holds."""
        return self.rows.nbytes + self.steps.done.nbytes

    def shade(
        self,
        term: Term,
        bands: Mapping[str, NDArray[np.float64]],
        lights: TriangleLights,
        receivers: Receivers,
        progress: Callable[[float], None],
        cancelled: Callable[[], bool],
        wanted: NDArray[np.bool_] | None = None,
    ) -> None:
        """Shade what is lacking of it.

        Args:
            term: it is of. bands: of its curves, as of `shade`. lights, receivers: what arrives, and where.
            progress: called with the share done. cancelled: asked now and then.
            wanted: samples that are shaded, with those beside them; None: all. (n,)
        Raises:
            CancelledError: `cancelled` said so; what was shaded stays.
        """
        contractions = contract_levels(term, bands, None)

        def some(start: int, stop: int) -> None:
            self.rows[start:stop] = shaded_rows(term, contractions, lights, receivers, start, stop)

        self.steps.work(some, progress, cancelled, "shading", wanted)


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
        bands: of each curve that depends on wi. (3, J) each, or (L, 3, J) where it differs from level to level
        lights, receivers: what arrives, and where.
        progress: called with the share done. cancelled: asked now and then.
    Raises:
        CancelledError: `cancelled` said so.
    """
    begun = Begun.of(len(receivers.normal))
    begun.shade(term, bands, lights, receivers, progress, cancelled)
    return Shaded.of(begun.rows)
