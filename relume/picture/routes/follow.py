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

from relume.basis.haar import haar
from relume.brdf.term import Term
from relume.operators.indirect import IndirectOperator, expected_light, freeze_rows, num_channels, rows_bytes
from relume.picture.fidelity import Fidelity
from relume.picture.jobs import Cancelled, Job, Place, Progress
from relume.picture.light import Light, is_same_environment
from relume.picture.routes.moved import MovedLights
from relume.picture.transfer import MoreThrown
from relume.picture.view_images import ViewImages
from relume.project.sent import evenly

F32 = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class FreezeRows:
    """The operator from what gather cells send out to the image of a term; found in the memory from then on.

    Attributes:
        material: index into the scene's. bands: of the term's curves, (3, J) each. light: like which it is to serve.
    """

    what: str
    key: tuple[Hashable, ...]
    images: ViewImages
    material: int
    term: Term
    bands: Mapping[str, NDArray[np.float64]]
    light: Light
    num_bytes: int

    state: Literal["freezing", "shading"] = "freezing"
    refines = goes_on = False

    def make(self, progress: Progress, cancelled: Cancelled) -> IndirectOperator:
        """See `Job`."""
        return self.images.cache.get(
            self.key, IndirectOperator, self.num_bytes, lambda: self._frozen(progress, cancelled)
        )

    def _frozen(self, progress: Progress, cancelled: Cancelled) -> IndirectOperator:
        reflected = self.images.transfer.reflected
        assert reflected is not None
        radiance, view = reflected.preview_under(self.light), self.images.view
        points, rays = view.receivers(self.material, is_lit=False), view.gather_rays(self.material, evenly(radiance))
        expected = expected_light(radiance[: reflected.num_cells])
        return freeze_rows(self.term, self.bands, points, rays, expected, progress, cancelled)

    def install(self, made: IndirectOperator) -> None:
        """See `Job`; the memory has it, which is enough."""


class Follow:
    """A `LightRoute` for what a hand moves: a local light, a diffuse colour, the number of bounces."""

    fidelity = Fidelity.FOLLOWED

    def __init__(self, images: ViewImages) -> None:
        self._images, self._moved = images, MovedLights(images)
        self._reflected = images.transfer.reflected
        self._change: tuple[Light, Light, F32, MoreThrown | None] | None = None

    def has_room(self) -> bool:
        """Whether the memory has room for all rows, where any are needed, beside other things."""
        if self._reflected is None:
            return True
        needed = sum(rows_bytes(m.num_samples, num_channels(t.term, t.target)) for m, t in self._images.terms())
        return 2 * needed <= self._images.cache.budget_bytes

    def reaches(self, place: Place, light: Light) -> bool:
        """See `LightRoute`."""
        anchor = place.live.ready.anchor
        return anchor is not None and anchor.light is not None and is_same_environment(anchor.light, light)

    def needs(self, place: Place, light: Light) -> Sequence[Job]:
        """See `LightRoute`. The rows serve any light like this one, so that they can be made before it changes."""
        if self._reflected is None or self._rows(place) is not None:
            return []
        images, material, live = place
        num_bytes = rows_bytes(material.num_samples, num_channels(live.term, live.target))
        what, key = f"{place.name}, reflected light", self._key(place)
        return [FreezeRows(what, key, images, material.index, live.term, live.target, light, num_bytes)]

    def apply(self, place: Place, light: Light) -> None:
        """See `LightRoute`."""
        live, images = place.live, self._images
        anchor, rows = live.ready.anchor, self._rows(place)
        if anchor is None or anchor.light is None:
            return
        image = live.ready.image  # nothing else refers to it but the picture's own state
        np.copyto(image, anchor.image)
        self._moved.add_change(place, anchor.light, light, image)
        if rows is not None:
            sent, thrown = self._sent_more(anchor.light, light)
            rows.add(sent, image)
            seen = None if thrown is None else images.transfer.thrown_to(images.view, place.material.index)
            if thrown is not None and seen is not None:
                self._moved.add_thrown(place, thrown.rays(seen), image)
        live.put(replace(live.ready, image=image, fidelity=self.fidelity, bands=anchor.bands, light=light))

    def _sent_more(self, before: Light, after: Light) -> tuple[F32, MoreThrown | None]:
        """Haar coefficients of what cells send out more, (padded cells, 3) float32, and what flat mirrors throw more;
        the same for all terms."""
        reflected = self._reflected
        assert reflected is not None
        if self._change is None or self._change[:2] != (before, after):
            change, thrown = reflected.preview_change(before, after), self._images.transfer.more_thrown(before, after)
            by_lobes = change if thrown is None else change - thrown.by_cells
            self._change = before, after, haar(by_lobes).astype(np.float32), thrown
        return self._change[2:]

    def _key(self, place: Place) -> tuple[Hashable, ...]:
        images, material, live = place
        return images.transfer.key, *images.view.place(material.index), "rows", live.model, *live.target_rows

    def _rows(self, place: Place) -> IndirectOperator | None:
        return self._images.cache.find(self._key(place), IndirectOperator)
