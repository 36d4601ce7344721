"""Compressed geometry that is damaged or has false sizes is rejected with a message before large allocations."""

from __future__ import annotations

import base64
import struct
import subprocess
import sys
import tracemalloc
from typing import Any

import DracoPy
import numpy as np
import pytest
from hostile_scenes import LIGHT, rejected
from packed_glb import SIDE, VECTORS, Glb, draco_bytes, draco_glb, meshopt_glb

from relume.core.errors import SceneError
from relume.scene_io.gltf import import_gltf
from relume.scene_io.import_scene import import_scene
from relume.scene_io.meshopt import MeshoptError, decode_sequence, decode_triangles, decode_vertices

HUGE = 2**31


@pytest.mark.parametrize("level", [0, 7])
@pytest.mark.parametrize("fraction", [0.0, 0.1, 0.3, 0.6, 0.9])
def test_truncated_draco_is_rejected(level: int, fraction: float) -> None:
    packed, _ = draco_bytes(level)
    assert "Draco" in rejected(draco_glb(packed[: int(fraction * len(packed))] or b"D").bytes())


@pytest.mark.parametrize("level", [0, 7])
def test_damaged_draco_is_rejected_or_imported(level: int) -> None:
    (packed, _), rng = draco_bytes(level), np.random.default_rng(36)
    for _ in range(60):
        damaged = bytearray(packed)
        for offset in rng.integers(11, len(packed), 3):
            damaged[offset] = rng.integers(256)
        try:
            import_gltf(draco_glb(bytes(damaged)).bytes(), "test")
        except SceneError:
            continue


def test_draco_with_other_counts_is_rejected_before_decoding(monkeypatch: pytest.MonkeyPatch) -> None:
    draco_bytes()  # decodes once
    monkeypatch.setattr("DracoPy.decode", lambda _: pytest.fail("it was decoded"))
    head = struct.pack("<5sBBBBH", b"DRACO", 2, 2, 1, 0, 0)
    many = b"\xff\xff\xff\xff\x07"
    for claims in (many + many, b"\x48" + many, b"\x48\x32", b"\xff" * 9):
        assert "different numbers" in rejected(draco_glb(head + claims + bytes(50)).bytes())
    for wrong in (b"BRACO" + head[5:], head[:7] + b"\0" + head[8:], head[:8] + b"\7" + head[9:]):
        assert "damaged" in rejected(draco_glb(wrong + bytes(50)).bytes())
    for unread in (head[:6] + b"\1" + head[7:], head[:9] + b"\0\x80"):
        assert "npx @gltf-transform/cli copy" in rejected(draco_glb(unread + bytes(50)).bytes())


def test_draco_with_impossible_counts_is_rejected_before_decoding(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    points, face = np.zeros((2_000_000, 3), np.float32), np.array([[0, 1, 2]], np.uint32)
    options = {"quantization_bits": 1, "compression_level": 0, "preserve_order": True}
    packed = DracoPy.encode(points, face, **options)
    assert len(packed) < 100
    glb = draco_glb(packed)
    for accessor, count in ((0, len(points)), (1, len(points)), (2, 3)):
        glb.document["accessors"][accessor]["count"] = count
    monkeypatch.setattr("DracoPy.decode", lambda _: pytest.fail("it was decoded"))
    assert "claims more than its Draco data can contain" in rejected(glb.bytes())


@pytest.mark.slow
def test_extra_draco_attributes_are_rejected_within_the_memory_limit() -> None:
    points, face = np.zeros((60_000, 3), np.float32), np.array([[0, 1, 2]], np.uint32)
    options = {"quantization_bits": 1, "compression_level": 0, "preserve_order": True}
    besides = {number: np.zeros((len(points), 127), np.uint8) for number in range(7, 57)}
    packed = DracoPy.encode(points, face, generic_attributes=besides, **options)
    limited = (
        "import resource, sys; from relume.scene_io.gltf.compression import decompress_draco; import DracoPy; "
        "resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30)); "
        "decompress_draco(sys.stdin.buffer.read(), 3, 60_000, 'the mesh')"
    )
    ended = subprocess.run([sys.executable, "-c", limited], input=packed, capture_output=True, check=False)
    assert ended.stderr.splitlines()[-1].startswith(b"relume.core.errors.SceneError: the mesh cannot be decompressed")


@pytest.mark.parametrize("accessor", [0, 1, 2])
@pytest.mark.parametrize("count", [3, SIDE * SIDE - 1, 300_000_000])
def test_accessors_without_draco_data_are_rejected(accessor: int, count: int) -> None:
    glb = draco_glb()
    glb.document["accessors"][accessor]["count"] = count
    rejected(glb.bytes())


def test_an_invalid_draco_extension_is_rejected() -> None:
    for extension in (None, 3, {}, {"bufferView": -1, "attributes": {}}, {"bufferView": 99, "attributes": {}}):
        glb = draco_glb()
        glb.document["meshes"][0]["primitives"][0]["extensions"] = {"KHR_draco_mesh_compression": extension}
        rejected(glb.bytes())


def packed_view(glb: Glb, view: int = 0) -> dict[str, Any]:
    extension: dict[str, Any] = glb.document["bufferViews"][view]["extensions"]["EXT_meshopt_compression"]
    return extension


@pytest.mark.parametrize(
    "changes",
    [
        {"count": HUGE},
        {"count": HUGE, "byteStride": 4},
        {"count": 0},
        {"byteStride": 6},
        {"byteStride": 1024},
        {"mode": "POINTS"},
        {"mode": "TRIANGLES"},
        {"filter": "QUATERNION"},
        {"byteOffset": 2**39},
        {"byteLength": 2**39},
        {"byteLength": 5},
        {"buffer": 9},
    ],
)
def test_false_meshopt_views_are_rejected_before_allocation(changes: dict[str, Any]) -> None:
    glb = meshopt_glb()
    packed_view(glb).update(changes)
    if "count" in changes:
        glb.document["bufferViews"][0]["byteLength"] = max(1, changes["count"] * packed_view(glb)["byteStride"])
        glb.document["accessors"][0]["count"] = max(1, changes["count"])
    data = glb.bytes()
    tracemalloc.start()
    rejected(data)
    assert tracemalloc.get_traced_memory()[1] < 50e6
    tracemalloc.stop()


@pytest.mark.parametrize("name", VECTORS)
def test_damaged_meshopt_data_is_rejected_or_decoded_within_bounds(name: str) -> None:
    vector, rng = VECTORS[name], np.random.default_rng(36)
    packed, count, stride = base64.b64decode(vector["packed"]), vector["count"], vector["stride"]

    def decode(data: bytes) -> Any:
        if vector["mode"] == "ATTRIBUTES":
            return decode_vertices(data, count, stride)
        return (decode_triangles if vector["mode"] == "TRIANGLES" else decode_sequence)(data, count)

    for length in {0, 1, 2, 20, len(packed) // 2, len(packed) - 1}:
        with pytest.raises(MeshoptError):
            decode(packed[:length])
    for _ in range(40):
        damaged = bytearray(packed)
        for offset in rng.integers(0, len(packed), 3):
            damaged[offset] = rng.integers(256)
        try:
            assert len(decode(bytes(damaged))) == count
        except MeshoptError:
            continue


def test_decoded_triangles_beyond_the_vertices_are_left_out() -> None:
    glb = meshopt_glb()
    glb.document["accessors"][0]["count"] = 20
    scene = import_scene(glb.bytes(), "test", LIGHT)
    assert [len(mesh.faces) for mesh in scene.meshes] == [22]
    assert "Removed 50 triangles from mesh “grid”: indices beyond its 20 vertices." in scene.warnings
