"""BTFs that were imported or made; `relume.assets.asset_store` keeps them.

    <folder>/<id>/mean.npy, eigen.npy, …        arrays of `relume.assets.btf.local_pca_btf.LocalPcaBtf`
                  packed.npy                    clusters and weights, in as few bits as they need
                  (`relume.assets.btf.bit_packing`) btf.json                      name, what it is, how well it is kept

Look documents name one as "btf:<id>".
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.assets.asset_store import AssetStore
from relume.assets.btf.bit_packing import cluster_bits, max_code, pack, packed_bytes, unpack
from relume.assets.btf.compress import MAX_CLUSTERS, MAX_COMPONENTS, MAX_TEXELS
from relume.assets.btf.direction_rings import make_direction_grid
from relume.assets.btf.local_pca_btf import I8, MAX_HEIGHT, U8, LocalPcaBtf
from relume.core.cache import asset_cached
from relume.core.errors import MaterialError

STORE = AssetStore("BTF", "btf:", "btf.json", MaterialError, max_entries=100)
_PACKED_FILE = "packed.npy"
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


def store_btf(
    folder: Path, source: Path, name: str, synthetic: str | None, compute: Callable[[], LocalPcaBtf]
) -> BtfRecord:
    """Keep a BTF under the hash of what it came from; the same twice is the same BTF, its newest name wins.

    Args:
        folder: of the asset store. source: the file that was imported, or says what was made.
        name: what people call it. synthetic: which geometry it was rendered from; None where it was measured.
        compute: reads or renders, and compresses; not called where it is here already.
    Raises:
        MaterialError: the store is full. And what `compute` raises; then nothing is kept.
    """

    def fill(staged_folder: Path) -> dict[str, Any]:
        btf = compute()
        for array in _ARRAYS:
            np.save(staged_folder / f"{array}.npy", getattr(btf, array))
        cluster_width = np.array([cluster_bits(btf.mean.shape[1])], np.uint8)
        rows = np.concatenate([(btf.cluster - max_code(cluster_width)).astype(np.int8)[..., None], btf.weight], axis=2)
        np.save(staged_folder / _PACKED_FILE, np.stack([pack(row, np.append(cluster_width, btf.bits)) for row in rows]))
        return {
            "synthetic": synthetic,
            "rings": [
                [float(np.degrees(theta)), int(count)]
                for theta, count in zip(btf.grid.theta, np.diff(btf.grid.first), strict=True)
            ],
            "shift": btf.grid.shift.tolist(),
            "bits": btf.bits.tolist(),
            "cluster_bits": int(cluster_width[0]),
            "error": list(btf.error),
            "ratio": btf.measured_bytes / btf.num_bytes,
        }

    return get_record(folder, STORE.store(folder, source, name, fill))


def records(folder: Path) -> list[BtfRecord]:
    """All BTFs of a folder, newest first."""
    return STORE.records(folder, get_record)


def get_record(folder: Path, identity: str) -> BtfRecord:
    """One of them. Raises NotFoundError; MaterialError where its files are damaged."""
    path = STORE.path(folder, identity)
    document, btf = STORE.load_record(path), _load(path)
    synthetic, ratio = document.get("synthetic"), document.get("ratio")
    if not (synthetic is None or isinstance(synthetic, str)) or not isinstance(ratio, float):
        raise STORE.damaged_error(path)
    return BtfRecord(
        identity, document["name"], document["created"], synthetic, btf.size, btf.grid.num_directions,
        btf.mean.shape[1], btf.num_components, btf.error, ratio,
    )  # fmt: skip


def load_btf(data: str) -> LocalPcaBtf:
    """What a look's `data` names.

    Raises:
        NotFoundError: it is not here. MaterialError: its files are damaged.
    """
    return _load(STORE.resolve(data))


@asset_cached("BTF file")
def _load(path: Path) -> LocalPcaBtf:
    document = STORE.load_record(path)
    try:
        shift = [float(value) for value in document.get("shift", [])]  # all rings began at φ = 0 before there was one
        grid = make_direction_grid([(float(theta), int(count)) for theta, count in document["rings"]], shift)
        error = tuple(float(value) for value in document["error"])
        arrays = {name: _array(path, name) for name in _ARRAYS if name != "height" or (path / "height.npy").exists()}
        arrays.setdefault("height", np.zeros((1, 1), np.float32))  # before there was one
        bits, cluster, weight = _texels(path, document, arrays["levels"])
    except (OSError, ValueError, KeyError, TypeError, EOFError) as problem:
        raise STORE.damaged_error(path) from problem
    if not all(arrays[name].dtype == dtype for name, dtype in _ARRAYS.items()):
        raise STORE.damaged_error(path)
    btf = LocalPcaBtf(grid=grid, error=error, bits=bits, cluster=cluster, weight=weight, **arrays)
    if not _is_consistent(btf):
        raise STORE.damaged_error(path)
    return btf


def _texels(path: Path, document: Mapping[str, Any], levels: NDArray[np.int32]) -> tuple[U8, U8, I8]:
    """Bits, clusters and weights. Raises ValueError, KeyError, TypeError, OSError, EOFError where they do not fit."""
    if "bits" not in document:  # each had a byte before they were packed
        weight = _array(path, "weight")
        if weight.dtype != np.int8 or weight.ndim != 3:
            raise ValueError("weights")
        return np.full(weight.shape[2], 8, np.uint8), _clusters(path), weight
    bits = np.array([int(value) for value in document["bits"]])
    if len(bits) > MAX_COMPONENTS or not ((bits >= 2) & (bits <= 8)).all():
        raise ValueError("bits")
    component_bits = bits.astype(np.uint8)
    if "cluster_bits" not in document:  # so had clusters
        cluster = _clusters(path)
        return component_bits, cluster, _read_packed_rows(path, component_bits, cluster.shape[1])
    width = int(document["cluster_bits"])
    if not 1 <= width <= cluster_bits(MAX_CLUSTERS) or levels.ndim != 2 or levels.shape[1:] != (3,):
        raise ValueError("clusters")
    cluster_width = np.array([width], np.uint8)
    num = int(levels[:, 1:].astype(np.int64).prod(axis=1).sum())
    rows = _read_packed_rows(path, np.append(cluster_width, component_bits), num)
    return (
        component_bits,
        (rows[..., 0] + max_code(cluster_width)).astype(np.uint8),
        np.ascontiguousarray(rows[..., 1:]),
    )


def _clusters(path: Path) -> U8:
    cluster = _array(path, "cluster")
    if cluster.dtype != np.uint8 or cluster.ndim != 2:
        raise ValueError("clusters")
    return cluster


def _read_packed_rows(path: Path, bits: U8, num: int) -> I8:
    """Rows of so many texels from each side. (V, num, columns)"""
    rows = _array(path, "packed")
    if rows.dtype != np.uint8 or rows.ndim != 2 or rows.shape[1] != packed_bytes(num, bits):
        raise ValueError("packed")
    return np.stack([unpack(row, bits, num) for row in rows])


def _array(path: Path, name: str) -> np.ndarray[Any, Any]:
    """One of them; the large one stays on the disk until tables are made of it, which lists do not need."""
    array: np.ndarray[Any, Any] = np.load(
        path / f"{name}.npy", mmap_mode="r" if name == "eigen" else None, allow_pickle=False
    )
    return array.view(np.ndarray)


def _is_consistent(btf: LocalPcaBtf) -> bool:
    """Whether its arrays fit each other: kernels read them without looking."""
    directions = btf.grid.num_directions
    components, clusters = len(btf.error) - 1, btf.mean.shape[1] if btf.mean.ndim == 4 else 0
    if not (1 <= clusters <= MAX_CLUSTERS and 0 <= components <= MAX_COMPONENTS):
        return False
    if btf.levels.ndim != 2 or btf.levels.shape[1] != 3 or not 1 <= len(btf.levels) <= 32:
        return False
    first, height, width = btf.levels.T.astype(np.int64)
    texels = int((height * width).sum())
    ends = np.concatenate([[0], np.cumsum(height * width)[:-1]])
    return bool(
        (height > 0).all()
        and (width > 0).all()
        and height[0] * width[0] <= MAX_TEXELS
        and (first == ends).all()
        and btf.cluster.shape == (directions, texels)
        and int(btf.cluster.max()) < clusters
        and btf.weight.shape == (directions, texels, components)
        and btf.bits.shape == (components,)
        and btf.mean.shape == (directions, clusters, directions, 3)
        and btf.eigen.shape == (directions, clusters, components, directions, 3)
        and btf.step.shape == (directions, clusters, components)
        and btf.average.shape == (directions, directions, 3)
        and btf.height.shape in ((1, 1), btf.size)
        and all(np.isfinite(array).all() for array in (btf.mean, btf.step, btf.average, btf.height))
        and float(np.abs(btf.height).max()) <= MAX_HEIGHT
    )
