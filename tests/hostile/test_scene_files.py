"""Scene and environment files that are broken, absurd or malicious: one clear SceneError, nothing else, no hang."""

from __future__ import annotations

import contextlib
import io
import json
import struct
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import PIL.Image
import pytest
from glb_builder import QUAD, Glb, pack, self_contained
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from relume.errors import SceneError
from relume.light.environment import read_environment
from relume.scene.gltf import import_gltf, importer
from relume.scene.model import Environment, Scene

LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))


def imported(data: bytes) -> Scene:
    return import_gltf(data, "test", LIGHT)


def refused(data: bytes) -> str:
    with pytest.raises(SceneError) as problem:
        imported(data)
    message = str(problem.value)
    assert "\n" not in message
    assert len(message) < 400
    return message


def changed(**changes: Any) -> bytes:
    """A good file with one top-level member of its document replaced."""
    glb = Glb().quad()
    glb.document.update(changes)
    return glb.bytes()


def with_accessor(**changes: Any) -> bytes:
    """A good file with its position accessor changed."""
    glb = Glb().quad()
    glb.document["accessors"][0].update(changes)
    return glb.bytes()


@pytest.mark.parametrize("length", [0, 3, 4, 12, 19, 20, 100, 300])
def test_import_refuses_a_truncated_glb(length: int) -> None:
    refused(Glb().quad().bytes()[:length])


def test_import_refuses_a_glb_cut_by_one_byte() -> None:
    assert "truncated" in refused(Glb().quad().bytes()[:-1])


@pytest.mark.parametrize(
    "uri", ["mesh.bin", "../secret.bin", "http://127.0.0.1/x.bin", "/etc/passwd", "file:///etc/passwd"]
)
def test_import_opens_no_external_buffer(uri: str) -> None:
    message = refused(changed(buffers=[{"uri": uri, "byteLength": 4}]))
    assert "gltf-transform copy" in message


@pytest.mark.parametrize("uri", ["wood.png", "../wood.png", "https://127.0.0.1/wood.png"])
def test_import_opens_no_external_image(uri: str) -> None:
    glb = Glb().quad({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})
    glb.document |= {"images": [{"uri": uri}], "textures": [{"source": 0}]}
    assert "outside the file" in refused(glb.bytes())


@pytest.mark.parametrize(
    "changes",
    [
        {"count": 2**31},
        {"count": 10**30},
        {"count": -1},
        {"count": 0},
        {"count": 5},
        {"byteOffset": 2**39},
        {"byteOffset": 10**40},
        {"byteOffset": -4},
        {"bufferView": 99},
        {"type": "MAT4"},
        {"type": "VEC9"},
        {"componentType": 5124},
        {"bufferView": None, "count": 4_000_000_000},
        {"sparse": {"count": 10**9, "indices": {"bufferView": 1, "componentType": 5125}, "values": {"bufferView": 0}}},
    ],
)
def test_import_refuses_absurd_accessors(changes: dict[str, Any]) -> None:
    refused(with_accessor(**changes))


def test_import_refuses_zeros_without_data_that_claim_gigabytes() -> None:
    sparse = {"count": 1, "indices": {"bufferView": 2, "componentType": 5123}, "values": {"bufferView": 0}}
    glb = Glb().quad()
    glb.document["accessors"][0] = {"componentType": 5126, "count": 70_000_000, "type": "VEC3", "sparse": sparse}
    refused(glb.bytes())


def test_import_refuses_views_that_reach_beyond_their_buffer() -> None:
    glb = Glb().quad()
    glb.document["bufferViews"][0]["byteLength"] = 10**9
    assert "beyond its buffer" in refused(glb.bytes())


@pytest.mark.parametrize("stride", [0, 4, 8, 253, 10**9])
def test_import_refuses_strides_that_do_not_fit(stride: int) -> None:
    glb = Glb().quad()
    glb.document["bufferViews"][0]["byteStride"] = stride
    refused(glb.bytes())


def test_import_refuses_indices_out_of_range() -> None:
    glb = Glb().quad()
    glb.document["meshes"][0]["primitives"][0]["indices"] = glb.accessor(np.array([0, 1, 40_000], np.uint16))
    assert "beyond its 4 vertices" in refused(glb.bytes())


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e30])
def test_import_refuses_positions_that_are_not_finite(value: float) -> None:
    positions = QUAD.copy()
    positions[2, 1] = value
    assert "not finite" in refused(Glb().quad(POSITION=positions).bytes())


def test_import_refuses_a_mesh_without_triangles() -> None:
    glb = Glb().quad()
    glb.document["meshes"][0]["primitives"][0]["mode"] = 1
    assert "no triangles" in refused(glb.bytes())


def test_import_refuses_a_file_without_meshes() -> None:
    assert "no triangles" in refused(pack({"asset": {"version": "2.0"}}, b""))


def test_import_drops_degenerate_triangles_with_a_warning() -> None:
    glb = Glb().quad()
    corners = np.array([0, 1, 2, 1, 1, 2, 3, 3, 3], np.uint16)
    glb.document["meshes"][0]["primitives"][0]["indices"] = glb.accessor(corners)
    scene = imported(glb.bytes())
    assert len(scene.meshes[0].faces) == 1
    assert any("2 triangles" in warning for warning in scene.warnings)


def test_import_refuses_a_mesh_of_degenerate_triangles_only() -> None:
    assert "no triangles" in refused(Glb().quad(POSITION=np.zeros((4, 3), np.float32)).bytes())


@pytest.mark.parametrize(
    "nodes",
    [
        [{"children": [0], "mesh": 0}],
        [{"children": [1]}, {"children": [0], "mesh": 0}],
        [{"children": [1, 1]}, {"mesh": 0}],
        [{"children": [7], "mesh": 0}],
        [{"mesh": 0, "matrix": [1e30] * 16}],
        [{"mesh": 3}],
        [{"camera": 3}],
        [{"children": [i + 1]} for i in range(99)] + [{"mesh": 0}],
        [{"mesh": 0}] * 4_097,
    ],
)
def test_import_refuses_nodes_that_are_no_tree(nodes: list[dict[str, Any]]) -> None:
    refused(changed(nodes=nodes))


def test_import_refuses_instances_without_end() -> None:
    glb = Glb().quad()
    glb.document["meshes"][0]["primitives"] *= 1_000
    glb.document["nodes"] = [{"mesh": 0}] * 30
    glb.document["scenes"] = [{"nodes": list(range(30))}]
    assert "20,000 meshes" in refused(glb.bytes())


def test_import_refuses_degenerate_triangles_without_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importer, "MAX_CORNERS", 600)
    glb = Glb().quad()
    primitive = glb.document["meshes"][0]["primitives"][0]
    primitive["indices"] = glb.accessor(np.zeros(300, np.uint16))
    glb.document["meshes"][0]["primitives"] = [primitive] * 3
    assert "triangles" in refused(glb.bytes())


def test_import_refuses_json_of_too_many_values() -> None:
    assert "values" in refused(b'{"asset":{"version":"2.0"},"nodes":[' + b"[]," * 4_000_001 + b"0]}")


def test_import_refuses_jpegs_of_too_many_scans() -> None:
    glb = Glb().quad({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})
    view = glb.view(b"\xff\xd8" + b"\xff\xda" * 500)
    glb.document |= {"images": [{"bufferView": view}], "textures": [{"source": 0}]}
    assert "scans" in refused(glb.bytes())


def test_import_shows_names_without_control_characters() -> None:
    glb = Glb().quad({"extensions": {"EVIL\n\x1b[2J": {}}, "alphaMode": "A\nB"})
    glb.document |= {"extensionsRequired": ["NEW\nLINE"], "cameras": [{"type": "orthographic", "name": "a\nb"}]}
    glb.document["nodes"][0] |= {"camera": 0, "skin": 0, "name": "c\r\nd"}
    warnings = imported(glb.bytes()).warnings
    assert len(warnings) == 5
    assert all(warning.isprintable() for warning in warnings)
    glb.document["meshes"][0]["primitives"][0]["attributes"]["X\nY"] = -1
    refused(glb.bytes())


@pytest.mark.parametrize(
    ("extension", "command"),
    [
        ("KHR_draco_mesh_compression", "gltf-transform copy"),
        ("EXT_meshopt_compression", "gltf-transform copy"),
        ("KHR_texture_basisu", "gltf-transform ktxdecompress"),
    ],
)
def test_import_says_how_to_unpack(extension: str, command: str) -> None:
    assert command in refused(changed(extensionsRequired=[extension]))


def test_import_refuses_huge_images_before_decoding() -> None:
    # 100,000 × 100,000 in the header of a PNG of a few bytes
    header = b"IHDR" + struct.pack(">IIBBBBB", 100_000, 100_000, 8, 2, 0, 0, 0)
    png = b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + header + struct.pack(">I", 0xDEADBEEF)
    for data in (png, _png_of_ones(9_000, 8)):
        glb = Glb().quad({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})
        glb.document |= {"images": [{"bufferView": glb.view(data)}], "textures": [{"source": 0}]}
        refused(glb.bytes())


def _png_of_ones(width: int, height: int) -> bytes:
    encoded = io.BytesIO()
    PIL.Image.new("1", (width, height)).save(encoded, "PNG")
    return encoded.getvalue()


@pytest.mark.parametrize("damage", [b"", b"no image", b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff\xe0"])
def test_import_refuses_damaged_images(damage: bytes) -> None:
    glb = Glb().quad({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})
    glb.document |= {"images": [{"bufferView": glb.view(damage + b"\0" * 8)}], "textures": [{"source": 0}]}
    assert "damaged" in refused(glb.bytes())


@pytest.mark.parametrize(
    "text",
    [
        b"",
        b"{}",
        b"[]",
        b"{" * 100_000,
        b'{"asset":' * 50_000,
        b'{"asset":{"version":"2.0"},"scene":NaN}',
        b'{"asset":{"version":"1.0"}}',
        b'{"asset":{"version":"2.0"},"nodes":{"a":1}}',
        b"\xff\xfe{}",
    ],
)
def test_import_refuses_json_that_is_no_gltf(text: bytes) -> None:
    refused(text)


def test_import_keeps_control_characters_out_of_names() -> None:
    glb = Glb().quad({"name": "a/b~c\x1b[31m\u202e" + "x" * 200})
    name = imported(glb.bytes()).materials[0].name
    assert name.startswith("a-b-c[31mx")
    assert len(name) <= 80
    assert name.isprintable()


@settings(max_examples=300, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 255)), min_size=1, max_size=12))
def test_import_survives_any_changed_bytes(changes: list[tuple[float, int]]) -> None:
    data = bytearray(FUZZED)
    for place, value in changes:
        data[int(place * len(data))] = value
    try:
        scene = imported(bytes(data))
    except SceneError:
        return
    assert isinstance(scene, Scene)


def _rich_file() -> bytes:
    glb = Glb()
    texture = glb.texture(np.arange(48).reshape(4, 4, 3))
    glb.quad({"pbrMetallicRoughness": {"baseColorTexture": {"index": texture}}, "normalTexture": {"index": texture}})
    glb.document["cameras"] = [{"type": "perspective", "perspective": {"yfov": 0.5}}]
    glb.document["nodes"].append({"camera": 0, "translation": [0, 0, 5]})
    glb.document["scenes"][0]["nodes"].append(1)
    return glb.bytes()


FUZZED = _rich_file()


def test_fuzzed_file_is_good_to_begin_with() -> None:
    scene = imported(FUZZED)
    assert [camera.name for camera in scene.cameras] == ["camera"]
    assert scene.warnings == ()


def hdr(width: int, height: int, pixels: bytes = b"") -> bytes:
    return b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (height, width) + pixels


@pytest.mark.parametrize("size", [(0, 0), (100_000, 100_000), (200_000, 100_000), (999_999_999, 1), (32_768, 16_384)])
def test_environment_refuses_sizes_before_reading(size: tuple[int, int]) -> None:
    with pytest.raises(SceneError, match="at most"):
        read_environment(hdr(*size), "sky")


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"#?",
        b"#?RADIANCE",
        b"#?RADIANCE\n\n",
        b"#?RADIANCE\n\n-Y a +X b\n",
        b"#?RADIANCE\n\n+X 4 -Y 2\n",
        b"#?RADIANCE\n" + b"x" * 100_000,
        b"\x76\x2f\x31\x01",
        b"\x76\x2f\x31\x01" + b"\xff" * 200,
        b"\x76\x2f\x31\x01\x02\0\0\0" + b"channels\0chlist\0\xff\xff\xff\x7f",
        b"\x89PNG\r\n\x1a\n",
        hdr(64, 32),
        hdr(64, 32, b"\2\2\0\x40" + b"\xff" * 40),
        hdr(3, 2, b"\1" * 24),
    ],
)
def test_environment_refuses_damaged_files(data: bytes) -> None:
    with pytest.raises(SceneError) as problem:
        read_environment(data, "sky")
    assert "\n" not in str(problem.value)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.lists(st.tuples(st.integers(8, 380), st.integers(0, 255)), min_size=1, max_size=6))
def test_environment_survives_any_changed_exr_header(changes: list[tuple[int, int]]) -> None:
    data = bytearray(EXR)
    for place, value in changes:
        data[place] = value
    with contextlib.suppress(SceneError):
        assert np.isfinite(read_environment(bytes(data), "sky").radiance).all()


@pytest.mark.parametrize(
    "window", [(0, 0, 99_999, 99_999), (0, 0, 199_999, 99_999), (0, 0, -1, -1), (0, 0, 2**31 - 1, 9)]
)
def test_environment_refuses_exr_sizes_before_reading(window: tuple[int, int, int, int]) -> None:
    place = EXR.index(b"dataWindow\0box2i\0") + len(b"dataWindow\0box2i\0") + 4
    data = bytearray(EXR)
    data[place : place + 16] = struct.pack("<4i", *window)
    with pytest.raises(SceneError):
        read_environment(bytes(data), "sky")


def _exr_file() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "sky.exr")
        output = oiio.ImageOutput.create(path)
        assert output is not None
        assert output.open(path, oiio.ImageSpec(16, 8, 3, oiio.HALF))
        assert output.write_image(np.full((8, 16, 3), 0.5, np.float32))
        output.close()
        return Path(path).read_bytes()


EXR = _exr_file()


def test_changed_exr_is_good_to_begin_with() -> None:
    np.testing.assert_array_equal(read_environment(EXR, "sky").radiance, np.full((8, 16, 3), 0.5, np.float32))


def test_environment_refuses_missing_files(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="no environment file"):
        read_environment(tmp_path / "none.hdr", "sky")


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.lists(st.tuples(st.integers(0, 60), st.integers(0, 255)), max_size=6), st.integers(0, 200))
def test_environment_survives_any_changed_bytes(changes: list[tuple[int, int]], length: int) -> None:
    data = bytearray(hdr(8, 4, bytes([128, 64, 32, 129]) * 32))
    for place, value in changes:
        data[place] = value
    with contextlib.suppress(SceneError):
        assert np.isfinite(read_environment(bytes(data[:length]), "sky").radiance).all()


@pytest.mark.parametrize("folder", ["conformance", "bad-inputs"])
def test_every_file_is_imported_or_refused(shared_data: Path, folder: str) -> None:
    files = [p for p in sorted((shared_data / folder).rglob("*")) if p.suffix in (".glb", ".gltf")]
    assert len(files) > 100
    num_imported, messages = 0, []
    for path in files:
        for data in {path.read_bytes(), self_contained(path) if path.suffix == ".gltf" else b""} - {b""}:
            try:
                imported(data)
                num_imported += 1
            except SceneError as problem:
                messages.append(str(problem))
    assert num_imported > 0
    assert messages
    assert not [message for message in messages if "\n" in message or len(message) > 400]


def test_refused_messages_show_no_path(tmp_path: Path) -> None:
    broken = tmp_path / "broken.glb"
    broken.write_bytes(json.dumps({"asset": 1}).encode())
    with pytest.raises(SceneError) as problem:
        import_gltf(broken, "test", LIGHT)
    assert str(tmp_path) not in str(problem.value)
