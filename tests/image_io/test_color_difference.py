"""CIEDE2000 against the pairs that Sharma, Wu and Dalal 2005 publish for implementations."""

import numpy as np
import pytest

from relume.image_io.color_difference import ciede2000, color_difference

# L, a, b of both colors, and their difference: Table 1
PAIRS = [
    (50.0, 2.6772, -79.7751, 50.0, 0.0, -82.7485, 2.0425),
    (50.0, 3.1571, -77.2803, 50.0, 0.0, -82.7485, 2.8615),
    (50.0, 2.8361, -74.0200, 50.0, 0.0, -82.7485, 3.4412),
    (50.0, -1.3802, -84.2814, 50.0, 0.0, -82.7485, 1.0000),
    (50.0, -1.1848, -84.8006, 50.0, 0.0, -82.7485, 1.0000),
    (50.0, -0.9009, -85.5211, 50.0, 0.0, -82.7485, 1.0000),
    (50.0, 0.0, 0.0, 50.0, -1.0, 2.0, 2.3669),
    (50.0, -1.0, 2.0, 50.0, 0.0, 0.0, 2.3669),
    (50.0, 2.4900, -0.0010, 50.0, -2.4900, 0.0009, 7.1792),
    (50.0, 2.4900, -0.0010, 50.0, -2.4900, 0.0011, 7.2195),
    (50.0, -0.0010, 2.4900, 50.0, 0.0009, -2.4900, 4.8045),
    (50.0, -0.0010, 2.4900, 50.0, 0.0011, -2.4900, 4.7461),
    (50.0, 2.5000, 0.0, 50.0, 0.0, -2.5000, 4.3065),
    (50.0, 2.5000, 0.0, 73.0, 25.0, -18.0, 27.1492),
    (50.0, 2.5000, 0.0, 61.0, -5.0, 29.0, 22.8977),
    (50.0, 2.5000, 0.0, 56.0, -27.0, -3.0, 31.9030),
    (50.0, 2.5000, 0.0, 58.0, 24.0, 15.0, 19.4535),
    (60.2574, -34.0099, 36.2677, 60.4626, -34.1751, 39.4387, 1.2644),
    (63.0109, -31.0961, -5.8663, 62.8187, -29.7946, -4.0864, 1.2630),
    (6.7747, -0.2908, -2.4247, 5.8714, -0.0985, -2.2286, 0.6377),
    (2.0776, 0.0795, -1.1350, 0.9033, -0.0636, -0.5514, 0.9082),
]


def test_differences_are_those_of_the_authors() -> None:
    table = np.array(PAIRS)
    np.testing.assert_allclose(ciede2000(table[:, :3], table[:, 3:6]), table[:, 6], atol=1e-4)
    np.testing.assert_allclose(ciede2000(table[:, 3:6], table[:, :3]), table[:, 6], atol=1e-4)


def test_black_and_white_differ_by_the_whole_lightness() -> None:
    black, white = np.zeros((1, 1, 3), np.float32), np.ones((1, 1, 3), np.float32)
    assert color_difference(black, white) == pytest.approx(100, abs=1e-6)
    assert color_difference(black, black).max() == color_difference(white, white).max() == 0


def test_an_eight_bit_step_of_gray_is_hardly_visible() -> None:
    steps = np.arange(256, dtype=np.float32)[:, None, None].repeat(3, axis=2) / 255
    assert color_difference(steps[1:], steps[:-1]).max() < 0.7
