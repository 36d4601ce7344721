"""Images of materials: every format has the same texels."""

import io
import itertools
import struct
import zlib

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import PIL.Image
import pytest

from relume.core.errors import SceneError
from relume.image_io.decode import Decoder

RGB = np.array(
    [[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]], [[9, 19, 29], [50, 60, 70]]], np.uint8
)  # 3 rows of 2
ALPHA = np.array([[255, 128], [64, 255], [32, 200]], np.uint8)
OPAQUE = np.dstack([RGB, np.full((3, 2), 255, np.uint8)])
RGBA = np.dstack([RGB, ALPHA])
EXIF_ORIENTATION = 274


def save(pixels, kind, **options):
    image = pixels if isinstance(pixels, PIL.Image.Image) else PIL.Image.fromarray(pixels)
    buffer = io.BytesIO()
    image.save(buffer, kind, **options)
    return buffer.getvalue()


def decode(data):
    return Decoder().decode(data, "it")


@pytest.mark.parametrize("kind", ["PNG", "BMP", "DDS", "TGA", "TIFF", "WEBP"])
def test_colors_are_exact(kind):
    np.testing.assert_array_equal(decode(save(RGB, kind, **({"lossless": True} if kind == "WEBP" else {}))), OPAQUE)


@pytest.mark.parametrize("kind", ["PNG", "BMP", "DDS", "TGA", "TIFF"])
def test_alpha_is_not_multiplied_in(kind):
    np.testing.assert_array_equal(decode(save(RGBA, kind)), RGBA)


@pytest.mark.parametrize(
    ("kind", "options"),
    [("TIFF", {"compression": name}) for name in ("tiff_lzw", "tiff_adobe_deflate", "packbits")]
    + [("TGA", {"compression": "tga_rle"})],
)
def test_compressed_files_are_exact(kind, options):
    np.testing.assert_array_equal(decode(save(RGBA, kind, **options)), RGBA)


@pytest.mark.parametrize("kind", ["GIF", "PNG", "BMP", "TIFF"])
def test_palettes_are_exact(kind):
    palette = PIL.Image.fromarray(np.arange(6, dtype=np.uint8).reshape(3, 2), "P")
    palette.putpalette(RGB.ravel().tolist())
    colors = decode(save(palette, kind)).astype(int)
    np.testing.assert_allclose(
        colors, OPAQUE, atol=kind == "TIFF"
    )  # whose palettes have 16 bits, which Pillow truncates


@pytest.mark.parametrize("kind", ["GIF", "PNG"])
def test_palettes_may_have_transparency(kind):
    palette = PIL.Image.fromarray(np.arange(6, dtype=np.uint8).reshape(3, 2), "P")
    palette.putpalette(RGB.ravel().tolist())
    transparency = 3 if kind == "GIF" else bytes(ALPHA.ravel())
    alpha = decode(save(palette, kind, transparency=transparency))[..., 3]
    np.testing.assert_array_equal(alpha, np.where(np.arange(6).reshape(3, 2) == 3, 0, 255) if kind == "GIF" else ALPHA)


@pytest.mark.parametrize("kind", ["PNG", "TIFF", "JPEG", "BMP", "TGA"])
def test_gray_is_repeated(kind):
    gray = np.full((8, 8), 77, np.uint8)
    np.testing.assert_array_equal(decode(save(gray, kind)), np.dstack([gray, gray, gray, np.full_like(gray, 255)]))


def test_gray_may_have_alpha():
    data = save(PIL.Image.fromarray(np.dstack([RGB[..., 2], ALPHA]), "LA"), "PNG")
    np.testing.assert_array_equal(decode(data), np.dstack([np.repeat(RGB[..., 2:], 3, axis=2), ALPHA]))


@pytest.mark.parametrize("kind", ["PNG", "TIFF"])
def test_sixteen_bits_are_scaled(kind):
    values = np.array([[0, 65_535], [128 * 257, 77 * 257]], np.uint16)
    np.testing.assert_array_equal(decode(save(values, kind))[..., 0], [[0, 255], [128, 77]])
    heights = np.array([[0, 65_535], [1, 300]], np.uint16)
    np.testing.assert_allclose(Decoder().decode_gray(save(heights, kind), "it"), heights / 65_535, atol=1e-7)


def test_sixteen_bit_colors_of_a_png_are_scaled():
    """Written by hand: Pillow does not."""

    def chunk(kind, content):
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    rows = b"".join(b"\0" + (row.astype(">u2") * 257).tobytes() for row in RGB)
    header = struct.pack(">2I5B", 2, 3, 16, 2, 0, 0, 0)
    data = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    np.testing.assert_array_equal(decode(data), OPAQUE)


def test_luma_of_colors_is_the_same_in_all_formats():
    png, *others = (Decoder().decode_gray(save(RGB, kind), "it") for kind in ("PNG", "TIFF", "BMP", "TGA"))
    for gray in others:
        np.testing.assert_allclose(gray, png, atol=1 / 255)


@pytest.mark.parametrize("kind", ["JPEG", "TIFF"])
def test_cmyk_is_converted(kind):
    flat = np.broadcast_to(np.array([200, 100, 50], np.uint8), (16, 16, 3))
    options = {"quality": 100} if kind == "JPEG" else {}
    actual = decode(save(PIL.Image.fromarray(flat).convert("CMYK"), kind, **options))
    np.testing.assert_allclose(actual[..., :3].astype(int), flat, atol=3)


def test_progressive_and_interlaced_images_are_read():
    flat = np.broadcast_to(np.array([200, 100, 50], np.uint8), (16, 16, 3))
    np.testing.assert_allclose(decode(save(flat, "JPEG", progressive=True))[..., :3].astype(int), flat, atol=4)


def oriented(orientation):
    """The image as a camera stores it, by the definition of the tag: positions of the 0th row and the 0th column."""
    rows, columns = [
        ("top", "left"), ("top", "right"), ("bottom", "right"), ("bottom", "left"),
        ("left", "top"), ("right", "top"), ("right", "bottom"), ("left", "bottom"),
    ][orientation - 1]  # fmt: skip
    is_transposed = rows in ("left", "right")
    height, width = (2, 3) if is_transposed else (3, 2)
    stored = np.empty((height, width, 3), np.uint8)
    for r, c in itertools.product(range(height), range(width)):
        down, right = (c, r) if is_transposed else (r, c)
        from_bottom, from_right = "bottom" in (rows, columns), "right" in (rows, columns)
        stored[r, c] = RGB[2 - down if from_bottom else down, 1 - right if from_right else right]
    return stored


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("kind", ["TIFF", "PNG", "WEBP"])
def test_orientations_are_applied(kind, orientation):
    exif = PIL.Image.Exif()
    exif[EXIF_ORIENTATION] = orientation
    options = {"tiffinfo": {EXIF_ORIENTATION: orientation}} if kind == "TIFF" else {"exif": exif}
    options |= {"lossless": True} if kind == "WEBP" else {}
    np.testing.assert_array_equal(decode(save(oriented(orientation), kind, **options)), OPAQUE)


def test_a_ktx2_image_is_refused_with_a_way_to_convert_it():
    with pytest.raises(SceneError, match="is a KTX2 image; save it as PNG"):
        decode(b"\xabKTX 20\xbb\r\n\x1a\n")


def test_orientation_of_a_jpeg_is_applied():
    exif = PIL.Image.Exif()
    exif[EXIF_ORIENTATION] = 6
    upright = np.zeros((16, 8, 3), np.uint8)
    upright[:8] = [200, 40, 40]
    actual = decode(save(np.ascontiguousarray(np.rot90(upright)), "JPEG", exif=exif, quality=100, subsampling=0))
    np.testing.assert_allclose(actual[..., :3].astype(int), upright, atol=6)


@pytest.mark.parametrize(
    "exif", [b"Exif\0\0II*\0\xff\xff\xff\xff", b"Exif\0\0garbage", b"Exif\0\0MM\0*\0\0\0\x08\xff\xff"]
)
def test_damaged_metadata_does_not_cost_the_image(exif):
    np.testing.assert_allclose(decode(save(np.full((8, 8, 3), 90, np.uint8), "JPEG", exif=exif))[..., 0], 90, atol=2)


@pytest.mark.parametrize("descriptor", [0x00, 0x10, 0x20, 0x30])
def test_targa_images_begin_in_any_corner(descriptor):
    stored = RGB[:, ::-1] if descriptor & 0x10 else RGB
    stored = stored if descriptor & 0x20 else stored[::-1]
    header = struct.pack("<BBBHHBHHHHBB", 0, 0, 2, 0, 0, 0, 0, 0, 2, 3, 24, descriptor)
    np.testing.assert_array_equal(decode(header + stored[..., ::-1].tobytes()), OPAQUE)


def test_bitmaps_of_four_bytes_without_alpha_are_opaque():
    """The fourth byte of BI_RGB is reserved, and mostly zero."""
    texels = np.dstack([RGB[::-1, :, ::-1], np.zeros((3, 2), np.uint8)]).tobytes()
    header = (
        b"BM"
        + struct.pack("<IHHI", 54 + len(texels), 0, 0, 54)
        + struct.pack("<IiiHHIIiiII", 40, 2, 3, 1, 32, *6 * [0])
    )
    np.testing.assert_array_equal(decode(header + texels), OPAQUE)


def test_targas_of_four_bytes_without_alpha_are_opaque():
    texels = np.dstack([RGB[..., ::-1], np.zeros((3, 2), np.uint8)]).tobytes()
    header = struct.pack("<BBBHHBHHHHBB", 0, 0, 2, 0, 0, 0, 0, 0, 2, 3, 32, 0x20)
    np.testing.assert_array_equal(decode(header + texels), OPAQUE)


@pytest.mark.parametrize("pixel_format", ["DXT1", "DXT3", "DXT5"])
def test_compressed_dds_is_read(pixel_format):
    flat = np.broadcast_to(np.array([248, 96, 48, 255], np.uint8), (8, 8, 4))
    np.testing.assert_allclose(decode(save(flat, "DDS", pixel_format=pixel_format)).astype(int), flat, atol=8)


def test_extra_channels_are_ignored(tmp_path):
    """Photoshop's alpha channels follow the fourth."""
    path = tmp_path / "a.tif"
    output = oiio.ImageOutput.create(str(path))
    assert output.open(str(path), oiio.ImageSpec(2, 3, 6, oiio.UINT8))
    assert output.write_image(np.dstack([OPAQUE, ALPHA, ALPHA]))
    output.close()
    np.testing.assert_array_equal(decode(path.read_bytes()), OPAQUE)


@pytest.mark.parametrize("kind", ["PNG", "BMP", "DDS", "GIF", "TGA", "TIFF"])
def test_sizes_are_checked_before_decoding(kind, monkeypatch):
    data = save(np.zeros((1, 9_000, 3), np.uint8), kind)
    monkeypatch.setattr(oiio.ImageInput, "read_image", lambda *_: pytest.fail("it was decoded"))
    monkeypatch.setattr(PIL.Image.Image, "convert", lambda *_: pytest.fail("it was decoded"))
    with pytest.raises(SceneError, match="9000×1; at most 8192×8192"):
        decode(data)
