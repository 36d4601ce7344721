"""Packed geometry: buffer views of EXT_meshopt_compression, primitives of KHR_draco_mesh_compression.

Both say in JSON how much they hold. That is bounded, and compared with what the packed data itself claims, before
anything of the size is made.
"""

from __future__ import annotations

import struct
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, ValidationError

from relume.errors import SceneError
from relume.scene.checks import MAX_TRIANGLES
from relume.scene.gltf.document import BufferView, Bytes, Extensions, Index
from relume.scene.meshopt import FILTERS, MeshoptError, decode_sequence, decode_triangles, decode_vertices

DRACO = "KHR_draco_mesh_compression"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
UNPACK = "unpack it: npx @gltf-transform/cli copy in.glb out.glb"
MAX_UNPACKED_BYTES = 1 << 30  # of all buffer views of a file

# A block of 256 elements has at least a byte for every four of an element's.
MESHOPT_RATIO = 1024
DRACO_HEADER = struct.Struct("<5sBBBBH")
DRACO_MESH, DRACO_SEQUENTIAL, DRACO_EDGEBREAKER = 1, 0, 1
DRACO_METADATA = 0x8000
# A plane that is divided regularly takes a byte for some 500 triangles, the more the larger it is.
DRACO_RATIO = 4096
DRACO_FREE = 1 << 20  # points and triangles of small data

Array = NDArray[Any]


class MeshoptView(BaseModel):
    """What the extension says of a buffer view."""

    buffer: Index
    byteOffset: Bytes = 0  # noqa: N815
    byteLength: Annotated[Bytes, Field(ge=1)]  # noqa: N815
    byteStride: Annotated[int, Field(ge=2, le=256, strict=True)]  # noqa: N815
    count: Annotated[int, Field(ge=1, lt=2**32, strict=True)]
    mode: Literal["ATTRIBUTES", "TRIANGLES", "INDICES"]
    filter: str = "NONE"


class DracoPart(BaseModel):
    """What the extension says of a primitive: the packed bytes, and the number of each attribute in them."""

    bufferView: Index  # noqa: N815
    attributes: Annotated[dict[str, Index], Field(max_length=64)]


def meshopt_view(view: BufferView, what: str) -> MeshoptView | None:
    """How a buffer view is packed; None where it is not. Raises SceneError."""
    found = next((view.extensions[name] for name in MESHOPT if name in view.extensions), None)
    if found is None:
        return None
    try:
        packed = MeshoptView.model_validate(found)
    except ValidationError:
        raise SceneError(f"{what} are packed in an unknown way; {UNPACK}") from None
    if packed.filter not in FILTERS:
        raise SceneError(f"{what} are packed with the filter {packed.filter[:20]!r}, which is not read; {UNPACK}")
    num_bytes = packed.count * packed.byteStride
    if num_bytes != view.byteLength or num_bytes > MESHOPT_RATIO * packed.byteLength:
        raise SceneError(f"{what} claim more than their packed data can hold; export the scene again")
    return packed


def unpacked_view(packed: MeshoptView, data: bytes, what: str) -> memoryview:
    """The bytes of a buffer view that meshopt has packed.

    Args:
        packed: what the document says of it: kind, number and size of its elements.
        data: the packed bytes.
        what: names the view in errors.
    Raises:
        SceneError: the bytes are damaged.
    """
    try:
        return memoryview(_meshopt(packed, data).tobytes())
    except MeshoptError as problem:
        raise SceneError(f"{what} cannot be unpacked: {problem}; export the scene again") from None


def _meshopt(packed: MeshoptView, data: bytes) -> Array:
    count, stride = packed.count, packed.byteStride
    if packed.mode == "ATTRIBUTES":
        if stride % 4:
            raise MeshoptError("the stride of vertices is a multiple of four")
        return FILTERS[packed.filter](decode_vertices(data, count, stride))
    if stride not in (2, 4):
        raise MeshoptError("indices have two or four bytes")
    decode = decode_triangles if packed.mode == "TRIANGLES" else decode_sequence
    return decode(data, count).astype(f"<u{stride}")


def is_fallback(extensions: Extensions) -> bool:
    """Whether a buffer only stands for what its views hold unpacked, and has no data of its own."""
    return any(isinstance(extensions.get(name), dict) and extensions[name].get("fallback") is True for name in MESHOPT)


def draco_part(extensions: Extensions, what: str) -> DracoPart | None:
    """How a primitive is packed; None where it is not. Raises SceneError."""
    if DRACO not in extensions:
        return None
    try:
        return DracoPart.model_validate(extensions[DRACO])
    except ValidationError:
        raise SceneError(f"{what} is packed in an unknown way; {UNPACK}") from None


def unpacked_draco(data: bytes, num_corners: int, num_vertices: int, what: str) -> tuple[Array, dict[int, Array]]:
    """The corner indices and the attributes of a Draco mesh.

    Args:
        data: the packed bytes.
        num_corners, num_vertices: what the accessors claim.
        what: names the mesh in errors.
    Returns:
        The indices (num_corners,), and the attributes (num_vertices, width) by their numbers in the packed mesh.
    Raises:
        SceneError: the data is damaged, or holds other numbers of them.
    """
    _check_draco(data, num_corners, num_vertices, what)
    import DracoPy  # half a file's import time, and seldom needed

    try:
        mesh = DracoPy.decode(data)
        corners, attributes = np.asarray(mesh.faces).reshape(-1), mesh.attributes
    except Exception:  # it raises many kinds for damaged data
        raise SceneError(f"{what} cannot be unpacked, its Draco data is damaged; export the scene again") from None
    values = {int(attribute["unique_id"]): np.asarray(attribute["data"]) for attribute in attributes}
    if len(corners) != num_corners or any(len(each) != num_vertices for each in values.values()):
        raise SceneError(f"{what} has other numbers of vertices or indices than its Draco data; export the scene again")
    return corners, values


def _check_draco(data: bytes, num_corners: int, num_vertices: int, what: str) -> None:
    """Compare what the data claims with what was announced, before it is decoded."""
    damaged = SceneError(f"{what} cannot be unpacked, its Draco data is damaged; export the scene again")
    if len(data) < DRACO_HEADER.size + 2:
        raise damaged
    magic, major, minor, kind, method, flags = DRACO_HEADER.unpack_from(data)
    if magic != b"DRACO" or kind != DRACO_MESH or method not in (DRACO_SEQUENTIAL, DRACO_EDGEBREAKER):
        raise damaged
    if (major, minor) != (2, 2) or flags & DRACO_METADATA:
        raise SceneError(f"{what} is packed by a Draco that is not read; {UNPACK}")
    at = DRACO_HEADER.size + (method == DRACO_EDGEBREAKER)  # one byte says how it goes round
    try:
        first, at = _varint(data, at)
        second, at = _varint(data, at)
    except IndexError:
        raise damaged from None
    num_faces, num_points = (first, second) if method == DRACO_SEQUENTIAL else (second, first)
    fits = num_points == num_vertices if method == DRACO_SEQUENTIAL else num_points <= num_vertices
    if 3 * num_faces != num_corners or not fits or num_faces > MAX_TRIANGLES or num_vertices > 3 * MAX_TRIANGLES:
        raise SceneError(f"{what} has other numbers of vertices or indices than its Draco data; export the scene again")
    if max(num_faces, num_vertices) > max(DRACO_FREE, DRACO_RATIO * len(data)):
        raise SceneError(f"{what} claims more than its Draco data can hold; export the scene again")


def _varint(data: bytes, at: int) -> tuple[int, int]:
    number = 0
    for shift in range(0, 35, 7):
        number |= (data[at] & 0x7F) << shift
        at += 1
        if data[at - 1] < 0x80:
            break
    return number, at
