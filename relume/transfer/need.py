"""What a picture needs before it can go on: found by looking, made in any thread, adopted by the picture's own user."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.light.triangles import TriangleLights
from relume.look.model import Rgb
from relume.transfer.along import Along, AlongCurve
from relume.transfer.contraction import contract
from relume.transfer.frozen import Frozen, frozen_bytes
from relume.transfer.light import Light, parts_of
from relume.transfer.material_image import MaterialImage
from relume.transfer.receivers import Receivers
from relume.transfer.shade import Shaded, shade, shaded_bytes
from relume.transfer.term_image import TermImage
from relume.transfer.view_images import ViewImages, documents_of


class Candidate(NamedTuple):
    """Something to be made for a term: an operator along something, or an image where that is None."""

    material: MaterialImage
    image: TermImage
    along: Along | None

    @property
    def num_bytes(self) -> int:
        """Memory to keep it."""
        if self.along is None:
            return shaded_bytes(self.material.num_samples)
        return frozen_bytes(self.material.num_samples, self.along.num_columns)


class Part(NamedTuple):
    """Of a light. key: name in the cache of the image in it alone. gain: how much of it there is, of each channel."""

    key: tuple[Hashable, ...]
    light: Light
    gain: Rgb


@dataclass(frozen=True, eq=False)
class Need:
    """An operator along `active`, or an image where that is None.

    All that `make` reads was fixed when the need was found: the picture may be changed while it runs.

    Attributes:
        what: in words. key: its name in the cache; equal keys are the same need.
        bands: of the term's curves, (3, J) each. num_bytes: memory to keep it.
        light: what arrives at it. parts: that it is the sum of, where there are several.
        is_default: the term is one of the scene's own look, whose images stay beside the store.
        refines: the picture is near its look without it, or shows a glimpse of it; it can wait until the hand rests.
    """

    what: str
    key: tuple[Hashable, ...]
    images: ViewImages
    material: MaterialImage
    image: TermImage
    term: Term
    kind: Hashable
    bands: Mapping[str, NDArray[np.float64]]
    active: Along | None
    num_bytes: int
    light: Light
    parts: Sequence[Part]
    is_default: bool
    refines: bool

    @property
    def state(self) -> Literal["freezing", "shading"]:
        """What making it is called."""
        return "shading" if self.active is None else "freezing"

    def make(self, progress: Callable[[float], None], cancelled: Callable[[], bool]) -> Frozen | Shaded:
        """Freeze or shade, unless the cache has it.

        Args:
            progress: called with the share done. cancelled: asked now and then.
        Raises:
            CancelledError: `cancelled` said so.
        """
        images, active = self.images, self.active

        def frozen(along: Along) -> Frozen:
            lights, receivers = self._arriving(self.light)
            return along.freeze(self.term, self.bands, lights, receivers, progress, cancelled)

        def shaded_once() -> Shaded:
            kept = images.transfer.derived if self.is_default else images.transfer.edited
            return kept.get(self.key[1:], self.image.image.shape, lambda: self._summed(progress, cancelled))

        if active is None:
            return images.cache.get(self.key, Shaded, self.num_bytes, shaded_once)
        return images.cache.get(self.key, Frozen, self.num_bytes, lambda: frozen(active))

    def _summed(self, progress: Callable[[float], None], cancelled: Callable[[], bool]) -> Shaded:
        """Shade the parts of the light that no other image has had, and sum all."""

        def shaded(light: Light, done: int) -> Shaded:
            def tell(share: float) -> None:
                progress((done + share) / max(1, len(self.parts)))

            return shade(self.term, self.bands, *self._arriving(light), tell, cancelled)

        if len(self.parts) < 2:
            return shaded(self.light, 0)
        total = np.zeros_like(self.image.image)
        for done, (key, light, gain) in enumerate(self.parts):
            part = self.images.cache.get(key, Shaded, self.num_bytes, partial(shaded, light, done))
            total += np.array(gain, np.float32)[:, None] * part.image
        return Shaded(total)

    def _arriving(self, light: Light) -> tuple[TriangleLights, Receivers]:
        """What arrives at the samples of the material in a light."""
        images, index = self.images, self.material.index
        lights, reflected = images.transfer.lights_of(light), images.transfer.reflected_in(light)
        local = images.local_rays(index, light)
        return lights, images.view.receivers(index, reflected, local, is_lit=lights.num_lights > 0)


class Hand(NamedTuple):
    """What a hand is known to be on.

    Attributes:
        touched: what the user has opened or taken hold of. moved: the parameter of the last edit, if it was one alone.
    """

    touched: Candidate | None
    moved: Candidate | None

    def along(self, image: TermImage, curves: set[str]) -> Along | None:
        """What the hand moves where such curves of a term change: all of them together, else what is touched."""
        found = [hand.along for hand in (self.moved, self.touched) if hand is not None and hand.image is image]
        able = [along for along in found if along is not None and not curves.isdisjoint(along.moves)]
        return next((along for along in able if curves <= set(along.moves)), able[-1] if able else None)


def next_need(images: ViewImages, hand: Hand) -> Need | None:
    """The most urgent need: first what the look lacks, then what is touched, then what is only near the look.

    The touched material goes first, and what is cheap: a picture that opens soon shows something, and then sharpens.

    Raises:
        MemoryBudgetError: something that the look lacks is larger than the cache may be.
    """
    lacking = sorted(_lacking(images, hand), key=lambda candidate: _cost(candidate, hand.touched))
    for candidate in lacking:
        images.cache.check(candidate.num_bytes)
    if lacking:
        return _need(images, lacking[0], refines=lacking[0].image.is_roughly_shown())
    if hand.touched is not None and is_freezable(hand.touched) and _is_awaited(images, hand.touched):
        return _need(images, hand.touched, refines=False)
    for material in images.by_name.values():
        for image in material.terms:
            if image.is_near and not image.differing():
                return _need(images, Candidate(material, image, None), refines=True)
    return None


def is_freezable(candidate: Candidate) -> bool:
    """Whether there is anything to freeze: samples, and something that light has a part in."""
    return candidate.material.num_samples > 0 and candidate.along is not None


def check_room(images: ViewImages, candidate: Candidate) -> None:
    """Raises MemoryBudgetError where a need is larger than the cache may be."""
    if is_freezable(candidate):
        images.cache.check(candidate.num_bytes)


def _is_awaited(images: ViewImages, touched: Candidate) -> bool:
    """Whether the hand must wait for an operator before it can move what it has touched.

    A parameter whose only curve is free in all its wavelets needs no nodes: that curve's operator is there, and exact.
    """
    material, image, along = touched
    active = image.active
    if along is None or image.differing():
        return False
    if active is None or images.operator(material, image) is None:
        return True
    return active != along and not (active.is_complete and active.moves == along.moves)


def _lacking(images: ViewImages, hand: Hand) -> Iterator[Candidate]:
    """One candidate for each term whose image does not show its target and follows no operator towards it."""
    for material in images.by_name.values():
        if not material.num_samples:
            continue
        for image in material.changed_terms():
            differing = set(image.differing())
            along = hand.along(image, differing)
            if image.effective is None:
                # its operator along a curve gives the image as well, and exactly
                yield Candidate(material, image, along if along is not None and along.is_complete else None)
            elif differing and not _follows(images, material, image, along):
                first = next(name for name in image.target if name in differing)
                yield Candidate(material, image, along or AlongCurve.of(image.term.curve(first)))


def _follows(images: ViewImages, material: MaterialImage, image: TermImage, along: Along | None) -> bool:
    """Whether the operator in use is the one to go on with: it leaves free what differs, or some and none is better."""
    active, differing = image.active, set(image.differing())
    if active is None or differing.isdisjoint(active.moves) or images.operator(material, image) is None:
        return False
    return differing <= set(active.moves) or along is None or not differing <= set(along.moves)


def _cost(candidate: Candidate, touched: Candidate | None) -> tuple[bool, bool, int]:
    """Sorts what is to be made: a term whose curves are all flat needs no angles, which take nearly all the time."""
    material, image, along = candidate
    is_flat = along is None and contract(image.term, image.target, None).kinds.size == 0
    return touched is None or material is not touched.material, not is_flat, material.num_samples


def _need(images: ViewImages, candidate: Candidate, *, refines: bool, light: Light | None = None) -> Need:
    """Of a candidate in some light, the picture's where none is given."""
    material, image, along = candidate
    name, light = images.transfer.material_names[material.index], light or images.light
    parts = parts_of(light).items() if along is None else ()
    if along is None:
        what, key = image.term.label, images.key_of_image(material, image, light)
    else:
        what, key = along.label, images.key(material, image, along, of_target=True)
    return Need(
        what=f"{name}, {what}",
        key=key,
        images=images,
        material=material,
        image=image,
        term=image.term,
        kind=(image.model, light),
        bands=image.target,
        active=along,
        num_bytes=candidate.num_bytes,
        light=light,
        parts=[Part(images.key_of_image(material, image, part), part, gain) for part, gain in parts],
        is_default=_is_default(images, material, image, light),
        refines=refines,
    )


def need_of_image(images: ViewImages, material: MaterialImage, image: TermImage, light: Light) -> Need:
    """The image of a term's target in another light than the picture's."""
    return _need(images, Candidate(material, image, None), refines=image.is_glimpse, light=light)


def _is_default(images: ViewImages, material: MaterialImage, image: TermImage, light: Light) -> bool:
    name = images.transfer.material_names[material.index]
    return light == images.default_light and image.document in documents_of(images.default, name)
