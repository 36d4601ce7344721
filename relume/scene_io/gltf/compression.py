"""Compressed geometry: buffer views of EXT_meshopt_compression, primitives of KHR_draco_mesh_compression.

The sizes in the JSON are limited, and compared with those in the compressed data, before memory is allocated.
"""

from __future__ import annotations

import struct
from typing import Annotated, Any, Literal

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from pydantic import BaseModel, Field, ValidationError

from relume.core.errors import SceneError
from relume.scene.validate import MAX_TRIANGLES
from relume.scene_io.gltf.document import BufferView, Bytes, Extensions, Index
from relume.scene_io.meshopt import FILTERS, MeshoptError, decode_sequence, decode_triangles, decode_vertices

DRACO = "KHR_draco_mesh_compression"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
UNPACK = "decompress it: npx @gltf-transform/cli copy in.glb out.glb"
MAX_UNPACKED_BYTES = 1 << 30  # of all buffer views of a file

# A block of 256 elements takes at least one byte for every four bytes of an element.
MESHOPT_RATIO = 1024
DRACO_HEADER = struct.Struct("<5sBBBBH")
DRACO_MESH, DRACO_SEQUENTIAL, DRACO_EDGEBREAKER = 1, 0, 1
DRACO_METADATA = 0x8000
# A regularly subdivided plane takes about a byte per 500 triangles, even less if it is larger.
DRACO_RATIO = 4096
DRACO_FREE = 1 << 20  # points and triangles that are allowed whatever the size of the data

Array = NDArray[Any]


class MeshoptBuffer(BaseModel):
    """The extension's object of a buffer view."""

    buffer: Index
    byteOffset: Bytes = 0  # noqa: N815
    byteLength: Annotated[Bytes, Field(ge=1)]  # noqa: N815
    byteStride: Annotated[int, Field(ge=2, le=256, strict=True)]  # noqa: N815
    count: Annotated[int, Field(ge=1, lt=2**32, strict=True)]
    mode: Literal["ATTRIBUTES", "TRIANGLES", "INDICES"]
    filter: str = "NONE"


class DracoPrimitive(BaseModel):
    """The extension's object of a primitive: buffer view, and the id of each attribute in it."""

    bufferView: Index  # noqa: N815
    attributes: Annotated[dict[str, Index], Field(max_length=64)]


def read_meshopt(view: BufferView, label: str) -> MeshoptBuffer | None:
    """Read the compression of a buffer view; None if uncompressed. Raises SceneError."""
    document = next((view.extensions[name] for name in MESHOPT if name in view.extensions), None)
    if document is None:
        return None
    try:
        compression = MeshoptBuffer.model_validate(document)
    except ValidationError:
        raise SceneError(f"{label} have an unknown compression; {UNPACK}") from None
    if compression.filter not in FILTERS:
        raise SceneError(f"{label} have the unsupported meshopt filter {compression.filter[:20]!r}; {UNPACK}")
    num_bytes = compression.count * compression.byteStride
    if num_bytes != view.byteLength or num_bytes > MESHOPT_RATIO * compression.byteLength:
        raise SceneError(f"{label} claim more than their compressed data can contain; export the scene again")
    return compression


def decompress_view(compression: MeshoptBuffer, data: bytes, label: str) -> memoryview:
    """Decompress a buffer view.

    Args:
        compression: mode, number and size of its elements, from the document.
        data: the compressed bytes.
        label: names the view in errors.
    Raises:
        SceneError: the data is damaged.
    """
    try:
        return memoryview(_decode_meshopt(compression, data).tobytes())
    except MeshoptError as problem:
        raise SceneError(f"{label} cannot be decompressed: {problem}; export the scene again") from None


def _decode_meshopt(compression: MeshoptBuffer, data: bytes) -> Array:
    count, stride = compression.count, compression.byteStride
    if compression.mode == "ATTRIBUTES":
        if stride % 4:
            raise MeshoptError("the stride of vertices is not a multiple of four")
        return FILTERS[compression.filter](decode_vertices(data, count, stride))
    if stride not in (2, 4):
        raise MeshoptError("indices do not have two or four bytes")
    decode = decode_triangles if compression.mode == "TRIANGLES" else decode_sequence
    return decode(data, count).astype(f"<u{stride}")


def is_fallback(extensions: Extensions) -> bool:
    """True for a placeholder buffer without data, only used by compressed views."""
    return any(isinstance(extensions.get(name), dict) and extensions[name].get("fallback") is True for name in MESHOPT)


def read_draco(extensions: Extensions, label: str) -> DracoPrimitive | None:
    """Read the compression of a primitive; None if uncompressed. Raises SceneError."""
    if DRACO not in extensions:
        return None
    try:
        return DracoPrimitive.model_validate(extensions[DRACO])
    except ValidationError:
        raise SceneError(f"{label} has an unknown compression; {UNPACK}") from None


def decompress_draco(
    data: bytes, num_corners: int, num_vertices: int, label: str
) -> tuple[Shaped[Array, " corners"], dict[int, Array]]:
    """Decompress the indices and attributes of a Draco mesh.

    Args:
        data: the compressed bytes.
        num_corners, num_vertices: counts of the accessors.
        label: names the mesh in errors.
    Returns:
        The indices, and the attributes (num_vertices, width) by their ids.
    Raises:
        SceneError: the data is damaged, or does not match the counts.
    """
    _check_draco(data, num_corners, num_vertices, label)
    import DracoPy  # as slow to import as half a file, and rarely needed

    try:
        mesh = DracoPy.decode(data)
        corners, attributes = np.asarray(mesh.faces).reshape(-1), mesh.attributes
    except Exception:  # damaged data raises many kinds
        raise SceneError(f"{label} cannot be decompressed, its Draco data is damaged; export the scene again") from None
    values = {int(attribute["unique_id"]): np.asarray(attribute["data"]) for attribute in attributes}
    if len(corners) != num_corners or any(len(array) != num_vertices for array in values.values()):
        raise SceneError(
            f"{label} has different numbers of vertices or indices than its Draco data; export the scene again"
        )
    return corners, values


def _check_draco(data: bytes, num_corners: int, num_vertices: int, label: str) -> None:
    """Compare the sizes in the data with those of the accessors before it is decoded."""
    damage_error = SceneError(f"{label} cannot be decompressed, its Draco data is damaged; export the scene again")
    if len(data) < DRACO_HEADER.size + 2:
        raise damage_error
    magic, major, minor, kind, method, flags = DRACO_HEADER.unpack_from(data)
    if magic != b"DRACO" or kind != DRACO_MESH or method not in (DRACO_SEQUENTIAL, DRACO_EDGEBREAKER):
        raise damage_error
    if (major, minor) != (2, 2) or flags & DRACO_METADATA:
        raise SceneError(f"{label} has an unsupported version of Draco; {UNPACK}")
    offset = DRACO_HEADER.size + (method == DRACO_EDGEBREAKER)  # one byte for the traversal method
    try:
        first, offset = _varint(data, offset)
        second, offset = _varint(data, offset)
    except IndexError:
        raise damage_error from None
    num_faces, num_points = (first, second) if method == DRACO_SEQUENTIAL else (second, first)
    fits = num_points == num_vertices if method == DRACO_SEQUENTIAL else num_points <= num_vertices
    if 3 * num_faces != num_corners or not fits or num_faces > MAX_TRIANGLES or num_vertices > 3 * MAX_TRIANGLES:
        raise SceneError(
            f"{label} has different numbers of vertices or indices than its Draco data; export the scene again"
        )
    if max(num_faces, num_vertices) > max(DRACO_FREE, DRACO_RATIO * len(data)):
        raise SceneError(f"{label} claims more than its Draco data can contain; export the scene again")


def _varint(data: bytes, offset: int) -> tuple[int, int]:
    number = 0
    for shift in range(0, 35, 7):
        number |= (data[offset] & 0x7F) << shift
        offset += 1
        if data[offset - 1] < 0x80:
            break
    return number, offset
