"""Shading the image of a term from scratch: every strategy with fidelity EXACT must match it."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.lobe_sampling import LobeSampling
from relume.brdf.term import Term
from relume.live.fixed_camera.displayed import DisplayedImage, weighted_sum
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination, split_for_shading
from relume.live.fixed_camera.jobs import CancelCheck, Job, Priority, ProgressCallback
from relume.live.fixed_camera.strategies.texel_sum import is_cacheable, put_texel_light
from relume.live.fixed_camera.view_images import TermTarget
from relume.look.model import Rgb
from relume.operators.shade import PartialImage, ShadedTerm, shade, shaded_bytes
from relume.transport.shading.shader import Shader
from relume.transport.split_light import SplitLight, group_means

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
_FIRST_POINTS = 5  # every fifth point of a pixel: not a divisor of its rows
_KNOWN_RADIANCE = np.float32(8)  # of other points, by the mean over the first ones
_PARTIAL_SUFFIX = "begun"  # ends the keys of partially shaded images


class LightComponent(NamedTuple):
    """A component of a light. key: of the image in it alone. gain: per channel."""

    key: tuple[Hashable, ...]
    light: Illumination
    gain: Rgb


def average_split(
    rows: Shaped[F32, "n 3"],
    term: Term,
    bands: Mapping[str, F64],
    split: SplitLight | None,
    is_canceled: CancelCheck,
) -> Shaped[F32, "n 3"]:
    """Return an image with the mean over the pixel where the highlight varies within it.

    Args:
        rows: the image. term, bands: as in `shade`. split: light of the samples that are split. is_canceled: polled.
    """
    if split is None:
        return rows
    averaged = rows.copy()
    averaged[split.rows] = split.mean(_shade_split_points(term, bands, split, is_canceled))
    return averaged


def _shade_split_points(
    term: Term, bands: Mapping[str, F64], split: SplitLight, is_canceled: CancelCheck
) -> Shaped[F32, "points 3"]:
    """Shade the points of split samples: some in each pixel, then all others as exactly as its mean needs."""
    num_points, points = split.points.points.num_points, split.points
    out, sample, mean = np.empty((num_points, 3), np.float32), split.sample, None
    is_first = (np.arange(num_points) - split.first[sample]) % _FIRST_POINTS == 0
    for selected in (np.flatnonzero(is_first), np.flatnonzero(~is_first)):
        base_radiance = None if mean is None else _KNOWN_RADIANCE * mean[sample[selected]]
        args = term, bands, split.lights, points.subset(selected), lambda fraction: None, is_canceled
        out[selected] = shade(*args, partial(Shader, base_radiance=base_radiance)).rows(len(selected))
        first = np.searchsorted(sample[selected], np.arange(len(split.rows)))
        mean = np.abs(group_means(out[selected], first, 0)) if mean is None else mean
    return out


@dataclass(frozen=True, eq=False)
class Shading:
    """The target of a term in some light, fixed when its job was found.

    Attributes:
        key: of the image in the cache. model: of the term. bands: of its curves, (3, J) each.
        lobe: along which rays are traced; None if it is wide.
        is_default: the look is the scene's own, whose images are cached next to the store.
    """

    target: TermTarget
    key: tuple[Hashable, ...]
    term: Term
    model: Hashable
    bands: Mapping[str, F64]
    lobe: LobeSampling | None
    light: Illumination
    is_default: bool

    @classmethod
    def for_target(cls, target: TermTarget, light: Illumination) -> Shading:
        """Return the shading of a target in some light."""
        images, material, live = target
        key = images.image_key(material, live, light)
        is_default = images.is_default(material, live, light)
        term_args = live.term, live.model, live.target_bands, live.lobe
        return cls(target, key, *term_args, light, is_default)

    def job(self, priority: Priority | None = None) -> Job:
        """Return the job of the complete image. priority: None: it can wait if the term already has a preview."""
        if priority is None:
            priority = Priority.REFINEMENT if self.target.live.has_preview() else Priority.IMAGE
        return Job(("image", *self.key), self.label, priority, self.run, self.apply, is_resumable=True)

    @property
    def label(self) -> str:
        """Text for the user."""
        return f"{self.target.name}, {self.term.label}"

    @cached_property
    def light_components(self) -> Sequence[LightComponent]:
        """Components whose sum is the light. Lobe rays bring all light at once."""
        if self.lobe is not None:
            return []
        images, material, live = self.target
        return [
            LightComponent(images.image_key(material, live, component), component, gain)
            for component, gain in split_for_shading(self.light).items()
        ]

    @property
    def num_bytes(self) -> int:
        """Memory of the result."""
        return shaded_bytes(self.target.material.num_samples)

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> ShadedTerm:
        """Shade the image; the result is cached on disk as well."""
        images = self.target.images
        image_files = images.transfer.derived if self.is_default else images.transfer.edited
        shape = self.target.live.ready.image.shape

        def shaded() -> ShadedTerm:
            return image_files.get(self.key[1:], shape, lambda: self._sum_components(progress, is_canceled))

        return images.cache.get(self.key, ShadedTerm, self.num_bytes, shaded)

    def _sum_components(self, progress: ProgressCallback, is_canceled: CancelCheck) -> ShadedTerm:
        """Shade the components of the light that are not cached, and sum all."""
        images, material, live = self.target
        btf_ref = self.term.texels
        if btf_ref is not None and self.light == live.light and is_cacheable(images, material, btf_ref):
            incident = put_texel_light(images, material, btf_ref, self.light, progress, is_canceled)
            return incident.shade(btf_ref, images.unlit_samples(material))
        if len(self.light_components) < 2:
            return self._complete_image(self.key, self.light, progress, is_canceled)
        weighted_images: list[tuple[F32, Rgb]] = []
        for done, (key, light, gain) in enumerate(self.light_components):
            shade_component = partial(
                self._complete_image, key, light, partial(self._report, progress, done), is_canceled
            )
            weighted_images.append((images.cache.get(key, ShadedTerm, self.num_bytes, shade_component).image, gain))
        return ShadedTerm(weighted_sum(np.zeros_like(live.ready.image), weighted_images))

    def _complete_image(
        self, key: tuple[Hashable, ...], light: Illumination, progress: ProgressCallback, is_canceled: CancelCheck
    ) -> ShadedTerm:
        """Complete the image in a light from its partial result."""
        rows = self._partial_rows(key, light, progress, is_canceled, None)
        shaded = ShadedTerm.from_rows(self._with_split_samples(rows, light, is_canceled))
        self.target.images.cache.evict((*key, _PARTIAL_SUFFIX))
        return shaded

    def _with_split_samples(self, rows: F32, light: Illumination, is_canceled: CancelCheck) -> F32:
        """Return the image in a light, with the mean over the pixel where the highlight varies within it. (n, 3)"""
        images, material, _ = self.target
        if self.lobe is None:
            return rows
        split = images.split_light(material, light, self.lobe, lambda: rows, is_canceled)
        return average_split(rows, self.term, self.bands, split, is_canceled)

    def _partial_rows(
        self,
        key: tuple[Hashable, ...],
        light: Illumination,
        progress: ProgressCallback,
        is_canceled: CancelCheck,
        sample_mask: NDArray[np.bool_] | None,
    ) -> F32:
        """Rows of the image in a light; only samples in the mask are shaded, None: all. (n, 3)"""
        images, material, _ = self.target
        num, transient = material.num_samples, images.cache.transient
        partial_image = transient.get(
            (*key, _PARTIAL_SUFFIX), PartialImage, self.num_bytes, lambda: PartialImage.empty(num)
        )
        partial_image.shade(
            self.term,
            self.bands,
            *images.incident_light(material, light, is_canceled, lobe=self.lobe),
            progress,
            is_canceled,
            sample_mask,
        )
        return partial_image.rows

    def _report(self, progress: ProgressCallback, done: int, fraction: float) -> None:
        """Report the progress of one component as a fraction of all components."""
        progress((done + fraction) / max(1, len(self.light_components)))

    def shade_samples(
        self, sample_mask: Shaped[NDArray[np.bool_], " n"], progress: ProgressCallback, is_canceled: CancelCheck
    ) -> Shaped[F32, "n 3"]:
        """Shade only the samples of a mask; the other rows are undefined. Partial results are cached.

        Args:
            sample_mask: samples of the material. progress, is_canceled: as in `run`.
        """
        if len(self.light_components) < 2:
            return self._partial_rows(self.key, self.light, progress, is_canceled, sample_mask)
        total, num = np.zeros((len(sample_mask), 3), np.float32), len(sample_mask)
        for done, (key, light, gain) in enumerate(self.light_components):
            cached = self.target.images.cache.get_cached(key, ShadedTerm)
            report = partial(self._report, progress, done)
            rows = (
                self._partial_rows(key, light, report, is_canceled, sample_mask) if cached is None else cached.rows(num)
            )
            total += np.array(gain, np.float32) * rows
        return total

    def apply(self, result: ShadedTerm) -> None:
        """Use the result; an image of older curves is shown if there is no other, since a drag may rarely pause."""
        images, material, live = self.target
        if not self.target.exists() or (live.model, live.light) != (self.model, self.light):
            return
        is_current = self.key == images.image_key(material, live, self.light)
        if not live.is_converged or (is_current and (not live.is_exact() or live.ready.rounding > 0)):
            basis = live.ready.basis  # an active edit continues from here
            coefficients = None if basis is None else basis.coefficients(self.bands)
            live.set_ready(
                DisplayedImage(result.image.copy(), Fidelity.EXACT, self.bands, self.light, basis, coefficients)
            )
