"""BTFs that were imported or made; `relume.asset_store` keeps them.

    <folder>/<id>/mean.npy, eigen.npy, …        arrays of `relume.btf.eigen.EigenBtf`
                  packed.npy                    clusters and weights, in as few bits as they need (`relume.btf.packing`)
                  btf.json                      name, what it is, how well it is kept

Look documents name one as "btf:<id>".
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.asset_store import AssetStore
from relume.btf.compress import MOST_CLUSTERS, MOST_COMPONENTS, MOST_TEXELS
from relume.btf.eigen import I8, MOST_HEIGHT, U8, EigenBtf
from relume.btf.packing import cluster_bits, largest, packed, packed_bytes, unpacked
from relume.btf.rings import rings_of
from relume.errors import MaterialError
from relume.memory import stored

STORE = AssetStore("BTF", "btf:", "btf.json", MaterialError, max_entries=100)
_PACKED = "packed.npy"
_ARRAYS = {
    "levels": np.int32, "mean": np.float16, "eigen": np.int8,
    "step": np.float32, "average": np.float32,
    "height": np.float32,
}  # fmt: skip


@dataclass(frozen=True)
class BtfRecord:
    """What lists show of a BTF.

    Attributes:
        created: seconds since 1970.
        synthetic: which geometry it was rendered from; None where it was measured.
        size: height and width, texels. directions: of light, and as many of view.
        clusters, components: that are kept. error: relative RMS, by how many components are used, from none on.
        ratio: of what was measured, a byte a channel, to what is kept.
    """

    id: str
    name: str
    created: float
    synthetic: str | None
    size: tuple[int, int]
    directions: int
    clusters: int
    components: int
    error: tuple[float, ...]
    ratio: float

    @property
    def data(self) -> str:
        """The name by which look documents mean it."""
        return STORE.prefix + self.id

    def terms(self) -> list[dict[str, Any]]:
        """It as terms of a look, without a texture of the scene's: it is its own."""
        return [{"model": "measured_btf", "data": self.data, "texture": None}]


def keep(folder: Path, source: Path, name: str, synthetic: str | None, make: Callable[[], EigenBtf]) -> BtfRecord:
    """Keep a BTF under the hash of what it came from; the same twice is the same BTF, its newest name wins.

    Args:
        folder: of the asset store. source: the file that was imported, or says what was made.
        name: what people call it. synthetic: which geometry it was rendered from; None where it was measured.
        make: reads or renders, and compresses; not called where it is here already.
    Raises:
        MaterialError: the store is full. And what `make` raises; then nothing is kept.
    """

    def fill(made: Path) -> dict[str, Any]:
        found = make()
        for array in _ARRAYS:
            np.save(made / f"{array}.npy", getattr(found, array))
        of_clusters = np.array([cluster_bits(found.mean.shape[1])], np.uint8)
        rows = np.concatenate([(found.cluster - largest(of_clusters)).astype(np.int8)[..., None], found.weight], axis=2)
        np.save(made / _PACKED, np.stack([packed(row, np.append(of_clusters, found.bits)) for row in rows]))
        return {
            "synthetic": synthetic,
            "rings": [
                [float(np.degrees(theta)), int(count)]
                for theta, count in zip(found.rings.theta, np.diff(found.rings.first), strict=True)
            ],
            "shift": found.rings.shift.tolist(),
            "bits": found.bits.tolist(),
            "cluster_bits": int(of_clusters[0]),
            "error": list(found.error),
            "ratio": found.measured_bytes / found.num_bytes,
        }

    return get_record(folder, STORE.keep(folder, source, name, fill))


def records(folder: Path) -> list[BtfRecord]:
    """All BTFs of a folder, newest first."""
    return STORE.records(folder, get_record)


def get_record(folder: Path, identity: str) -> BtfRecord:
    """One of them. Raises NotFoundError; MaterialError where its files are damaged."""
    path = STORE.path(folder, identity)
    document, found = STORE.read(path), _load(path)
    synthetic, ratio = document.get("synthetic"), document.get("ratio")
    if not (synthetic is None or isinstance(synthetic, str)) or not isinstance(ratio, float):
        raise STORE.damaged(path)
    return BtfRecord(
        identity, document["name"], document["created"], synthetic, found.size, found.rings.num_directions,
        found.mean.shape[1], found.num_components, found.error, ratio,
    )  # fmt: skip


def btf(data: str) -> EigenBtf:
    """What a look's `data` names.

    Raises:
        NotFoundError: it is not here. MaterialError: its files are damaged.
    """
    return _load(STORE.found(data))


@stored("BTF file")
def _load(path: Path) -> EigenBtf:
    document = STORE.read(path)
    try:
        shift = [float(one) for one in document.get("shift", [])]  # all rings began at φ = 0 before there was one
        rings = rings_of([(float(theta), int(count)) for theta, count in document["rings"]], shift)
        error = tuple(float(one) for one in document["error"])
        arrays = {name: _array(path, name) for name in _ARRAYS if name != "height" or (path / "height.npy").exists()}
        arrays.setdefault("height", np.zeros((1, 1), np.float32))  # before there was one
        bits, cluster, weight = _texels(path, document, arrays["levels"])
    except (OSError, ValueError, KeyError, TypeError, EOFError) as problem:
        raise STORE.damaged(path) from problem
    if not all(arrays[name].dtype == dtype for name, dtype in _ARRAYS.items()):
        raise STORE.damaged(path)
    found = EigenBtf(rings=rings, error=error, bits=bits, cluster=cluster, weight=weight, **arrays)
    if not _is_sound(found):
        raise STORE.damaged(path)
    return found


def _texels(path: Path, document: Mapping[str, Any], levels: NDArray[np.int32]) -> tuple[U8, U8, I8]:
    """Bits, clusters and weights. Raises ValueError, KeyError, TypeError, OSError, EOFError where they do not fit."""
    if "bits" not in document:  # each had a byte before they were packed
        weight = _array(path, "weight")
        if weight.dtype != np.int8 or weight.ndim != 3:
            raise ValueError("weights")
        return np.full(weight.shape[2], 8, np.uint8), _clusters(path), weight
    bits = np.array([int(one) for one in document["bits"]])
    if len(bits) > MOST_COMPONENTS or not ((bits >= 2) & (bits <= 8)).all():
        raise ValueError("bits")
    of_bits = bits.astype(np.uint8)
    if "cluster_bits" not in document:  # so had clusters
        cluster = _clusters(path)
        return of_bits, cluster, _unpacked(path, of_bits, cluster.shape[1])
    width = int(document["cluster_bits"])
    if not 1 <= width <= cluster_bits(MOST_CLUSTERS) or levels.ndim != 2 or levels.shape[1:] != (3,):
        raise ValueError("clusters")
    of_clusters = np.array([width], np.uint8)
    num = int(levels[:, 1:].astype(np.int64).prod(axis=1).sum())
    rows = _unpacked(path, np.append(of_clusters, of_bits), num)
    return of_bits, (rows[..., 0] + largest(of_clusters)).astype(np.uint8), np.ascontiguousarray(rows[..., 1:])


def _clusters(path: Path) -> U8:
    found = _array(path, "cluster")
    if found.dtype != np.uint8 or found.ndim != 2:
        raise ValueError("clusters")
    return found


def _unpacked(path: Path, bits: U8, num: int) -> I8:
    """Rows of so many texels from each side. (V, num, columns)"""
    rows = _array(path, "packed")
    if rows.dtype != np.uint8 or rows.ndim != 2 or rows.shape[1] != packed_bytes(num, bits):
        raise ValueError("packed")
    return np.stack([unpacked(row, bits, num) for row in rows])


def _array(path: Path, name: str) -> np.ndarray[Any, Any]:
    """One of them; the large one stays on the disk until tables are made of it, which lists do not need."""
    found: np.ndarray[Any, Any] = np.load(
        path / f"{name}.npy", mmap_mode="r" if name == "eigen" else None, allow_pickle=False
    )
    return found.view(np.ndarray)


def _is_sound(found: EigenBtf) -> bool:
    """Whether its arrays fit each other: kernels read them without looking."""
    directions = found.rings.num_directions
    components, clusters = len(found.error) - 1, found.mean.shape[1] if found.mean.ndim == 4 else 0
    if not (1 <= clusters <= MOST_CLUSTERS and 0 <= components <= MOST_COMPONENTS):
        return False
    if found.levels.ndim != 2 or found.levels.shape[1] != 3 or not 1 <= len(found.levels) <= 32:
        return False
    first, height, width = found.levels.T.astype(np.int64)
    texels = int((height * width).sum())
    ends = np.concatenate([[0], np.cumsum(height * width)[:-1]])
    return bool(
        (height > 0).all()
        and (width > 0).all()
        and height[0] * width[0] <= MOST_TEXELS
        and (first == ends).all()
        and found.cluster.shape == (directions, texels)
        and int(found.cluster.max()) < clusters
        and found.weight.shape == (directions, texels, components)
        and found.bits.shape == (components,)
        and found.mean.shape == (directions, clusters, directions, 3)
        and found.eigen.shape == (directions, clusters, components, directions, 3)
        and found.step.shape == (directions, clusters, components)
        and found.average.shape == (directions, directions, 3)
        and found.height.shape in ((1, 1), found.size)
        and all(np.isfinite(array).all() for array in (found.mean, found.step, found.average, found.height))
        and float(np.abs(found.height).max()) <= MOST_HEIGHT
    )
