"""A small geometry of somebody's own: a mesh file that holds one period of it.

Scenes have +Y up; the texture's plane is that of x and z, seen from above, z downwards in the texture. The square that
repeats may lie anywhere, since what is beside it is the same: its side is all that has to be known.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from relume.brdf.symmetry import is_isotropic
from relume.core.errors import ParameterError, SceneError
from relume.scene.model import Material, Scene
from relume.scene_io.import_scene import import_scene
from relume.synthetic_btf.tileable_geometry import F64, Terms, Tile

MAX_FACES = 60_000
"""Light between faces takes two kilobytes of each, several times."""
_SQUARE_TOLERANCE = 0.02  # share by which sides of a box may differ that is taken for the square
_MAX_EXTENT = 2.0  # periods that it covers, along each side
_MAX_HEIGHT = 1.0  # periods
_SCENE_TO_TEXTURE = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # the scene's (x, y, z) to the texture's (x, −z, y)


def read_tile(file: Path, period: float | None) -> Tile:
    """Read one period of a small geometry.

    Args:
        file: of any kind that scenes are imported from. period: side of the square that repeats, metres; None: that of
            the box about it, which has to be a square.
    Raises:
        SceneError: the file cannot be used. ParameterError: the period does not fit it.
    """
    scene = import_scene(file, file.stem)
    positions = np.concatenate([mesh.positions for mesh in scene.meshes]).astype(np.float64) @ _SCENE_TO_TEXTURE.T
    normals = np.concatenate([mesh.normals for mesh in scene.meshes]).astype(np.float64) @ _SCENE_TO_TEXTURE.T
    counts = [len(mesh.faces) for mesh in scene.meshes]
    if sum(counts) > MAX_FACES:
        raise SceneError(f"a small geometry has at most {MAX_FACES:,} triangles, not {sum(counts):,}; simplify it")
    starts = np.cumsum([0, *(len(mesh.positions) for mesh in scene.meshes)])
    faces = np.concatenate(
        [mesh.faces.astype(np.int64) + start for mesh, start in zip(scene.meshes, starts, strict=False)]
    )
    material = np.repeat([mesh.material for mesh in scene.meshes], counts)
    return Tile(
        _to_unit_square(positions, period),
        normals,
        faces,
        material,
        tuple(map(_isotropic_terms, _materials_in_use(scene))),
    )


def _to_unit_square(positions: F64, period: float | None) -> F64:
    """Bring what repeats to the unit square, its middle to the square's."""
    low, high = positions.min(axis=0), positions.max(axis=0)
    width, depth, height = high - low
    if period is None:
        if abs(width - depth) > _SQUARE_TOLERANCE * max(width, depth):
            raise ParameterError(
                "period", "not given", f"side of the square that repeats: the mesh is {width:g} × {depth:g} metres"
            )
        period = float(max(width, depth))
    if not (period > 0 and max(width, depth) <= _MAX_EXTENT * period and height <= _MAX_HEIGHT * period):
        raise ParameterError(
            "period", period, f"metres, at least the height of the mesh, {height:g}, and half its width, "
            f"{max(width, depth) / _MAX_EXTENT:g}"
        )  # fmt: skip
    return np.asarray((positions - [*(0.5 * (low + high))[:2], 0.0]) / period + [0.5, 0.5, 0.0])


def _materials_in_use(scene: Scene) -> list[Material]:
    """All materials, where those that are not on it are nothing that has to be kept to."""
    used_indices = {mesh.material for mesh in scene.meshes}
    return [
        material if k in used_indices else Material(material.name, ()) for k, material in enumerate(scene.materials)
    ]


def _isotropic_terms(material: Material) -> Terms:
    """Terms of a material that looks the same from all around, everywhere. Raises SceneError."""
    if material.textures or material.normal_map is not None or material.is_alpha_tested:
        raise SceneError(
            f"material {material.name[:80]!r} has images or lets light pass; a small geometry's has plain colours alone"
        )
    if not all(is_isotropic({"params": {}, "curves": {}, **term}) for term in material.terms):
        raise SceneError(f"material {material.name[:80]!r} is brushed; a small geometry's looks the same all around")
    return tuple({**term, "texture": None} for term in material.terms)
