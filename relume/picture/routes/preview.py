"""A preview of other light: one sample of each small square of pixels is shaded, those between are interpolated.

When the environment is turned or exchanged, or surfaces reflect other light onto each other, every image of a picture
counts for nothing at once, and shading all samples takes seconds; so it does where a view is opened for the first time,
and for one term where a parameter changes that its operators are frozen with.
A preview costs a few thousand samples whatever the picture's size, holds no operator, and lets the hand see where the
light goes; colours and textures multiply it at full size. It is never called exact: at rest all is shaded. Where that
takes long, as of a large picture, finer previews come before, each of eight times as many samples.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from relume.brdf.term import Term
from relume.look.model import Rgb
from relume.operators.arrived import arrive, is_quick, sent_between
from relume.operators.shade import Shaded, shade
from relume.picture.fidelity import Fidelity
from relume.picture.jobs import Cancelled, Place, Progress
from relume.picture.light import Light, straight
from relume.picture.region import with_rows
from relume.picture.shown import Shown
from relume.picture.transfer import Few, Transfer
from relume.picture.view_images import ViewImages
from relume.views.squares import nearest, one_of_each_square
from relume.views.view import View

F32 = NDArray[np.float32]

_MOST_SHADED = 6000  # samples of a view, about
_FEW_TO_SHADE = 8 * _MOST_SHADED  # samples of terms of a view; they take about as long as choosing some of them
_FINER = 8  # times as many samples
_LONG = 16  # times as many as a finer preview shades; where fewer are left, all are shaded
_NUM_NEIGHBOURS = 3
_SOFT = 0.5  # pixels²; a sample's own neighbours share it where they are as near as this


@dataclass(frozen=True)
class Sparse:
    """The samples of a material that are shaded, and how all others are made from them.

    Attributes:
        few: the samples. weights: rows sum to one. (samples, few samples) sparse float32
    """

    few: Few
    weights: Any

    @property
    def num_bytes(self) -> int:
        """Memory it holds."""
        weights = self.weights
        return int(self.few.num_bytes + weights.data.nbytes + weights.indices.nbytes + weights.indptr.nbytes)


def choose_sparse(transfer: Transfer, view: View, material: int, detail: int, *, reflects: bool) -> Sparse:
    """One sample of each square of pixels that a material is seen in; reads the store.

    Those between take the mean of the nearest, by place in the picture and by normal.

    Args:
        transfer: an opened bake. view: one of its views. material: index of the material.
        detail: how often the samples are made more. reflects: they are shaded with light between surfaces.
    """
    step = max(1, int(np.ceil(np.sqrt(view.num_surface_samples / _num_shaded(detail)))))
    chosen = one_of_each_square(view, material, step)
    near, weight = nearest(view, material, chosen, step, _NUM_NEIGHBOURS, _SOFT)
    first, shape = np.arange(0, weight.size + 1, weight.shape[1]), (len(weight), len(chosen))
    weights = csr_array((weight.ravel(), near.ravel(), first), shape=shape)
    weights.eliminate_zeros()
    return Sparse(transfer.some(view, material, chosen, reflects=reflects), weights)


def _num_shaded(detail: int) -> int:
    return _MOST_SHADED * int(_FINER**detail)


def _sparse(images: ViewImages, material: int, light: Light, detail: int) -> Sparse:
    """Of a material of a view, kept in the cache with the operators; of finer previews for a while."""
    reflects = light.paths.reflect

    def choose() -> Sparse:
        return choose_sparse(images.transfer, images.view, material, detail, reflects=reflects)

    cache = images.cache.passing if detail else images.cache
    return cache.get(_key(images, material, light, detail), Sparse, _bytes_of(images, material), choose)


def _key(images: ViewImages, material: int, light: Light, detail: int = 0) -> tuple[Hashable, ...]:
    return images.transfer.key, *images.view.place(material), "sparse", light.paths.reflect, detail


def _bytes_of(images: ViewImages, material: int) -> int:
    """Memory that `Sparse` takes at most, but for the few samples themselves."""
    rows = images.view.rows(material)
    return int(rows.stop - rows.start) * (_NUM_NEIGHBOURS * 12 + 8)


def can_preview(images: ViewImages) -> bool:
    """Whether the cache has room for it beside other things."""
    return 2 * sum(_bytes_of(images, k) for k in range(len(images.by_name))) <= images.cache.budget_bytes


def helps_to_open(images: ViewImages) -> bool:
    """Whether a picture that shows nothing yet is seen much sooner so than by making the images that it lacks."""
    lacking = sum(m.num_samples for m, image in images.terms() if not images.is_at_hand(m, image))
    return lacking > _FEW_TO_SHADE and can_preview(images)


def is_worth_finer(num_samples: int, detail: int) -> bool:
    """Whether shading so many samples takes so long that a preview of one more detail than this is worth its while."""
    return num_samples > _LONG * _num_shaded(detail + 1)


def is_prepared(images: ViewImages) -> bool:
    """Whether the samples have been chosen: the first preview of a view takes a second more."""
    seen = {material.index for material, _ in images.terms()}
    return all(images.cache.find(_key(images, index, images.light), Sparse) is not None for index in seen)


@dataclass(frozen=True)
class _Part:
    """One term, as it was when the preview was asked for."""

    place: Place
    term: Term
    bands: Mapping[str, NDArray[np.float64]]


@dataclass(frozen=True, eq=False)
class Preview:
    """Rough images of terms in one light; the only route that reaches any light, from nothing.

    Attributes:
        gain: what multiplies the finished picture in that light.
        detail: how often it is made finer.
    """

    key: tuple[Hashable, ...]
    images: ViewImages
    light: Light
    gain: Rgb
    parts: Sequence[_Part]
    what: str = "the light"
    detail: int = 0
    refines: bool = False

    state: Literal["freezing", "shading"] = "shading"
    goes_on = False

    @classmethod
    def of(cls, images: ViewImages, places: Iterable[Place], what: str) -> Preview:
        """Of the terms at these places of a picture's images, in the look as it is now. what: in words."""
        places = list(places)
        parts = [_Part(place, place.live.term, place.live.target) for place in places]
        wanted = (images.key_of_image(place.material, place.live, images.light) for place in places)
        key = images.transfer.key, images.view.name, images.light, *wanted
        return cls(key, images, images.light, images.gain, parts, what)

    def finer(self, detail: int, *, refines: bool) -> Preview:
        """The same of more samples. refines: it can wait for hands."""
        return replace(self, key=(*self.key, detail), detail=detail, refines=refines)

    def sooner(self) -> Preview:
        """The same of what light comes straight: that between surfaces takes some seconds where it is not known."""
        return replace(self, key=(*self.key, "straight"), light=straight(self.light))

    def make(self, progress: Progress, cancelled: Cancelled) -> list[F32]:
        """See `Job`. Returns images of all parts, (tiles, 3, samples) float32 each."""
        found = []
        for k, part in enumerate(self.parts):
            sparse = _sparse(self.images, part.place.material.index, self.light, self.detail)
            found.append(self._glimpsed(part, sparse, cancelled))
            progress((k + 1) / len(self.parts))
        return found

    def _glimpsed(self, part: _Part, sparse: Sparse, cancelled: Cancelled) -> F32:
        """One term's image, (tiles, 3, samples) float32; a texture's samples have texels of their own, if quick."""
        arriving, texels = sparse.few.arriving(self.light), part.term.texels
        if texels is None or not is_quick(texels, part.place.material.num_samples):
            return _spread(shade(part.term, part.bands, *arriving, _unheard, cancelled), sparse.weights)
        receivers = self.images.unlit(part.place.material)
        return sent_between(texels, arrive(texels, *arriving, _unheard, cancelled), sparse.weights, receivers).image

    def install(self, made: Sequence[F32]) -> None:
        """See `Job`; also where the hand has turned the light further meanwhile."""
        for part, image in zip(self.parts, made, strict=True):
            live = part.place.live
            is_followed = live.ready.fidelity == Fidelity.FOLLOWED and live.ready.light == live.light
            is_same = live.term.model == part.term.model  # with other fixed parameters it is a glimpse of it as well
            if is_same and not (live.is_firm or is_followed) and part.place.is_there():
                live.put(self._over(part, image))

    def _over(self, part: _Part, image: F32) -> Shown:
        """The image in the place of what is ready; a part of that which is exact already stays."""
        ready, material = part.place.live.ready, part.place.material
        rough = replace(ready, image=image, fidelity=Fidelity.PREVIEW, bands=part.bands, light=self.light)
        if ready.exact_in is None or ready.light != self.light:
            return replace(rough, exact_in=None, detail=self.detail)
        which = material.lies_in(ready.exact_in[1])
        kept = with_rows(image, Shaded(ready.image).rows(len(which)), which)
        return replace(rough, image=kept, detail=self.detail)


def _unheard(share: float) -> None:
    """Say nothing: a part of a preview takes some milliseconds."""


def _spread(shaded: Shaded, weights: Any) -> F32:
    """An image of all samples from that of the few. (tiles, 3, samples) float32"""
    return Shaded.of(weights @ shaded.rows(weights.shape[1])).image
