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

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, unsupported
from relume.scene_io.gltf.compression import is_fallback
from relume.scene_io.gltf.document import LIMITS, Document, Root
from relume.scene_io.gltf.tolerant import read_object
from relume.scene_io.referenced_files import Companions

MAX_JSON_VALUES = 4_000_000
_LISTS_OF_GLTF_2 = ("buffers", "meshes", "nodes")  # in version 1.0 they are objects
PACK = "pack everything into one file: npx @gltf-transform/cli copy in.gltf out.glb"


@dataclass(frozen=True)
class GltfContainer:
    """A document and the bytes that it refers to, which are read when they are used.

    Attributes:
        binary: the binary chunk of a .glb file. companions: files that it may refer to.
        warnings: gets a sentence for each fault.
        buffers: cache of buffers, by index. decompressed_views: cache of decompressed buffer views, by index.
    """

    document: Document
    binary: memoryview | None
    companions: Companions
    warnings: list[ImporterWarning]
    buffers: dict[int, memoryview] = field(default_factory=dict)
    decompressed_views: dict[int, memoryview] = field(default_factory=dict)

    def resolve(self, uri: str, label: str) -> bytes:
        """Return the content of a data URI or of a companion file. Raises SceneError."""
        return _resolve(uri, self.companions, label)

    def buffer(self, index: int, label: str) -> memoryview:
        """Return the bytes of a buffer, at most as long as declared.

        Args:
            index: index in the document. label: names the object that refers to it, in errors.
        Raises:
            SceneError: it does not exist, or its file is missing or unreadable.
        """
        if index not in self.buffers:
            self.buffers[index] = self._read_buffer(index, label)
        return self.buffers[index]

    def _read_buffer(self, index: int, label: str) -> memoryview:
        buffer = self.document.buffers.get(index, label)
        if is_fallback(buffer.extensions):
            return memoryview(b"")
        if buffer.uri is not None:
            content = memoryview(self.resolve(buffer.uri, f"buffer {index}"))
        elif index == 0 and self.binary is not None:
            content = self.binary
        else:
            raise SceneError(f"buffer {index} has no data; {PACK}")
        if len(content) < buffer.byteLength:
            message = f"Buffer {index} is truncated: {len(content):,} of {buffer.byteLength:,} bytes."
            self.warnings.append(unsupported(message))
        return content[: buffer.byteLength]


def read_container(data: bytes, companions: Companions, warnings: list[ImporterWarning]) -> GltfContainer:
    """Split a file into its document and its binary chunk, and validate the outermost object.

    Args:
        data: the file's bytes. companions: files that it may refer to.
        warnings: gets a sentence for each fault of the document that does not prevent its use.
    Raises:
        SceneError: truncated, not glTF 2, or has too many objects.
    """
    if data[:4] == b"glTF":
        json_bytes, binary = _split_glb(data)
    elif data[:64].lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{"):
        json_bytes, binary = data, None
    else:
        raise SceneError("the scene file is neither .glb nor .gltf; export it as binary glTF 2.0 (.glb)")
    return GltfContainer(parse_document(json_bytes, warnings), binary, companions, warnings)


def parse_document(json_bytes: bytes, warnings: list[ImporterWarning]) -> Document:
    """Parse the JSON chunk, where null means that a property is missing. Raises SceneError as `read_container`."""
    if sum(json_bytes.count(mark) for mark in b",[{") > MAX_JSON_VALUES:  # each value follows one of these
        raise SceneError(f"the scene's JSON has more than {MAX_JSON_VALUES:,} values; export it as .glb")
    text = json_bytes.rstrip(b" \t\r\n\0")  # some exporters pad the chunk with zeros
    try:
        content = json.loads(
            text.decode("utf-8-sig"), parse_constant=_refuse_constant, object_pairs_hook=_without_nulls
        )
    except (ValueError, RecursionError) as problem:
        raise SceneError(f"the scene's JSON cannot be read ({_first_line(problem)}); export it again") from None
    if isinstance(content, dict) and any(isinstance(content.get(name), dict) for name in _LISTS_OF_GLTF_2):
        raise SceneError("the scene is glTF 1.0, whose objects have names for numbers; export it as glTF 2.0 (.glb)")
    root = read_object(Root, content, "the scene's JSON", warnings)
    for name, limit in LIMITS.items():
        if len(getattr(root, name)) > limit:
            raise SceneError(f"the scene has more than {limit:,} {name}, the limit; merge some or split the scene")
    return Document(root, warnings)


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


def _without_nulls(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    return {key: value for key, value in pairs if value is not None}


def _refuse_constant(constant: str) -> Any:
    raise ValueError(f"{constant} is not a JSON number")


def _first_line(problem: BaseException) -> str:
    return (str(problem).partition("\n")[0] or type(problem).__name__)[:120]
