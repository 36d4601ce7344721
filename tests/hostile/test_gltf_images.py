"""Images of glTF files: outside the file, huge, or damaged."""

from __future__ import annotations

import io
import struct

import PIL.Image
import pytest
from glb_builder import Glb
from hostile_scenes import imported


def left_out(glb: Glb) -> str:
    """The warning about the only image of a file, whose mesh is shown without it."""
    scene = imported(glb.bytes())
    assert not scene.materials[0].textures
    (warning,) = scene.warnings
    assert "An image was left out" in warning
    return warning


@pytest.mark.parametrize("uri", ["wood.png", "../wood.png", "https://127.0.0.1/wood.png"])
def test_import_opens_no_external_image(uri: str) -> None:
    glb = Glb().quad({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})
    glb.document |= {"images": [{"uri": uri}], "textures": [{"source": 0}]}
    assert "outside the " in left_out(glb)


def test_import_leaves_out_jpegs_of_too_many_scans() -> None:
    glb = Glb().quad({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})
    view = glb.view(b"\xff\xd8" + b"\xff\xda" * 500)
    glb.document |= {"images": [{"bufferView": view}], "textures": [{"source": 0}]}
    assert "scans" in left_out(glb)


def test_import_leaves_out_huge_images_before_decoding() -> None:
    # 100,000 × 100,000 in the header of a PNG of a few bytes
    header = b"IHDR" + struct.pack(">IIBBBBB", 100_000, 100_000, 8, 2, 0, 0, 0)
    png = b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + header + struct.pack(">I", 0xDEADBEEF)
    for data in (png, _png_of_ones(9_000, 8)):
        glb = Glb().quad({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})
        glb.document |= {"images": [{"bufferView": glb.view(data)}], "textures": [{"source": 0}]}
        left_out(glb)


def _png_of_ones(width: int, height: int) -> bytes:
    encoded = io.BytesIO()
    PIL.Image.new("1", (width, height)).save(encoded, "PNG")
    return encoded.getvalue()


@pytest.mark.parametrize("damage", [b"", b"no image", b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff\xe0"])
def test_import_leaves_out_damaged_images(damage: bytes) -> None:
    glb = Glb().quad({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})
    glb.document |= {"images": [{"bufferView": glb.view(damage + b"\0" * 8)}], "textures": [{"source": 0}]}
    assert "damaged" in left_out(glb)
