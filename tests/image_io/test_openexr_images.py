"""OpenEXR's own test images show what they are made to show."""

import numpy as np
import pytest

from relume.image_io.read_linear import read_pixels


@pytest.fixture(scope="module")
def read(shared_data):
    folder = shared_data / "conformance" / "openexr"
    if not folder.is_dir():
        pytest.skip("the shared data has no OpenEXR images")
    return lambda name: read_pixels((folder / name).read_bytes(), ".exr", name, lambda width, height: None)


def test_one_picture_in_three_encodings_is_the_same(read):
    rgb, xyz, luminance_chroma = (read(f"Chromaticities/{name}.exr")[0] for name in ("Rec709", "XYZ", "Rec709_YC"))
    np.testing.assert_allclose(xyz, rgb, atol=6e-3)
    np.testing.assert_allclose(luminance_chroma.mean(axis=(0, 1)), rgb.mean(axis=(0, 1)), rtol=2e-3)
    assert np.abs(luminance_chroma - rgb).mean() < 0.01  # chroma has half the resolution


@pytest.mark.parametrize("number", range(2, 9))
def test_display_windows_show_the_same_pixels(read, number):
    """All have the pixels of t01 in another window; README of openexr-images has the corners."""
    whole, _ = read("DisplayWindow/t01.exr")
    left, top = {2: (1, 1), 3: (30, 20), 4: (0, 0), 5: (30, 20), 6: (-1, -1), 7: (-40, -40), 8: (-30, -40)}[number]
    pixels, (warning,) = read(f"DisplayWindow/t0{number}.exr")
    assert "400×300 in a display window" in warning
    height, width, _ = pixels.shape
    padded = np.pad(whole, ((100, 100), (100, 100), (0, 0)))
    np.testing.assert_array_equal(pixels, padded[100 + top :, 100 + left :][:height, :width])


def test_infinite_and_missing_numbers(read):
    pixels, (warning,) = read("TestImages/BrightRingsNanInf.exr")
    assert "8 infinite texels" in warning
    assert np.isnan(pixels).any(axis=-1).sum() == 4
    assert np.nanmax(pixels) == 65_504


def test_the_front_of_a_latlong_map_is_its_center(read):
    """Letters are drawn in black at +Z, the center, and at +X, a quarter to the left of it."""
    pixels, _ = read("MultiResolution/OrientationLatLong.exr")
    assert pixels.shape == (512, 1024, 3)
    assert pixels[256:300, 492:545].min() < 0.1
    assert pixels[256:300, 236:289].min() < 0.1
