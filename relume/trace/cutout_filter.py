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

from relume.color import LUMINANCE
from relume.trace.cutouts import MOST_TINTS, PASSES, Cutouts, tint_groups
from relume.trace.texture import two_texels
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]
U32 = NDArray[np.uint32]

_DIRECTION, _TIME = 4, 7  # rows of RTCRayN; triangles that do not move have no other use for the time
_U, _V, _PRIMITIVE = 3, 4, 5  # rows of RTCHitN
_RED, _GREEN, _BLUE = (np.float32(share) for share in LUMINANCE)
_MOST = np.float32(254.5 / 255)  # a chance that texels of 255 reach, however they are rounded
# chances of rays that are stopped by whatever is there a little, of those that only what is wholly there stops, and of
# those that see no glass, and else what their direction makes them see
ANYWHERE, EVERYWHERE, PAST_GLASS = np.float32(-1), np.float32(2), np.float32(-2)
# of rays that only light of one channel takes
OF_CHANNEL = np.array([-3, -4, -5], np.float32)
_LAST_CHANNEL = OF_CHANNEL[2]
# of rays that tinted glass stops, and from then on of those that glass of one more group of tints lets pass altogether
UP_TO_GROUP = np.array([-6 - group for group in range(MOST_TINTS + 1)], np.float32)
_NO_GROUP = UP_TO_GROUP[0]


class Holes(NamedTuple):
    """What the filter reads, kept for as long as the scene that it belongs to.

    Attributes:
        addresses: of the arrays below and of those of the cut-outs. (8,) int64
        image: row of `Cutouts.images` of each triangle, −1 where it has no holes. (faces,) int32
        sheet: those of one number are passed by one chance: all of an image, but each piece of glass. (faces,) int32
        faces: corners. (faces, 3) uint32. uvs: places of corners in textures. (corners, 2) float32
        cutouts: the images. groups: of the tints of each, see `tint_groups`. (images,) int32
    """

    addresses: NDArray[np.int64]
    image: NDArray[np.int32]
    sheet: NDArray[np.int32]
    faces: U32
    uvs: F32
    cutouts: Cutouts
    groups: NDArray[np.int32]

    @property
    def blends(self) -> bool:
        """Whether some surface is there for a share of an eye's rays."""
        is_share = self.cutouts.rules[:, 0] < 0
        first, height, width = self.cutouts.images[is_share, :3].T
        return any(self.cutouts.texels[a : a + h * w].min() < 255 for a, h, w in zip(first, height, width, strict=True))

    @classmethod
    def of(cls, faces: U32, positions: F32, uvs: F32, face_material: NDArray[np.int32], cutouts: Cutouts) -> Holes:
        """Gather what the filter reads.

        Args:
            faces: (num_faces, 3) uint32 into the next two.
            positions: (num_vertices, 3) float32. uvs: (num_vertices, 2) float32
            face_material: (num_faces,) int32 into `cutouts.of_material`. cutouts: the images.
        """
        image = np.ascontiguousarray(cutouts.of_material[face_material], np.int32)
        faces, uvs = np.ascontiguousarray(faces, np.uint32), np.ascontiguousarray(uvs, np.float32)
        sheet, groups = _sheets(positions, faces, image, cutouts), tint_groups(cutouts)
        read = (image, faces, uvs, cutouts.texels, cutouts.images, cutouts.rules, sheet, groups)
        return cls(np.array([array.ctypes.data for array in read], np.int64), image, sheet, faces, uvs, cutouts, groups)


def _sheets(positions: F32, faces: U32, image: NDArray[np.int32], cutouts: Cutouts) -> NDArray[np.int32]:
    """The image of each triangle; of pieces of glass that do not touch its first, numbers of their own. (faces,)

    Panes one behind the other absorb as two.
    """
    sheet, (first, num) = image.copy(), (len(cutouts.rules), 0)
    for row in np.flatnonzero(cutouts.rules[:, 0] == PASSES):
        of_row = np.flatnonzero(image == row)
        _, corner = np.unique(positions[faces[of_row]].reshape(-1, 3), axis=0, return_inverse=True)
        a, b, c = corner.reshape(-1, 3).T
        ends = np.concatenate([a, b]), np.concatenate([b, c])
        num_corners = int(corner.max(initial=-1)) + 1
        graph = coo_array((np.ones(len(ends[0]), np.bool_), ends), (num_corners, num_corners))
        pieces, piece = connected_components(graph, directed=False)
        sheet[of_row] = np.where(piece[a] == 0, row, first + num + piece[a])
        num += pieces
    return sheet


def _cast(typing_context, address):  # type: ignore[no-untyped-def]
    def make(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        return builder.inttoptr(arguments[0], cgutils.voidptr_t)

    return types.voidptr(types.int64), make


_at: Any = intrinsic(_cast)  # makes an address (int64) a pointer
_array: Any = nb.carray  # type: ignore[attr-defined]  # an array over the memory at a pointer


@nb.njit(nogil=True, cache=True, error_model="numpy", **UNCOUNTED)
def _opacity(image, texels, u, v):  # type: ignore[no-untyped-def]
    """Look opacity up, between four texels. image: of `Cutouts.images`. u, v: v from the top"""
    first, height, width = image[0], image[1], image[2]
    left, right, x = two_texels(image[3], u, width)
    above, below, y = two_texels(image[4], v, height)
    over, under = first + above * width, first + below * width
    one = np.float32(1)
    top = (one - x) * np.float32(texels[over + left]) + x * np.float32(texels[over + right])
    bottom = (one - x) * np.float32(texels[under + left]) + x * np.float32(texels[under + right])
    return ((one - y) * top + y * bottom) / np.float32(255)


@nb.njit(nogil=True, cache=True, error_model="numpy", **UNCOUNTED)
def _hashed(word):  # type: ignore[no-untyped-def]
    """Mix the bits of a word (the finaliser of MurmurHash3). uint32"""
    word = np.uint32((word ^ (word >> np.uint32(16))) * np.uint32(0x85EBCA6B))  # a product of two has 64 bits
    word = np.uint32((word ^ (word >> np.uint32(13))) * np.uint32(0xC2B2AE35))
    return np.uint32(word ^ (word >> np.uint32(16)))


@nb.njit(nogil=True, cache=True, error_model="numpy", **UNCOUNTED)
def _chance(given, face, sheet, x, y, z, is_behind):  # type: ignore[no-untyped-def]
    """A number in (0, 1) for a ray that meets a surface that blends: the given one, or one of its direction (x, y, z).

    A given one moves with the face: what a ray met before says nothing about what it meets behind that. All rays to
    one light have one direction and so one chance, at fronts and at backs of each sheet: shadows of panes are even.
    """
    if given == ANYWHERE:
        return np.float32(1 / 512)
    if given == EVERYWHERE:
        return _MOST
    if given > 0:
        moved = given + np.float32(_hashed(np.uint32(face)) >> np.uint32(8)) * np.float32(2**-24)
        return min(moved - np.float32(1) if moved > 1 else moved, _MOST)
    word = np.uint32(2 * sheet + is_behind)
    for component in (x, y, z):
        word = _hashed(np.uint32(word ^ np.float32(component).view(np.uint32)))
    return min((np.float32(word >> np.uint32(8)) + np.float32(1)) * np.float32(2**-24), _MOST)


@nb.njit(nogil=True, cache=True, error_model="numpy", inline="always")
def _schlick(cosine, f0):  # type: ignore[no-untyped-def]
    return f0 + (np.float32(1) - f0) * (np.float32(1) - min(cosine, np.float32(1))) ** 5


@nb.njit(nogil=True, cache=True, error_model="numpy", inline="always")
def _passed(rule, given):  # type: ignore[no-untyped-def]
    """What a side of glass lets pass but for what it reflects: of a channel, or of luminance. rule: of `Cutouts`"""
    if _LAST_CHANNEL <= given < 0:
        return rule[np.int64(-given) - 2]
    return _RED * rule[1] + _GREEN * rule[2] + _BLUE * rule[3]


@nb.njit(nogil=True, cache=True, error_model="numpy", inline="always")
def _is_open(group, given):  # type: ignore[no-untyped-def]
    """Whether glass lets all rays of a chance pass. group: of its tint, see `tint_groups`."""
    return given == PAST_GLASS or (group > 0 and given <= _NO_GROUP and np.float32(group) <= _NO_GROUP - given)


@nb.njit(nogil=True, cache=True, error_model="numpy", inline="always")
def _lets_a_share_pass(group, given):  # type: ignore[no-untyped-def]
    """Whether glass lets a share of the rays of a chance pass, and else none. group: of its tint."""
    return given == 0 or _LAST_CHANNEL <= given < PAST_GLASS or (given <= _NO_GROUP and group == 0)


@nb.cfunc("void(CPointer(int64))", cache=True, error_model="numpy")
def _filter(arguments):  # type: ignore[no-untyped-def]
    """RTCFilterFunctionN. arguments: valid, user pointer, context, ray, hit, and how many."""
    words = _array(arguments, (6,))
    width = np.int64(np.uint32(words[5] & 0xFFFFFFFF))
    valid = _array(_at(words[0]), (width,), np.int32)
    rays = _array(_at(words[3]), (9, width), np.float32)
    hits = _array(_at(words[4]), (6, width), np.float32)
    primitives = _array(_at(words[4]), (6, width), np.uint32)
    read = _array(_at(words[1]), (8,), np.int64)
    of_face = _array(_at(read[0]), (1 << 40,), np.int32)
    faces = _array(_at(read[1]), (1 << 40, 3), np.uint32)
    uvs = _array(_at(read[2]), (1 << 40, 2), np.float32)
    sheets = _array(_at(read[6]), (1 << 40,), np.int32)
    texels = _array(_at(read[3]), (1 << 40,), np.uint8)
    images = _array(_at(read[4]), (1 << 30, 5), np.int64)
    rules = _array(_at(read[5]), (1 << 30, 6), np.float32)
    groups = _array(_at(read[7]), (1 << 30,), np.int32)
    for lane in range(width):
        if valid[lane] == 0:
            continue
        face = np.int64(primitives[_PRIMITIVE, lane])
        row = of_face[face]
        b, c = hits[_U, lane], hits[_V, lane]
        a = np.float32(1) - b - c
        i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
        u = a * uvs[i, 0] + b * uvs[j, 0] + c * uvs[k, 0]
        v = a * uvs[i, 1] + b * uvs[j, 1] + c * uvs[k, 1]
        there, least = _opacity(images[row], texels, u, v), rules[row, 0]
        if least < 0:
            x, y, z = rays[_DIRECTION, lane], rays[_DIRECTION + 1, lane], rays[_DIRECTION + 2, lane]
            along = hits[0, lane] * x + hits[1, lane] * y + hits[2, lane] * z
            given = rays[_TIME, lane]
            least = _chance(given, face, sheets[face], x, y, z, along > 0)
            if rules[row, 0] == PASSES and _is_open(groups[row], given):
                there = np.float32(0)
            elif rules[row, 0] == PASSES and _lets_a_share_pass(groups[row], given):
                square = hits[0, lane] ** 2 + hits[1, lane] ** 2 + hits[2, lane] ** 2
                cosine = abs(along) / np.sqrt(square * (x * x + y * y + z * z))
                there *= np.float32(1) - _passed(rules[row], given) * (np.float32(1) - _schlick(cosine, rules[row, 4]))
        if there < least:
            valid[lane] = 0


FILTER = ctypes.c_void_p(_filter.address)
"""What Embree calls."""
