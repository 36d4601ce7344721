"""Maps in other primaries: published matrices, invariance of color, invalid primaries."""

import re

import numpy as np
import pytest
from environment_files import dusk, write_map
from exr_builder import exr_part, write_exr

from relume.assets.environments.read_environment import read_environment
from relume.core.errors import SceneError
from relume.image_io.primaries import CIE_XYZ, REC_709, to_rec_709

D65 = (0.3127, 0.3290)
REC_2020 = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, *D65)
ACES = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.0770, 0.32168, 0.33767)

# ITU-R BT.2087, table 4's inverse; and ACES 2065-1 by Bradford's rule, as in OpenColorIO's configurations
OF_2020 = [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]]
OF_ACES = [[2.5217, -1.1341, -0.3876], [-0.2765, 1.3727, -0.0962], [-0.0154, -0.1530, 1.1684]]


@pytest.mark.parametrize(("primaries", "published"), [(REC_2020, OF_2020), (ACES, OF_ACES)])
def test_matrices_equal_the_published_ones(primaries, published):
    np.testing.assert_allclose(to_rec_709(primaries), published, atol=3e-4)


@pytest.mark.parametrize("primaries", [REC_2020, ACES, (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.314, 0.351)])
def test_white_stays_white(primaries):
    np.testing.assert_allclose(to_rec_709(primaries).sum(axis=1), 1, atol=1e-9)


def test_rec_709_primaries_change_nothing():
    assert to_rec_709(REC_709) is None
    assert to_rec_709((0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.313, 0.329)) is None


def test_a_map_in_other_primaries_has_the_same_radiance(tmp_path):
    """Written with the inverse matrix; a texel that is no number is the mean of the eight around it."""
    expected = dusk()
    other = expected @ np.linalg.inv(np.array(OF_2020)).T
    other[3, 4] = np.nan
    actual = read_environment(write_map(tmp_path / "a.exr", other, REC_2020), "dusk")
    around = expected[2:5, 3:6].reshape(9, 3)
    expected[3, 4] = np.delete(around, 4, axis=0).mean(axis=0)
    np.testing.assert_allclose(actual.radiance, expected, atol=2e-3 * expected.max(), rtol=2e-3)
    assert [warning.severity for warning in actual.warnings] == ["unsupported"]
    plain = read_environment(write_map(tmp_path / "b.exr", expected, REC_709), "dusk")
    np.testing.assert_array_equal(plain.radiance, expected)


def test_a_color_space_may_be_named_instead(tmp_path):
    """`colorInteropID` of OpenEXR 3.4; chromaticities, if there are any, decide."""
    expected = dusk()
    other = (expected @ np.linalg.inv(np.array(OF_2020)).T).astype(np.float32)
    for name, chromaticities, pixels in (
        ("lin_rec2020_scene", None, other),
        ("lin_rec709_scene", None, expected),
        ("lin_ap1_scene", REC_2020, other),
    ):
        path = write_map(tmp_path / "a.exr", pixels, chromaticities, colorInteropID=name)
        actual = read_environment(path, "dusk")
        np.testing.assert_allclose(actual.radiance, expected, atol=2e-3 * expected.max(), rtol=2e-3)
        assert actual.warnings == ()
    unknown = read_environment(write_map(tmp_path / "b.exr", expected, colorInteropID="srgb_p3d65_scene"), "dusk")
    np.testing.assert_array_equal(unknown.radiance, expected)
    (warning,) = unknown.warnings
    assert "color space “srgb_p3d65_scene”; it was read as linear Rec. 709" in warning


@pytest.mark.parametrize("chromaticities", [None, REC_2020])
def test_infinite_texels_are_as_bright_as_possible(tmp_path, chromaticities):
    """A sun that exceeds the format stays a white sun; infinite red stays red."""
    other = dusk()
    other[3, 4] = np.inf
    other[5, 6] = [np.inf, 1, -np.inf]
    actual = read_environment(write_map(tmp_path / "a.exr", other, chromaticities), "dusk")
    np.testing.assert_array_equal(actual.radiance[3, 4], 1e6)
    assert actual.radiance[5, 6, 0] == 1e6
    assert actual.radiance[5, 6, 2] == 0
    assert "Environment “dusk” has 2 infinite texels, read as the largest number" in actual.warnings[0]
    half = np.ones((8, 16, 3), np.float16)
    half[2, 3] = np.inf
    data = write_exr(tmp_path / "b.exr", exr_part(dict(zip("RGB", np.moveaxis(half, -1, 0), strict=True))))
    environment = read_environment(data, "sun")
    np.testing.assert_array_equal(environment.radiance[2, 3], 65_504)
    assert environment.radiance.sum() == 3 * (65_504 + 127)
    assert "read as the largest number." in environment.warnings[0]


def test_a_gray_map_is_unchanged(tmp_path):
    gray = dusk()[..., :1]
    actual = read_environment(write_map(tmp_path / "a.exr", gray, ACES), "dusk")
    np.testing.assert_array_equal(actual.radiance, np.repeat(gray, 3, axis=2))


def test_colors_outside_the_gamut_are_clamped_with_a_warning(tmp_path):
    green = np.tile(np.array([0, 1, 0], np.float32), (4, 8, 1))
    actual = read_environment(write_map(tmp_path / "a.exr", green, ACES), "green")
    assert "negative" in actual.warnings[0]
    np.testing.assert_allclose(actual.radiance[0, 0], [0, 1.3727, 0], atol=1e-3)


@pytest.mark.parametrize(
    "primaries",
    [
        (np.nan, *REC_709[1:]),
        (np.inf, *REC_709[1:]),
        (1e30, *REC_709[1:]),
        (0.3, 0.3, 0.4, 0.4, 0.5, 0.5, *D65),  # on a line
        (0.313, 0.329, 0.3131, 0.3291, 0.3126, 0.3292, *D65),  # in a point
        (*REC_709[:6], 0.3, 0.0),
        (*REC_709[:6], 0.7, 0.29),  # not within the triangle
        (*REC_709[:6], 0.3, -0.3),
    ],
)
def test_degenerate_primaries_give_a_warning(tmp_path, primaries):
    environment = read_environment(write_map(tmp_path / "a.exr", dusk(), primaries), "dusk")
    np.testing.assert_array_equal(environment.radiance, dusk())
    assert re.search(r"invalid color primaries .* Rec\. 709", environment.warnings[0])


def test_zeros_are_no_primaries(tmp_path):
    environment = read_environment(write_map(tmp_path / "a.exr", dusk(), (0.0,) * 8), "dusk")
    np.testing.assert_array_equal(environment.radiance, dusk())
    assert environment.warnings == ()


def test_an_attribute_without_eight_numbers_is_rejected(tmp_path):
    data = write_map(tmp_path / "a.exr", dusk(), REC_2020).read_bytes()
    assert b"chromaticities\0chromaticities\0" in data
    words = data.replace(b"chromaticities\0chromaticities\0\x20\0\0\0", b"chromaticities\0string\0\x20\0\0\0")
    with pytest.raises(SceneError):
        read_environment(words, "dusk")


def with_primaries(path, words):
    """The dusk map as an .hdr whose header has one more line."""
    write_map(path, dusk())
    head, rest = path.read_bytes().split(b"\n", 1)
    path.write_bytes(head + b"\nPRIMARIES=" + words + b"\n" + rest)
    return path


def test_primaries_of_a_radiance_header_are_used(tmp_path):
    """Some writers write zeros; the last line counts."""
    plain = read_environment(write_map(tmp_path / "plain.hdr", dusk()), "dusk").radiance
    wide = " ".join(map(str, REC_2020)).encode()
    actual = read_environment(with_primaries(tmp_path / "wide.hdr", wide), "dusk")
    np.testing.assert_allclose(
        actual.radiance, np.maximum(plain @ np.array(OF_2020, np.float32).T, 0), rtol=2e-3, atol=1e-3
    )
    assert np.abs(actual.radiance - plain).max() > 0.1
    for words in (b"", b" 0 0 0 0 0 0 0 0", wide + b"\nPRIMARIES= " + " ".join(map(str, REC_709)).encode()):
        same = read_environment(with_primaries(tmp_path / "same.hdr", words), "dusk")
        np.testing.assert_array_equal(same.radiance, plain)
        assert not same.warnings


@pytest.mark.parametrize("words", [b"1 2 3", b"a b c d e f g h", b"nan " * 8, b"1e999 " * 8, b"0.3 0.3 " * 4])
def test_invalid_radiance_primaries_give_a_warning(tmp_path, words):
    actual = read_environment(with_primaries(tmp_path / "a.hdr", words), "dusk")
    assert "invalid color primaries" in actual.warnings[0]
    np.testing.assert_array_equal(
        actual.radiance, read_environment(write_map(tmp_path / "b.hdr", dusk()), "b").radiance
    )


def test_xyz_is_converted_without_adaptation(tmp_path):
    """IEC 61966-2-1, the matrix from Rec. 709 to XYZ."""
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    environment = read_environment(write_map(tmp_path / "a.exr", dusk() @ to_xyz.T, CIE_XYZ), "dusk")
    np.testing.assert_allclose(environment.radiance, dusk(), rtol=2e-3, atol=1e-3 * dusk().max())
