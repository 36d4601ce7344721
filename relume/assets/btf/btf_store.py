"""Store of imported and synthetic BTFs, in `relume.assets.asset_store`.

    <folder>/<id>/arrays.npz    arrays of `relume.assets.btf.stored_arrays`, deflated
                  btf.json      name, origin, directions, error of the compression

Older folders have a .npy file for each array, with clusters and weights bit-packed (`relume.assets.btf.bit_packing`).

Looks refer to one as "btf:<id>".
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any
from zipfile import BadZipFile, ZipFile

import numpy as np
from numpy.typing import NDArray

from relume.assets.asset_store import AssetStore
from relume.assets.btf.bit_packing import cluster_bits, max_code, packed_bytes, unpack
from relume.assets.btf.compress import MAX_TEXELS
from relume.assets.btf.direction_rings import DirectionGrid, make_direction_grid
from relume.assets.btf.local_pca_btf import I8, MAX_HEIGHT, U8, LocalPcaBtf
from relume.assets.btf.per_view_coder import MAX_CLUSTERS, MAX_COMPONENTS
from relume.assets.btf.stored_arrays import from_arrays, stored_bytes, to_arrays
from relume.assets.btf.whole_brdf_coder import MAX_SHARED_CLUSTERS
from relume.core.cache import asset_cached
from relume.core.errors import MaterialError

STORE = AssetStore("BTF", "btf:", "btf.json", MaterialError, max_entries=100)
_ARRAYS_FILE = "arrays.npz"
_TYPES = {
    "levels": np.int32, "mean": np.int8, "mean_step": np.float32, "eigen": np.int8, "step": np.float32,
    "average": np.float32, "height": np.float32, "cluster": np.uint8, "weight": np.int8,
    "shared_cluster": np.uint8, "shared_weight": np.int8,
}  # fmt: skip
_MAX_STORED_BYTES = 4 << 30  # of all arrays, not deflated
_MAX_LEVELS_BYTES = 4096
# what NumPy and zipfile raise for damaged archives: headers that claim too much, foreign members, unknown methods
_DAMAGES = (
    OSError, ValueError, KeyError, TypeError, IndexError, AttributeError, EOFError, MemoryError, RuntimeError,
    BadZipFile, zlib.error,
)  # fmt: skip


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
        arrays: dict[str, Any] = to_arrays(btf)
        np.savez_compressed(staged_folder / _ARRAYS_FILE, **arrays)
        return {
            "synthetic": synthetic,
            "rings": [
                [float(np.degrees(theta)), int(count)]
                for theta, count in zip(btf.grid.theta, np.diff(btf.grid.first), strict=True)
            ],
            "shift": btf.grid.shift.tolist(),
            "error": list(btf.error),
            "ratio": btf.measured_bytes / stored_bytes(btf),
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


def load_shape(data: str) -> tuple[tuple[int, int], int, int, int]:
    """Height and width, directions, clusters and components of a stored BTF, from headers alone.

    Raises:
        NotFoundError: it does not exist. MaterialError: its files are damaged.
    """
    path = STORE.resolve(data)
    try:
        if (path / _ARRAYS_FILE).exists():
            with ZipFile(path / _ARRAYS_FILE) as archive:
                levels = _read_levels(archive)
                with archive.open("eigen.npy") as file:
                    components, directions, clusters = _header_shape(file)[:3]
        else:
            levels = _array(path, "levels")
            directions, clusters, components = _array(path, "eigen").shape[:3]
        _, height, width = levels[0]
    except _DAMAGES as problem:
        raise STORE.damaged_error(path) from problem
    return (int(height), int(width)), directions, clusters, components


def _read_levels(archive: ZipFile) -> NDArray[np.int32]:
    if archive.getinfo("levels.npy").file_size > _MAX_LEVELS_BYTES:
        raise ValueError("levels")
    with archive.open("levels.npy") as file:
        return np.asarray(np.lib.format.read_array(file, allow_pickle=False), np.int32)


def _header_shape(file: IO[bytes]) -> tuple[int, ...]:
    version = np.lib.format.read_magic(file)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape: tuple[int, ...] = read(file)[0]
    return shape


@asset_cached("BTF file")
def _load(path: Path) -> LocalPcaBtf:
    document = STORE.load_record(path)
    try:
        shift = [float(value) for value in document.get("shift", [])]  # older files have none: all rings start at φ = 0
        grid = make_direction_grid([(float(theta), int(count)) for theta, count in document["rings"]], shift)
        error = tuple(float(value) for value in document["error"])
        btf = (
            _load_arrays(path / _ARRAYS_FILE, grid, error)
            if (path / _ARRAYS_FILE).exists()
            else _load_packed(path, document, grid, error)
        )
    except _DAMAGES as problem:
        raise STORE.damaged_error(path) from problem
    if not _is_consistent(btf):
        raise STORE.damaged_error(path)
    return btf


def _load_arrays(file: Path, grid: DirectionGrid, error: tuple[float, ...]) -> LocalPcaBtf:
    """Read the arrays. Raises ValueError, KeyError, IndexError, OSError, EOFError, BadZipFile, zlib.error."""
    with ZipFile(file) as archive:
        if sum(member.file_size for member in archive.infolist()) > _MAX_STORED_BYTES:
            raise ValueError("size")
    with np.load(file, allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files if name in _TYPES}
    levels = arrays["levels"]
    if not all(array.dtype == _TYPES[name] for name, array in arrays.items()) or levels.ndim != 2 or not len(levels):
        raise ValueError("types")
    num, size = grid.num_directions, tuple(levels[0, 1:].tolist())
    if not 0 < size[0] * size[1] <= MAX_TEXELS or arrays["height"].shape not in ((1, 1), size):
        raise ValueError("texels")
    if "shared_cluster" in arrays and arrays["shared_cluster"].shape != (size[0] * size[1],):
        raise ValueError("shared texels")
    if arrays["mean"].shape[:1] != (num,) or arrays["mean_step"].shape != arrays["mean"].shape[:2]:
        raise ValueError("means")
    if not np.isfinite(arrays["height"]).all():
        raise ValueError("height")
    return from_arrays(arrays, grid, error)


def _load_packed(path: Path, document: Mapping[str, Any], grid: DirectionGrid, error: tuple[float, ...]) -> LocalPcaBtf:
    """Read an older folder. Raises OSError, ValueError, KeyError, TypeError, EOFError."""
    arrays: dict[str, Any] = {name: _array(path, name) for name in ("levels", "mean", "eigen", "step", "average")}
    height = _array(path, "height") if (path / "height.npy").exists() else np.zeros((1, 1), np.float32)
    cluster, weight = _texels(path, document, arrays["levels"])
    types = {**_TYPES, "mean": np.float16}
    if height.dtype != np.float32 or any(array.dtype != types[name] for name, array in arrays.items()):
        raise ValueError("types")
    mean_step = np.zeros(arrays["mean"].shape[:2], np.float32)
    return LocalPcaBtf(
        grid=grid, error=error, cluster=cluster, weight=weight, height=height, mean_step=mean_step, **arrays
    )


def _texels(path: Path, document: Mapping[str, Any], levels: NDArray[np.int32]) -> tuple[U8, I8]:
    """Clusters and weights. Raises ValueError, KeyError, TypeError, OSError, EOFError if inconsistent."""
    if "bits" not in document:  # older files: one byte each, not packed
        weight = _array(path, "weight")
        if weight.dtype != np.int8 or weight.ndim != 3:
            raise ValueError("weights")
        return _clusters(path), weight
    bits = np.array([int(value) for value in document["bits"]])
    if len(bits) > MAX_COMPONENTS or not ((bits >= 2) & (bits <= 8)).all():
        raise ValueError("bits")
    component_bits = bits.astype(np.uint8)
    if "cluster_bits" not in document:  # older files: clusters not packed
        cluster = _clusters(path)
        return cluster, _read_packed_rows(path, component_bits, cluster.shape[1])
    width = int(document["cluster_bits"])
    if not 1 <= width <= cluster_bits(MAX_CLUSTERS) or levels.ndim != 2 or levels.shape[1:] != (3,):
        raise ValueError("clusters")
    cluster_width = np.array([width], np.uint8)
    num = int(levels[:, 1:].astype(np.int64).prod(axis=1).sum())
    rows = _read_packed_rows(path, np.append(cluster_width, component_bits), num)
    return (rows[..., 0] + max_code(cluster_width)).astype(np.uint8), np.ascontiguousarray(rows[..., 1:])


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
    if not (1 <= clusters <= MAX_SHARED_CLUSTERS and 0 <= components <= MAX_COMPONENTS):
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
        and (height[1:] == np.maximum(height[:-1] // 2, 1)).all()
        and (width[1:] == np.maximum(width[:-1] // 2, 1)).all()
        and (first == ends).all()
        and btf.cluster.shape == (directions, texels)
        and int(btf.cluster.max()) < clusters
        and btf.weight.shape == (directions, texels, components)
        and btf.mean_step.shape == (directions, clusters)
        and btf.mean.shape == (directions, clusters, directions, 3)
        and btf.eigen.shape == (directions, clusters, components, directions, 3)
        and btf.step.shape == (directions, clusters, components)
        and btf.average.shape == (directions, directions, 3)
        and btf.height.shape in ((1, 1), btf.size)
        and all(np.isfinite(array).all() for array in (btf.mean, btf.mean_step, btf.step, btf.average, btf.height))
        and float(np.abs(btf.height).max()) <= MAX_HEIGHT
    )
