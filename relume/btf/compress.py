"""From all values of a BTF to what is kept: local PCA of the texels, one view direction after another (Müller 2004).

Seen from one side, a texel is a row of its values in light from all sides, a few hundred numbers. Rows are brought to
what spans nearly all of them, clustered there, and mapped back; how far clusters and components have to go for an error
bound is found from some of the views. The error that is told is that of what was kept, as it is rounded.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from relume.basis.local_pca import Clusters, cluster, distances, missed, strongest
from relume.btf.begun import Arrays, Begun
from relume.btf.eigen import LARGEST, EigenBtf
from relume.btf.rings import Rings
from relume.errors import CancelledError, MaterialError

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MOST_CLUSTERS, MOST_COMPONENTS = 64, 16
MOST_TEXELS = 512 * 512
_CLUSTERS = (1, 2, 4, 8, 16, 32, 64)  # among which the number is chosen
_SEED = 0  # of the first clusters
_SPAN = 64  # R: numbers that a texel's row is brought to
_LOOKED_AT = 5  # views that numbers are chosen by
_OF_CHOOSING = 0.2  # of the time, about
_MORE = 2  # components that are found, in case that other views need them
_LEAST_RATIO = 2.5  # what is larger is no compression


class Images(Protocol):
    """All values of a BTF, as they are read."""

    rings: Rings
    size: tuple[int, int]

    def seen_from(self, view: int) -> F32:
        """Every texel's values from one direction. (lights, texels, 3) float32, finite, not negative"""
        ...


class _Span(NamedTuple):
    """rows ≈ centre + z basis, orthonormal. z: (texels, R). basis: (R, F). lost: squares missed. energy: of all."""

    z: F32
    basis: F32
    centre: F32
    lost: float
    energy: float


class _Part(NamedTuple):
    """What is kept from one side: a view of `EigenBtf`'s arrays; squares of all, and missed by how many components."""

    cluster: NDArray[np.uint8]
    weight: NDArray[np.int8]
    mean: NDArray[np.float16]
    eigen: NDArray[np.int8]
    step: F32
    average: F32
    energy: NDArray[np.float64]
    missed: F64


def compress(
    images: Images,
    bound: float,
    progress: Callable[[float], object],
    cancelled: Callable[[], bool],
    begun: Begun | None = None,
) -> EigenBtf:
    """Choose clusters and components so that no more is kept than an error bound needs.

    Args:
        images: the BTF. bound: relative RMS that is allowed.
        progress: called with the share done. cancelled: asked before each view.
        begun: parts that were found before, which are not found again; new ones are put there.
    Raises:
        MaterialError: values are not finite, or negative, or the BTF is black. CancelledError: `cancelled` said so.
    """
    height, width = images.size
    if not 0 < height * width <= MOST_TEXELS:
        raise MaterialError(f"the BTF has {width}×{height} texels; at most {MOST_TEXELS:,} can be kept")
    views = images.rings.num_directions

    def rows_of(view: int, share: float) -> F32:
        if cancelled():
            raise CancelledError("the compression was cancelled")
        progress(share)
        return _rows(images, view)

    chosen = _known(begun, "choice", lambda: _choice(images, bound, rows_of))
    num_clusters, num = int(chosen["clusters"]), int(chosen["components"])
    parts = []
    for view in range(views):
        rows = partial(rows_of, view, _OF_CHOOSING + (1 - _OF_CHOOSING) * view / views)
        parts.append(
            _Part(**_known(begun, f"view-{view}", partial(_found, rows, images.size, num_clusters, num, view)))
        )
    energy = float(sum(part.energy for part in parts))
    if energy <= 0:
        raise MaterialError("the BTF is black")
    kept = _joined(images, parts, energy)
    return kept.with_components(next((j for j, one in enumerate(kept.error) if one <= bound), num))


def _known(begun: Begun | None, name: str, find: Callable[[], Arrays]) -> Arrays:
    """What was found before, else find it now."""
    found = None if begun is None else begun.take(name)
    if found is None:
        found = find()
        if begun is not None:
            begun.put(name, found)
    return found


def _choice(images: Images, bound: float, rows_of: Callable[[int, float], F32]) -> Arrays:
    """Choose clusters and components by some of the views."""
    views = images.rings.num_directions
    looked_at = np.unique(np.linspace(0, views - 1, _LOOKED_AT).round().astype(int))
    some = [
        _span(rows_of(view, _OF_CHOOSING * number / len(looked_at)))
        for number, view in enumerate(looked_at)
    ]  # fmt: skip
    num_clusters, least = _choose(some, bound)
    return {"clusters": np.array(num_clusters), "components": np.array(min(least + _MORE, MOST_COMPONENTS))}


def _rows(images: Images, view: int) -> F32:
    """Every texel's values from one side. (texels, lights · 3)"""
    seen = images.seen_from(view)
    if not np.isfinite(seen).all() or seen.min() < 0:
        raise MaterialError("values of the BTF are negative or no numbers")
    return np.ascontiguousarray(seen.transpose(1, 0, 2)).reshape(seen.shape[1], -1)


def _span(rows: F32) -> _Span:
    centre = rows.mean(axis=0)
    away = rows - centre
    found = strongest(away, _SPAN)
    basis = found if len(found) else np.zeros((1, rows.shape[1]), np.float32)  # all texels are alike
    z = away @ basis.T
    lost = max(_energy(away) - _energy(z), 0.0)
    return _Span(z, basis, centre, lost, _energy(rows))


def _energy(rows: F32) -> float:
    return float(np.einsum("nr,nr->", rows, rows, dtype=np.float64))


def _choose(some: list[_Span], bound: float) -> tuple[int, int]:
    """Find the clusters and components that keep some views to a bound in the least space, else what errs least."""
    best: tuple[float, float, int, int] | None = None
    texels = len(some[0].z)
    values = some[0].basis.shape[1]
    energy = max(sum(span.energy for span in some), 1e-30)
    for num_clusters in _CLUSTERS:
        left = np.zeros(MOST_COMPONENTS + 1)
        for span in some:
            rng = np.random.default_rng(_SEED)
            left += span.lost + missed(span.z, cluster(span.z, num_clusters, MOST_COMPONENTS, rng))
        for num, error in enumerate(np.sqrt(left / energy)):
            size = num_clusters * (2 + num) * values + texels * (1 + num)
            rank = (max(float(error), bound), float(size), num_clusters, num)
            if size * _LEAST_RATIO <= texels * values and (best is None or rank < best):
                best = rank
    return (1, 0) if best is None else best[2:]


def _found(rows_of: Callable[[], F32], size: tuple[int, int], num_clusters: int, num: int, view: int) -> Arrays:
    """Cluster the texels of one view, and round what tells them: a `_Part`."""
    rows, rng = rows_of(), np.random.default_rng((_SEED, view))
    span = _span(rows)
    found = cluster(span.z, num_clusters, num, rng)
    z = np.concatenate([level.reshape(-1, span.z.shape[1]) for level in levels_of(span.z, size)])
    of, weight = _told(z, found)
    reach = np.zeros((len(found.mean), num), np.float32)
    np.maximum.at(reach, of, np.abs(weight))
    weight = np.rint(weight * (LARGEST / np.maximum(reach, 1e-30))[of])
    mean = (found.mean @ span.basis + span.centre).astype(np.float16)
    eigen = found.components @ span.basis
    most = np.maximum(np.abs(eigen).max(axis=2, initial=0), 1e-30)
    eigen, step = np.rint(eigen * (LARGEST / most)[:, :, None]), (most * reach / LARGEST**2).astype(np.float32)
    by_light = (len(mean), -1, 3)
    part = _Part(
        of.astype(np.uint8), weight.astype(np.int8), mean.reshape(by_light),
        eigen.astype(np.int8).reshape(*step.shape, -1, 3), step, span.centre.reshape(-1, 3),
        np.array(span.energy), np.zeros(0),
    )  # fmt: skip
    return part._replace(missed=_missed(rows, part))._asdict()


def _told(z: F32, found: Clusters) -> tuple[NDArray[np.intp], F32]:
    """Which cluster tells each row best, and by which weights. (n,), (n, C)"""
    of, weight = np.argmin(distances(z, found), axis=1), np.empty((len(z), found.components.shape[1]), np.float32)
    for k in np.unique(of):
        weight[of == k] = (z[of == k] - found.mean[k]) @ found.components[k].T
    return of, weight


def _missed(rows: F32, part: _Part) -> F64:
    """Squares that what is kept misses of the finest texels, by how many components are used. (C + 1,)"""
    num = part.step.shape[1]
    left, of = np.zeros(num + 1), part.cluster[: len(rows)]
    tables = (part.eigen * part.step[:, :, None, None]).astype(np.float32).reshape(*part.step.shape, -1)
    for k in np.unique(of):
        mine = np.flatnonzero(of == k)
        away = rows[mine] - part.mean[k].astype(np.float32).ravel()
        left[0] += _energy(away)
        for j in range(num):
            away -= part.weight[mine, j, None].astype(np.float32) * tables[k, j]
            left[1 + j] += _energy(away)
    return left


def _joined(images: Images, parts: list[_Part], energy: float) -> EigenBtf:
    """Put the views together. Clusters that a view has fewer of are empty there."""
    nothing = np.zeros((images.size[0] * images.size[1], 1), np.float32)
    shapes = [level.shape[:2] for level in levels_of(nothing, images.size)]
    ends = np.cumsum([0, *(height * width for height, width in shapes)])
    most = max(len(part.mean) for part in parts)

    def stacked(name: str) -> NDArray[Any]:
        arrays = [getattr(part, name) for part in parts]
        return np.stack([np.pad(one, [(0, most - len(one)), *[(0, 0)] * (one.ndim - 1)]) for one in arrays])

    return EigenBtf(
        rings=images.rings,
        levels=np.array([(first, *shape) for first, shape in zip(ends[:-1], shapes, strict=True)], np.int32),
        cluster=np.stack([part.cluster for part in parts]),
        weight=np.stack([part.weight for part in parts]),
        mean=stacked("mean"),
        eigen=stacked("eigen"),
        step=stacked("step"),
        average=np.stack([part.average for part in parts]),
        error=tuple(float(one) for one in np.sqrt(np.sum([part.missed for part in parts], axis=0) / energy)),
    )


def levels_of(z: F32, size: tuple[int, int]) -> list[F32]:
    """Average texels over 2 × 2, again and again, down to one: what a distant eye sees.

    Args:
        z: of the finest, row after row. (height · width, R). size: height and width.
    Returns:
        (height, width, R) of each level, the finest first.
    """
    levels = [z.reshape(*size, z.shape[1])]
    while levels[-1].shape[:2] != (1, 1):
        image = levels[-1]
        height, width = image.shape[:2]
        image = image[: max(1, height // 2 * 2), : max(1, width // 2 * 2)]
        if height > 1:
            image = 0.5 * (image[0::2] + image[1::2])
        if width > 1:
            image = 0.5 * (image[:, 0::2] + image[:, 1::2])
        levels.append(image)
    return levels
