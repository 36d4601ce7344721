"""Paths in the data directory. Ids are validated here: no other string becomes part of a path."""

from __future__ import annotations

import re
from pathlib import Path

from relume.core.errors import NotFoundError

_ID = re.compile(r"[0-9a-f]{16}")


def _check_id(identity: str) -> str:
    if not _ID.fullmatch(identity):
        raise NotFoundError(f"{identity[:40]!r} is not an id; give 16 hexadecimal digits")
    return identity


def scene_path(data_dir: Path, scene_id: str) -> Path:
    """Folder of a scene. Raises NotFoundError if the id is malformed, as do all functions here."""
    return data_dir / "scenes" / _check_id(scene_id)


def materials_path(data_dir: Path) -> Path:
    """Folder of measured materials; see `relume.assets.measured.measured_store`."""
    return data_dir / "materials"


def imported_materials_path(data_dir: Path) -> Path:
    """Folder of imported materials; see `relume.imported_materials.material_store`."""
    return data_dir / "imported"


def btfs_path(data_dir: Path) -> Path:
    """Folder of BTFs; see `relume.assets.btf.btf_store`."""
    return data_dir / "btfs"


def environments_path(data_dir: Path) -> Path:
    """Folder of imported environments; see `relume.assets.environments.environment_store`."""
    return data_dir / "environments"


def ies_path(data_dir: Path) -> Path:
    """Folder of IES files; see `relume.assets.ies.ies_store`."""
    return data_dir / "ies"


def images_path(data_dir: Path) -> Path:
    """Folder of images for looks; see `relume.images.image_store`."""
    return data_dir / "images"


def luts_path(data_dir: Path) -> Path:
    """Folder of display LUTs; see `relume.luts.lut_store`."""
    return data_dir / "luts"


def bake_path(data_dir: Path, bake_id: str) -> Path:
    """The published store of a bake."""
    return data_dir / "bakes" / f"{_check_id(bake_id)}.zarr"


def staging_path(data_dir: Path, bake_id: str) -> Path:
    """The store of an unfinished bake."""
    return data_dir / "bakes" / "staging" / f"{_check_id(bake_id)}.zarr"


def scene_path_of_bake(bake: Path, scene_id: str) -> Path:
    """Folder of the scene of a published store, in the same data directory."""
    return scene_path(bake.parents[1], scene_id)
