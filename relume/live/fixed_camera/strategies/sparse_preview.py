"""A sparse preview in another light: one sample per pixel block is shaded, and the others are interpolated.

    R = D + W (S − D)

S is the light of the shaded samples and W interpolates. D is a part of the light, shaded at all samples if the image is
small enough, else zero (`relume.live.fixed_camera.strategies.dense_light`).

If the environment is rotated or replaced, or reflectances for indirect light change, all images of a picture become
invalid at once, and shading all samples takes seconds. The same holds for a newly opened view, and for a term whose
fixed parameter changes. A preview costs a few thousand samples at any image size, needs no operator, and shows
where the light moves; colors and textures multiply it at full resolution. It is never labeled exact: when the drag
ends, all samples are shaded. In large images finer previews come first, each with eight times as many samples.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.sparse import csr_array

from relume.brdf.term import Term
from relume.core.thread_pools import map_ordered
from relume.live.fixed_camera.displayed import DisplayedImage
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination, direct_only
from relume.live.fixed_camera.jobs import CancelCheck, Job, Priority, ProgressCallback
from relume.live.fixed_camera.protocols import FixedViewTransfer, LightQuality, Samples
from relume.live.fixed_camera.strategies import incremental_light
from relume.live.fixed_camera.strategies.dense_light import (
    NO_DENSE_TERMS,
    DenseTerms,
    find_dense_terms,
    is_dense_alone,
    preview_shader,
    shade_dense,
)
from relume.live.fixed_camera.strategies.lobe_image import has_round_narrow_lobe, lobe_image
from relume.live.fixed_camera.strategies.strategy import Situation, Strategy, Urgency
from relume.live.fixed_camera.view_images import TermTarget, ViewImages
from relume.look.model import Rgb
from relume.operators.interpolation import add_interpolated
from relume.operators.linear_operator import tile_layout
from relume.operators.shade import ShadedTerm, shade
from relume.operators.texel_light import collect_light, fits_budget, indirect_texel_light
from relume.views.pixel_blocks import block_sizes, nearest_chosen, one_per_block
from relume.views.view import View

F32 = NDArray[np.float32]

_NUM_SHADED = 8000  # approximate number of samples in a view
_MAX_SHADED_AT_ONCE = 6 * _NUM_SHADED  # samples of terms in a view that take as long as selecting a subset
_DETAIL_FACTOR = 8  # ratio of samples between levels of detail
_MIN_FINER_RATIO = 16  # times the samples of a finer preview; with fewer, all are shaded
_NUM_NEIGHBORS = 5
_SOFTENING = 0.5  # pixels²; smooths the interpolation weights near a shaded sample


@dataclass(frozen=True)
class SampleSubset:
    """The shaded samples of a material, and the weights that interpolate all others.

    Attributes:
        sample_indices: of the shaded samples, counted from the material's first. samples: the same.
        weights: sparse float32, rows sum to 1. (samples, shaded samples)
    """

    sample_indices: Shaped[NDArray[np.intp], " k"]
    samples: Samples
    weights: Any

    @property
    def num_bytes(self) -> int:
        """Memory that it takes."""
        weights = self.weights
        return int(self.samples.num_bytes + weights.data.nbytes + weights.indices.nbytes + weights.indptr.nbytes)


def choose_samples(
    transfer: FixedViewTransfer, view: View, material: int, block_size: int, *, has_indirect: bool
) -> SampleSubset:
    """Select one sample per pixel block of a material; reads the store.

    The others are averages of the nearest selected samples, by image position and normal.

    Args:
        transfer: an open bake. view: one of its views. material: index of the material.
        block_size: side of a block, pixels. has_indirect: they are shaded with indirect light.
    """
    sample_indices = one_per_block(view, material, block_size)
    neighbors, weight = nearest_chosen(view, material, sample_indices, block_size, _NUM_NEIGHBORS, _SOFTENING)
    first, shape = np.arange(0, weight.size + 1, weight.shape[1]), (len(weight), len(sample_indices))
    weights = csr_array((weight.ravel(), neighbors.ravel(), first), shape=shape)
    weights.eliminate_zeros()
    samples = transfer.selected_samples(view, material, sample_indices, has_indirect=has_indirect)
    return SampleSubset(sample_indices, samples, weights)


def _num_shaded(detail: int) -> int:
    return _NUM_SHADED * int(_DETAIL_FACTOR**detail)


def _sample_subsets(
    images: ViewImages, materials: Iterable[int], light: Illumination, detail: int
) -> dict[int, SampleSubset]:
    """Return cached subsets of the samples of materials, of smaller blocks where these bend; read side by side.

    Subsets of finer previews are held in the transient cache.
    """
    sizes, cache = block_sizes(images.view, _num_shaded(detail)), images.cache.transient if detail else images.cache

    def choose(material: int) -> SampleSubset:
        choose_args, has_indirect = (material, int(sizes[material])), light.paths.has_indirect
        return cache.get(
            _key(images, material, light, detail),
            SampleSubset,
            _subset_bytes(images, material),
            lambda: choose_samples(images.transfer, images.view, *choose_args, has_indirect=has_indirect),
        )

    largest_first = sorted(materials, key=lambda material: -_subset_bytes(images, material))
    return dict(zip(largest_first, map_ordered(choose, largest_first, len(largest_first)), strict=True))


def _key(images: ViewImages, material: int, light: Illumination, detail: int = 0) -> tuple[Hashable, ...]:
    return images.transfer.key, *images.view.sample_key(material), "sparse", light.paths.has_indirect, detail


def _subset_bytes(images: ViewImages, material: int) -> int:
    """Upper limit of the memory of a `SampleSubset` without the shaded samples."""
    rows = images.view.rows(material)
    return int(rows.stop - rows.start) * (_NUM_NEIGHBORS * 12 + 8)


def _can_preview(images: ViewImages) -> bool:
    """Return whether the subsets fit half of the memory budget."""
    return 2 * sum(_subset_bytes(images, k) for k in range(len(images.by_name))) <= images.cache.budget_bytes


def _is_needed_for_first_frame(images: ViewImages) -> bool:
    """Return whether a preview of a new picture is much faster than its missing images."""
    num_missing = sum(m.num_samples for m, image in images.terms() if not images.is_cached(m, image))
    return num_missing > _MAX_SHADED_AT_ONCE and _can_preview(images)


def is_finer_worthwhile(num_samples: int, detail: int) -> bool:
    """Return whether shading takes so long that a preview of the next detail is worthwhile."""
    return num_samples > _MIN_FINER_RATIO * _num_shaded(detail + 1)


def _is_prepared(images: ViewImages) -> bool:
    """Return whether the samples are selected; otherwise the first preview of a view takes a second more."""
    materials = {material.index for material, _ in images.terms()}
    return all(
        images.cache.get_cached(_key(images, index, images.light), SampleSubset) is not None for index in materials
    )


@dataclass(frozen=True)
class _TermSnapshot:
    """State of a term when the preview was requested."""

    target: TermTarget
    term: Term
    bands: Mapping[str, NDArray[np.float64]]
    document: Mapping[str, Any]
    view_factor: Shaped[F32, "channels n"] | None

    @classmethod
    def of_target(cls, target: TermTarget) -> _TermSnapshot:
        """Return the state of a term now."""
        live = target.live
        return cls(target, live.term, live.target_bands, live.document, live.view_factor)


@dataclass(frozen=True)
class SparsePreview:
    """Previews of terms in one light; the only strategy that reaches any light without a reference image.

    Attributes:
        gain: gain of the finished image in that light.
        detail: number of refinements. dense_terms: indices of the terms that are also shaded at all samples.
        lobe_terms: indices of the terms that lobe rays show at all samples: interpolated, they would be blocks.
    """

    images: ViewImages
    light: Illumination
    gain: Rgb
    snapshots: Sequence[_TermSnapshot]
    detail: int = 0
    dense_terms: DenseTerms = NO_DENSE_TERMS
    lobe_terms: frozenset[int] = frozenset()

    @classmethod
    def for_targets(
        cls,
        images: ViewImages,
        targets: Sequence[TermTarget],
        light: Illumination,
        detail: int = 0,
        *,
        is_read: bool = True,
    ) -> SparsePreview:
        """Return the preview of terms, with their current curves.

        Args:
            images, targets: the terms. light: the illumination. detail: number of refinements.
            is_read: samples of the view have been read already; else a dense preview takes longer.
        """
        snapshots = list(map(_TermSnapshot.of_target, targets))
        if not is_read:
            return cls(images, light, images.gain, snapshots, detail)
        is_linked = light.environment.link is not None  # lobe rays do not know links
        narrow = [k for k, target in enumerate(targets) if has_round_narrow_lobe(target.live)]
        lobe_terms = frozenset() if is_linked else frozenset(narrow)
        dense_terms = find_dense_terms(images, targets, light, lobe_terms)
        return cls(images, light, images.gain, snapshots, detail, dense_terms, lobe_terms)

    def job(
        self, label: str, on_preview: Callable[[Illumination, Rgb], None], priority: Priority = Priority.IMAGE
    ) -> Job:
        """Return the job.

        Args:
            label: text for the user. on_preview: called with its light and gain when it is applied.
            priority: when it starts.
        """
        images, targets = self.images, [snapshot.target for snapshot in self.snapshots]
        image_keys = [images.image_key(target.material, target.live, images.light) for target in targets]
        key = "preview", images.transfer.key, images.view.name, self.light, self.detail, *image_keys

        def apply(previews: Sequence[F32]) -> None:
            self.apply(previews)
            on_preview(self.light, self.gain)

        return Job(key, label, priority, self.run, apply)

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> list[F32]:
        """Return the images of all terms, (tiles, 3, samples) float32 each."""
        previews, shader = [], None
        if self.lobe_terms:
            shader = self.images.transfer.few_lobe_rays(self.light, is_canceled, LightQuality.PREVIEW)
        materials = {snapshot.target.material.index for snapshot in self.snapshots}
        subsets = _sample_subsets(self.images, materials, self.light, self.detail)
        for k, snapshot in enumerate(self.snapshots):
            subset = subsets[snapshot.target.material.index]
            dense = self._dense_image(k, is_canceled)
            if shader is not None and k in self.lobe_terms:
                term_args = snapshot.target, self.light, shader, snapshot.document, snapshot.view_factor
                previews.append(lobe_image(*term_args))
            elif dense is not None and k in self.dense_terms.diffuse and is_dense_alone(self.light):
                previews.append(dense.image)
            else:
                previews.append(self._preview_image(snapshot, subset, dense, is_canceled))
            progress((k + 1) / len(self.snapshots))
        return previews

    def _dense_image(self, index: int, is_canceled: CancelCheck) -> ShadedTerm | None:
        """Shade a part of the light on a term at all samples; None if it takes too long. index: of the term"""
        terms, snapshot = self.dense_terms, self.snapshots[index]
        if index not in terms.diffuse | terms.glossy:
            return None
        shade_args = snapshot.target, snapshot.term, snapshot.bands, self.light, is_canceled
        return shade_dense(*shade_args, is_bright_only=index in terms.glossy)

    def _preview_image(
        self, snapshot: _TermSnapshot, subset: SampleSubset, dense: ShadedTerm | None, is_canceled: CancelCheck
    ) -> F32:
        """Return one term's image, (tiles, 3, samples) float32; BTFs evaluate a texel per sample if that is fast.

        dense: light of all samples, which is part of theirs; None for none.
        """
        transfer, btf_ref = self.images.transfer, snapshot.term.texels
        if snapshot.term.is_lambertian:
            incident = transfer.incident_light(subset.samples, self.light, LightQuality.PREVIEW, is_canceled)
        else:
            incident = transfer.preview_highlights(subset.samples, self.light, is_canceled)
        if btf_ref is None or not fits_budget(btf_ref, snapshot.target.material.num_samples):
            shade_args = snapshot.term, snapshot.bands, *incident, _ignore_progress, is_canceled
            shaded = shade(*shade_args, preview_shader(self.images))
            return _interpolate(shaded, subset, dense)
        receivers = self.images.unlit_samples(snapshot.target.material)
        return indirect_texel_light(
            btf_ref, collect_light(btf_ref, *incident, _ignore_progress, is_canceled), subset.weights, receivers
        ).image

    def apply(self, previews: Sequence[F32]) -> None:
        """Use the images, even if the light has changed further meanwhile."""
        for snapshot, image in zip(self.snapshots, previews, strict=True):
            live = snapshot.target.live
            is_incremental = live.ready.fidelity == Fidelity.INCREMENTAL and live.ready.light == live.light
            # with other fixed parameters it is still a preview
            is_same = live.term.model == snapshot.term.model
            if is_same and not (live.is_converged or is_incremental) and snapshot.target.exists():
                live.set_ready(self._merge(snapshot, image))

    def _merge(self, snapshot: _TermSnapshot, image: F32) -> DisplayedImage:
        """Return the preview that replaces the newest image; its exact region is retained."""
        ready, material = snapshot.target.live.ready, snapshot.target.material
        preview = replace(ready, image=image, fidelity=Fidelity.PREVIEW, bands=snapshot.bands, light=self.light)
        if ready.exact_region is None or ready.light != self.light:
            return replace(preview, exact_region=None, detail=self.detail)
        mask = material.lies_in(ready.exact_region[1])
        merged = preview.with_samples(ShadedTerm(ready.image).rows(len(mask)), mask)
        return replace(preview, image=merged, detail=self.detail)


def _ignore_progress(fraction: float) -> None:
    """Ignore progress: a term of a preview takes milliseconds."""


def _interpolate(shaded: ShadedTerm, subset: SampleSubset, dense: ShadedTerm | None) -> F32:
    """Interpolate an image of all samples from the shaded ones, or its difference from `dense`, which is overwritten.

    Returns:
        (tiles, 3, samples) float32
    """
    num_samples, num_shaded = subset.weights.shape
    tiles, lanes = tile_layout(num_samples)
    rows = shaded.rows(num_shaded)
    if dense is None:
        image = np.zeros((tiles, 3, lanes), np.float32)
    else:
        image = dense.image
        rows = rows - image[subset.sample_indices // lanes, :, subset.sample_indices % lanes]
    add_interpolated(subset.weights, rows, image)
    return image


def _preview_job(situation: Situation) -> Job | None:
    """Return a preview if the target light differs or the picture opens, or to select samples before a rotation."""
    images, light = situation.images, situation.images.light
    if _needs_preview(situation):
        missing = [target for target in situation.unconverged if not situation.can_reach(target)]
        if situation.is_opening and light.paths.direct and light.paths.has_indirect:
            light = direct_only(light)  # indirect light takes seconds if it is not cached
        is_read = not situation.is_opening
        label = "the light" if is_read else "a preview"
        return SparsePreview.for_targets(images, missing, light, is_read=is_read).job(label, situation.on_preview)
    targets = situation.targets
    outdated = [t for t in targets if t.live.displays_outdated and not images.is_cached(t.material, t.live)]
    if outdated and situation.is_watched and _can_preview(images):
        return SparsePreview.for_targets(images, outdated, light).job("what was changed", situation.on_preview)
    if situation.control.rotates_environment and _can_preview(images) and not _is_prepared(images):
        return SparsePreview.for_targets(images, targets, light).job("the light", situation.on_preview)
    return None


def _needs_preview(situation: Situation) -> bool:
    images = situation.images
    if situation.is_opening:
        return situation.is_watched and _is_needed_for_first_frame(images)
    if situation.displayed_light == images.light or not _can_preview(images):
        return False
    is_immediate = all(situation.can_reach(target) for target in situation.unconverged)
    return not is_immediate and not (situation.control.edits_light and incremental_light.can_follow(situation))


SPARSE_PREVIEW = Strategy(
    name="sparse preview",
    needs="a few thousand shaded samples",
    cost="nothing; its job takes as long as a few frames",
    fidelity=Fidelity.PREVIEW,
    jobs={Urgency.PREVIEW: _preview_job},
)
