"""Incremental light updates: reference image + transport rows · ΔL + direct light of moved lights, per term.

An edit of a diffuse color or of the number of bounces changes only the outgoing radiance of patches; an edit of a local
light also changes its direct light. The rows of all terms are precomputed when such a control is prepared (after the
image has converged) or first edited. From then on each frame shows the last exact image plus the change. It is never
labeled exact: when the drag ends, everything that has changed is shaded.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination, is_same_environment
from relume.live.fixed_camera.jobs import CancelCheck, Job, ProgressCallback, TermTarget
from relume.live.fixed_camera.protocols import LightQuality, PatchRadiance
from relume.live.fixed_camera.strategies.moved_lights import MovedLights
from relume.live.fixed_camera.view_images import ViewImages
from relume.math.haar import haar
from relume.operators.indirect import IndirectOperator, expected_light, num_channels, precompute_rows, row_bytes

F32 = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class PrecomputeRows:
    """Operator from the outgoing radiance of patches to the image of a term; cached.

    Attributes:
        material: index into the scene's. bands: of the term's curves, (3, J) each. light: for expected light values.
    """

    label: str
    key: tuple[Hashable, ...]
    images: ViewImages
    material: int
    term: Term
    bands: Mapping[str, NDArray[np.float64]]
    light: Illumination
    num_bytes: int

    state: Literal["precomputing", "shading"] = "precomputing"
    is_refinement = is_resumable = False

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> IndirectOperator:
        """See `Job`."""
        return self.images.cache.get(
            self.key, IndirectOperator, self.num_bytes, lambda: self._precompute(progress, is_canceled)
        )

    def _precompute(self, progress: ProgressCallback, is_canceled: CancelCheck) -> IndirectOperator:
        reflected = self.images.transfer.indirect
        assert reflected is not None
        radiance, view = reflected.solve_indirect(self.light, LightQuality.PREVIEW).mean_to_others(), self.images.view
        receivers, rays = view.receivers(self.material, is_lit=False), view.gather_rays(self.material)
        return precompute_rows(self.term, self.bands, receivers, rays, expected_light(radiance), progress, is_canceled)

    def install(self, result: IndirectOperator) -> None:
        """See `Job`; the result is in the cache, so nothing is left to do."""


class IncrementalLight:
    """A `LightStrategy` for edits of a local light, a diffuse color, or the number of bounces."""

    fidelity = Fidelity.INCREMENTAL

    def __init__(self, images: ViewImages) -> None:
        self._images, self._moved_lights = images, MovedLights(images)
        self._reflected = images.transfer.indirect
        self._change: tuple[Illumination, Illumination, PatchRadiance, F32] | None = None

    def fits_budget(self) -> bool:
        """Return whether all needed rows fit half of the memory budget."""
        if self._reflected is None:
            return True
        needed = sum(row_bytes(m.num_samples, num_channels(t.term, t.target_bands)) for m, t in self._images.terms())
        return 2 * needed <= self._images.cache.budget_bytes

    def applicable(self, target: TermTarget, light: Illumination) -> bool:
        """See `LightStrategy`."""
        reference = target.live.ready.reference
        return reference is not None and reference.light is not None and is_same_environment(reference.light, light)

    def prepare(self, target: TermTarget, light: Illumination) -> Sequence[Job]:
        """See `LightStrategy`. The rows serve any similar light, so they can be precomputed before it changes."""
        if self._reflected is None or self._rows(target) is not None:
            return []
        images, material, live = target
        num_bytes = row_bytes(material.num_samples, num_channels(live.term, live.target_bands))
        label, key = f"{target.name}, indirect light", self._key(target)
        return [PrecomputeRows(label, key, images, material.index, live.term, live.target_bands, light, num_bytes)]

    def evaluate(self, target: TermTarget, light: Illumination) -> None:
        """See `LightStrategy`."""
        live, images = target.live, self._images
        reference, rows = live.ready.reference, self._rows(target)
        if reference is None or reference.light is None:
            return
        image = live.ready.image  # only the picture's own state refers to it
        np.copyto(image, reference.image)
        self._moved_lights.add_change(target, reference.light, light, image)
        if rows is not None:
            change, coefficients = self._indirect_change(reference.light, light)
            rows.add(coefficients, image)
            rays = change.rays_to(images.view, target.material.index)
            if rays is not None:
                self._moved_lights.add_rays(target, rays, image)
        live.set_ready(replace(live.ready, image=image, fidelity=self.fidelity, bands=reference.bands, light=light))

    def _indirect_change(self, before: Illumination, after: Illumination) -> tuple[PatchRadiance, F32]:
        """Return the change of patch radiance, and its Haar coefficients; equal for all terms. (padded patches, 3)"""
        reflected = self._reflected
        assert reflected is not None
        if self._change is None or self._change[:2] != (before, after):
            change = reflected.solve_indirect(after, LightQuality.PREVIEW, start_from=before)
            self._change = before, after, change, haar(change.mean_to_others()).astype(np.float32)
        return self._change[2:]

    def _key(self, target: TermTarget) -> tuple[Hashable, ...]:
        images, material, live = target
        return images.transfer.key, *images.view.sample_key(material.index), "rows", live.model, *live.target_rows_key

    def _rows(self, target: TermTarget) -> IndirectOperator | None:
        return self._images.cache.get_cached(self._key(target), IndirectOperator)
