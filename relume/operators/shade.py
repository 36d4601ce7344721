"""The image of a term with all curves contracted, before an operator exists.

    Σ_j c_j T_j = Σ_m V L_m Ω_m cos θi · q · Π_f mean_m(f)

The same sums as those of an operator, by another quadrature (`relume.transport.shading.shader`); images differ by
one or two thousandths.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Shaped
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
MakeShader = Callable[[Term, Contraction, TriangleLights, ShadingPoints], Shader]

_MIN_ROWS_PER_STEP, _MAX_ROWS_PER_STEP, _NUM_STEPS = 128, 2048, 8


@dataclass(frozen=True)
class ShadedTerm:
    """An image of one term, before color, texture and outgoing curves."""

    image: Shaped[F32, "tiles 3 samples"]

    @classmethod
    def from_rows(cls, rows: Shaped[F32, "n 3"]) -> ShadedTerm:
        """Create an image from one row per sample, padded with zeros to whole tiles."""
        tiles, samples = tile_layout(len(rows))
        padded = np.zeros((tiles * samples, 3), np.float32)
        padded[: len(rows)] = rows
        return cls(np.ascontiguousarray(padded.reshape(tiles, samples, 3).transpose(0, 2, 1)))

    def rows(self, num_samples: int) -> Shaped[F32, "n 3"]:
        """Return one row per sample."""
        return self.image.transpose(0, 2, 1).reshape(-1, 3)[:num_samples]

    @property
    def num_bytes(self) -> int:
        """Memory in use."""
        return self.image.nbytes


def shaded_bytes(num_samples: int) -> int:
    """Return the memory of a shaded image."""
    tiles, samples = tile_layout(num_samples)
    return tiles * samples * 3 * 4


def shade_rows(
    term: Term,
    contractions: Sequence[Contraction],
    lights: TriangleLights,
    receivers: ShadingPoints,
    start: int,
    stop: int,
    make_shader: MakeShader | None = None,
) -> Shaped[F32, "m 3"]:
    """Contract all curves of a term at receivers [start, stop).

    Args:
        contractions: contractions of the term's curves, none of them free, from `contract_levels`.
        lights, receivers: incident light, and its receivers. make_shader: returns a shader; None: `Shader`.
    """
    if term.texels is not None and receivers.uv is not None:
        return texel_rows(term.texels, lights, receivers, start, stop)
    return project_levels(term, contractions, lights, receivers, start, stop, make_shader or Shader)[:, 0]


@dataclass(frozen=True, eq=False)
class PartialImage:
    """A partially shaded image of one term.

    Attributes:
        rows: one per sample, zero until it is shaded.
        steps: the completed ranges.
    """

    rows: Shaped[F32, "n 3"]
    steps: ResumableLoop

    @classmethod
    def empty(cls, num_samples: int) -> PartialImage:
        """Create an image without shaded samples."""
        grain = min(max(num_samples // _NUM_STEPS, _MIN_ROWS_PER_STEP), _MAX_ROWS_PER_STEP)
        return cls(np.zeros((num_samples, 3), np.float32), ResumableLoop.start(num_samples, grain))

    @property
    def num_bytes(self) -> int:
        """Memory in use."""
        return self.rows.nbytes + self.steps.done.nbytes

    def shade(
        self,
        term: Term,
        bands: Mapping[str, NDArray[np.float64]],
        lights: TriangleLights,
        receivers: ShadingPoints,
        progress: Callable[[float], None],
        is_canceled: Callable[[], bool],
        target_rows: Shaped[NDArray[np.bool_], " n"] | None = None,
        make_shader: MakeShader | None = None,
    ) -> None:
        """Shade the missing samples.

        Args:
            term: term of the image. bands: bands of its curves, as in `shade`.
            lights, receivers: incident light, and receivers.
            progress: called with the completed fraction. is_canceled: polled.
            target_rows: samples to shade, with others of the same ranges; None: all. make_shader: as in `shade_rows`.
        Raises:
            CancelledError: `is_canceled` returned True; completed ranges are kept.
        """
        contractions = contract_levels(term, bands, None)

        def shade_range(start: int, stop: int) -> None:
            self.rows[start:stop] = shade_rows(term, contractions, lights, receivers, start, stop, make_shader)

        self.steps.run(shade_range, progress, is_canceled, "shading", target_rows)


def shade(
    term: Term,
    bands: Mapping[str, NDArray[np.float64]],
    lights: TriangleLights,
    receivers: ShadingPoints,
    progress: Callable[[float], None],
    is_canceled: Callable[[], bool],
    make_shader: MakeShader | None = None,
) -> ShadedTerm:
    """Contract all curves of a term.

    Args:
        bands: bands of each curve that depends on wi. (3, J) each, or (L, 3, J) if it depends on the level
        lights, receivers: incident light, and its receivers.
        progress: called with the completed fraction. is_canceled: polled. make_shader: as in `shade_rows`.
    Raises:
        CancelledError: `is_canceled` returned True.
    """
    partial_image = PartialImage.empty(len(receivers.normal))
    partial_image.shade(term, bands, lights, receivers, progress, is_canceled, make_shader=make_shader)
    return ShadedTerm.from_rows(partial_image.rows)
