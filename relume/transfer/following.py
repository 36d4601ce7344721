"""Changed light, followed at once: image + rows · ΔL, and what moved lights give straight, for every term of a picture.

Where a hand drags a diffuse colour or the number of bounces, all that changes of light is what gather cells send out;
where it moves a local light, what comes straight from that light as well. The rows of all terms are made when such a
thing is touched, once the picture is exact, or first edited; from then on each frame shows the image that was shaded
last and what has changed. It is never called exact: at rest all is shaded that has changed.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from relume.basis.haar import haar
from relume.brdf.term import Term
from relume.transfer.light import Light, is_moved_by_hand, is_same_but_for_gains, is_same_environment
from relume.transfer.material_image import MaterialImage
from relume.transfer.moved import MovedLights
from relume.transfer.rows import Rows, expected_light, freeze_rows, num_channels, rows_bytes
from relume.transfer.term_image import TermImage
from relume.transfer.view_images import ViewImages

F32 = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class RowsNeed:
    """A need of the rows of one term; made like a `Need`, and found in the cache from then on.

    Attributes:
        what: in words. key: its name in the cache. light: like which they are to serve.
    """

    what: str
    key: tuple[Hashable, ...]
    images: ViewImages
    material: int
    term: Term
    bands: Mapping[str, NDArray[np.float64]]
    light: Light
    num_bytes: int

    state: Literal["freezing"] = "freezing"
    refines = False

    def make(self, progress: Callable[[float], None], cancelled: Callable[[], bool]) -> Rows:
        """Freeze, unless the cache has them.

        Args:
            progress: called with the share done. cancelled: asked now and then.
        Raises:
            CancelledError: `cancelled` said so.
        """
        return self.images.cache.get(self.key, Rows, self.num_bytes, lambda: self._frozen(progress, cancelled))

    def _frozen(self, progress: Callable[[float], None], cancelled: Callable[[], bool]) -> Rows:
        reflected = self.images.transfer.reflected
        assert reflected is not None
        radiance, view = reflected.roughly_under(self.light), self.images.view
        points, rays = view.receivers(self.material, is_lit=False), view.gather_rays(self.material, radiance)
        expected = expected_light(radiance[: reflected.num_cells])
        return freeze_rows(self.term, self.bands, points, rays, expected, progress, cancelled)


class Follower:
    """Keeps the terms of one view near their look while the light between surfaces changes."""

    def __init__(self, images: ViewImages) -> None:
        self._images, self._moved = images, MovedLights(images)
        self._reflected = images.transfer.reflected
        self._is_wanted = self._is_awaited = False

    def prepare(self) -> None:
        """A hand is on something that changes local lights, or what surfaces reflect onto each other."""
        self._is_wanted = self._has_room()

    def follow_look(self, before: Light) -> None:
        """The look has changed, and with it perhaps the light, which was this before."""
        self._is_wanted = self._is_awaited = False
        after = self._images.light
        is_followed = is_same_environment(before, after) and is_moved_by_hand(before, after)
        if before != after and is_followed and not is_same_but_for_gains(before, after):
            self.prepare()
            self._is_awaited = self._is_wanted

    @property
    def is_awaited(self) -> bool:
        """Whether light has changed that only rows can follow; else what they are for has only been touched."""
        return self._is_awaited

    def follows_all(self) -> bool:
        """Whether every term shows its look already, or will, roughly, as soon as there are rows."""
        shows = (image.effective is not None or image.can_follow() for _, image in self._images.terms())
        return self._is_wanted and all(shows)

    def next_need(self) -> RowsNeed | None:
        """The next rows to be made, those of few samples first; None where there are all, or none are wanted."""
        if not self._is_wanted or self._reflected is None:
            return None
        # a term whose own curve moves would want other rows after every edit, and could not add them to anything
        able = ((m, t) for m, t in self._images.terms() if t.effective is not None or t.can_follow())
        lacking = [(m, t) for m, t in able if self._rows(m, t) is None]
        return self._need(*min(lacking, key=lambda item: item[0].num_samples)) if lacking else None

    def follows(self, material: MaterialImage, image: TermImage) -> bool:
        """Whether a term can be brought to light like that of the look at once."""
        base = image.base
        if base is None or not image.can_follow() or not is_same_environment(base.light, self._images.light):
            return False
        return self._reflected is None or self._rows(material, image) is not None

    def step(self, light: Light) -> None:
        """Bring all terms that can be to this light, which is like that of the look."""
        changes: dict[Light, F32] = {}
        for material, image in self._images.terms():
            base = image.base
            is_alike = base is not None and is_same_environment(base.light, light)
            if base is None or not is_alike or image.followed == light or not self.follows(material, image):
                continue
            if base.light not in changes:
                changes[base.light] = self._change(base.light, light)
            image.follow(light, partial(self._add_change, material, image, (base.light, light), changes[base.light]))

    def _add_change(
        self, material: MaterialImage, image: TermImage, lights: tuple[Light, Light], change: F32, out: F32
    ) -> None:
        """Add to an image what has changed. lights: before and after. change: of what cells send out."""
        self._moved.add_change(material, image, *lights, out)
        rows = self._rows(material, image)
        if rows is not None:
            rows.add(change, out)

    def _change(self, before: Light, after: Light) -> F32:
        """Haar coefficients of what cells send out more. (padded cells, 3) float32"""
        reflected = self._reflected
        if reflected is None:
            return np.empty((0, 3), np.float32)
        change = reflected.roughly_under(after) - reflected.roughly_under(before)
        return haar(change[: reflected.num_cells]).astype(np.float32)

    def _has_room(self) -> bool:
        """Whether the cache has room for all rows, where any are needed, beside other things."""
        if self._reflected is None:
            return True
        needed = sum(rows_bytes(m.num_samples, num_channels(t.term, t.target)) for m, t in self._images.terms())
        return 2 * needed <= self._images.cache.budget_bytes

    def _key(self, material: MaterialImage, image: TermImage) -> tuple[Hashable, ...]:
        bands = (image.target[name].astype(np.float32).tobytes() for name in sorted(image.target))
        images = self._images
        return images.transfer.key, images.view.name, material.index, "rows", image.model, *bands

    def _rows(self, material: MaterialImage, image: TermImage) -> Rows | None:
        return self._images.cache.find(self._key(material, image), Rows)

    def _need(self, material: MaterialImage, image: TermImage) -> RowsNeed:
        images = self._images
        return RowsNeed(
            what=f"{images.transfer.material_names[material.index]}, reflected light",
            key=self._key(material, image),
            images=images,
            material=material.index,
            term=image.term,
            bands=image.target,
            light=images.light,
            num_bytes=rows_bytes(material.num_samples, num_channels(image.term, image.target)),
        )
