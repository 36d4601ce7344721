"""Broken, absurd or malicious environment files give one clear SceneError, and nothing hangs."""

from __future__ import annotations

import contextlib
import struct
import tempfile
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest
from exr_builder import exr_attribute, required_attributes
from hypothesis import given, settings
from hypothesis import strategies as st

from relume.assets.environments.read_environment import read_environment
from relume.core.errors import SceneError
from relume.image_io.read_linear import read_pixels


def hdr(width: int, height: int, pixels: bytes = b"") -> bytes:
    return b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (height, width) + pixels


@pytest.mark.parametrize("size", [(0, 0), (100_000, 100_000), (200_000, 100_000), (999_999_999, 1), (32_768, 16_384)])
def test_environment_refuses_sizes_before_reading(size: tuple[int, int]) -> None:
    with pytest.raises(SceneError, match="the limit is"):
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


@settings(max_examples=300)
@given(st.lists(st.tuples(st.integers(8, 380), st.integers(0, 255)), min_size=1, max_size=6))
def test_environment_survives_any_changed_exr_header(changes: list[tuple[int, int]]) -> None:
    data = bytearray(EXR)
    for offset, value in changes:
        data[offset] = value
    with contextlib.suppress(SceneError):
        assert np.isfinite(read_environment(bytes(data), "sky").radiance).all()


@pytest.mark.parametrize(
    "window", [(0, 0, 99_999, 99_999), (0, 0, 199_999, 99_999), (0, 0, -1, -1), (0, 0, 2**31 - 1, 9)]
)
def test_environment_refuses_exr_sizes_before_reading(window: tuple[int, int, int, int]) -> None:
    offset = EXR.index(b"dataWindow\0box2i\0") + len(b"dataWindow\0box2i\0") + 4
    data = bytearray(EXR)
    data[offset : offset + 16] = struct.pack("<4i", *window)
    with pytest.raises(SceneError):
        read_environment(bytes(data), "sky")


def _exr_claiming(width: int, height: int, tile: tuple[int, int] | None) -> bytes:
    """An EXR file with a header only: half RGB, zip, no pixels."""
    attributes = required_attributes(width, height, dict.fromkeys("BGR", 1), b"\3")
    if tile is not None:
        attributes += exr_attribute("tiles", "tiledesc", struct.pack("<IIB", *tile, 0))
    version = struct.pack("<I", 2 | (0x200 if tile is not None else 0))
    return b"\x76\x2f\x31\x01" + version + attributes + bytes(101)


@pytest.mark.parametrize("tile", [None, (64, 64), (16_384, 8_192), (2**31 - 1, 2**31 - 1), (1, 1)])
def test_environment_allocates_nothing_for_missing_data(
    tile: tuple[int, int] | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    requested: list[str] = []
    for name in ("read_image", "read_scanlines", "read_tiles"):
        monkeypatch.setattr(oiio.ImageInput, name, lambda *_: requested.append("pixels"))
    with pytest.raises(SceneError):
        read_environment(_exr_claiming(16_384, 8_192, tile), "sky")
    assert requested == []


@pytest.mark.parametrize(("size", "tile"), [((1_024, 512), (16_384, 16_384)), ((1_024, 512), (1, 1))])
def test_environment_refuses_tiles_that_cannot_be_in_the_file(
    size: tuple[int, int], tile: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    requested: list[str] = []
    for name in ("read_image", "read_scanlines", "read_tiles"):
        monkeypatch.setattr(oiio.ImageInput, name, lambda *_: requested.append("pixels"))
    with pytest.raises(SceneError):
        read_environment(_exr_claiming(*size, tile), "sky")
    assert requested == []


def test_environment_refuses_a_large_hdr_of_a_few_bytes() -> None:
    with pytest.raises(SceneError, match="claims 1,611 MB"):
        read_environment(hdr(16_384, 8_192, bytes(200)), "sky")


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


def test_the_unchanged_exr_is_valid() -> None:
    np.testing.assert_array_equal(read_environment(EXR, "sky").radiance, np.full((8, 16, 3), 0.5, np.float32))


@pytest.mark.parametrize("kind", ["png", "tga", "bmp", "tif", "pnm", "sgi", "dpx"])
@pytest.mark.parametrize("suffix", [".exr", ".hdr"])
def test_other_formats_reach_no_other_reader(tmp_path: Path, kind: str, suffix: str) -> None:
    path = tmp_path / f"a.{kind}"
    output = oiio.ImageOutput.create(str(path))
    assert output.open(str(path), oiio.ImageSpec(8, 8, 3, oiio.UINT8))
    assert output.write_image(np.zeros((8, 8, 3), np.uint8))
    output.close()
    with pytest.raises(SceneError, match="not what its first bytes say"):
        read_pixels(path.read_bytes(), suffix, "it", lambda width, height: None)


def test_environment_refuses_missing_files(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="no environment file"):
        read_environment(tmp_path / "none.hdr", "sky")


@settings(max_examples=200)
@given(st.lists(st.tuples(st.integers(0, 60), st.integers(0, 255)), max_size=6), st.integers(0, 200))
def test_environment_survives_any_changed_bytes(changes: list[tuple[int, int]], length: int) -> None:
    data = bytearray(hdr(8, 4, bytes([128, 64, 32, 129]) * 32))
    for offset, value in changes:
        data[offset] = value
    with contextlib.suppress(SceneError):
        assert np.isfinite(read_environment(bytes(data[:length]), "sky").radiance).all()
