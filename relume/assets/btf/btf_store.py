"""Store of imported and synthetic BTFs, in `relume.assets.asset_store`.

    <folder>/<id>/mean.npy, eigen.npy, …        arrays of `relume.assets.btf.local_pca_btf.LocalPcaBtf`
                  packed.npy                    clusters and weights, bit-packed (`relume.assets.btf.bit_packing`)
                  btf.json                      name, origin, directions, error of the compression

Looks refer to one as "btf:<id>".
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
    """A BTF in lists.

    Attributes:
        created: seconds since 1970.
        synthetic: name of the geometry; None for a measured BTF.
        size: height and width, texels. directions: directions of light, the same number as of view.
        clusters, components: number of clusters and of components per view.
        error: relative RMS by the number of components, from zero.
        ratio: bytes of the measurement, one per channel, over compressed bytes.
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
        """Name of the BTF in looks."""
        return STORE.prefix + self.id

    def terms(self) -> list[dict[str, Any]]:
        """Terms of the BTF in a look; they use no texture of the scene."""
        return [{"model": "measured_btf", "data": self.data, "texture": None}]


def store_btf(
    folder: Path, source: Path, name: str, synthetic: str | None, compute: Callable[[], LocalPcaBtf]
) -> BtfRecord:
    """Store a BTF under the hash of its source; an existing one gets the new name.

    Args:
        folder: folder of the asset store. source: the imported file, or a description of the synthesis.
        name: shown to users. synthetic: name of the geometry; None for a measured BTF.
        compute: reads or renders, and compresses; not called if the BTF exists.
    Raises:
        MaterialError: the store is full. If `compute` raises, nothing is stored.
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
    """Return all BTFs of a folder, newest first."""
    return STORE.records(folder, get_record)


def get_record(folder: Path, identity: str) -> BtfRecord:
    """Return one BTF. Raises NotFoundError; MaterialError if its files are damaged."""
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
    """Load the BTF of a look's `data`.

    Raises:
        NotFoundError: it does not exist. MaterialError: its files are damaged.
    """
    return _load(STORE.resolve(data))


@asset_cached("BTF file")
def _load(path: Path) -> LocalPcaBtf:
    document = STORE.load_record(path)
    try:
        shift = [float(value) for value in document.get("shift", [])]  # older files have none: all rings start at φ = 0
        grid = make_direction_grid([(float(theta), int(count)) for theta, count in document["rings"]], shift)
        error = tuple(float(value) for value in document["error"])
        arrays = {name: _array(path, name) for name in _ARRAYS if name != "height" or (path / "height.npy").exists()}
        arrays.setdefault("height", np.zeros((1, 1), np.float32))  # older files have none
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
    """Bits, clusters and weights. Raises ValueError, KeyError, TypeError, OSError, EOFError if inconsistent."""
    if "bits" not in document:  # older files: one byte each, not packed
        weight = _array(path, "weight")
        if weight.dtype != np.int8 or weight.ndim != 3:
            raise ValueError("weights")
        return np.full(weight.shape[2], 8, np.uint8), _clusters(path), weight
    bits = np.array([int(value) for value in document["bits"]])
    if len(bits) > MAX_COMPONENTS or not ((bits >= 2) & (bits <= 8)).all():
        raise ValueError("bits")
    component_bits = bits.astype(np.uint8)
    if "cluster_bits" not in document:  # older files: clusters not packed
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
    """Rows of `num` texels for each view. (V, num, columns)"""
    rows = _array(path, "packed")
    if rows.dtype != np.uint8 or rows.ndim != 2 or rows.shape[1] != packed_bytes(num, bits):
        raise ValueError("packed")
    return np.stack([unpack(row, bits, num) for row in rows])


def _array(path: Path, name: str) -> np.ndarray[Any, Any]:
    """Load an array; the large one is memory-mapped, since lists do not need it."""
    array: np.ndarray[Any, Any] = np.load(
        path / f"{name}.npy", mmap_mode="r" if name == "eigen" else None, allow_pickle=False
    )
    return array.view(np.ndarray)


def _is_consistent(btf: LocalPcaBtf) -> bool:
    """True if array shapes and indices are consistent: kernels do not check them."""
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
