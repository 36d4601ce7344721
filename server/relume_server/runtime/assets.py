"""All that looks may name besides what is built in: which stores there are, and where each lies in the data."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from relume.assets.asset_store import AssetStore
from relume.assets.btf.btf_store import STORE as BTFS
from relume.assets.environments.environment_store import STORE as ENVIRONMENTS
from relume.assets.measured.measured_store import STORE as MATERIALS
from relume.brdf.texture_slots import IMAGES
from relume_worker.paths import btfs_path, environments_path, images_path, materials_path


def list_asset_stores(data_dir: Path) -> list[tuple[AssetStore, Path]]:
    """Every store with its folder."""
    return [
        (MATERIALS, materials_path(data_dir)),
        (BTFS, btfs_path(data_dir)),
        (ENVIRONMENTS, environments_path(data_dir)),
        (IMAGES, images_path(data_dir)),
    ]


@contextmanager
def using_asset_stores(data_dir: Path) -> Iterator[None]:
    """Looks find what is in this data directory for as long as the block runs."""
    with ExitStack() as stack:
        for store, folder in list_asset_stores(data_dir):
            stack.enter_context(store.with_search_folder(folder))
        yield
