"""From all values of a BTF to what is kept: local PCA of the texels, one view direction after another (Müller 2004).

Seen from one side, a texel is a row of its values in light from all sides, a few hundred numbers. Rows are brought to
what spans nearly all of them, clustered there, and mapped back; how far clusters and components have to go for an error
bound is found from some of the views. The error that is told is that of what was kept, as it is rounded.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from relume.basis.local_pca import Clusters, cluster, distances, missed, strongest
from relume.btf.begun import Arrays, Begun
from relume.btf.eigen import LARGEST, EigenBtf
from relume.btf.packing import cluster_bits, largest
from relume.btf.rings import Rings
from relume.errors import CancelledError, MaterialError

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MOST_CLUSTERS, MOST_COMPONENTS = 64, 16
MOST_TEXELS = 512 * 512
_MOST_SEEN = 1 << 25  # texels times directions: values of one side take 400 MB, and are there up to four times
_CLUSTERS = (1, 2, 4, 8, 16, 32, 64)  # among which the number is chosen
_SEED = 0  # of the first clusters
_SPAN = 64  # R: numbers that a texel's row is brought to
_LOOKED_AT = 5  # views that numbers are chosen by
_OF_CHOOSING = 0.2  # of the time, about
_MORE = 2  # components that are found, in case that other views need them
_LEAST_RATIO = 2.5  # what is larger is no compression
_BITS_OF_LAST = (3, 4, 5, 6, 8)  # of the weights of the last component, among which the number is chosen


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


class _Chosen(NamedTuple):
    """clusters, components: of each view. bits: of the weights of each component. (components,) uint8"""

    clusters: int
    components: int
    bits: NDArray[np.uint8]


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


def most_texels(directions: int) -> int:
    """How many can be kept of a BTF of so many directions."""
    return min(MOST_TEXELS, _MOST_SEEN // directions)


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
    (height, width), views = images.size, images.rings.num_directions
    if not 0 < height * width <= most_texels(views):
        raise MaterialError(
            f"the BTF has {width}×{height} texels; in {views} directions at most {most_texels(views):,} can be kept, "
            "scale it down"
        )

    def rows_of(view: int, share: float) -> F32:
        if cancelled():
            raise CancelledError("the compression was cancelled")
        progress(share)
        return _rows(images, view)

    arrays = _known(begun, "choice", lambda: _choice(images, bound, rows_of)._asdict())
    chosen = _Chosen(int(arrays["clusters"]), int(arrays["components"]), arrays["bits"])
    parts = []
    for view in range(views):
        rows = partial(rows_of, view, _OF_CHOOSING + (1 - _OF_CHOOSING) * view / views)
        parts.append(_Part(**_known(begun, f"view-{view}", partial(_found, rows, images.size, chosen, view))))
    energy = float(sum(part.energy for part in parts))
    if energy <= 0:
        raise MaterialError("the BTF is black; check its images")
    kept = _joined(images, parts, chosen.bits, energy)
    return kept.with_components(next((j for j, one in enumerate(kept.error) if one <= bound), chosen.components))


def _known(begun: Begun | None, name: str, find: Callable[[], Arrays]) -> Arrays:
    """What was found before, else find it now."""
    found = None if begun is None else begun.take(name)
    if found is None:
        found = find()
        if begun is not None:
            begun.put(name, found)
    return found


def _choice(images: Images, bound: float, rows_of: Callable[[int, float], F32]) -> _Chosen:
    """Choose clusters, components and bits by some of the views."""
    views = images.rings.num_directions
    looked_at = np.unique(np.linspace(0, views - 1, _LOOKED_AT).round().astype(int))
    some = [
        _span(rows_of(view, _OF_CHOOSING * number / len(looked_at)))
        for number, view in enumerate(looked_at)
    ]  # fmt: skip
    return _choose(some, bound)


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


def _choose(some: list[_Span], bound: float) -> _Chosen:
    """Find what keeps some views to a bound in the least space, else what errs least; and some components more."""
    best: tuple[tuple[float, ...], _Chosen] | None = None
    texels, values = len(some[0].z), some[0].basis.shape[1]
    energy = max(sum(span.energy for span in some), 1e-30)
    for num_clusters in _CLUSTERS:
        left, unit = np.zeros(MOST_COMPONENTS + 1), np.zeros(MOST_COMPONENTS)
        for span in some:
            found = cluster(span.z, num_clusters, MOST_COMPONENTS, np.random.default_rng(_SEED))
            left += span.lost + missed(span.z, found)
            unit += _rounding(span.z, found)
        for num, last in itertools.product(range(MOST_COMPONENTS + 1), _BITS_OF_LAST):
            bits = _bits(left[: num + 1], last)
            error = float(np.sqrt((left[num] + (unit[:num] / largest(bits) ** 2).sum()) / energy))
            rank = (max(error, bound), _size(num_clusters, bits, texels, values))
            more = np.append(bits, np.full(min(_MORE, MOST_COMPONENTS - num), last, np.uint8))
            is_small = _size(num_clusters, more, texels, values) * _LEAST_RATIO <= texels * values
            if is_small and (best is None or rank < best[0]):
                best = rank, _Chosen(num_clusters, len(more), more)
    return _Chosen(1, 0, np.zeros(0, np.uint8)) if best is None else best[1]


def _size(num_clusters: int, bits: NDArray[np.uint8], texels: int, values: int) -> float:
    """Bytes of a view, nearly."""
    return num_clusters * (2 + len(bits)) * values + texels * (cluster_bits(num_clusters) + float(bits.sum())) / 8


def _rounding(z: F32, found: Clusters) -> F64:
    """Squares that rounding of weights misses, were the largest of each cluster one step. (C,)"""
    out = np.zeros(found.components.shape[1])
    for k in np.unique(found.of):
        weight = (z[found.of == k] - found.mean[k]) @ found.components[k].T
        out += len(weight) * np.abs(weight).max(axis=0).astype(np.float64) ** 2 / 12
    return out


def _bits(left: F64, last: int) -> NDArray[np.uint8]:
    """Bits of weights: `last` for the last component, one more for four times as many squares that one tells. (C,)"""
    told = np.maximum(-np.diff(left), 1e-30)
    return np.asarray(np.clip(last + np.rint(0.5 * np.log2(told / told[-1:])), last, 8), np.uint8)


def _found(rows_of: Callable[[], F32], size: tuple[int, int], chosen: _Chosen, view: int) -> Arrays:
    """Cluster the texels of one view, and round what tells them: a `_Part`."""
    rows, rng = rows_of(), np.random.default_rng((_SEED, view))
    span = _span(rows)
    num, most_steps = chosen.components, largest(chosen.bits)
    found = cluster(span.z, chosen.clusters, num, rng)
    z = np.concatenate([level.reshape(-1, span.z.shape[1]) for level in levels_of(span.z, size)])
    of, weight = _told(z, found)
    reach = np.zeros((len(found.mean), num), np.float32)
    np.maximum.at(reach, of, np.abs(weight))
    weight = np.rint(weight * (most_steps / np.maximum(reach, 1e-30))[of])
    mean = (found.mean @ span.basis + span.centre).astype(np.float16)
    eigen = found.components @ span.basis
    most = np.maximum(np.abs(eigen).max(axis=2, initial=0), 1e-30)
    eigen, step = (
        np.rint(eigen * (LARGEST / most)[:, :, None]),
        (most * reach / (LARGEST * most_steps)).astype(np.float32),
    )
    by_light = (rows.shape[1] // 3, 3)
    part = _Part(
        of.astype(np.uint8), weight.astype(np.int8), mean.reshape(-1, *by_light),
        eigen.astype(np.int8).reshape(*step.shape, *by_light), step, span.centre.reshape(by_light),
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
    tables = (part.eigen * part.step[:, :, None, None]).astype(np.float32).reshape(*part.step.shape, rows.shape[1])
    for k in np.unique(of):
        mine = np.flatnonzero(of == k)
        away = rows[mine] - part.mean[k].astype(np.float32).ravel()
        left[0] += _energy(away)
        for j in range(num):
            away -= part.weight[mine, j, None].astype(np.float32) * tables[k, j]
            left[1 + j] += _energy(away)
    return left


def _joined(images: Images, parts: list[_Part], bits: NDArray[np.uint8], energy: float) -> EigenBtf:
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
        bits=bits,
        mean=stacked("mean"),
        eigen=stacked("eigen"),
        step=stacked("step"),
        average=np.stack([part.average for part in parts]),
        height=np.zeros((1, 1), np.float32),
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
