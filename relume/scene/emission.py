"""Images of what surfaces shine: a light's emission is the mean over its surfaces, the image says where it is more.

L(x) = emission · image(x),   mean of the image over the surfaces = 1 in every channel
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relume.core.color import luminance
from relume.scene.model import Material, Mesh, Scene, Texture, TextureEncoding
from relume.scene.texture_encoding import decode, periodic

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_SUBDIVISIONS = 4  # along a side of a triangle: the middles of so many squared smaller ones are looked up
_FACES_PER_BATCH = 65_536
_MIN_MEAN = 1e-6  # of a channel's mean: darker ones shine nothing


def normalize_emission(material: Material, emission: F64, meshes: Sequence[Mesh]) -> tuple[Material, F64]:
    """Bring an image of what a material shines to the mean of one.

    Args:
        material: its image "emission" has sRGB bytes. emission: that multiplies the image. (3,)
        meshes: that wear the material.
    Returns:
        The material, without the image where it is the same all over; and the mean radiance of its surfaces. (3,)
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


def average_over_faces(texture: Texture, mesh: Mesh) -> F64:
    """The mean of an image over each triangle of a mesh. (num_faces, 3)"""
    means = np.empty((len(mesh.faces), 3))
    for start in range(0, len(mesh.faces), _FACES_PER_BATCH):
        corners = mesh.uvs[mesh.faces[start : start + _FACES_PER_BATCH]].astype(np.float64)
        total = np.zeros((len(corners), 3))
        for a, b, c in _subdivision_centers():
            total += _nearest(texture, a * corners[:, 0] + b * corners[:, 1] + c * corners[:, 2])
        means[start : start + len(corners)] = total / _SUBDIVISIONS**2
    return means


def has_emission_images(scene: Scene) -> bool:
    """Whether any surface shines as an image says."""
    return any("emission" in material.textures for material in scene.materials)


def relative_emission(scene: Scene) -> F32:
    """How brightly each triangle of a scene shines, as eyes weigh the scene's own colours of it, over its material's
    mean. (num_faces,)"""
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
    """Barycentric coordinates of the middles of the small triangles that a triangle is divided into."""
    n = _SUBDIVISIONS
    upright = [(i + 1 / 3, j + 1 / 3) for i in range(n) for j in range(n - i)]
    inverted = [(i + 2 / 3, j + 2 / 3) for i in range(n) for j in range(n - i - 1)]
    return [(1 - (x + y) / n, x / n, y / n) for x, y in upright + inverted]


def _areas(mesh: Mesh) -> F64:
    a, b, c = mesh.positions[mesh.faces].astype(np.float64).transpose(1, 0, 2)
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)


def _nearest(texture: Texture, uv: F64) -> F32:
    """The texels that places (n, 2) lie in. (n, 3)"""
    height, width = texture.pixels.shape[:2]
    column = periodic(np.floor(uv[:, 0] * width), width, texture.wrap[0])
    row = periodic(np.floor(uv[:, 1] * height), height, texture.wrap[1])
    return decode(texture.pixels[row, column], texture.encoding)
