"""Container of a glTF file: a validated document and its buffers, from .glb, or .gltf with data URIs or files.

glTF 2.0 specification, section 4. Only files in the scene's companions are opened.
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import unquote_to_bytes

from pydantic import ValidationError

from relume.core.errors import SceneError
from relume.core.import_warnings import UNREADABLE
from relume.scene_io.gltf.compression import DRACO, MESHOPT, is_fallback
from relume.scene_io.gltf.document import Buffer, Document
from relume.scene_io.gltf.material_extensions import MATERIAL_EXTENSIONS
from relume.scene_io.referenced_files import Companions

MAX_JSON_VALUES = 4_000_000
PACK = "pack everything into one file: npx @gltf-transform/cli copy in.gltf out.glb"

# Unsupported required extensions that compress accessors or images, with the command that decompresses them.
UNSUPPORTED_COMPRESSION = {
    "KHR_texture_basisu": "npx @gltf-transform/cli ktxdecompress in.glb out.glb",
}
SUPPORTED_EXTENSIONS = {
    DRACO,
    *MESHOPT,
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "EXT_mesh_gpu_instancing",
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_materials_variants",
    *MATERIAL_EXTENSIONS,
}


@dataclass(frozen=True)
class GltfContainer:
    """A document and the bytes of its buffers, each at least as long as declared.

    Attributes:
        decompressed_views: cache of decompressed buffer views, by index.
    """

    document: Document
    buffers: tuple[memoryview, ...]
    companions: Companions
    decompressed_views: dict[int, memoryview] = field(default_factory=dict)

    def resolve(self, uri: str, label: str) -> bytes:
        """Return the content of a data URI or of a companion file. Raises SceneError."""
        return _resolve(uri, self.companions, label)


def read_container(data: bytes, companions: Companions) -> GltfContainer:
    """Split a file into its document and its buffers, and validate both.

    Raises:
        SceneError: truncated, not glTF 2, refers to missing files, or requires an unsupported compression.
    """
    if data[:4] == b"glTF":
        json_bytes, binary = _split_glb(data)
    elif data[:64].lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{"):
        json_bytes, binary = data, None
    else:
        raise SceneError("the scene file is neither .glb nor .gltf; export it as binary glTF 2.0 (.glb)")
    document = parse_document(json_bytes)
    _check_extensions(document)
    buffers = [_buffer(i, buffer, binary, companions) for i, buffer in enumerate(document.buffers)]
    return GltfContainer(document, tuple(buffers), companions)


def parse_document(json_bytes: bytes) -> Document:
    """Parse and validate the JSON chunk. The SceneError names the first invalid value."""
    if sum(json_bytes.count(mark) for mark in b",[{") > MAX_JSON_VALUES:  # each value follows one of these
        raise SceneError(f"the scene's JSON has more than {MAX_JSON_VALUES:,} values; export it as .glb")
    try:
        content = json.loads(json_bytes.decode("utf-8-sig"), parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as problem:
        raise SceneError(f"the scene's JSON cannot be read ({_first_line(problem)}); export it again") from None
    try:
        return Document.model_validate(content)
    except ValidationError as problem:
        first_error = problem.errors(include_url=False, include_input=False)[0]
        location = UNREADABLE.sub("", "/".join(str(step)[:40] for step in first_error["loc"])) or "the document"
        if first_error["type"] == "too_long":
            max_length = first_error["ctx"]["max_length"]
            raise SceneError(
                f"the scene has more than {max_length:,} {location}, the limit; merge some or split the scene"
            ) from None
        raise SceneError(
            f"the scene's JSON is not valid glTF 2.0 at {location}: {first_error['msg']}; export it again"
        ) from None
    except RecursionError:
        raise SceneError("the scene's JSON is nested too deeply; export it again") from None


def _resolve(uri: str, companions: Companions, label: str) -> bytes:
    if uri[:5].lower() == "data:":
        return _data_uri(uri, label)
    content = companions.read(uri, label)
    if content is None:
        printable = uri[:60].encode("ascii", "replace").decode()
        raise SceneError(f"{label} is outside the file, in {printable!r}, which is missing; add it or {PACK}")
    return content


def _data_uri(uri: str, label: str) -> bytes:
    head, comma, body = uri.partition(",")
    try:
        if head.lower().endswith(";base64"):
            return base64.b64decode(unquote_to_bytes(body) if "%" in body else body, validate=True)
        if comma:
            return unquote_to_bytes(body)
    except (binascii.Error, ValueError):
        pass
    raise SceneError(f"{label} is a damaged data URI; {PACK}")


def _split_glb(data: bytes) -> tuple[bytes, memoryview | None]:
    if len(data) < 20:
        raise SceneError("the .glb file is truncated in its header; export or download it again")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise SceneError(f"the .glb file has version {version}; export it as glTF 2.0")
    if length > len(data):
        raise SceneError(f"the .glb file is truncated: {len(data):,} of {length:,} bytes; download it again")
    chunks: list[tuple[bytes, memoryview]] = []
    offset = 12
    while offset + 8 <= length and len(chunks) < 64:
        size, kind = struct.unpack_from("<I4s", data, offset)
        if offset + 8 + size > length:
            raise SceneError("a chunk of the .glb file is longer than the file; export it again")
        chunks.append((kind, memoryview(data)[offset + 8 : offset + 8 + size]))
        offset += 8 + size
    if not chunks or chunks[0][0] != b"JSON":
        raise SceneError("the .glb file does not begin with JSON; export it again")
    binary = chunks[1][1] if len(chunks) > 1 and chunks[1][0] == b"BIN\0" else None
    return bytes(chunks[0][1]), binary


def _buffer(i: int, buffer: Buffer, binary: memoryview | None, companions: Companions) -> memoryview:
    if is_fallback(buffer.extensions):
        return memoryview(b"")
    if buffer.uri is not None:
        content = memoryview(_resolve(buffer.uri, companions, f"buffer {i}"))
    elif i == 0 and binary is not None:
        content = binary
    else:
        raise SceneError(f"buffer {i} has no data; {PACK}")
    if len(content) < buffer.byteLength:
        raise SceneError(f"buffer {i} is truncated: {len(content):,} of {buffer.byteLength:,} bytes; export it again")
    return content[: buffer.byteLength]


def _check_extensions(document: Document) -> None:
    for name in document.extensionsRequired:
        if name in UNSUPPORTED_COMPRESSION:
            command = UNSUPPORTED_COMPRESSION[name]
            raise SceneError(f"the file uses KTX2 textures ({name}), which can't be read; run: {command}")


def _refuse_constant(constant: str) -> Any:
    raise ValueError(f"{constant} is not a JSON number")


def _first_line(problem: BaseException) -> str:
    return (str(problem).partition("\n")[0] or type(problem).__name__)[:120]
