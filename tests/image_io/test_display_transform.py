"""White balance against colors with known whites, contrast, and their order with exposure, tone map and LUT."""

from __future__ import annotations

import numpy as np
import pytest

from relume.image_io.contrast import CONTRASTS, apply_contrast
from relume.image_io.display_transform import DisplayTransform, to_display
from relume.image_io.tone_mapping import TONE_MAPS, tone_map
from relume.image_io.white_balance import TEMPERATURES, TINTS, balance_matrix

# displayed white of three settings; client_web/tests/whiteBalance.test.ts has the same numbers
BALANCED_WHITES = {
    (6500.0, 0.0): [1.0, 1.0, 1.0],
    (3200.0, 0.0): [0.394544, 1.100249, 2.796253],
    (10000.0, 0.0): [1.176391, 0.985282, 0.715479],
    (5000.0, 30.0): [0.938235, 0.972567, 1.585053],
}


@pytest.mark.parametrize(("setting", "expected"), BALANCED_WHITES.items())
def test_balanced_whites_are_those_of_the_editor(setting, expected):
    np.testing.assert_allclose(balance_matrix(*setting) @ np.ones(3), expected, atol=1e-5)


def test_a_surface_in_tungsten_light_becomes_gray():
    """Rec. 709 of the CIE illuminant A, (x, y) = (0.44758, 0.40745), at its 2856 K."""
    illuminant_a = np.array([1.8451, 0.8261, 0.2333])
    balanced = balance_matrix(2856.0, 0.0) @ illuminant_a
    np.testing.assert_allclose(balanced / balanced.mean(), 1, atol=0.04)
    assert np.ptp(balance_matrix(6500.0, 0.0) @ illuminant_a) > 1.5


def test_a_positive_tint_takes_green_out():
    red, green, blue = balance_matrix(6500.0, 30.0) @ np.ones(3)
    assert green < 0.97
    assert min(red, blue) > 1.05


@pytest.mark.parametrize("temperature", TEMPERATURES)
@pytest.mark.parametrize("tint", TINTS)
def test_gains_are_finite_over_the_whole_range(temperature, tint):
    matrix = balance_matrix(temperature, tint)
    assert np.abs(matrix).max() < 40
    assert np.linalg.det(matrix) > 0


@pytest.mark.parametrize(
    ("contrast", "radiance", "expected"),  # client_web/tests/contrast.test.ts has the same numbers
    [
        (1.0, 0.7, 0.7),
        (2.0, 0.18, 0.18),
        (2.0, 0.36, 0.72),
        (0.5, 0.72, 0.36),
        (1.4, 1.0, 1.985596),
        (0.7, 0.01, 0.0238003),
    ],
)
def test_contrast_is_a_slope_about_middle_gray(contrast, radiance, expected):
    contrasted = apply_contrast(np.float32([radiance]), contrast)
    np.testing.assert_allclose(contrasted, expected, rtol=1e-5)
    np.testing.assert_allclose(apply_contrast(contrasted, 1 / contrast), radiance, rtol=1e-5)


@pytest.mark.parametrize("name", TONE_MAPS)
@pytest.mark.parametrize("contrast", CONTRASTS)
def test_contrast_is_after_exposure_and_before_the_tone_map(name, contrast):
    image = np.random.default_rng(3).random((6, 7, 3)).astype(np.float32)
    exposed = 2**0.7 * np.maximum(image @ balance_matrix(4200.0, 12.0).T, 0)
    display = to_display(image, DisplayTransform(0.7, name, 4200.0, 12.0, contrast=contrast))
    expected = tone_map((0.18 * (exposed / 0.18) ** contrast).astype(np.float32), 0.0, name)
    np.testing.assert_allclose(display, expected, atol=1e-5)


@pytest.mark.parametrize("name", TONE_MAPS)
def test_white_balance_is_before_the_tone_map(name):
    image = np.random.default_rng(1).random((6, 7, 3)).astype(np.float32)
    balanced = (image @ balance_matrix(4200.0, 12.0).T).astype(np.float32)
    display = to_display(image, DisplayTransform(0.7, name, 4200.0, 12.0))
    np.testing.assert_allclose(display, tone_map(balanced, 0.7, name), atol=1e-5)
    np.testing.assert_array_equal(to_display(image, DisplayTransform(0.7, name)), tone_map(image, 0.7, name))


@pytest.mark.parametrize("contrast", [1.0, 2.0])
def test_invalid_radiance_is_black_in_any_balance(contrast):
    image = np.float32([[[np.nan, 0.2, 0.2], [np.inf] * 3, [-1, -1, -1]]])
    display = to_display(image, DisplayTransform(0.0, "none", 3200.0, contrast=contrast))[0]
    assert np.isfinite(display).all()
    assert display[0].min() == 0  # of red alone
    np.testing.assert_allclose(display[1], 1, atol=1e-6)
    np.testing.assert_array_equal(display[2], 0)


def test_a_lut_is_applied_to_display_values():
    """Two nodes that swap red and blue, and 17 with a square, which is linear between them."""
    image = np.random.default_rng(2).random((5, 4, 3)).astype(np.float32)
    plain = tone_map(image, 0.0, "agx")
    nodes = np.stack(np.meshgrid(*[np.array([0, 65535])] * 3, indexing="ij"), axis=-1).astype(np.uint16)
    swapped = to_display(image, DisplayTransform(lut=np.ascontiguousarray(nodes[..., ::-1])))
    np.testing.assert_allclose(swapped, plain[..., ::-1], atol=1e-6)
    levels = np.linspace(0, 1, 17)
    squares = np.stack(np.meshgrid(*[levels**2] * 3, indexing="ij"), axis=-1)
    squared = to_display(image, DisplayTransform(lut=(squares * 65535 + 0.5).astype(np.uint16)))
    np.testing.assert_allclose(squared, np.interp(plain, levels, levels**2), atol=2e-5)
