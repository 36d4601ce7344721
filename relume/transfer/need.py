"""What a picture needs before it can go on: found by looking, made in any thread, adopted by the picture's own user."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.look import BAKED_ENVIRONMENT, EnvironmentKey
from relume.transfer.frozen import Frozen, freeze, frozen_bytes
from relume.transfer.material_image import MaterialImage
from relume.transfer.projector import contract
from relume.transfer.shade import Shaded, shade, shaded_bytes
from relume.transfer.term_image import TermImage
from relume.transfer.view_images import ViewImages

Candidate = tuple[MaterialImage, TermImage, str | None]


@dataclass(frozen=True, eq=False)
class Need:
    """An operator along the curve `active`, or an image where that is None.

    All that `make` reads was fixed when the need was found: the picture may be changed while it runs.

    Attributes:
        what: in words. key: its name in the cache; equal keys are the same need.
        bands: of the term's curves, (3, J) each. num_bytes: memory to keep it.
        environment: what lights it.
        is_default: the term is one of the scene's own look, whose images are kept beside the store.
    """

    what: str
    key: tuple[Hashable, ...]
    images: ViewImages
    material: MaterialImage
    image: TermImage
    term: Term
    kind: Hashable
    bands: Mapping[str, NDArray[np.float64]]
    active: str | None
    num_bytes: int
    environment: EnvironmentKey
    is_default: bool

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
        lights = images.transfer.lights_in(self.environment)

        def frozen(curve: str) -> Frozen:
            receivers = images.view.receivers(self.material.index)
            return freeze(self.term, self.bands, curve, lights, receivers, progress, cancelled)

        def shaded() -> Shaded:
            receivers = images.view.receivers(self.material.index)
            return shade(self.term, self.bands, lights, receivers, progress, cancelled)

        def shaded_once() -> Shaded:
            if not self.is_default:
                return shaded()
            return images.transfer.derived.get(self.key[1:], self.image.image.shape, shaded)

        if active is None:
            return images.cache.get(self.key, Shaded, self.num_bytes, shaded_once)
        return images.cache.get(self.key, Frozen, self.num_bytes, lambda: frozen(active))


def next_need(images: ViewImages, touched: Candidate | None) -> Need | None:
    """The most urgent need: first what the look lacks, then the curve that the user has opened.

    The touched material goes first, and what is cheap: a picture that opens soon shows something, and then sharpens.

    Raises:
        MemoryBudgetError: something that the look lacks is larger than the cache may be.
    """
    lacking = sorted(_lacking(images, touched), key=lambda candidate: _cost(candidate, touched))
    for candidate in lacking:
        images.cache.check(_num_bytes(candidate))
    if lacking:
        return _need(images, lacking[0])
    if touched is None or not is_freezable(touched):
        return None
    material, image, curve = touched
    is_followed = image.active == curve and images.operator(material, image) is not None
    return None if is_followed or not image.is_exact() else _need(images, touched)


def is_freezable(candidate: Candidate) -> bool:
    """Whether there is anything to freeze: samples, and a curve that light has a part in."""
    material, image, curve = candidate
    return material.num_samples > 0 and curve in image.target


def check_room(images: ViewImages, candidate: Candidate) -> None:
    """Raises MemoryBudgetError where a need is larger than the cache may be."""
    if is_freezable(candidate):
        images.cache.check(_num_bytes(candidate))


def _lacking(images: ViewImages, touched: Candidate | None) -> Iterator[Candidate]:
    """One candidate for each term whose image does not show its target and follows no operator towards it."""
    for material in images.by_name.values():
        if not material.num_samples:
            continue
        for image in material.changed_terms():
            differing = image.differing()
            if image.active in differing and images.operator(material, image) is not None:
                continue  # the hand moves this curve: follow it, the others when it rests
            opened = touched[2] if touched is not None and touched[1] is image else None
            otherwise = None if image.effective is None else differing[0]
            yield material, image, opened if opened in differing else otherwise


def _cost(candidate: Candidate, touched: Candidate | None) -> tuple[bool, bool, int]:
    """Sorts what is to be made: a term whose curves are all flat needs no angles, which take nearly all the time."""
    material, image, curve = candidate
    is_flat = curve is None and contract(image.term, image.target, None).kinds.size == 0
    return touched is None or material is not touched[0], not is_flat, material.num_samples


def _num_bytes(candidate: Candidate) -> int:
    material, image, curve = candidate
    if curve is None:
        return shaded_bytes(material.num_samples)
    return frozen_bytes(material.num_samples, image.term.curve(curve).num_bands)


def _need(images: ViewImages, candidate: Candidate) -> Need:
    material, image, curve = candidate
    name = images.transfer.material_names[material.index]
    label = image.term.label if curve is None else image.term.curve(curve).label
    return Need(
        what=f"{name}, {label}",
        key=images.key(material, image, curve, of_target=True),
        images=images,
        material=material,
        image=image,
        term=image.term,
        kind=image.kind,
        bands=image.target,
        active=curve,
        num_bytes=_num_bytes(candidate),
        environment=images.environment,
        is_default=images.environment == BAKED_ENVIRONMENT and image.document in images.default.materials[name].terms,
    )
