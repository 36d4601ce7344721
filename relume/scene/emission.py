"""Images of what surfaces shine: a light's emission is the mean over its surfaces, the image says where it is more.

L(x) = emission · image(x),   mean of the image over the surfaces = 1 in every channel
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relume.color import luminance
from relume.scene.coding import decode, wrapped
from relume.scene.model import Coding, Material, Mesh, Scene, Texture

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_PLACES = 4  # along a side of a triangle: the middles of so many squared smaller ones are looked up
_FACES_AT_ONCE = 65_536
_LEAST = 1e-6  # of a channel's mean: darker ones shine nothing


def lit_surfaces(material: Material, emission: F64, meshes: Sequence[Mesh]) -> tuple[Material, F64]:
    """Bring an image of what a material shines to the mean of one.

    Args:
        material: its image "emission" has sRGB bytes. emission: that multiplies the image. (3,)
        meshes: that wear the material.
    Returns:
        The material, without the image where it is the same all over; and the mean radiance of its surfaces. (3,)
    """
    texture = material.textures["emission"]
    areas = [_areas(mesh) for mesh in meshes]
    total = sum(of_mesh @ shine_of_faces(texture, mesh) for of_mesh, mesh in zip(areas, meshes, strict=True))
    mean = np.asarray(total / max(sum(float(of_mesh.sum()) for of_mesh in areas), 1e-30) * np.ones(3))
    others = {name: image for name, image in material.textures.items() if name != "emission"}
    if np.ptp(texture.pixels.reshape(-1, 3), axis=0).max() <= 2 or mean.max() <= 0:
        return replace(material, textures=others), emission * mean
    red, green, blue = (1 / np.maximum(mean, _LEAST)).tolist()
    over = replace(texture, coding=Coding("srgb", (red, green, blue)))
    return replace(material, textures={**others, "emission": over}), emission * mean


def shine_of_faces(texture: Texture, mesh: Mesh) -> F64:
    """The mean of an image over each triangle of a mesh. (num_faces, 3)"""
    found = np.empty((len(mesh.faces), 3))
    for start in range(0, len(mesh.faces), _FACES_AT_ONCE):
        corners = mesh.uvs[mesh.faces[start : start + _FACES_AT_ONCE]].astype(np.float64)
        total = np.zeros((len(corners), 3))
        for a, b, c in _middles():
            total += _nearest(texture, a * corners[:, 0] + b * corners[:, 1] + c * corners[:, 2])
        found[start : start + len(corners)] = total / _PLACES**2
    return found


def has_images(scene: Scene) -> bool:
    """Whether any surface shines as an image says."""
    return any("emission" in material.textures for material in scene.materials)


def shares_of_faces(scene: Scene) -> F32:
    """How brightly each triangle of a scene shines, as eyes weigh the scene's own colours of it, over its material's
    mean. (num_faces,)"""
    own = {light.fields.get("material"): light.fields["emission"] for light in scene.lights}
    shares = []
    for mesh in scene.meshes:
        material = scene.materials[mesh.material]
        texture, emission = material.textures.get("emission"), np.array(own.get(material.name, [1.0, 1.0, 1.0]))
        if texture is None or not emission.any():
            shares.append(np.ones(len(mesh.faces), np.float32))
        else:
            radiance = (emission * shine_of_faces(texture, mesh)).astype(np.float32)
            shares.append(luminance(radiance) / luminance(emission.astype(np.float32)))
    return np.concatenate(shares).astype(np.float32)


def _middles() -> list[tuple[float, float, float]]:
    """Barycentric coordinates of the middles of the small triangles that a triangle is divided into."""
    n = _PLACES
    upright = [(i + 1 / 3, j + 1 / 3) for i in range(n) for j in range(n - i)]
    turned = [(i + 2 / 3, j + 2 / 3) for i in range(n) for j in range(n - i - 1)]
    return [(1 - (x + y) / n, x / n, y / n) for x, y in upright + turned]


def _areas(mesh: Mesh) -> F64:
    a, b, c = mesh.positions[mesh.faces].astype(np.float64).transpose(1, 0, 2)
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)


def _nearest(texture: Texture, uv: F64) -> F32:
    """The texels that places (n, 2) lie in. (n, 3)"""
    height, width = texture.pixels.shape[:2]
    column = wrapped(np.floor(uv[:, 0] * width), width, texture.wrap[0])
    row = wrapped(np.floor(uv[:, 1] * height), height, texture.wrap[1])
    return decode(texture.pixels[row, column], texture.coding)
