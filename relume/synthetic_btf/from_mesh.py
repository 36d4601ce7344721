"""User geometry for synthetic BTFs: a mesh file with one period.

Scenes have +Y up; the texture's plane is the xz plane from above, with z downward in the texture. The repeated square
can be anywhere because the geometry is periodic: only its side length matters.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from relume.brdf.symmetry import is_isotropic
from relume.core.errors import ParameterError, SceneError
from relume.scene.model import Material, Scene
from relume.scene_io.import_scene import import_scene
from relume.synthetic_btf.tileable_geometry import COLOR_CHANNELS, F64, Terms, Tile

MAX_FACES = 60_000
"""Form factors between faces take two kilobytes per face, several times."""
_SQUARE_TOLERANCE = 0.02  # relative difference between the sides of a bounding box that counts as a square
_MAX_EXTENT = 2.0  # periods per side
_MAX_HEIGHT = 1.0  # periods
_SCENE_TO_TEXTURE = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # the scene's (x, y, z) to the texture's (x, −z, y)


def read_tile(file: Path, period: float | None) -> Tile:
    """Read one period of a tileable geometry.

    Args:
        file: a scene file. period: side of the repeated square, meters; None for that of the bounding box, which must
            be a square.
    Raises:
        SceneError: the file is unusable. ParameterError: the period does not fit the mesh.
    """
    scene = import_scene(file, file.stem)
    positions = np.concatenate([mesh.positions for mesh in scene.meshes]).astype(np.float64) @ _SCENE_TO_TEXTURE.T
    normals = np.concatenate([mesh.normals for mesh in scene.meshes]).astype(np.float64) @ _SCENE_TO_TEXTURE.T
    counts = [len(mesh.faces) for mesh in scene.meshes]
    if sum(counts) > MAX_FACES:
        raise SceneError(f"the mesh has {sum(counts):,} triangles, the limit for a BTF is {MAX_FACES:,}; simplify it")
    starts = np.cumsum([0, *(len(mesh.positions) for mesh in scene.meshes)])
    faces = np.concatenate(
        [mesh.faces.astype(np.int64) + start for mesh, start in zip(scene.meshes, starts, strict=False)]
    )
    material = np.repeat([mesh.material for mesh in scene.meshes], counts)
    materials = _materials_in_use(scene)
    return Tile(
        _to_unit_square(positions, period),
        normals,
        faces,
        material,
        tuple(map(_isotropic_terms, materials)),
        np.concatenate([mesh.uvs for mesh in scene.meshes]).astype(np.float64),
        tuple(material.textures for material in materials),
    )


def _to_unit_square(positions: F64, period: float | None) -> F64:
    """Move and scale the repeated square to the unit square."""
    low, high = positions.min(axis=0), positions.max(axis=0)
    width, depth, height = high - low
    if period is None:
        if abs(width - depth) > _SQUARE_TOLERANCE * max(width, depth):
            raise ParameterError(
                "period", None, f"the side of the repeated square; the mesh is {width:g} × {depth:g} meters"
            )
        period = float(max(width, depth))
    if not (period > 0 and max(width, depth) <= _MAX_EXTENT * period and height <= _MAX_HEIGHT * period):
        raise ParameterError(
            "period", period, f"meters, at least the height of the mesh, {height:g}, and half its width, "
            f"{max(width, depth) / _MAX_EXTENT:g}"
        )  # fmt: skip
    return np.asarray((positions - [*(0.5 * (low + high))[:2], 0.0]) / period + [0.5, 0.5, 0.0])


def _materials_in_use(scene: Scene) -> list[Material]:
    """All materials, with empty ones for those that no mesh uses."""
    used_indices = {mesh.material for mesh in scene.meshes}
    return [
        material if k in used_indices else Material(material.name, ()) for k, material in enumerate(scene.materials)
    ]


def _isotropic_terms(material: Material) -> Terms:
    """Terms of an isotropic material. Raises SceneError."""
    if not set(material.textures) <= set(COLOR_CHANNELS) or material.normal_map is not None or material.is_alpha_tested:
        raise SceneError(
            f"material {material.name[:80]!r} is transparent, or has images of roughness, normals or emission, which "
            "BTFs don't support; use colors, images of color, and real relief"
        )
    if not all(is_isotropic({"params": {}, "curves": {}, **term}) for term in material.terms):
        raise SceneError(f"material {material.name[:80]!r} is anisotropic, which BTFs don't support; change it")
    return tuple(
        {**term, "texture": term.get("texture") if term.get("texture") in material.textures else None}
        for term in material.terms
    )
