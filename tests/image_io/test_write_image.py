"""Images read back by other libraries, and files that are complete or absent."""

from __future__ import annotations

import numpy as np
import OpenImageIO
import pytest
from PIL import Image

from relume.core.errors import DiskFullError, ParameterError, RelumeError, ShapeMismatchError
from relume.image_io.display_transform import DisplayTransform
from relume.image_io.ocio.view import OcioView
from relume.image_io.tone_mapping import tone_map
from relume.image_io.write_image import to_bytes, write_image


@pytest.fixture
def image():
    rng = np.random.default_rng(4)
    smooth = np.linspace(0, 3, 48)[None, :, None] * np.linspace(0, 1, 32)[:, None, None] * np.array([1.0, 0.6, 0.3])
    return (smooth + rng.uniform(0, 0.01, (32, 48, 3))).astype(np.float32)


def test_exr_keeps_linear_radiance_to_the_last_bit(tmp_path, image):
    image[0, 0] = (1e6, 1e-6, 0)
    write_image(tmp_path / "a.exr", image, DisplayTransform(3.0))
    buffer = OpenImageIO.ImageBuf(str(tmp_path / "a.exr"))
    np.testing.assert_array_equal(buffer.get_pixels(OpenImageIO.FLOAT), image)
    assert list(buffer.spec().channelnames) == ["R", "G", "B"]


def test_png_has_the_displayed_values(tmp_path, image):
    write_image(tmp_path / "a.png", image, DisplayTransform(1.0, "filmic"))
    shown = OpenImageIO.ImageBuf(str(tmp_path / "a.png")).get_pixels(OpenImageIO.UINT8)
    np.testing.assert_array_equal(shown, np.round(tone_map(image, 1.0, "filmic") * 255))


def test_webp_is_close_to_the_displayed_values(tmp_path, image):
    write_image(tmp_path / "a.WEBP", image)
    with Image.open(tmp_path / "a.WEBP") as opened:
        shown = np.asarray(opened.convert("RGB"), np.float64)
    assert shown.shape == image.shape
    assert np.abs(shown - tone_map(image, 0.0, "agx") * 255).mean() < 4


def test_png_declares_its_color_space(tmp_path, image, monkeypatch):
    monkeypatch.setattr("relume.image_io.write_image.to_display", lambda shown, transform: shown)
    views = ["agx", OcioView("sRGB - Display", "Un-tone-mapped"), OcioView("Display P3 - Display", "Un-tone-mapped")]
    tagged = []
    for view in views:
        write_image(tmp_path / "a.png", image, DisplayTransform(0.0, view))
        with Image.open(tmp_path / "a.png") as png:
            tagged.append("srgb" in png.info)
    assert tagged == [True, True, False]


@pytest.mark.parametrize("name", ["a.png", "a.webp", "a.exr"])
def test_coverage_is_written_as_alpha(tmp_path, image, name):
    alpha = np.linspace(0, 1, 48, dtype=np.float32)[None, :, None] * np.ones((32, 1, 1), np.float32)
    write_image(tmp_path / name, np.concatenate([image * alpha, alpha], axis=-1))
    buffer = OpenImageIO.ImageBuf(str(tmp_path / name))
    assert buffer.spec().alpha_channel == 3
    if name == "a.exr":  # premultiplied, as the format requires
        np.testing.assert_array_equal(buffer.get_pixels(OpenImageIO.FLOAT)[..., :3], image * alpha)
        return
    with Image.open(tmp_path / name) as opened:
        assert opened.mode == "RGBA"
        pixels = np.asarray(opened, np.float64)
    np.testing.assert_allclose(pixels[..., 3], 255 * alpha[..., 0], atol=0.51)
    solid = alpha[..., 0] > 0.1
    assert np.abs(pixels[..., :3] - tone_map(image, 0.0, "agx") * 255)[solid].mean() < 4


def test_a_transposed_array_is_written_correctly(tmp_path, image):
    write_image(tmp_path / "a.exr", image.transpose(1, 0, 2))
    read = OpenImageIO.ImageBuf(str(tmp_path / "a.exr")).get_pixels(OpenImageIO.FLOAT)
    np.testing.assert_array_equal(read, image.transpose(1, 0, 2))


def test_bytes_round_to_the_nearest():
    values = np.float32([-1, 0, 0.4 / 255, 0.6 / 255, 0.5, 1, 9])
    np.testing.assert_array_equal(to_bytes(values), [0, 0, 0, 1, 128, 255, 255])


@pytest.mark.parametrize("name", ["a.exr", "a.png", "a.webp"])
def test_failure_leaves_the_old_file_and_nothing_else(tmp_path, image, name, monkeypatch):
    target = tmp_path / name
    write_image(target, image)
    before = target.read_bytes()

    def no_space(source, destination):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", no_space)
    with pytest.raises(DiskFullError):
        write_image(target, image * 2)
    assert [p.name for p in tmp_path.iterdir()] == [name]
    assert target.read_bytes() == before


@pytest.mark.parametrize("name", ["a.exr", "a.png", "a.webp"])
def test_a_missing_folder_is_named(tmp_path, image, name):
    with pytest.raises(RelumeError, match="cannot be written"):
        write_image(tmp_path / "nowhere" / name, image)


def test_bad_arguments_are_refused_before_anything_is_written(tmp_path, image):
    with pytest.raises(ParameterError, match=r"\.exr"):
        write_image(tmp_path / "a.gif", image)
    with pytest.raises(ParameterError, match="tone_map"):
        write_image(tmp_path / "a.png", image, DisplayTransform(0.0, "reinhard"))
    for shape in ((3,), (4, 4), (4, 4, 5), (0, 4, 3)):
        with pytest.raises(ShapeMismatchError):
            write_image(tmp_path / "a.exr", np.zeros(shape, np.float32))
    assert not list(tmp_path.iterdir())
