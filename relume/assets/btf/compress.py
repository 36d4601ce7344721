"""Compression of a BTF: two coders behind one interface, and the smaller result for an error bound.

Clusters and weights per view (`relume.assets.btf.per_view_coder`) follow relief that moves across texels from one view
to the next. Whole BRDFs (`relume.assets.btf.whole_brdf_coder`, Müller 2004) store one weight vector per texel for all
views, which is smaller for flat materials. Both give the same `LocalPcaBtf`.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.btf.compressed_view import CompressedView, Span, ViewArrays, compute_span, stack_views, view_rows
from relume.assets.btf.local_pca_btf import LocalPcaBtf, SharedTexels
from relume.assets.btf.parallax import visible_texels
from relume.assets.btf.partial_results import Arrays, PartialCompression, as_arrays
from relume.assets.btf.per_view_coder import PcaChoice, choose_pca, compress_view
from relume.assets.btf.stored_arrays import stored_bytes
from relume.assets.btf.whole_brdf_coder import CodePlan, WholeBrdfs, code_view, make_plan, project_brdfs
from relume.core.errors import CancelledError, MaterialError

F32 = NDArray[np.float32]

MAX_TEXELS = 512 * 512
# texels times directions: values of one view take 400 MB, and up to four copies exist
_MAX_TEXEL_DIRECTIONS = 1 << 25
_NUM_CHOICE_VIEWS = 5  # views for choosing the parameters per view
_CHOICE_END, _VIEWS_END, _PLAN_END = 0.1, 0.6, 0.75  # approximate fractions of the time
FLAT = np.zeros((1, 1), np.float32)
"""Height of a BTF without relief, or of unknown relief."""


def max_texels(directions: int) -> int:
    """Largest allowed number of texels for a number of directions."""
    return min(MAX_TEXELS, _MAX_TEXEL_DIRECTIONS // directions)


def compress(
    images: ViewArrays,
    bound: float,
    progress: Callable[[float], object],
    is_canceled: Callable[[], bool],
    partial_compression: PartialCompression | None = None,
    height: Shaped[F32, "height width"] = FLAT,
) -> LocalPcaBtf:
    """Compress a BTF to as few bytes as an error bound allows, by the better of both coders.

    Args:
        images: the BTF. bound: allowed relative RMS error.
        progress: called with the completed fraction. is_canceled: checked before each view.
        partial_compression: stores partial results, and provides earlier ones.
        height: height of the relief, in side lengths of the texture.
    Raises:
        MaterialError: values are not finite, or negative, or the BTF is black. CancelledError: `is_canceled` is true.
    """
    (rows, columns), num_views = images.size, images.grid.num_directions
    if not 0 < rows * columns <= max_texels(num_views):
        raise MaterialError(
            f"the BTF has {columns}×{rows} texels, the limit for {num_views} directions is {max_texels(num_views):,}; "
            "scale it down"
        )
    with tempfile.TemporaryDirectory() as folder:
        coders = Coders(
            images, height, progress, is_canceled, partial_compression or PartialCompression(Path(folder), {})
        )
        per_view = coders.per_view(bound)
        whole = coders.whole_brdfs(bound, stored_bytes(per_view) if per_view.error[-1] <= bound else float("inf"))
        progress(1.0)
    if whole is None:
        return per_view
    rank_per_view, rank_whole = ((max(btf.error[-1], bound), stored_bytes(btf)) for btf in (per_view, whole))
    return whole if rank_whole < rank_per_view else per_view


class Coders:
    """Both coders on the same images; what they share is computed once.

    Args:
        images, height, progress, is_canceled: see `compress`. partial_compression: stores spans of views, and results.
    """

    def __init__(
        self,
        images: ViewArrays,
        height: F32,
        progress: Callable[[float], object],
        is_canceled: Callable[[], bool],
        partial_compression: PartialCompression,
    ) -> None:
        self._images, self._height, self._progress, self._is_canceled = images, height, progress, is_canceled
        self._partial = partial_compression
        self._num_views = images.grid.num_directions

    def per_view(self, bound: float) -> LocalPcaBtf:
        """Compress each view by itself, with as few components as keep the bound."""
        arrays = self._partial.load_or_compute(f"choice-{bound}", lambda: as_arrays(self._choose(bound)))
        choice = PcaChoice(int(arrays["clusters"]), int(arrays["components"]), arrays["bits"])
        views = []
        for view in range(self._num_views):
            self._report(_CHOICE_END + (_VIEWS_END - _CHOICE_END) * view / self._num_views)
            arrays = self._partial.load_or_compute(f"view-{view}-{bound}", partial(self._per_view, choice, view))
            views.append(CompressedView(**arrays))
        return _shortest(stack_views(self._images, views, self._height), bound)

    def whole_brdfs(self, bound: float, max_bytes: float = float("inf")) -> LocalPcaBtf | None:
        """Compress whole BRDFs; None if the bound is out of reach, or more than `max_bytes` are expected."""
        source = visible_texels(self._height, self._images.grid, self._images.size)
        self._report(_VIEWS_END)
        arrays = self._partial.load_or_compute(
            "brdfs", lambda: as_arrays(project_brdfs(self._span, source, self._num_views))
        )
        brdfs = WholeBrdfs(arrays["z"], *(arrays[name].item() for name in WholeBrdfs._fields[1:]))
        arrays = self._partial.load_or_compute(f"plan-{bound}", lambda: as_arrays(make_plan(brdfs, bound, self._poll)))
        plan = CodePlan(**{**arrays, "size": arrays["size"].item()})
        if not plan.size < max_bytes:
            return None
        views = []
        for view in range(self._num_views):
            self._report(_PLAN_END + (1 - _PLAN_END) * view / self._num_views)
            code = partial(self._whole_brdfs, plan, source[view], view)
            views.append(CompressedView(**self._partial.load_or_compute(f"whole-{view}-{bound}", code)))
        shared = SharedTexels(plan.cluster, plan.weight)
        return _shortest(stack_views(self._images, views, self._height, shared), bound)

    def _poll(self) -> None:
        if self._is_canceled():
            raise CancelledError("the compression was canceled")

    def _report(self, fraction: float) -> None:
        self._poll()
        self._progress(fraction)

    def _choose(self, bound: float) -> PcaChoice:
        """Choose clusters, components and bits on a subset of the views."""
        sampled_views = np.unique(np.linspace(0, self._num_views - 1, _NUM_CHOICE_VIEWS).round().astype(int))
        spans = []
        for index, view in enumerate(sampled_views):
            self._report(_CHOICE_END * index / len(sampled_views))
            spans.append(self._span(int(view)))
        return choose_pca(spans, bound)

    def _span(self, view: int, rows: F32 | None = None) -> Span:
        """Load or compute the span of a view, from its `rows` if the caller has them."""

        def compute() -> Arrays:
            return as_arrays(compute_span(view_rows(self._images, view) if rows is None else rows))

        self._poll()
        arrays = self._partial.load_or_compute(f"span-{view}", compute)
        return Span(arrays["z"], arrays["basis"], arrays["center"], arrays["residual"].item(), arrays["energy"].item())

    def _per_view(self, choice: PcaChoice, view: int) -> Arrays:
        rows = view_rows(self._images, view)
        return as_arrays(compress_view(rows, self._span(view, rows), self._images.size, choice, view))

    def _whole_brdfs(self, plan: CodePlan, source: NDArray[np.int32], view: int) -> Arrays:
        rows = view_rows(self._images, view)
        return as_arrays(code_view(rows, self._span(view, rows), self._images.size, plan, source))


def _shortest(btf: LocalPcaBtf, bound: float) -> LocalPcaBtf:
    """Keep as few components as the bound allows."""
    return btf.with_components(next((j for j, rms in enumerate(btf.error) if rms <= bound), btf.num_components))
