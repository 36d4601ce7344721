"""The image of a term with all its curves contracted: what a picture shows before anybody touches a curve.

    Σ_j c_j T_j = Σ_m V L_m Ω_m cos θi · q · Π_f mean_m(f)

The sums that freezing makes, by another quadrature (`relume.transport.shading.shader`); pictures differ by a thousandth
or two.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.core.resumable_loop import ResumableLoop
from relume.lights.spherical_triangles import TriangleLights
from relume.operators.linear_operator import tile_layout
from relume.transport.btf_kernel import texel_rows
from relume.transport.roughness_ranges import contract_levels, project_levels
from relume.transport.shading.shader import Shader
from relume.transport.shading_points import ShadingPoints
from relume.transport.term_contraction import Contraction

F32 = NDArray[np.float32]

_MIN_ROWS_PER_STEP, _MAX_ROWS_PER_STEP, _NUM_STEPS = 128, 2048, 8


@dataclass(frozen=True)
class ShadedTerm:
    """An image of one term, before colour, texture and outgoing curves. (tiles, 3, samples) float32"""

    image: F32

    @classmethod
    def from_rows(cls, rows: F32) -> ShadedTerm:
        """From one row for each sample, padded with zeros to whole tiles. rows: (n, 3)"""
        tiles, samples = tile_layout(len(rows))
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
    tiles, samples = tile_layout(num_samples)
    return tiles * samples * 3 * 4


def shade_rows(
    term: Term,
    contractions: Sequence[Contraction],
    lights: TriangleLights,
    receivers: ShadingPoints,
    start: int,
    stop: int,
    base_radiance: F32 | None = None,
) -> F32:
    """Contract all curves of a term at receivers [start, stop). (stop - start, 3)

    Args:
        contractions: of the term's curves, none of them free, from `contract_levels`.
        lights, receivers: what arrives, and where. base_radiance: as `Shader` takes it.
    """
    if term.texels is not None and receivers.uv is not None:
        return texel_rows(term.texels, lights, receivers, start, stop)
    shader = Shader if base_radiance is None else partial(Shader, base_radiance=base_radiance)
    return project_levels(term, contractions, lights, receivers, start, stop, shader)[:, 0]


@dataclass(frozen=True, eq=False)
class PartialImage:
    """An image of one term of which some is shaded.

    Attributes:
        rows: one for each sample, nothing where it is not shaded yet. (n, 3) float32
        steps: which of them are.
    """

    rows: F32
    steps: ResumableLoop

    @classmethod
    def empty(cls, num_samples: int) -> PartialImage:
        """Nothing of it."""
        grain = min(max(num_samples // _NUM_STEPS, _MIN_ROWS_PER_STEP), _MAX_ROWS_PER_STEP)
        return cls(np.zeros((num_samples, 3), np.float32), ResumableLoop.start(num_samples, grain))

    @property
    def num_bytes(self) -> int:
        """Memory it holds."""
        return self.rows.nbytes + self.steps.done.nbytes

    def shade(
        self,
        term: Term,
        bands: Mapping[str, NDArray[np.float64]],
        lights: TriangleLights,
        receivers: ShadingPoints,
        progress: Callable[[float], None],
        is_canceled: Callable[[], bool],
        target_rows: NDArray[np.bool_] | None = None,
    ) -> None:
        """Shade what is lacking of it.

        Args:
            term: it is of. bands: of its curves, as of `shade`. lights, receivers: what arrives, and where.
            progress: called with the share done. is_canceled: asked now and then.
            target_rows: samples that are shaded, with those beside them; None: all. (n,)
        Raises:
            CancelledError: `is_canceled` said so; what was shaded stays.
        """
        contractions = contract_levels(term, bands, None)

        def shade_range(start: int, stop: int) -> None:
            self.rows[start:stop] = shade_rows(term, contractions, lights, receivers, start, stop)

        self.steps.run(shade_range, progress, is_canceled, "shading", target_rows)


def shade(
    term: Term,
    bands: Mapping[str, NDArray[np.float64]],
    lights: TriangleLights,
    receivers: ShadingPoints,
    progress: Callable[[float], None],
    is_canceled: Callable[[], bool],
) -> ShadedTerm:
    """Contract all curves of a term.

    Args:
        bands: of each curve that depends on wi. (3, J) each, or (L, 3, J) where it differs from level to level
        lights, receivers: what arrives, and where.
        progress: called with the share done. is_canceled: asked now and then.
    Raises:
        CancelledError: `is_canceled` said so.
    """
    partial_image = PartialImage.empty(len(receivers.normal))
    partial_image.shade(term, bands, lights, receivers, progress, is_canceled)
    return ShadedTerm.from_rows(partial_image.rows)
