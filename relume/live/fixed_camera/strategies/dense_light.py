"""Direct light of the environment that is shaded at all samples even in previews, because it cannot be interpolated.

Lambertian terms have shadow edges: all lights are summed, which takes 0.2 ns of processor time for each light and
sample (`relume.transport.diffuse_projector`). Terms of materials that bend most have small highlights: of the brightest
lights, which takes 1 µs for each sample.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.core.thread_pools import parallel_for_chunks
from relume.live.fixed_camera.illumination import Illumination, direct_environment
from relume.live.fixed_camera.jobs import CancelCheck
from relume.live.fixed_camera.protocols import LightQuality
from relume.live.fixed_camera.view_images import TermTarget, ViewImages
from relume.operators.shade import ShadedTerm, shade_rows
from relume.transport.diffuse_projector import is_constant
from relume.transport.roughness_ranges import contract_levels
from relume.transport.shading.shader import UndividedShader
from relume.views.pixel_blocks import block_sizes

_MAX_PAIRS = 8 * 10**8  # of samples of Lambertian terms and lights: 0.15 s of processor time
_MAX_GLOSSY = 100_000  # samples of other terms: 0.1 s of processor time
_NUM_BRIGHT = 64  # lights of which their highlights are
_LEAST_PART = 3e-3  # of the peak of a curve: the rest of a highlight is interpolated
_MIN_UNDIVIDED = 500  # lights of the environment: their triangles are smaller than most highlights
_BYTES_PER_SAMPLE = 80  # without visibility
_MEMORY_DIVISOR = 4  # samples must fit the cache between frames


class DenseTerms(NamedTuple):
    """Terms that are shaded at all samples, as indices.

    Attributes:
        diffuse: in the light of the whole environment. glossy: in that of its brightest lights.
    """

    diffuse: frozenset[int] = frozenset()
    glossy: frozenset[int] = frozenset()


NO_DENSE_TERMS = DenseTerms()


def find_dense_terms(
    images: ViewImages, targets: Sequence[TermTarget], light: Illumination, others: frozenset[int] = frozenset()
) -> DenseTerms:
    """Return which terms are shaded at all samples, as far as time and memory allow.

    Args:
        images, targets: the terms. light: the illumination. others: indices of terms that are shown otherwise.
    """
    if not light.has_direct_environment or light.environment.link is not None:  # links darken a copy of all visibility
        return NO_DENSE_TERMS
    num_lights = images.transfer.num_lights
    num_bytes = images.view.num_surface_samples * (_BYTES_PER_SAMPLE + num_lights // 8)
    if _MEMORY_DIVISOR * num_bytes > images.cache.budget_bytes:
        return NO_DENSE_TERMS
    diffuse = frozenset(k for k, target in enumerate(targets) if _is_diffuse(target))
    if sum(targets[k].material.num_samples for k in diffuse) * num_lights > _MAX_PAIRS:
        return NO_DENSE_TERMS
    return DenseTerms(diffuse, _find_glossy(images, targets, diffuse | others))


def preview_shader(images: ViewImages) -> type[UndividedShader] | None:
    """Return the class that shades previews; None as in exact images: large triangles of few lights are divided.

    images: the terms.
    """
    return None if images.transfer.num_lights < _MIN_UNDIVIDED else UndividedShader


def _is_diffuse(target: TermTarget) -> bool:
    term, bands = target.live.term, target.live.target_bands
    return term.is_lambertian and all(is_constant(term, each) for each in contract_levels(term, bands, None))


def _find_glossy(images: ViewImages, targets: Sequence[TermTarget], others: frozenset[int]) -> frozenset[int]:
    """Return the terms of the materials that bend most, less some others, until their samples take too long."""
    possible = [k for k, target in enumerate(targets) if k not in others and target.live.term.texels is None]
    bend, glossy, num_left = block_sizes(images.view, 1), set[int](), _MAX_GLOSSY
    for k in sorted(possible, key=lambda k: bend[targets[k].material.index]):
        if targets[k].material.num_samples <= num_left:
            glossy.add(k)
            num_left -= targets[k].material.num_samples
    return frozenset(glossy)


def shade_dense(
    target: TermTarget,
    term: Term,
    bands: Mapping[str, NDArray[np.float64]],
    light: Illumination,
    is_canceled: CancelCheck,
    *,
    is_bright_only: bool,
) -> ShadedTerm:
    """Shade a term at all samples in direct light of the environment.

    Args:
        target: the term, now. term, bands: the term with its curves. light: the illumination. is_canceled: polled.
        is_bright_only: in the light of the brightest triangles alone.
    """
    direct = direct_environment(light)
    light_args = target.material, direct, is_canceled
    if is_bright_only:
        lights, receivers = target.images.preview_highlights(*light_args, _NUM_BRIGHT)
    else:
        lights, receivers = target.images.incident_light(*light_args, LightQuality.PREVIEW)
    contractions = [each.without_tails(_LEAST_PART) for each in contract_levels(term, bands, None)]
    rows, make_shader = np.empty_like(receivers.normal), preview_shader(target.images)

    def shade_range(start: int, stop: int) -> None:
        rows[start:stop] = shade_rows(term, contractions, lights, receivers, start, stop, make_shader)

    parallel_for_chunks(shade_range, len(rows))
    return ShadedTerm.from_rows(rows)


def is_dense_alone(light: Illumination) -> bool:
    """Return whether a light is the direct light of the environment: diffuse dense terms have no other."""
    return light._replace(reflectances=()) == direct_environment(light)
