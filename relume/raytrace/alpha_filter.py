"""What Embree asks while it traces: is the surface there, where a ray meets a triangle that rays may pass?

One function for all such triangles of a scene; Embree calls it with a packet's hits and takes back which of them
count. A surface that blends is there for the share of rays that its opacity says. Which rays those are, their chance
decides: a number that the caller gives an eye's rays, so that those of a pixel share out the opacity evenly; of others
it follows from their direction: the same ray finds the same, in any packet. Rays that are given one always meet glass.
"""

from __future__ import annotations

import ctypes
from typing import Any, NamedTuple

import numba as nb
import numpy as np
from numba.core import cgutils, types
from numba.extending import intrinsic
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from relume.core.color import LUMINANCE
from relume.core.numba_options import UNCOUNTED
from relume.raytrace.alpha_test import GLASS_RULE, MAX_TINTS, AlphaMasks, tint_groups
from relume.raytrace.texture import two_texels

F32 = NDArray[np.float32]
U32 = NDArray[np.uint32]

_DIRECTION, _TIME = 4, 7  # rows of RTCRayN; triangles that do not move have no other use for the time
_U, _V, _PRIMITIVE = 3, 4, 5  # rows of RTCHitN
_RED, _GREEN, _BLUE = (np.float32(share) for share in LUMINANCE)
_MAX_ALPHA_SAMPLE = np.float32(254.5 / 255)  # a chance that texels of 255 reach, however they are rounded
# chances of rays that are stopped by whatever is there a little, of those that only what is wholly there stops, and of
# those that see no glass, and else what their direction makes them see
STOP_AT_PARTIAL, STOP_AT_OPAQUE, IGNORE_GLASS = np.float32(-1), np.float32(2), np.float32(-2)
# of rays that only light of one channel takes
ONE_CHANNEL = np.array([-3, -4, -5], np.float32)
_LAST_CHANNEL = ONE_CHANNEL[2]
# of rays that tinted glass stops, and from then on of those that glass of one more group of tints lets pass altogether
PASS_TINT_GROUPS = np.array([-6 - group for group in range(MAX_TINTS + 1)], np.float32)
_NO_GROUP = PASS_TINT_GROUPS[0]


class AlphaTest(NamedTuple):
    """What the filter reads, kept for as long as the scene that it belongs to.

    Attributes:
        addresses: of the arrays below and of those of the cut-outs. (8,) int64
        image: row of `AlphaMasks.images` of each triangle, −1 where it has no holes. (faces,) int32
        sheet: those of one number are passed by one chance: all of an image, but each piece of glass. (faces,) int32
        faces: corners. (faces, 3) uint32. uvs: places of corners in textures. (corners, 2) float32
        alpha_masks: the images. groups: of the tints of each, see `tint_groups`. (images,) int32
    """

    addresses: NDArray[np.int64]
    image: NDArray[np.int32]
    sheet: NDArray[np.int32]
    faces: U32
    uvs: F32
    alpha_masks: AlphaMasks
    groups: NDArray[np.int32]

    @property
    def blends(self) -> bool:
        """Whether some surface is there for a share of an eye's rays."""
        is_blended = self.alpha_masks.rules[:, 0] < 0
        first, height, width = self.alpha_masks.images[is_blended, :3].T
        return any(
            self.alpha_masks.texels[a : a + h * w].min() < 255 for a, h, w in zip(first, height, width, strict=True)
        )

    @classmethod
    def build(
        cls, faces: U32, positions: F32, uvs: F32, face_material: NDArray[np.int32], alpha_masks: AlphaMasks
    ) -> AlphaTest:
        """Gather what the filter reads.

        Args:
            faces: (num_faces, 3) uint32 into the next two.
            positions: (num_vertices, 3) float32. uvs: (num_vertices, 2) float32
            face_material: (num_faces,) int32 into `alpha_masks.material_textures`. alpha_masks: the images.
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
    """The image of each triangle; of pieces of glass that do not touch its first, numbers of their own. (faces,)

    Panes one behind the other absorb as two.
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


@nb.njit(nogil=True, cache=True, error_model="numpy", **UNCOUNTED)
def _opacity(image, texels, u, v):  # type: ignore[no-untyped-def]
    """Look opacity up, between four texels. image: of `AlphaMasks.images`. u, v: v from the top"""
    first, height, width = image[0], image[1], image[2]
    left, right, x = two_texels(image[3], u, width)
    above, below, y = two_texels(image[4], v, height)
    row_above, row_below = first + above * width, first + below * width
    unity = np.float32(1)
    top = (unity - x) * np.float32(texels[row_above + left]) + x * np.float32(texels[row_above + right])
    bottom = (unity - x) * np.float32(texels[row_below + left]) + x * np.float32(texels[row_below + right])
    return ((unity - y) * top + y * bottom) / np.float32(255)


@nb.njit(nogil=True, cache=True, error_model="numpy", **UNCOUNTED)
def _hash_bits(bits):  # type: ignore[no-untyped-def]
    """Mix the bits of a word (the finaliser of MurmurHash3). uint32"""
    bits = np.uint32((bits ^ (bits >> np.uint32(16))) * np.uint32(0x85EBCA6B))  # a product of two has 64 bits
    bits = np.uint32((bits ^ (bits >> np.uint32(13))) * np.uint32(0xC2B2AE35))
    return np.uint32(bits ^ (bits >> np.uint32(16)))


@nb.njit(nogil=True, cache=True, error_model="numpy", **UNCOUNTED)
def _alpha_sample(alpha_sample, face, sheet, x, y, z, is_back_face):  # type: ignore[no-untyped-def]
    """A number in (0, 1) for a ray that meets a surface that blends: the given one, or one of its direction (x, y, z).

    A given one moves with the face: what a ray met before says nothing about what it meets behind that. All rays to
    one light have one direction and so one chance, at fronts and at backs of each sheet: shadows of panes are even.
    """
    if alpha_sample == STOP_AT_PARTIAL:
        return np.float32(1 / 512)
    if alpha_sample == STOP_AT_OPAQUE:
        return _MAX_ALPHA_SAMPLE
    if alpha_sample > 0:
        shifted = alpha_sample + np.float32(_hash_bits(np.uint32(face)) >> np.uint32(8)) * np.float32(2**-24)
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
    """What a side of glass lets pass but for what it reflects: of a channel, or of luminance. rule: of `AlphaMasks`"""
    if _LAST_CHANNEL <= alpha_sample < 0:
        return rule[np.int64(-alpha_sample) - 2]
    return _RED * rule[1] + _GREEN * rule[2] + _BLUE * rule[3]


@nb.njit(nogil=True, cache=True, error_model="numpy", inline="always")
def _ignores_glass(group, alpha_sample):  # type: ignore[no-untyped-def]
    """Whether glass lets all rays of a chance pass. group: of its tint, see `tint_groups`."""
    return alpha_sample == IGNORE_GLASS or (
        group > 0 and alpha_sample <= _NO_GROUP and np.float32(group) <= _NO_GROUP - alpha_sample
    )


@nb.njit(nogil=True, cache=True, error_model="numpy", inline="always")
def _passes_fraction(group, alpha_sample):  # type: ignore[no-untyped-def]
    """Whether glass lets a share of the rays of a chance pass, and else none. group: of its tint."""
    return (
        alpha_sample == 0 or _LAST_CHANNEL <= alpha_sample < IGNORE_GLASS or (alpha_sample <= _NO_GROUP and group == 0)
    )


@nb.cfunc("void(CPointer(int64))", cache=True, error_model="numpy")
def _filter(arguments):  # type: ignore[no-untyped-def]
    """RTCFilterFunctionN. arguments: valid, user pointer, context, ray, hit, and how many."""
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
"""What Embree calls."""
