"""Files that `relume_bench.assets` measures: by rule, so that none is chosen by hand.

Every .gltf, .glb, .obj and .ply file of the shared data that relume imports, except

- `bad-inputs`, which are made to be refused;
- files with more than `MAX_TRIANGLES` triangles, which take too long;
- .obj and .ply files with less than `MIN_TRIANGLES`, which test readers of text and show next to nothing;
- of files that differ only in a number (NAME_00, NAME_01, …) all but the last, which has the most properties;
- of files with the same name in several folders, which are other packings of the same model, all but the first.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from relume.core.errors import SceneError
from relume.scene_io.import_scene import import_scene

MAX_TRIANGLES, MIN_TRIANGLES = 200_000, 30
_SUFFIXES = (".gltf", ".glb", ".obj", ".ply")


def asset_files(data: Path) -> Iterator[tuple[str, Path]]:
    """Names, relative to the folder of shared data, and paths of the files."""
    stems = set()
    for path in _candidates(data):
        if path.stem in stems:
            continue
        try:
            scene = import_scene(path, "asset")
        except SceneError:
            continue
        num = sum(len(mesh.faces) for mesh in scene.meshes)
        is_text = path.suffix.lower() in (".obj", ".ply")
        if num > MAX_TRIANGLES or (is_text and num < MIN_TRIANGLES):
            continue
        stems.add(path.stem)
        yield path.relative_to(data).as_posix(), path


def _candidates(data: Path) -> list[Path]:
    """Files by name, the last of each numbered series."""
    last = {}
    for path in sorted(data.rglob("*")):
        if path.suffix.lower() in _SUFFIXES and "bad-inputs" not in path.relative_to(data).parts:
            last[path.with_name(re.sub(r"_\d\d$", "", path.stem) + path.suffix)] = path
    return list(last.values())
