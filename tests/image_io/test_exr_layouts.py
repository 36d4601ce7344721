"""Parts, layers, windows and channels of OpenEXR files."""

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest
from exr_builder import exr_part, luminance_chroma_exr, write_exr

from relume.core.errors import SceneError
from relume.image_io.read_linear import read_pixels

SIZE = HEIGHT, WIDTH = 8, 16
RGB = np.random.default_rng(3).uniform(0.1, 2, (*SIZE, 3)).astype(np.float16)
OTHER = np.full(SIZE, 7, np.float16)


def layer(name, rgb=RGB, suffixes="RGB"):
    return {f"{name}{suffix}": plane for suffix, plane in zip(suffixes, np.moveaxis(rgb, -1, 0), strict=True)}


def gray_layer(name, value):
    return {f"{name}{channel}": np.full(SIZE, value, np.float16) for channel in "RGB"}


def read(data):
    return read_pixels(data, ".exr", "it", lambda width, height: None)


def test_channels_may_have_any_layer_and_case(tmp_path):
    for index, channels in enumerate(
        [
            layer(""),
            layer("beauty."),
            layer("ViewLayer.Combined."),
            layer("C.", suffixes="rgb"),
            layer("rgba.", suffixes=("red", "green", "blue")),
            {"Z": OTHER, **layer(""), "A": OTHER},
            {"A": OTHER, "N.X": OTHER, "N.Y": OTHER, "N.Z": OTHER, **layer("")},
        ]
    ):
        pixels, warnings = read(write_exr(tmp_path / f"{index}.exr", exr_part(channels)))
        np.testing.assert_array_equal(pixels, RGB)
        assert warnings == []


def test_the_complete_image_of_several_layers_is_read(tmp_path):
    blender = gray_layer("ViewLayer.AO.", 1) | layer("ViewLayer.Combined.") | gray_layer("ViewLayer.DiffCol.", 2)
    stereo = gray_layer("left.", 1) | layer("") | gray_layer("right.", 2)
    views = gray_layer("ViewLayer.AO.left.", 1) | layer("ViewLayer.Combined.left.")
    for index, (channels, message) in enumerate(
        [
            (blender, "3 layers with colors, of which “ViewLayer.Combined”"),
            (stereo, "3 layers with colors, of which the main one"),
            (views, "2 layers with colors, of which “ViewLayer.Combined.left”"),
        ]
    ):
        pixels, (warning,) = read(write_exr(tmp_path / f"{index}.exr", exr_part(channels)))
        np.testing.assert_array_equal(pixels, RGB)
        assert message in warning
        assert warning.severity == "ignored"


def test_the_first_part_with_colors_is_read(tmp_path):
    depth, beauty = exr_part({"Z": OTHER}, name="depth"), exr_part(layer(""), name="beauty")
    luminance = exr_part({"Y": OTHER}, name="y")
    pixels, warnings = read(write_exr(tmp_path / "a.exr", depth, luminance, beauty))
    np.testing.assert_array_equal(pixels, RGB)
    assert warnings == []
    blender = [
        exr_part({"ViewLayer.Depth.Z": OTHER}, name="ViewLayer.Depth"),
        exr_part(layer("ViewLayer.Combined."), name="ViewLayer.Combined"),
    ]
    np.testing.assert_array_equal(read(write_exr(tmp_path / "b.exr", *blender))[0], RGB)


def test_parts_may_differ_in_size(tmp_path):
    small = exr_part({"Z": OTHER[:2, :2]}, (WIDTH, HEIGHT, 0, 0), name="small")
    pixels, _ = read(write_exr(tmp_path / "a.exr", small, exr_part(layer(""), name="beauty")))
    np.testing.assert_array_equal(pixels, RGB)


@pytest.mark.parametrize("tiles", [None, (16, 16)])
def test_any_number_of_channels_is_read(tmp_path, tiles):
    """Blender's multilayer panoramas have dozens; red, green and blue may be far apart."""
    others = {f"id{index:03}.Q": OTHER for index in range(300)}
    options = {} if tiles is None else {"tiles": tiles}
    pixels, _ = read(write_exr(tmp_path / "a.exr", exr_part(layer("") | others, **options)))
    np.testing.assert_array_equal(pixels, RGB)
    red, green, blue = layer("x.", suffixes=("red", "green", "blue")).items()
    far = dict([blue, *list(others.items())[:50], green, *list(others.items())[50:], red])
    np.testing.assert_array_equal(read(write_exr(tmp_path / "b.exr", exr_part(far)))[0], RGB)


@pytest.mark.parametrize(
    "names", [("Z",), ("A",), ("Z", "A"), ("N.X", "N.Y", "N.Z"), ("U", "V"), ("R", "G"), ("depth.V",)]
)
def test_files_without_colors_are_rejected_with_their_channels(tmp_path, names):
    data = write_exr(tmp_path / "a.exr", exr_part(dict.fromkeys(names, OTHER)))
    with pytest.raises(SceneError, match="has no channels R, G and B, only “") as problem:
        read(data)
    assert f"“{sorted(names)[0]}”" in str(problem.value)


@pytest.mark.parametrize("name", ["Y", "L", "R", "gray", "roughness.R"])
def test_one_channel_is_gray(tmp_path, name):
    data = write_exr(tmp_path / "a.exr", exr_part({name: RGB[..., 0], "A": OTHER}, chromaticities=(0.0,) * 8))
    pixels, warnings = read(data)
    np.testing.assert_array_equal(pixels, np.repeat(RGB[..., :1], 3, axis=-1))
    assert warnings == []


def test_deep_files_are_rejected(tmp_path):
    spec = oiio.ImageSpec(4, 2, 3, oiio.HALF)
    spec.deep = True
    deep = oiio.DeepData()
    deep.init(spec)
    for pixel in range(8):
        deep.set_samples(pixel, 1)
    output = oiio.ImageOutput.create(str(tmp_path / "a.exr"))
    assert output.open(str(tmp_path / "a.exr"), spec), output.geterror()
    assert output.write_deep_image(deep), output.geterror()
    output.close()
    with pytest.raises(SceneError, match=r"is deep .*; flatten it and save it as plain RGB"):
        read((tmp_path / "a.exr").read_bytes())


@pytest.mark.parametrize("tiles", [None, (16, 16)])
@pytest.mark.parametrize(
    ("display", "message"),
    [
        ((WIDTH + 6, HEIGHT + 5, -4, -2), "a data window of 16×8 in a display window of 22×13"),  # a crop
        ((WIDTH - 6, HEIGHT - 5, 4, 2), "cut off"),  # overscan
        ((WIDTH, HEIGHT, 4, -3), "display window of 16×8"),  # both
        ((WIDTH, HEIGHT, 100, 0), "display window of 16×8"),  # apart
    ],
)
def test_pixels_are_placed_in_the_display_window(tmp_path, display, message, tiles):
    options = {} if tiles is None else {"tiles": tiles}
    pixels, (warning,) = read(write_exr(tmp_path / "a.exr", exr_part(layer(""), display, **options)))
    width, height, left, top = display
    expected = np.zeros((height, width, 3), np.float32)
    for y in range(height):
        for x in range(width):
            if 0 <= y + top < HEIGHT and 0 <= x + left < WIDTH:
                expected[y, x] = RGB[y + top, x + left]
    np.testing.assert_array_equal(pixels, expected)
    assert message in warning


def test_infinite_values_become_the_largest_ones(tmp_path):
    for dtype, largest in ((np.float16, 65_504), (np.float32, 1e30)):
        rgb = RGB.astype(dtype)
        rgb[1, 2] = np.inf
        rgb[3, 4, 1] = -np.inf
        rgb[5, 6, 0] = np.nan
        pixels, (warning,) = read(write_exr(tmp_path / f"{largest}.exr", exr_part(layer("", rgb))))
        expected = rgb.astype(np.float32)
        expected[1, 2], expected[3, 4, 1] = largest, -largest
        np.testing.assert_array_equal(pixels, expected)
        assert "has 2 infinite texels" in warning


def test_luminance_and_chroma_are_decoded():
    """Constant chroma, which the subsampling keeps: the luminance varies."""
    color = np.array([0.8, 0.4, 0.2])
    rgb = color * np.linspace(0.5, 2, WIDTH * HEIGHT).reshape(*SIZE, 1)
    pixels, warnings = read(luminance_chroma_exr(rgb, (0.2126, 0.7152, 0.0722)))
    np.testing.assert_allclose(pixels, rgb, rtol=4e-3)
    assert warnings == []


@pytest.mark.parametrize("options", [{"compression": "zip"}, {"compression": "none"}, {"tiles": (32, 32)}])
def test_a_truncated_file_shows_its_complete_blocks(tmp_path, options):
    rgb = np.random.default_rng(1).uniform(0, 1, (512, 64, 3)).astype(np.float16)
    data = write_exr(tmp_path / "a.exr", exr_part(layer("", rgb), **options))
    pixels, (warning,) = read(data[: len(data) // 2])
    is_missing = (pixels == 0).all(axis=(1, 2))
    np.testing.assert_array_equal(pixels[~is_missing], rgb[~is_missing])
    assert 200 < (~is_missing).sum() <= 256
    assert f"{is_missing.sum()} of its 512 rows were made black" in warning
    assert warning.severity == "unsupported"


def test_a_damaged_block_costs_only_its_rows(tmp_path):
    rgb = np.random.default_rng(1).uniform(0, 1, (64, 64, 3)).astype(np.float16)
    data = bytearray(write_exr(tmp_path / "a.exr", exr_part(layer("", rgb), compression="zip")))
    middle = len(data) // 2
    data[middle : middle + 100] = bytes(100)
    pixels, (warning,) = read(bytes(data))
    is_missing = (pixels == 0).all(axis=(1, 2))
    assert is_missing.sum() == 16
    np.testing.assert_array_equal(pixels[~is_missing], rgb[~is_missing])
    assert "16 of its 64 rows" in warning
