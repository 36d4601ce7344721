"""Store of imported environments, in `relume.assets.asset_store`.

    <folder>/<id>/radiance.npy        read by `relume.assets.environments.read_environment`, at most 2048 texels wide
                  thumbnail.png
                  environment.json    name and warnings

Looks refer to one as "env:<id>".
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from relume.assets.environments.environment import Environment
from relume.assets.environments.read_environment import read_environment
from relume.assets.small_asset_store import SmallAssetRecord, SmallAssetStore
from relume.core.cache import asset_cached
from relume.core.errors import SceneError

STORE = SmallAssetStore(
    "imported environment", "env:", "environment.json", SceneError, max_entries=500, record_type=SmallAssetRecord
)
MAX_WIDTH = 2048  # texels of 0.18°: finer than the environment triangles of a bake, and fast to integrate
_RADIANCE, _THUMBNAIL = "radiance.npy", "thumbnail.png"


def store_environment(folder: Path, source: Path, name: str) -> SmallAssetRecord:
    """Import an equirectangular .hdr or .exr file; an existing one with this content gets the new name.

    Args:
        folder: folder of the asset store.
        source: the file to import.
        name: shown to users.
    Raises:
        SceneError: the file is unusable, or the store is full.
    """
    from relume.assets.environments.thumbnail import write_thumbnail  # loads kernels, which other users do not need

    environment = read_environment(source, name, MAX_WIDTH)

    def fill(staged_folder: Path) -> dict[str, Any]:
        np.save(staged_folder / _RADIANCE, environment.radiance)
        write_thumbnail(staged_folder / _THUMBNAIL, environment.radiance)
        return {}

    return STORE.import_asset(folder, source, name, environment.warnings, fill)


def thumbnail_path(folder: Path, identity: str) -> Path:
    """Return the path of its thumbnail. Raises NotFoundError."""
    return STORE.path(folder, identity) / _THUMBNAIL


def load_imported(name: str) -> Environment:
    """Load the environment of a look's `map`; its texels are memory-mapped.

    Raises:
        NotFoundError: it does not exist. SceneError: its files are damaged.
    """
    return _load(STORE.resolve(name))


@asset_cached("environment file")
def _load(path: Path) -> Environment:
    radiance = STORE.open_array(path, _RADIANCE)
    height = len(radiance) if radiance.ndim else 0
    if height == 0 or radiance.shape != (height, 2 * height, 3) or radiance.dtype != np.float32:
        raise STORE.damaged_error(path)
    return Environment(STORE.load_record(path)["name"], radiance)
