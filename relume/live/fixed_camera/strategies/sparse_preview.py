"""A preview of other light: one sample of each small square of pixels is shaded, those between are interpolated.

When the environment is turned or exchanged, or surfaces reflect other light onto each other, every image of a picture
counts for nothing at once, and shading all samples takes seconds; so it does where a view is opened for the first time,
and for one term where a parameter changes that its operators are frozen with.
A preview costs a few thousand samples whatever the picture's size, holds no operator, and lets the hand see where the
light goes; colours and textures multiply it at full size. It is never called exact: at rest all is shaded. Where that
takes long, as of a large picture, finer previews come before, each of eight times as many samples.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from relume.brdf.term import Term
from relume.live.fixed_camera.displayed import DisplayedImage
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination, direct_only
from relume.live.fixed_camera.jobs import CancelCheck, ProgressCallback, TermTarget
from relume.live.fixed_camera.priority_region import with_samples
from relume.live.fixed_camera.protocols import FixedViewTransfer, SampledShading
from relume.live.fixed_camera.view_images import ViewImages
from relume.look.model import Rgb
from relume.operators.shade import ShadedTerm, shade
from relume.operators.texel_light import collect_light, fits_budget, indirect_texel_light
from relume.views.pixel_blocks import nearest_chosen, one_per_block
from relume.views.view import View

F32 = NDArray[np.float32]

_MAX_SHADED = 6000  # samples of a view, about
_MAX_SHADED_AT_ONCE = 8 * _MAX_SHADED  # samples of terms of a view; they take about as long as choosing some of them
_DETAIL_FACTOR = 8  # times as many samples
_MIN_FINER_RATIO = 16  # times as many as a finer preview shades; where fewer are left, all are shaded
_NUM_NEIGHBORS = 3
_SOFTENING = 0.5  # pixels²; a sample's own neighbours share it where they are as near as this


@dataclass(frozen=True)
class SampleSubset:
    """The samples of a material that are shaded, and how all others are made from them.

    Attributes:
        samples: the samples. weights: rows sum to one. (samples, few samples) sparse float32
    """

    samples: SampledShading
    weights: Any

    @property
    def num_bytes(self) -> int:
        """Memory it holds."""
        weights = self.weights
        return int(self.samples.num_bytes + weights.data.nbytes + weights.indices.nbytes + weights.indptr.nbytes)


def choose_samples(
    transfer: FixedViewTransfer, view: View, material: int, detail: int, *, has_indirect: bool
) -> SampleSubset:
    """One sample of each square of pixels that a material is seen in; reads the store.

    Those between take the mean of the nearest, by place in the picture and by normal.

    Args:
        transfer: an opened bake. view: one of its views. material: index of the material.
        detail: how often the samples are made more. has_indirect: they are shaded with light between surfaces.
    """
    step = max(1, int(np.ceil(np.sqrt(view.num_surface_samples / _num_shaded(detail)))))
    sample_indices = one_per_block(view, material, step)
    neighbors, weight = nearest_chosen(view, material, sample_indices, step, _NUM_NEIGHBORS, _SOFTENING)
    first, shape = np.arange(0, weight.size + 1, weight.shape[1]), (len(weight), len(sample_indices))
    weights = csr_array((weight.ravel(), neighbors.ravel(), first), shape=shape)
    weights.eliminate_zeros()
    return SampleSubset(transfer.subset(view, material, sample_indices, has_indirect=has_indirect), weights)


def _num_shaded(detail: int) -> int:
    return _MAX_SHADED * int(_DETAIL_FACTOR**detail)


def _sample_subset(images: ViewImages, material: int, light: Illumination, detail: int) -> SampleSubset:
    """Of a material of a view, kept in the cache with the operators; of finer previews for a while."""
    has_indirect = light.paths.has_indirect

    def choose() -> SampleSubset:
        return choose_samples(images.transfer, images.view, material, detail, has_indirect=has_indirect)

    cache = images.cache.transient if detail else images.cache
    return cache.get(_key(images, material, light, detail), SampleSubset, _subset_bytes(images, material), choose)


def _key(images: ViewImages, material: int, light: Illumination, detail: int = 0) -> tuple[Hashable, ...]:
    return images.transfer.key, *images.view.sample_key(material), "sparse", light.paths.has_indirect, detail


def _subset_bytes(images: ViewImages, material: int) -> int:
    """Memory that `Sparse` takes at most, but for the few samples themselves."""
    rows = images.view.rows(material)
    return int(rows.stop - rows.start) * (_NUM_NEIGHBORS * 12 + 8)


def can_preview(images: ViewImages) -> bool:
    """Whether the cache has room for it beside other things."""
    return 2 * sum(_subset_bytes(images, k) for k in range(len(images.by_name))) <= images.cache.budget_bytes


def is_needed_for_first_frame(images: ViewImages) -> bool:
    """Whether a picture that shows nothing yet is seen much sooner so than by making the images that it lacks."""
    num_missing = sum(m.num_samples for m, image in images.terms() if not images.is_cached(m, image))
    return num_missing > _MAX_SHADED_AT_ONCE and can_preview(images)


def should_refine(num_samples: int, detail: int) -> bool:
    """Whether shading so many samples takes so long that a preview of one more detail than this is worth its while."""
    return num_samples > _MIN_FINER_RATIO * _num_shaded(detail + 1)


def is_prepared(images: ViewImages) -> bool:
    """Whether the samples have been chosen: the first preview of a view takes a second more."""
    materials = {material.index for material, _ in images.terms()}
    return all(
        images.cache.get_cached(_key(images, index, images.light), SampleSubset) is not None for index in materials
    )


@dataclass(frozen=True)
class _TermSnapshot:
    """One term, as it was when the preview was asked for."""

    target: TermTarget
    term: Term
    bands: Mapping[str, NDArray[np.float64]]


@dataclass(frozen=True, eq=False)
class SparsePreview:
    """Rough images of terms in one light; the only route that reaches any light, from nothing.

    Attributes:
        gain: what multiplies the finished picture in that light.
        detail: how often it is made finer.
    """

    key: tuple[Hashable, ...]
    images: ViewImages
    light: Illumination
    gain: Rgb
    snapshots: Sequence[_TermSnapshot]
    label: str = "the light"
    detail: int = 0
    is_refinement: bool = False

    state: Literal["precomputing", "shading"] = "shading"
    is_resumable = False

    @classmethod
    def for_targets(cls, images: ViewImages, targets: Iterable[TermTarget], label: str) -> SparsePreview:
        """Preview the terms of these targets of a picture's images in the current look. label: in messages."""
        targets = list(targets)
        snapshots = [_TermSnapshot(target, target.live.term, target.live.target_bands) for target in targets]
        image_keys = (images.image_key(target.material, target.live, images.light) for target in targets)
        key = images.transfer.key, images.view.name, images.light, *image_keys
        return cls(key, images, images.light, images.gain, snapshots, label)

    def with_detail(self, detail: int, *, is_refinement: bool) -> SparsePreview:
        """The same of more samples. refines: it can wait for hands."""
        return replace(self, key=(*self.key, detail), detail=detail, is_refinement=is_refinement)

    def direct_only_first(self) -> SparsePreview:
        """The same of what light comes straight: that between surfaces takes some seconds where it is not known."""
        return replace(self, key=(*self.key, "direct"), light=direct_only(self.light))

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> list[F32]:
        """See `Job`. Returns images of all parts, (tiles, 3, samples) float32 each."""
        previews = []
        for k, snapshot in enumerate(self.snapshots):
            subset = _sample_subset(self.images, snapshot.target.material.index, self.light, self.detail)
            previews.append(self._preview_image(snapshot, subset, is_canceled))
            progress((k + 1) / len(self.snapshots))
        return previews

    def _preview_image(self, snapshot: _TermSnapshot, subset: SampleSubset, is_canceled: CancelCheck) -> F32:
        """One term's image, (tiles, 3, samples) float32; a texture's samples have texels of their own, if quick."""
        incident, btf_ref = subset.samples.incident_light(self.light), snapshot.term.texels
        if btf_ref is None or not fits_budget(btf_ref, snapshot.target.material.num_samples):
            return _interpolate(
                shade(snapshot.term, snapshot.bands, *incident, _ignore_progress, is_canceled), subset.weights
            )
        receivers = self.images.unlit_samples(snapshot.target.material)
        return indirect_texel_light(
            btf_ref, collect_light(btf_ref, *incident, _ignore_progress, is_canceled), subset.weights, receivers
        ).image

    def install(self, result: Sequence[F32]) -> None:
        """See `Job`; also where the hand has turned the light further meanwhile."""
        for snapshot, image in zip(self.snapshots, result, strict=True):
            live = snapshot.target.live
            is_incremental = live.ready.fidelity == Fidelity.INCREMENTAL and live.ready.light == live.light
            # with other fixed parameters it is a glimpse of it as well
            is_same = live.term.model == snapshot.term.model
            if is_same and not (live.is_converged or is_incremental) and snapshot.target.exists():
                live.set_ready(self._merge(snapshot, image))

    def _merge(self, snapshot: _TermSnapshot, image: F32) -> DisplayedImage:
        """The image in the place of what is ready; a part of that which is exact already stays."""
        ready, material = snapshot.target.live.ready, snapshot.target.material
        preview = replace(ready, image=image, fidelity=Fidelity.PREVIEW, bands=snapshot.bands, light=self.light)
        if ready.exact_region is None or ready.light != self.light:
            return replace(preview, exact_region=None, detail=self.detail)
        mask = material.lies_in(ready.exact_region[1])
        merged = with_samples(image, ShadedTerm(ready.image).rows(len(mask)), mask)
        return replace(preview, image=merged, detail=self.detail)


def _ignore_progress(fraction: float) -> None:
    """Say nothing: a part of a preview takes some milliseconds."""


def _interpolate(shaded: ShadedTerm, weights: Any) -> F32:
    """An image of all samples from that of the few. (tiles, 3, samples) float32"""
    return ShadedTerm.from_rows(weights @ shaded.rows(weights.shape[1])).image
