"""Read an uploaded file, write the result into a folder, and return its id or an error.

Runs in a separate process with limits, without access to the database or other files: a hostile file can end that
process, not the server. `relume_server.io.importer_zygote` creates it, `relume_server.io.import_processes` requests it,
and `relume_server.io.import_queue` moves the result into place.
"""

from __future__ import annotations

import errno
import json
import os
import shutil
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from relume.core.errors import DiskFullError, MaterialError, RelumeError, is_disk_full
from relume.core.filesystem import UNFINISHED

if TYPE_CHECKING:  # not needed by the import process, or not at once
    from relume.scene.model import Scene
    from relume_server.settings import Settings

_OUT_OF_MEMORY_MESSAGES = (os.strerror(errno.ENOMEM), "can't start new thread")
UPLOAD_PREFIX = "upload-"
SUMMARY = "summary.json"
"""File with the summary of a scene, next to its folder."""
IMAGES, IES = "images", "ies"
"""Folder with the images of imported materials, next to the material's."""
ImportKind = Literal[
    "scene", "environment", "built_in", "grounded", "image", "ies", "lut", "material", "imported", "tile"
]


@dataclass(frozen=True)
class ImportRequest:
    """An import.

    Attributes:
        into: empty folder for the result; nothing else is written.
        kind, file: kind and path; no path for a built-in scene; for a scene to be "grounded" its folder. A "tile" for a
            BTF is validated only, and has no id.
        environment: path of a scene's environment map, or None.
        name: display name; for a built-in scene, its key.
        scene: file name of a scene or a material, with folders.
        companions: paths of a scene's companion files, by name.
        options: fields of `relume.scene_io.import_options.ImportOptions`.
        ground: whether to add a ground plane. period: side of one period, meters, if known.
        seconds: limit of processor and wall time. max_bytes: maximum size in bytes of address space.
        max_file_bytes: maximum size in bytes of each written file.
    """

    into: str
    kind: ImportKind
    file: str
    environment: str | None
    name: str
    seconds: int
    max_bytes: int
    max_file_bytes: int
    ground: bool = False
    period: float | None = None
    scene: str = ""
    companions: dict[str, str] = field(default_factory=dict)
    options: dict[str, str] = field(default_factory=dict)

    @classmethod
    def create(
        cls,
        settings: Settings,
        kind: ImportKind,
        file: Path | None,
        name: str,
        environment: Path | None = None,
        scene: str = "",
        companions: Mapping[str, Path] | None = None,
    ) -> ImportRequest:
        """Create a request with a server's limits; `into` and `max_file_bytes` are set when it gets its slot."""
        return cls(
            into="",
            kind=kind,
            file="" if file is None else str(file),
            environment=None if environment is None else str(environment),
            name=name,
            seconds=settings.import_seconds,
            max_bytes=settings.import_bytes,
            max_file_bytes=0,
            scene=scene,
            companions={named: str(path) for named, path in (companions or {}).items()},
        )

    @property
    def input_files(self) -> list[Path]:
        """Input files."""
        paths = [self.file, self.environment or "", *self.companions.values()]
        return [Path(path) for path in paths if path]


def remove_strays(data: Path, older_than_s: float) -> None:
    """Delete uploads and files to be deleted that a killed server left; younger ones may belong to another server."""
    for folder in [*data.glob(f"{UPLOAD_PREFIX}*"), *data.glob(f"*/{UNFINISHED}/")]:
        with suppress(OSError):
            if time.time() - folder.stat().st_mtime > older_than_s:
                shutil.rmtree(folder)


def run_import(request: ImportRequest) -> dict[str, str]:
    """Run the import, and return {"id": id} or an error.

    Errors: {"problem": sentence} of the file, {"material": sentence} of a material's file, {"full": sentence} if the
    disk is full, {"large": sentence} if a written file exceeds its limit, and {"failure": sentence} for all other known
    errors. Unexpected exceptions propagate.
    """
    try:
        return {"id": _import(request)}
    except DiskFullError as error:
        return {"full": str(error)}
    except MaterialError as error:
        return {"material": str(error)}
    except RelumeError as error:
        if _is_too_large(error.__cause__):
            return {"large": str(error)}
        return {"problem" if type(error) is not RelumeError else "failure": str(error)}
    except Exception as error:
        if isinstance(error, OSError) and is_disk_full(error):
            return {"full": str(error)}
        if _is_too_large(error):
            return {"large": str(error)}
        if not _is_out_of_memory(error):
            raise
        return {"problem": f"the import needs more than {request.max_bytes / 1e9:.1f} GB; simplify the file"}


def _is_too_large(error: BaseException | None) -> bool:
    """True if the file size limit was exceeded; NumPy reports short writes only by the missing amount."""
    is_short = isinstance(error, OSError) and error.errno is None and "requested and" in str(error)
    return is_short or (isinstance(error, OSError) and error.errno == errno.EFBIG)


def _is_out_of_memory(error: Exception) -> bool:
    """True if the address space limit was exceeded; system calls report it in their own way."""
    return isinstance(error, MemoryError) or any(message in str(error) for message in _OUT_OF_MEMORY_MESSAGES)


def _import(request: ImportRequest) -> str:
    if request.kind == "grounded":
        return _put_on_ground(request)
    if request.kind == "image":
        return _import_image(request)
    if request.kind == "lut":
        return _import_lut(request)
    if request.kind == "ies":
        return _import_ies(request)
    if request.kind == "material":
        return _import_material(request)
    if request.kind == "imported":
        return _import_library_materials(request)
    if request.kind == "tile":
        return _look_at_tile(request)
    return _import_environment(request) if request.kind == "environment" else _import_scene(request)


def _import_environment(request: ImportRequest) -> str:
    from relume.assets.environments.environment_store import store_environment

    return store_environment(Path(request.into), Path(request.file), request.name).id


def _import_image(request: ImportRequest) -> str:
    from relume.images.image_store import store

    return store(Path(request.into), Path(request.file), request.name).id


def _import_lut(request: ImportRequest) -> str:
    from relume.luts.lut_store import store_lut

    return store_lut(Path(request.into), Path(request.file), request.name).id


def _import_ies(request: ImportRequest) -> str:
    from relume.assets.ies.ies_store import store_ies

    return store_ies(Path(request.into), Path(request.file), request.name).id


def _import_material(request: ImportRequest) -> str:
    from relume.assets.measured.measured_store import store_material

    return store_material(Path(request.into), Path(request.file), request.name, request.scene or None).id


def _import_library_materials(request: ImportRequest) -> str:
    from relume.imported_materials.material_store import store_materials

    return store_materials(Path(request.into), Path(request.into) / IMAGES, Path(request.file), request.name).id


def _look_at_tile(request: ImportRequest) -> str:
    from relume.synthetic_btf.from_mesh import read_tile

    read_tile(Path(request.file), request.period)
    return ""


def _import_scene(request: ImportRequest) -> str:
    scene = _built_in(request.name) if request.kind == "built_in" else _read_scene(request)
    if request.ground:
        from relume.scene.shadow_catcher_ground import with_ground

        scene = with_ground(scene)
    return _write_scene(request, scene)


def _built_in(name: str) -> Scene:
    from relume.scene.examples.catalog import built_in

    return built_in(name)


def _put_on_ground(request: ImportRequest) -> str:
    from relume.scene.scene_folder import load_scene
    from relume.scene.shadow_catcher_ground import with_ground

    return _write_scene(request, with_ground(load_scene(request.file), request.name))


def _write_scene(request: ImportRequest, scene: Scene) -> str:
    from relume.assets.ies.ies_store import store_ies_files
    from relume.scene.scene_folder import save_scene
    from relume_worker.scenes import summarize_scene

    store_ies_files(Path(request.into) / IES, scene.ies_files)
    save_scene(scene, Path(request.into) / scene.id)
    (Path(request.into) / SUMMARY).write_text(json.dumps(summarize_scene(scene)))
    return scene.id


def _read_scene(request: ImportRequest) -> Scene:
    from relume.assets.environments.read_environment import read_environment
    from relume.scene_io.import_options import ImportOptions
    from relume.scene_io.import_scene import import_scene, read_file
    from relume.scene_io.referenced_files import UploadedFiles

    environment = None if request.environment is None else read_environment(request.environment, "Environment")
    uploaded_files = UploadedFiles({name: Path(path) for name, path in request.companions.items()}, request.scene)
    # bytes: files next to it on this disk are not part of the upload
    options = ImportOptions.model_validate(request.options)
    return import_scene(read_file(request.file), request.name, environment, uploaded_files, options)
