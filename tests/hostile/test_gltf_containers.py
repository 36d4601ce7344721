"""Broken, absurd or malicious glTF: the container, its JSON and its names."""

from __future__ import annotations

import pytest
from glb_builder import Glb
from hostile_scenes import changed, imported, rejected


@pytest.mark.parametrize("length", [0, 3, 4, 12, 19, 20, 100, 300])
def test_import_refuses_a_truncated_glb(length: int) -> None:
    rejected(Glb().quad().bytes()[:length])


@pytest.mark.parametrize(
    "data", [b"\x00" * 1000, b"glTF", b"glTF\x02\x00\x00\x00\xff\xff\xff\x7f", b"glTF\x02\x00\x00\x00\x0c\x00\x00\x00"]
)
def test_import_refuses_other_files(data: bytes) -> None:
    rejected(data)


def test_import_refuses_a_glb_cut_by_one_byte() -> None:
    assert "truncated" in rejected(Glb().quad().bytes()[:-1])


@pytest.mark.parametrize(
    "uri", ["mesh.bin", "../secret.bin", "http://127.0.0.1/x.bin", "/etc/passwd", "file:///etc/passwd"]
)
def test_import_opens_no_external_buffer(uri: str) -> None:
    assert "outside the " in rejected(changed(buffers=[{"uri": uri, "byteLength": 4}]))


def test_import_explains_how_to_pack() -> None:
    message = rejected(changed(buffers=[{"uri": "mesh.bin", "byteLength": 4}]))
    assert "@gltf-transform/cli copy" in message


def test_import_refuses_json_of_too_many_values() -> None:
    assert "values" in rejected(b'{"asset":{"version":"2.0"},"nodes":[' + b"[]," * 4_000_001 + b"0]}")


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
    rejected(text)


def test_import_explains_how_to_unpack() -> None:
    glb = Glb().quad({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})
    glb.document |= {"textures": [{"extensions": {"KHR_texture_basisu": {"source": 0}}}]}
    assert any("@gltf-transform/cli ktxdecompress" in warning for warning in imported(glb.bytes()).warnings)


def test_import_shows_names_without_control_characters() -> None:
    glb = Glb().quad({"extensions": {"EVIL\n\x1b[2J": {}}, "alphaMode": "A\nB"})
    glb.document |= {"extensionsRequired": ["NEW\nLINE"], "cameras": [{"type": "orthographic", "name": "a\nb"}]}
    glb.document["nodes"][0] |= {"camera": 0, "skin": 0, "name": "c\r\nd"}
    warnings = imported(glb.bytes()).warnings
    assert len(warnings) == 5
    assert all(warning.isprintable() for warning in warnings)
    glb.document["meshes"][0]["primitives"][0]["attributes"]["X\nY"] = "no index"
    assert all(warning.isprintable() for warning in imported(glb.bytes()).warnings)


def test_import_keeps_control_characters_out_of_names() -> None:
    glb = Glb().quad({"name": "a/b~c\x1b[31m\u202e" + "x" * 200})
    name = imported(glb.bytes()).materials[0].name
    assert name.startswith("a-b-c[31mx")
    assert len(name) <= 80
    assert name.isprintable()
