"""Zips of measured images: valid ones are read exactly, invalid ones are rejected."""

import io
import struct
import tempfile
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest
from btf_zips import DIRECTIONS, make_image, make_image_name, zipped
from PIL import Image

from relume.assets.btf.bonn_zip import ZippedBtf
from relume.assets.btf.direction_rings import make_direction_grid
from relume.assets.btf.import_btf import import_btf
from relume.core.errors import MaterialError
from relume.image_io.exr_writer import image_channels, write_scanlines
from relume_cli.main import main


def test_images_are_linear_and_in_ring_order(tmp_path):
    btf = ZippedBtf(zipped(tmp_path / "a.zip"))
    expected = make_direction_grid([(0.0, 1), (40.0, 4), (70.0, 5)])
    np.testing.assert_array_equal(btf.grid.first, expected.first)
    assert btf.size == (6, 5)
    for view in (0, 3, 9):
        values = btf.get_view(view)
        for light in (0, 2, 7):
            source_pixels = make_image(DIRECTIONS[view], DIRECTIONS[light])[1].reshape(-1, 3)
            np.testing.assert_allclose(values[light], source_pixels, atol=0.006)


def renamed(old, new):
    return lambda files: files.update({new: files.pop(old)})


FIRST, SECOND = (make_image_name(DIRECTIONS[k], DIRECTIONS[2]) for k in (1, 3))


def declared_as(side, png):
    """A PNG whose header declares another size: nothing of that size may be allocated."""
    header = png[12:16] + struct.pack(">II", side, side) + png[24:29]
    return png[:12] + header + struct.pack(">I", zlib.crc32(header)) + png[33:]


def of_16_bits():
    file = io.BytesIO()
    Image.fromarray(np.full((6, 5), 40_000, np.uint16)).save(file, "PNG")
    return file.getvalue()


def of_exr(image):
    with tempfile.NamedTemporaryFile(suffix=".exr") as file:
        write_scanlines(Path(file.name), image_channels(image.astype(np.float32)), {}, "float")
        return Path(file.name).read_bytes()


def whole(path):
    btf = ZippedBtf(path)
    return [btf.get_view(view) for view in range(len(DIRECTIONS))]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda files: files.pop(FIRST), r"\(40, 90\) and view from \(40, 0\).* is missing; add it"),
        (lambda files: [files.pop(FIRST), files.pop(SECOND)], "is missing, the first of 2;"),
        (lambda files: [files.pop(n) for n in list(files) if "tl070" in n], "is missing, the first of 50;"),
        (lambda files: files.update({FIRST: declared_as(60_000, files[FIRST])}), "scale the images down"),
        (lambda files: files.update({FIRST: declared_as(11_000, files[FIRST])}), "scale the images down"),
        (lambda files: files.update({FIRST: of_16_bits()}), "more than 8 bits per channel"),
        (renamed(FIRST, FIRST.replace("tv040 pv000", "tv040 pv999")), "not above the horizon"),
        (lambda files: files.update({FIRST.replace("tv040/", "again/"): files[FIRST]}), "two images"),
        (lambda files: files.update({FIRST: files[FIRST][:60]}), "cannot be read"),
        (
            lambda files: files.update({FIRST: make_image(DIRECTIONS[1], DIRECTIONS[2], (7, 5))[0]}),
            "^the image tv040.* has 5×7 pixels, the first",
        ),
        (
            lambda files: files.update({FIRST: make_image(DIRECTIONS[1], DIRECTIONS[2], kind="GIF")[0]}),
            "cannot be read",
        ),
        (renamed(FIRST, FIRST.replace("tv040 pv000", "tv095 pv000")), "not above the horizon"),
        (lambda files: files.clear(), "named by their directions"),
        (lambda files: files.update({"\x1b[2J\n" + FIRST.rpartition("/")[2]: b""}), r"of \?\[2J\?00000 tl040"),
        (lambda files: files.update({FIRST: of_exr(np.full((6, 5, 3), np.nan))}), "non-finite"),
    ],
)
def test_invalid_zips_are_rejected_with_the_reason(tmp_path, change, message):
    path = zipped(tmp_path / "bad.zip", change)
    with pytest.raises(MaterialError, match=message):
        whole(path)


def test_directions_that_are_not_on_uniform_rings_are_rejected(tmp_path):
    def crooked(files):
        for name in [n for n in files if " pl090 " in n or n.endswith("pv090.png")]:
            new = name.replace(" pl090 ", " pl100 ").replace("pv090.png", "pv100.png")
            files[new] = files.pop(name)

    with pytest.raises(MaterialError, match="uniformly spaced on rings"):
        ZippedBtf(zipped(tmp_path / "crooked.zip", crooked))


def test_exr_images_are_linear_and_not_negative(tmp_path):
    def linear(files):
        for name in [name for name in files if name.endswith(".png")]:
            files[name.replace(".png", ".exr")] = of_exr(np.full((6, 5, 3), [7.5, 0.25, -0.5]))
            del files[name]

    view_values = ZippedBtf(zipped(tmp_path / "a.zip", linear)).get_view(3)
    np.testing.assert_array_equal(view_values, np.broadcast_to(np.float32([7.5, 0.25, 0]), view_values.shape))


def test_large_images_are_downsampled_in_linear_values(tmp_path, monkeypatch):
    def larger(files):
        for view in DIRECTIONS:
            for light in DIRECTIONS:
                files[make_image_name(view, light)] = make_image(view, light, (6, 4))[0]

    monkeypatch.setattr("relume.assets.btf.compress.MAX_TEXELS", 10)
    btf = ZippedBtf(zipped(tmp_path / "a.zip", larger))
    assert btf.size == (3, 2)
    means = make_image(DIRECTIONS[4], DIRECTIONS[6], (6, 4))[1].reshape(3, 2, 2, 2, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(btf.get_view(4)[6], means.reshape(-1, 3), atol=0.006)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "not a zip"),
        (b"hello", "not a zip"),
        (b"PK\x03\x04 and nothing", "truncated"),
        (b"PK" * 9999, "truncated"),
    ],
)
def test_files_that_are_not_zips_are_rejected(tmp_path, content, message):
    (tmp_path / "no.zip").write_bytes(content)
    with pytest.raises(MaterialError, match=message):
        ZippedBtf(tmp_path / "no.zip")


def test_a_list_of_millions_of_files_is_not_read(tmp_path):
    num_bytes = 40_000_000
    with (tmp_path / "a.zip").open("wb") as file:
        file.write(b"PK\1\2")
        file.seek(num_bytes)
        file.write(struct.pack("<4sHHHHIIH", b"PK\5\6", 0, 0, 65535, 65535, num_bytes, 0, 0))
    with pytest.raises(MaterialError, match="more than 161,000 files"):
        ZippedBtf(tmp_path / "a.zip")


def test_compression_methods_that_may_need_gigabytes_are_rejected(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.zip", "w", zipfile.ZIP_LZMA) as file:
        file.writestr(make_image_name(DIRECTIONS[0], DIRECTIONS[0]), b"1")
    with pytest.raises(MaterialError, match="deflate"):
        ZippedBtf(tmp_path / "a.zip")


def test_the_command_line_imports_a_zip(tmp_path, capsys):
    path = zipped(tmp_path / "cloth.zip")
    assert main(["material", "import", str(path), "--name", "Cloth", "--data", str(tmp_path / "data")]) == 0
    output = capsys.readouterr()
    assert output.out.startswith("btf:")
    assert "relative RMS" in output.err


def test_a_rejected_zip_leaves_no_files(tmp_path):
    path = zipped(tmp_path / "a.zip", lambda files: files.update({FIRST: files[FIRST][:60]}))
    with pytest.raises(MaterialError, match="cannot be read"):
        import_btf(tmp_path / "btfs", path, "Cloth", 0.1, lambda fraction: None, lambda: False)
    assert not list((tmp_path / "btfs" / "making").iterdir())


def test_an_image_of_one_texel_is_accepted(tmp_path):
    def of_one_texel(files):
        for name in [name for name in files if name.endswith(".png")]:
            files[name] = make_image(DIRECTIONS[1], DIRECTIONS[2], (1, 1))[0]

    path = zipped(tmp_path / "a.zip", of_one_texel)
    record = import_btf(tmp_path / "btfs", path, "Cloth", 0.1, lambda fraction: None, lambda: False)
    assert record.size == (1, 1)
