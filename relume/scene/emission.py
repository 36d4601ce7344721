"""Emission textures: a light's emission is the mean over its surfaces, and the texture holds relative values.

L(x) = emission · image(x), with mean(image) = 1 over the surfaces in each channel
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import luminance
from relume.scene.model import Material, Mesh, Scene, Texture, TextureEncoding
from relume.scene.texture_encoding import decode, periodic

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_SUBDIVISIONS = 4  # along each edge of a triangle; the texture is sampled at the centers of the small triangles
_FACES_PER_BATCH = 65_536
_MIN_MEAN = 1e-6  # of a channel; below, it emits nothing


def normalize_emission(
    material: Material, emission: Shaped[F64, " 3"], meshes: Sequence[Mesh]
) -> tuple[Material, Shaped[F64, " 3"]]:
    """Divide a material's emission texture by its mean over the surfaces.

    Args:
        material: material whose texture "emission" has sRGB bytes. emission: factor of the texture.
        meshes: meshes that use the material.
    Returns:
        The material, without the texture if it is uniform; and the mean radiance of its surfaces.
    """
    texture = material.textures["emission"]
    areas = [_areas(mesh) for mesh in meshes]
    total = sum(mesh_areas @ average_over_faces(texture, mesh) for mesh_areas, mesh in zip(areas, meshes, strict=True))
    mean = np.asarray(total / max(sum(float(mesh_areas.sum()) for mesh_areas in areas), 1e-30) * np.ones(3))
    other_textures = {name: image for name, image in material.textures.items() if name != "emission"}
    if np.ptp(texture.pixels.reshape(-1, 3), axis=0).max() <= 2 or mean.max() <= 0:
        return replace(material, textures=other_textures), emission * mean
    red, green, blue = (1 / np.maximum(mean, _MIN_MEAN)).tolist()
    normalized = replace(texture, encoding=TextureEncoding("srgb", (red, green, blue)))
    return replace(material, textures={**other_textures, "emission": normalized}), emission * mean


def average_over_faces(texture: Texture, mesh: Mesh) -> Shaped[F64, "triangles 3"]:
    """Mean of a texture over each triangle of a mesh."""
    means = np.empty((len(mesh.faces), 3))
    for start in range(0, len(mesh.faces), _FACES_PER_BATCH):
        corners = mesh.uvs[mesh.faces[start : start + _FACES_PER_BATCH]].astype(np.float64)
        total = np.zeros((len(corners), 3))
        for a, b, c in _subdivision_centers():
            total += _nearest(texture, a * corners[:, 0] + b * corners[:, 1] + c * corners[:, 2])
        means[start : start + len(corners)] = total / _SUBDIVISIONS**2
    return means


def has_emission_images(scene: Scene) -> bool:
    """True if any material has an emission texture."""
    return any("emission" in material.textures for material in scene.materials)


def relative_emission(scene: Scene) -> Shaped[F32, " triangles"]:
    """Luminance of each triangle's emission, relative to the mean of its material, for unedited light colors."""
    emission_by_material = {light.fields.get("material"): light.fields["emission"] for light in scene.lights}
    relative = []
    for mesh in scene.meshes:
        material = scene.materials[mesh.material]
        texture, emission = (
            material.textures.get("emission"),
            np.array(emission_by_material.get(material.name, [1.0, 1.0, 1.0])),
        )
        if texture is None or not emission.any():
            relative.append(np.ones(len(mesh.faces), np.float32))
        else:
            radiance = (emission * average_over_faces(texture, mesh)).astype(np.float32)
            relative.append(luminance(radiance) / luminance(emission.astype(np.float32)))
    return np.concatenate(relative).astype(np.float32)


def _subdivision_centers() -> list[tuple[float, float, float]]:
    """Barycentric coordinates of the centers of the small triangles."""
    n = _SUBDIVISIONS
    upright = [(i + 1 / 3, j + 1 / 3) for i in range(n) for j in range(n - i)]
    inverted = [(i + 2 / 3, j + 2 / 3) for i in range(n) for j in range(n - i - 1)]
    return [(1 - (x + y) / n, x / n, y / n) for x, y in upright + inverted]


def _areas(mesh: Mesh) -> F64:
    a, b, c = mesh.positions[mesh.faces].astype(np.float64).transpose(1, 0, 2)
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)


def _nearest(texture: Texture, uv: F64) -> F32:
    """Look up the nearest texels at UV coordinates (n, 2). (n, 3)"""
    height, width = texture.pixels.shape[:2]
    column = periodic(np.floor(uv[:, 0] * width), width, texture.wrap[0])
    row = periodic(np.floor(uv[:, 1] * height), height, texture.wrap[1])
    return decode(texture.pixels[row, column], texture.encoding)
