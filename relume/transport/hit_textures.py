"""Textures at the hits of lobe rays, averaged over a ray's footprint: what is polished shows them as they are.

A patch knows the mean of its texture, and its light is proportional to it. A ray stores the texture that it meets, and
brings the patch's light divided by the mean, times that texture: irradiance is interpolated between patches, and
albedo is not.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.texture_slots import TEXTURES
from relume.core.numba_options import NO_REFCOUNT
from relume.math.rgb9e5 import pack_rgb9e5
from relume.raytrace.ray_packet import LANES, get_hit, get_uv
from relume.raytrace.surface_textures import EMISSION, TextureCoordinates, Textures
from relume.raytrace.texture_kernels import sample_texture

F32 = NDArray[np.float32]

_ONE = np.float32(1)
_WHITE = np.uint32(0x84020100)  # packed ones


class HitTextures(NamedTuple):
    """Textures of the surfaces that lobe rays meet.

    Attributes:
        textures: all, with those of the look. coordinates: of the triangles.
        slots: the `TEXTURES` that a material has, by index; only these are stored of a ray.
    """

    textures: Textures
    coordinates: TextureCoordinates
    slots: Shaped[NDArray[np.int64], " slots"]


def hit_textures(textures: Textures, coordinates: TextureCoordinates) -> HitTextures:
    """Return the textures for rays. textures: with those of the look. coordinates: of the triangles."""
    is_used = (textures.material_textures[:, : len(TEXTURES)] >= 0).any(axis=0)
    return HitTextures(textures, coordinates, np.flatnonzero(is_used).astype(np.int64))


NO_TEXTURES = hit_textures(
    Textures(
        np.empty((0, 3), np.float32),
        np.empty((0, 3), np.int64),
        np.zeros(1, np.int64),
        np.empty((0, 2), np.int64),
        np.empty((0, len(TEXTURES) + 2), np.int64),
    ),
    TextureCoordinates(np.empty((0, 2), np.float32), np.empty((0, 3), np.uint32), np.empty(0, np.float32)),
)
"""Of a scene without textures, or a store without them: rays bring the mean light of patches."""


class TexturedLight(NamedTuple):
    """Outgoing light of patches by the textures at a hit: plain + Σ_s by_texture_s × texture_s, less directional light.

    Attributes:
        plain: isotropic radiance of terms without a stored texture.
        by_diffuse, by_specular: isotropic radiance of terms with each texture, where it is 1.
        per_specular: reciprocal of the patches' mean specular texture, for their directional light.
        diffuse, specular: row of each texture among those of a hit, −1 for none.
    """

    plain: Shaped[F32, "patches 3"]
    by_diffuse: Shaped[F32, "patches 3"]
    by_specular: Shaped[F32, "patches 3"]
    per_specular: Shaped[F32, "patches 3"]
    diffuse: int
    specular: int


def row_of_slot(slots: Shaped[NDArray[np.int64], " slots"], slot: int) -> int:
    """Return the row of a slot of `TEXTURES` among those of a hit, −1 if none is stored."""
    rows = np.flatnonzero(slots == slot)
    return int(rows[0]) if len(rows) else -1


def textured_light(
    isotropic: Shaped[F32, "patches 3"],
    unit_share: Shaped[F32, "2 patches 3"],
    mean: Shaped[F32, "2 patches 3"],
    slots: Shaped[NDArray[np.int64], " slots"],
) -> TexturedLight:
    """Divide the light of patches by their textures.

    Args:
        isotropic: their isotropic radiance. unit_share: share of each of `TEXTURES` in it, divided by its mean.
        mean: of each texture on each patch. slots: of `HitTextures`.
    """
    stored = np.isin(np.arange(len(TEXTURES)), slots)[:, None, None]
    by_texture = np.where(stored, isotropic * unit_share, 0).astype(np.float32)
    plain = (isotropic - (by_texture * mean).sum(axis=0)).astype(np.float32)
    per_specular = np.where(stored[1], 1 / mean[1], 1).astype(np.float32)
    diffuse, specular = row_of_slot(slots, 0), row_of_slot(slots, 1)
    return TexturedLight(plain, by_texture[0], by_texture[1], per_specular, diffuse, specular)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _texture_uv(packet, k, face, coordinates):  # type: ignore[no-untyped-def]
    """Texture coordinates at a lane's hit, a tuple."""
    u, v = get_uv(packet, k)
    a, b, c = coordinates.faces[face, 0], coordinates.faces[face, 1], coordinates.faces[face, 2]
    w = _ONE - u - v
    return (
        w * coordinates.uvs[a, 0] + u * coordinates.uvs[b, 0] + v * coordinates.uvs[c, 0],
        w * coordinates.uvs[a, 1] + u * coordinates.uvs[b, 1] + v * coordinates.uvs[c, 1],
    )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def look_up_textures(packet, hit_textures, face_material, lanes):  # type: ignore[no-untyped-def]
    """Look up the textures that the rays of active lanes meet; white where there is none.

    Args:
        packet: traced rays. hit_textures: `HitTextures`. face_material: of all triangles.
        lanes: `RayLanes`; `texture` is written.
    """
    textures, coordinates, slots = hit_textures
    value = lanes.texel
    for k in range(LANES):
        face = get_hit(packet, k)[0] if packet.is_active[k] != 0 else np.int32(-1)
        if face < 0:
            continue
        u, v = _texture_uv(packet, k, face, coordinates)
        for row in range(slots.shape[0]):
            texture = textures.material_textures[face_material[face], slots[row]]
            lanes.texture[row, k] = _WHITE
            if texture >= 0:
                footprint = lanes.spread[k] * lanes.distance[k] * coordinates.scale[face]
                sample_texture(textures, texture, u, v, footprint, value)
                lanes.texture[row, k] = pack_rgb9e5(value[0], value[1], value[2])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def emission_image(packet, k, face, material, hit_textures, lanes):  # type: ignore[no-untyped-def]
    """Value of the emission image at a lane's hit, packed; ones without an image.

    Args:
        packet: traced rays. k: the lane. face, material: of its hit. hit_textures: `HitTextures`. lanes: `RayLanes`.
    """
    textures, coordinates, _ = hit_textures
    image = textures.material_textures[material, EMISSION] if textures.material_textures.shape[0] > 0 else -1
    if image < 0:
        return _WHITE
    (u, v), value = _texture_uv(packet, k, face, coordinates), lanes.texel
    sample_texture(textures, image, u, v, lanes.spread[k] * lanes.distance[k] * coordinates.scale[face], value)
    return pack_rgb9e5(value[0], value[1], value[2])
