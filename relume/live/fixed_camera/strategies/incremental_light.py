"""Changed light, followed at once: anchor + rows · ΔL, and what moved lights give straight, for each term of a picture.

Where a hand drags a diffuse colour or the number of bounces, all that changes of light is what gather cells send out;
where it moves a local light, what comes straight from that light as well. The rows of all terms are made when such a
thing is touched, once the picture is exact, or first edited; from then on each frame shows the image that was exact
last and what has changed. It is never called exact: at rest all is shaded that has changed.
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
from relume.live.fixed_camera.protocols import MirrorLightsDelta
from relume.live.fixed_camera.strategies.moved_lights import MovedLights
from relume.live.fixed_camera.view_images import ViewImages
from relume.math.haar import haar
from relume.operators.indirect import IndirectOperator, expected_light, num_channels, precompute_rows, row_bytes
from relume.transport.outgoing_patch_light import isotropic

F32 = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class PrecomputeRows:
    """The operator from what gather cells send out to the image of a term; found in the memory from then on.

    Attributes:
        material: index into the scene's. bands: of the term's curves, (3, J) each. light: like which it is to serve.
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
        radiance, view = reflected.preview(self.light), self.images.view
        receivers, rays = (
            view.receivers(self.material, is_lit=False),
            view.gather_rays(self.material, isotropic(radiance)),
        )
        expected = expected_light(radiance[: reflected.num_patches])
        return precompute_rows(self.term, self.bands, receivers, rays, expected, progress, is_canceled)

    def install(self, result: IndirectOperator) -> None:
        """See `Job`; the memory has it, which is enough."""


class IncrementalLight:
    """A `LightStrategy` for what a hand moves: a local light, a diffuse colour, the number of bounces."""

    fidelity = Fidelity.INCREMENTAL

    def __init__(self, images: ViewImages) -> None:
        self._images, self._moved_lights = images, MovedLights(images)
        self._reflected = images.transfer.indirect
        self._change: tuple[Illumination, Illumination, F32, MirrorLightsDelta | None] | None = None

    def fits_budget(self) -> bool:
        """Whether the memory has room for all rows, where any are needed, beside other things."""
        if self._reflected is None:
            return True
        needed = sum(row_bytes(m.num_samples, num_channels(t.term, t.target_bands)) for m, t in self._images.terms())
        return 2 * needed <= self._images.cache.budget_bytes

    def applicable(self, target: TermTarget, light: Illumination) -> bool:
        """See `LightStrategy`."""
        reference = target.live.ready.reference
        return reference is not None and reference.light is not None and is_same_environment(reference.light, light)

    def prepare(self, target: TermTarget, light: Illumination) -> Sequence[Job]:
        """See `LightStrategy`. The rows serve any light like this one, so that they can be made before it changes."""
        if self._reflected is None or self._rows(target) is not None:
            return []
        images, material, live = target
        num_bytes = row_bytes(material.num_samples, num_channels(live.term, live.target_bands))
        label, key = f"{target.name}, reflected light", self._key(target)
        return [PrecomputeRows(label, key, images, material.index, live.term, live.target_bands, light, num_bytes)]

    def evaluate(self, target: TermTarget, light: Illumination) -> None:
        """See `LightStrategy`."""
        live, images = target.live, self._images
        reference, rows = live.ready.reference, self._rows(target)
        if reference is None or reference.light is None:
            return
        image = live.ready.image  # nothing else refers to it but the picture's own state
        np.copyto(image, reference.image)
        self._moved_lights.add_change(target, reference.light, light, image)
        if rows is not None:
            outgoing_change, mirror_change = self._outgoing_change(reference.light, light)
            rows.add(outgoing_change, image)
            mirror_bits = (
                None if mirror_change is None else images.transfer.mirror_lights_of(images.view, target.material.index)
            )
            if mirror_change is not None and mirror_bits is not None:
                self._moved_lights.add_mirror_lights(target, mirror_change.rays(mirror_bits), image)
        live.set_ready(replace(live.ready, image=image, fidelity=self.fidelity, bands=reference.bands, light=light))

    def _outgoing_change(self, before: Illumination, after: Illumination) -> tuple[F32, MirrorLightsDelta | None]:
        """Haar coefficients of what cells send out more, (padded cells, 3) float32, and what flat mirrors throw more;
        the same for all terms."""
        reflected = self._reflected
        assert reflected is not None
        if self._change is None or self._change[:2] != (before, after):
            change, mirror_change = (
                reflected.preview_delta(before, after),
                self._images.transfer.mirror_lights_delta(before, after),
            )
            change_in_highlights = change if mirror_change is None else change - mirror_change.patch_radiance
            self._change = before, after, haar(change_in_highlights).astype(np.float32), mirror_change
        return self._change[2:]

    def _key(self, target: TermTarget) -> tuple[Hashable, ...]:
        images, material, live = target
        return images.transfer.key, *images.view.sample_key(material.index), "rows", live.model, *live.target_rows_key

    def _rows(self, target: TermTarget) -> IndirectOperator | None:
        return self._images.cache.get_cached(self._key(target), IndirectOperator)
