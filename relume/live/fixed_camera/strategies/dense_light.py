"""Direct light of the environment on Lambertian terms, which is shaded at all samples even in previews.

Shadow edges on diffuse surfaces cannot be interpolated, and the sum over all lights takes 0.2 ns of processor time for
each light and sample (`relume.transport.diffuse_projector`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.core.thread_pools import parallel_for_chunks
from relume.lights.spherical_triangles import TriangleLights
from relume.live.fixed_camera.illumination import Illumination, direct_environment
from relume.live.fixed_camera.view_images import TermTarget, ViewImages
from relume.operators.shade import ShadedTerm
from relume.transport.diffuse_projector import DiffuseProjector, is_constant
from relume.transport.roughness_ranges import contract_levels
from relume.transport.shading_points import ShadingPoints

_MAX_PAIRS = 5 * 10**8  # of samples and lights in a frame: 0.1 s of processor time
_BYTES_PER_SAMPLE = 80  # of a sample without its visibility
_MEMORY_DIVISOR = 4  # samples must fit the cache between frames


def find_dense_terms(images: ViewImages, targets: Sequence[TermTarget], light: Illumination) -> frozenset[int]:
    """Return which terms are shaded at all samples, as indices; none if that takes too long or too much memory.

    Args:
        images, targets: the terms. light: the illumination.
    """
    if not light.has_direct_environment or light.environment.link is not None:  # links darken a copy of all visibility
        return frozenset()
    terms = frozenset(k for k, target in enumerate(targets) if _is_constant(target))
    num_samples = sum(targets[k].material.num_samples for k in terms)
    num_lights = images.transfer.num_lights
    num_bytes = num_samples * (_BYTES_PER_SAMPLE + num_lights // 8)
    is_small = num_samples * num_lights <= _MAX_PAIRS and _MEMORY_DIVISOR * num_bytes <= images.cache.budget_bytes
    return terms if is_small else frozenset()


def _is_constant(target: TermTarget) -> bool:
    live = target.live
    return live.term.is_lambertian and all(
        is_constant(live.term, each) for each in contract_levels(live.term, live.target_bands, None)
    )


def shade_constant(
    term: Term, bands: Mapping[str, NDArray[np.float64]], lights: TriangleLights, receivers: ShadingPoints
) -> ShadedTerm:
    """Shade a Lambertian term with constant curves under the environment alone.

    Args:
        term, bands: as in `relume.operators.shade.shade`. lights, receivers: incident light without rays.
    """
    (contraction,) = contract_levels(term, bands, None)
    projector, rows = DiffuseProjector(term, contraction.constant, lights), np.empty_like(receivers.normal)

    def shade_range(start: int, stop: int) -> None:
        rows[start:stop] = projector.shade(receivers, start, stop)

    parallel_for_chunks(shade_range, len(rows))
    return ShadedTerm.from_rows(rows)


def is_dense_alone(light: Illumination) -> bool:
    """Return whether a light is the direct light of the environment: dense terms have no other."""
    return light._replace(reflectances=()) == direct_environment(light)
