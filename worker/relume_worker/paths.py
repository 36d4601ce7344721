"""Where things lie in the data directory. Ids are checked here: no other string becomes part of a path."""

from __future__ import annotations

import re
from pathlib import Path

from relume.core.errors import NotFoundError

_ID = re.compile(r"[0-9a-f]{16}")


def _check_id(identity: str) -> str:
    if not _ID.fullmatch(identity):
        raise NotFoundError(f"{identity[:40]!r} is not an id; ids are 16 hexadecimal digits")
    return identity


def scene_path(data_dir: Path, scene_id: str) -> Path:
    """Folder of a scene. Raises NotFoundError where the id is malformed, as all of these do."""
    return data_dir / "scenes" / _check_id(scene_id)


def materials_path(data_dir: Path) -> Path:
    """Folder of the measured materials; `relume.assets.measured.measured_store` names what is in it."""
    return data_dir / "materials"


def btfs_path(data_dir: Path) -> Path:
    """Folder of the BTFs; `relume.assets.btf.btf_store` names what is in it."""
    return data_dir / "btfs"


def environments_path(data_dir: Path) -> Path:
    """Folder of the imported environments; `relume.assets.environments.environment_store` names what is in it."""
    return data_dir / "environments"


def images_path(data_dir: Path) -> Path:
    """Folder of the images that looks may name; `relume.images.image_store` names what is in it."""
    return data_dir / "images"


def bake_path(data_dir: Path, bake_id: str) -> Path:
    """The published store of a bake."""
    return data_dir / "bakes" / f"{_check_id(bake_id)}.zarr"


def staging_path(data_dir: Path, bake_id: str) -> Path:
    """The store of a bake that is not finished."""
    return data_dir / "bakes" / "staging" / f"{_check_id(bake_id)}.zarr"


def scene_path_of_bake(bake: Path, scene_id: str) -> Path:
    """Folder of the scene that a published store was baked of, in the same data directory."""
    return scene_path(bake.parents[1], scene_id)
