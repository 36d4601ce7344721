"""Synthetic BTFs for benchmarks; their values are cached in bench/.kept between runs."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from relume.assets.btf.btf_store import BtfRecord, store_btf
from relume.assets.btf.compress import compress
from relume.assets.btf.direction_rings import ubo_grid
from relume.assets.btf.local_pca_btf import F32, LocalPcaBtf
from relume.assets.btf.value_cache import ValueFile
from relume.core.source_hash import code_hash, collect_sources
from relume.synthetic_btf.render import TileGeometry
from relume.synthetic_btf.synthesize import GEOMETRIES
from relume_bench.btf_flat import FLAT_MATERIALS

CACHE_FOLDER = Path(__file__).parents[1] / ".kept"


class SyntheticBtf:
    """A synthetic BTF before compression.

    Args:
        name: name of its geometry or flat material. folder: folder of its values. tiny: a trial run.
        size: texels a side.
    """

    def __init__(self, name: str, folder: Path, tiny: bool, size: int = 128) -> None:
        self.name = name
        # like `relume material make-btf` up to 128 texels a side; then as many rays
        size, self.grid = (8, 1) if tiny else (size, min(3, max(1, 384 // size)))
        tile = GEOMETRIES[name]() if name in GEOMETRIES else FLAT_MATERIALS[name](size)
        small = TileGeometry(tile, ubo_grid(), (size, size), self.grid, 1)
        self.values = ValueFile(folder / f"{name}-{size}", ubo_grid(), (size, size))
        self.values.fill(small.get_view, lambda share: None, lambda: False)
        self.height: F32 = small.height()

    def compress(self, bound: float) -> LocalPcaBtf:
        """Compress to an error bound, like `relume material make-btf`."""
        return compress(self.values, bound, lambda share: None, lambda: False, height=self.height)

    def save(self, folder: Path, bound: float) -> BtfRecord:
        """Compress and save in an asset store."""
        folder.mkdir(parents=True, exist_ok=True)
        source = folder / f"{self.name}.json"
        source.write_text(f"{self.name} {bound}")
        return store_btf(folder / "btfs", source, self.name, self.name, lambda: self.compress(bound))


def compression_texels() -> int:
    """Texels a side of the BTFs whose compression is measured: 256, as in Müller 2004, unless the environment says."""
    return int(os.environ.get("RELUME_BTF_TEXELS", "256"))


@contextmanager
def open_values_folder(tiny: bool) -> Iterator[Path]:
    """Open the folder of values, named by the code that makes them; others are deleted; trial runs store nothing."""
    if tiny:
        with TemporaryDirectory() as trial:
            yield Path(trial)
        return
    makers = ("render", "weave", "pebbles", "corduroy", "from_images")
    folder = CACHE_FOLDER / code_hash(collect_sources([f"synthetic_btf.{name}" for name in makers]))
    for stale_folder in CACHE_FOLDER.iterdir() if CACHE_FOLDER.is_dir() else ():
        if stale_folder != folder:
            shutil.rmtree(stale_folder)
    yield folder
