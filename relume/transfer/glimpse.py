"""A glimpse of other light: one sample of each small square of pixels is shaded, those between are interpolated.

When the environment is turned or exchanged, or surfaces reflect other light onto each other, every image of a picture
counts for nothing at once, and shading all samples takes seconds; so it does where a view is opened for the first time.
A glimpse costs a few thousand samples whatever the picture's size, holds no operator, and lets the hand see where the
light goes; colours and textures multiply it at full size. It is never called exact: at rest all is shaded.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from relume.brdf.term import Term
from relume.look.model import Rgb
from relume.trace.cell_tree import NO_CELL
from relume.transfer.light import Light
from relume.transfer.local import Points
from relume.transfer.material_image import MaterialImage
from relume.transfer.receivers import GatherRays, LocalRays, Receivers
from relume.transfer.shade import Shaded, shade
from relume.transfer.term_image import TermImage
from relume.transfer.view import View
from relume.transfer.view_images import ViewImages

F32 = NDArray[np.float32]

_MOST_SHADED = 6000  # samples of a view, about
_FEW_TO_SHADE = 8 * _MOST_SHADED  # samples of terms of a view; they take about as long as choosing some of them
_NUM_NEIGHBOURS = 3
_PIXELS_A_TURN = 10.0  # a unit of normals counts as so many squares of pixels
_SOFT = 0.5  # pixels²; a sample's own neighbours share it where they are as near as this


@dataclass(frozen=True)
class Sparse:
    """The samples of a material that are shaded, and how all others are made from them.

    Attributes:
        receivers: without any rays. gathered: their gather rays, where those were baked; they bring nothing yet.
        points: where they are.
        weights: rows sum to one. (samples, shaded samples)
    """

    receivers: Receivers
    gathered: GatherRays | None
    points: Points
    weights: Any

    @property
    def num_bytes(self) -> int:
        """Memory it holds."""
        few, weights = self.receivers, self.weights
        links = 0 if self.gathered is None else self.gathered.links.nbytes
        of_few = 2 * few.normal.nbytes + few.tangent.nbytes + few.wo.nbytes + few.visible.nbytes + links
        return int(of_few + weights.data.nbytes + weights.indices.nbytes + weights.indptr.nbytes)

    def lit_by(self, reflected: F32 | None, local: Sequence[LocalRays]) -> Receivers:
        """The few samples in the light as it is now. reflected: radiance of the gather cells, None for none."""
        if self.gathered is None or reflected is None:
            return replace(self.receivers, rays=local)
        return replace(self.receivers, rays=(replace(self.gathered, radiance=reflected), *local))


def choose_sparse(view: View, material: int, *, has_rays: bool) -> Sparse:
    """One sample of each square of pixels that a material is seen in; reads the store.

    Those between take the mean of the nearest, by place in the picture and by normal.

    Args:
        has_rays: whether gather rays were baked; they bring nothing before `Sparse.lit_by`.
    """
    rows = view.rows(material)
    step = max(1, int(np.ceil(np.sqrt(view.num_surface_samples / _MOST_SHADED))))
    y, x = np.divmod(view.pixel[rows].astype(np.int64), view.width)
    _, chosen = np.unique(y // step * view.width + x // step, return_index=True)
    whole, points = view.receivers(material), view.points(material)
    place = np.concatenate([np.stack([x, y], axis=1), _PIXELS_A_TURN * step * whole.normal], axis=1)
    num = min(_NUM_NEIGHBOURS, len(chosen))
    distance, nearest = cKDTree(place[chosen]).query(place, k=list(range(1, num + 1)))
    weight = 1 / (distance**2 + _SOFT)
    weight /= weight.sum(axis=1, keepdims=True)
    first = np.arange(0, weight.size + 1, num)
    shape = (len(place), len(chosen))
    gathered = view.gather_rays(material, np.zeros((NO_CELL + 1, 3), np.float32)) if has_rays else None
    return Sparse(
        Receivers(whole.normal[chosen], whole.tangent[chosen], whole.wo[chosen], whole.visible[chosen]),
        gathered and gathered.alone(chosen),
        Points(points.position[chosen], points.normal[chosen], points.numbers[chosen]),
        csr_array((weight.ravel().astype(np.float32), nearest.ravel(), first), shape=shape),
    )


def _sparse(images: ViewImages, material: int) -> Sparse:
    """Of a material of a view, kept in the cache with the operators."""

    def choose() -> Sparse:
        return choose_sparse(images.view, material, has_rays=images.transfer.cells is not None)

    return images.cache.get(_key(images, material), Sparse, _bytes_of(images, material), choose)


def _key(images: ViewImages, material: int) -> tuple[Hashable, ...]:
    return images.transfer.key, images.view.name, material, "sparse"


def _bytes_of(images: ViewImages, material: int) -> int:
    """Memory that `Sparse` takes at most, but for the few samples themselves."""
    rows = images.view.rows(material)
    return int(rows.stop - rows.start) * (_NUM_NEIGHBOURS * 12 + 8)


def can_glimpse(images: ViewImages) -> bool:
    """Whether the cache has room for it beside other things."""
    return 2 * sum(_bytes_of(images, k) for k in range(len(images.by_name))) <= images.cache.budget_bytes


def helps_to_open(images: ViewImages) -> bool:
    """Whether a picture that shows nothing yet is seen much sooner so than by making the images that it lacks."""
    lacking = sum(m.num_samples for m, image in images.terms() if not images.is_at_hand(m, image))
    return lacking > _FEW_TO_SHADE and can_glimpse(images)


def is_prepared(images: ViewImages) -> bool:
    """Whether the samples have been chosen: the first glimpse of a view takes a second more."""
    seen = {material.index for material, _ in images.terms()}
    return all(images.cache.find(_key(images, index), Sparse) is not None for index in seen)


@dataclass(frozen=True)
class _Part:
    """One term, as it was when the glimpse was asked for."""

    material: MaterialImage
    image: TermImage
    term: Term
    bands: Mapping[str, NDArray[np.float64]]


@dataclass(frozen=True, eq=False)
class Glimpse:
    """A need of images of all terms in one light; made like a `Need`, adopted by the picture.

    Attributes:
        gain: what multiplies the finished picture in that light.
    """

    key: tuple[Hashable, ...]
    images: ViewImages
    light: Light
    gain: Rgb
    parts: Sequence[_Part]
    what: str = "the light"

    state: Literal["shading"] = "shading"
    refines = False

    @classmethod
    def of(cls, images: ViewImages, terms: Iterable[tuple[MaterialImage, TermImage]], what: str) -> Glimpse:
        """Of these terms in the look as it is now. what: in words."""
        parts = [_Part(material, image, image.term, image.target) for material, image in terms]
        key = images.transfer.key, images.view.name, images.light
        return cls(key, images, images.light, images.gain, parts, what)

    def make(self, progress: Callable[[float], None], cancelled: Callable[[], bool]) -> list[F32]:
        """Images of all parts. (tiles, 3, samples) float32 each

        Args:
            progress: called with the share done. cancelled: asked now and then.
        Raises:
            CancelledError: `cancelled` said so.
        """
        transfer = self.images.transfer
        lights, reflected = transfer.rough_lights_of(self.light), transfer.reflected_in(self.light)
        found = []
        for k, part in enumerate(self.parts):
            sparse = _sparse(self.images, part.material.index)
            lit = sparse.lit_by(reflected, transfer.local.all_rays(self.light, sparse.points))
            shaded = shade(part.term, part.bands, lights, lit, lambda share: None, cancelled)
            found.append(_spread(shaded, sparse.weights))
            progress((k + 1) / len(self.parts))
        return found

    def adopt(self, made: Sequence[F32]) -> None:
        """Show them where there is nothing better, also where the hand has turned the light further meanwhile."""
        for part, image in zip(self.parts, made, strict=True):
            if part.image.effective is None and any(part.image is known for known in part.material.terms):
                part.image.glimpse(image, part.bands, self.light)


def _spread(shaded: Shaded, weights: Any) -> F32:
    """An image of all samples from that of the few. (tiles, 3, samples) float32"""
    return Shaded.of(weights @ shaded.rows(weights.shape[1])).image
