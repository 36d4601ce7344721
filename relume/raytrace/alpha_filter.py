"""Embree filter function for alpha-tested, blended and glass surfaces.

Embree calls one function for all such triangles of a scene, with the hits of a packet; it rejects the hits that the
rays pass. A blended surface stops a fraction of the rays equal to its opacity, by comparison with each ray's alpha
sample. Camera rays have stratified samples, so that the right fraction of a pixel's rays stops; the sample of any other
ray is a hash of its direction, so that the result does not depend on the packet. Rays with a given alpha sample always
hit glass.
"""

from __future__ import annotations

import ctypes
from typing import Any, NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numba.core import cgutils, types
from numba.extending import intrinsic
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from relume.core.color import LUMINANCE
from relume.core.numba_options import NO_REFCOUNT
from relume.raytrace.alpha_test import GLASS_RULE, MAX_TINTS, AlphaMasks, tint_groups
from relume.raytrace.texture import two_texels

F32 = NDArray[np.float32]
U32 = NDArray[np.uint32]

_DIRECTION, _TIME = 4, 7  # rows of RTCRayN; the time is free for the alpha sample, because triangles do not move
_U, _V, _PRIMITIVE = 3, 4, 5  # rows of RTCHitN
_RED, _GREEN, _BLUE = (np.float32(share) for share in LUMINANCE)
_MAX_ALPHA_SAMPLE = np.float32(254.5 / 255)  # below the opacity of texels of 255, however it is rounded
NUM_OFFSETS = 4096  # of the samples of different pixels within a stratum of 1/8; samples lie in the middle of one
# alpha samples of rays that stop at any partly opaque surface, of rays that stop only at opaque surfaces, and of rays
# that ignore glass and otherwise use the hash of their direction
STOP_AT_PARTIAL, STOP_AT_OPAQUE, IGNORE_GLASS = np.float32(-1), np.float32(2), np.float32(-2)
# of rays for the light of one channel
ONE_CHANNEL = np.array([-3, -4, -5], np.float32)
_LAST_CHANNEL = ONE_CHANNEL[2]
# of rays that tinted glass stops; each further value lets one more group of tints pass all light
PASS_TINT_GROUPS = np.array([-6 - group for group in range(MAX_TINTS + 1)], np.float32)
_NO_GROUP = PASS_TINT_GROUPS[0]


class AlphaTest(NamedTuple):
    """Data of the filter function; it must live as long as its Embree scene.

    Attributes:
        addresses: addresses of the arrays below and of the arrays of `alpha_masks`.
        image: row of `AlphaMasks.images` of each triangle, −1 if it is opaque.
        sheet: triangles with the same number share one hash: all of an image, but each piece of glass has its own.
        faces: corner indices. uvs: texture coordinates of the corners.
        alpha_masks: the images. groups: tint group of each image, see `tint_groups`.
    """

    addresses: Shaped[NDArray[np.int64], " 8"]
    image: Shaped[NDArray[np.int32], " faces"]
    sheet: Shaped[NDArray[np.int32], " faces"]
    faces: Shaped[U32, "faces 3"]
    uvs: Shaped[F32, "corners 2"]
    alpha_masks: AlphaMasks
    groups: Shaped[NDArray[np.int32], " images"]

    @property
    def blends(self) -> bool:
        """True if a surface stops only a fraction of the camera rays."""
        is_blended = self.alpha_masks.rules[:, 0] < 0
        first, height, width = self.alpha_masks.images[is_blended, :3].T
        return any(
            self.alpha_masks.texels[a : a + h * w].min() < 255 for a, h, w in zip(first, height, width, strict=True)
        )

    @classmethod
    def build(
        cls,
        faces: Shaped[U32, "faces 3"],
        positions: Shaped[F32, "vertices 3"],
        uvs: Shaped[F32, "vertices 2"],
        face_material: Shaped[NDArray[np.int32], " faces"],
        alpha_masks: AlphaMasks,
    ) -> AlphaTest:
        """Collect the data of the filter function.

        Args:
            faces: indices into `positions` and `uvs`. positions, uvs: positions and UV coordinates of the vertices.
            face_material: index into `alpha_masks.material_rule`. alpha_masks: the images.
        """
        image = np.ascontiguousarray(alpha_masks.material_rule[face_material], np.int32)
        faces, uvs = np.ascontiguousarray(faces, np.uint32), np.ascontiguousarray(uvs, np.float32)
        sheet, groups = _number_sheets(positions, faces, image, alpha_masks), tint_groups(alpha_masks)
        kernel_arrays = (image, faces, uvs, alpha_masks.texels, alpha_masks.images, alpha_masks.rules, sheet, groups)
        return cls(
            np.array([array.ctypes.data for array in kernel_arrays], np.int64),
            image,
            sheet,
            faces,
            uvs,
            alpha_masks,
            groups,
        )


def _number_sheets(positions: F32, faces: U32, image: NDArray[np.int32], alpha_masks: AlphaMasks) -> NDArray[np.int32]:
    """Sheet of each triangle: the row of its image, or a separate number per connected piece of glass. (faces,)

    Separate numbers let two glass surfaces in a row absorb independently.
    """
    sheet, (first, num) = image.copy(), (len(alpha_masks.rules), 0)
    for row in np.flatnonzero(alpha_masks.rules[:, 0] == GLASS_RULE):
        row_faces = np.flatnonzero(image == row)
        _, corner = np.unique(positions[faces[row_faces]].reshape(-1, 3), axis=0, return_inverse=True)
        a, b, c = corner.reshape(-1, 3).T
        edge_ends = np.concatenate([a, b]), np.concatenate([b, c])
        num_corners = int(corner.max(initial=-1)) + 1
        graph = coo_array((np.ones(len(edge_ends[0]), np.bool_), edge_ends), (num_corners, num_corners))
        num_pieces, piece = connected_components(graph, directed=False)
        sheet[row_faces] = np.where(piece[a] == 0, row, first + num + piece[a])
        num += num_pieces
    return sheet


def _cast(typing_context, address):  # type: ignore[no-untyped-def]
    def codegen(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        return builder.inttoptr(arguments[0], cgutils.voidptr_t)

    return types.voidptr(types.int64), codegen


_to_pointer: Any = intrinsic(_cast)  # makes an address (int64) a pointer
_array: Any = nb.carray  # type: ignore[attr-defined]  # an array over the memory at a pointer


@nb.njit(nogil=True, cache=True, error_model="numpy", **NO_REFCOUNT)
def _opacity(image, texels, u, v):  # type: ignore[no-untyped-def]
    """Bilinear lookup of the opacity. image: row of `AlphaMasks.images`. u, v: v from the top"""
    first, height, width = image[0], image[1], image[2]
    left, right, x = two_texels(image[3], u, width)
    above, below, y = two_texels(image[4], v, height)
    row_above, row_below = first + above * width, first + below * width
    unity = np.float32(1)
    top = (unity - x) * np.float32(texels[row_above + left]) + x * np.float32(texels[row_above + right])
    bottom = (unity - x) * np.float32(texels[row_below + left]) + x * np.float32(texels[row_below + right])
    return ((unity - y) * top + y * bottom) / np.float32(255)


@nb.njit(nogil=True, cache=True, error_model="numpy", **NO_REFCOUNT)
def _hash_bits(bits):  # type: ignore[no-untyped-def]
    """Mix the bits of a word (the finalizer of MurmurHash3). uint32"""
    bits = np.uint32((bits ^ (bits >> np.uint32(16))) * np.uint32(0x85EBCA6B))  # a product of two has 64 bits
    bits = np.uint32((bits ^ (bits >> np.uint32(13))) * np.uint32(0xC2B2AE35))
    return np.uint32(bits ^ (bits >> np.uint32(16)))


@nb.njit(nogil=True, cache=True, error_model="numpy", **NO_REFCOUNT)
def _alpha_sample(alpha_sample, face, sheet, x, y, z, is_back_face):  # type: ignore[no-untyped-def]
    """Alpha sample in (0, 1) of a ray at a blended surface: the given one, or a hash of its direction (x, y, z).

    A given sample is shifted per face and pixel, so that successive surfaces are independent. Rays of a pixel keep
    their strata at each face: their samples differ by multiples of 1/8, so that the rest of the division identifies the
    pixel. All rays to one light have one direction and so the same sample at the front or back of each sheet: shadows
    of glass have no noise.
    """
    if alpha_sample == STOP_AT_PARTIAL:
        return np.float32(1 / 512)
    if alpha_sample == STOP_AT_OPAQUE:
        return _MAX_ALPHA_SAMPLE
    if alpha_sample > 0:
        eighths = np.float32(8) * alpha_sample
        pixel = np.uint32(np.float32(NUM_OFFSETS) * (eighths - np.floor(eighths)))
        bits = _hash_bits(np.uint32(np.uint32(face) ^ _hash_bits(pixel)))
        shifted = alpha_sample + np.float32(bits >> np.uint32(8)) * np.float32(2**-24)
        return min(shifted - np.float32(1) if shifted > 1 else shifted, _MAX_ALPHA_SAMPLE)
    bits = np.uint32(2 * sheet + is_back_face)
    for component in (x, y, z):
        bits = _hash_bits(np.uint32(bits ^ np.float32(component).view(np.uint32)))
    return min((np.float32(bits >> np.uint32(8)) + np.float32(1)) * np.float32(2**-24), _MAX_ALPHA_SAMPLE)


@nb.njit(nogil=True, cache=True, error_model="numpy", inline="always")
def _schlick(cosine, f0):  # type: ignore[no-untyped-def]
    return f0 + (np.float32(1) - f0) * (np.float32(1) - min(cosine, np.float32(1))) ** 5


@nb.njit(nogil=True, cache=True, error_model="numpy", inline="always")
def _glass_transmittance(rule, alpha_sample):  # type: ignore[no-untyped-def]
    """Transmittance of a glass surface without the Fresnel reflectance: of a channel, or the luminance."""
    if _LAST_CHANNEL <= alpha_sample < 0:
        return rule[np.int64(-alpha_sample) - 2]
    return _RED * rule[1] + _GREEN * rule[2] + _BLUE * rule[3]


@nb.njit(nogil=True, cache=True, error_model="numpy", inline="always")
def _ignores_glass(group, alpha_sample):  # type: ignore[no-untyped-def]
    """True if glass passes all rays with this alpha sample. group: group index of its tint, see `tint_groups`."""
    return alpha_sample == IGNORE_GLASS or (
        group > 0 and alpha_sample <= _NO_GROUP and np.float32(group) <= _NO_GROUP - alpha_sample
    )


@nb.njit(nogil=True, cache=True, error_model="numpy", inline="always")
def _passes_fraction(group, alpha_sample):  # type: ignore[no-untyped-def]
    """True if glass passes a fraction of the rays with this alpha sample, otherwise none. group: its tint group."""
    return (
        alpha_sample == 0 or _LAST_CHANNEL <= alpha_sample < IGNORE_GLASS or (alpha_sample <= _NO_GROUP and group == 0)
    )


@nb.cfunc("void(CPointer(int64))", cache=True, error_model="numpy")
def _filter(arguments):  # type: ignore[no-untyped-def]
    """Implement RTCFilterFunctionN. arguments: valid, user pointer, context, ray, hit, and width."""
    pointers = _array(arguments, (6,))
    width = np.int64(np.uint32(pointers[5] & 0xFFFFFFFF))
    valid = _array(_to_pointer(pointers[0]), (width,), np.int32)
    rays = _array(_to_pointer(pointers[3]), (9, width), np.float32)
    hits = _array(_to_pointer(pointers[4]), (6, width), np.float32)
    primitives = _array(_to_pointer(pointers[4]), (6, width), np.uint32)
    array_pointers = _array(_to_pointer(pointers[1]), (8,), np.int64)
    face_image = _array(_to_pointer(array_pointers[0]), (1 << 40,), np.int32)
    faces = _array(_to_pointer(array_pointers[1]), (1 << 40, 3), np.uint32)
    uvs = _array(_to_pointer(array_pointers[2]), (1 << 40, 2), np.float32)
    sheets = _array(_to_pointer(array_pointers[6]), (1 << 40,), np.int32)
    texels = _array(_to_pointer(array_pointers[3]), (1 << 40,), np.uint8)
    images = _array(_to_pointer(array_pointers[4]), (1 << 30, 5), np.int64)
    rules = _array(_to_pointer(array_pointers[5]), (1 << 30, 6), np.float32)
    groups = _array(_to_pointer(array_pointers[7]), (1 << 30,), np.int32)
    for lane in range(width):
        if valid[lane] == 0:
            continue
        face = np.int64(primitives[_PRIMITIVE, lane])
        row = face_image[face]
        b, c = hits[_U, lane], hits[_V, lane]
        a = np.float32(1) - b - c
        i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
        u = a * uvs[i, 0] + b * uvs[j, 0] + c * uvs[k, 0]
        v = a * uvs[i, 1] + b * uvs[j, 1] + c * uvs[k, 1]
        opacity, threshold = _opacity(images[row], texels, u, v), rules[row, 0]
        if threshold < 0:
            x, y, z = rays[_DIRECTION, lane], rays[_DIRECTION + 1, lane], rays[_DIRECTION + 2, lane]
            along = hits[0, lane] * x + hits[1, lane] * y + hits[2, lane] * z
            alpha_sample = rays[_TIME, lane]
            threshold = _alpha_sample(alpha_sample, face, sheets[face], x, y, z, along > 0)
            if rules[row, 0] == GLASS_RULE and _ignores_glass(groups[row], alpha_sample):
                opacity = np.float32(0)
            elif rules[row, 0] == GLASS_RULE and _passes_fraction(groups[row], alpha_sample):
                squared_length = hits[0, lane] ** 2 + hits[1, lane] ** 2 + hits[2, lane] ** 2
                cosine = abs(along) / np.sqrt(squared_length * (x * x + y * y + z * z))
                opacity *= np.float32(1) - _glass_transmittance(rules[row], alpha_sample) * (
                    np.float32(1) - _schlick(cosine, rules[row, 4])
                )
        if opacity < threshold:
            valid[lane] = 0


FILTER = ctypes.c_void_p(_filter.address)
"""Function pointer for Embree."""
