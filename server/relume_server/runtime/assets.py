"""Asset stores of the data directory."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from relume.assets.asset_store import AssetStore
from relume.assets.btf.btf_store import STORE as BTFS
from relume.assets.environments.environment_store import STORE as ENVIRONMENTS
from relume.assets.ies.ies_store import IES_FILES
from relume.assets.measured.measured_store import STORE as MATERIALS
from relume.brdf.texture_slots import IMAGES
from relume.imported_materials.material_store import STORE as IMPORTED
from relume.luts.lut_store import LUTS
from relume_worker.paths import (
    btfs_path,
    environments_path,
    ies_path,
    images_path,
    imported_materials_path,
    luts_path,
    materials_path,
)


def list_asset_stores(data_dir: Path) -> list[tuple[AssetStore, Path]]:
    """All asset stores with their folders."""
    return [
        (MATERIALS, materials_path(data_dir)),
        (IMPORTED, imported_materials_path(data_dir)),
        (BTFS, btfs_path(data_dir)),
        (ENVIRONMENTS, environments_path(data_dir)),
        (IMAGES, images_path(data_dir)),
        (LUTS, luts_path(data_dir)),
        (IES_FILES, ies_path(data_dir)),
    ]


@contextmanager
def using_asset_stores(data_dir: Path) -> Iterator[None]:
    """Let looks find the assets of a data directory inside the block."""
    with ExitStack() as stack:
        for store, folder in list_asset_stores(data_dir):
            stack.enter_context(store.with_search_folder(folder))
        yield
