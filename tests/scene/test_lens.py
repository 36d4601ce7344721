"""The thin lens: its formula, and uniform points of its aperture."""

import numpy as np
import pytest
from scipy.stats.qmc import Sobol

from relume.scene.lens import Lens


def test_the_circle_of_confusion_is_that_of_the_thin_lens_formula() -> None:
    focal_length, f_number, focus, depth = 0.05, 2.0, 1.5, 4.0
    lens = Lens(focal_length / (2 * f_number), focus)
    image_distance = 1 / (1 / focal_length - 1 / focus)  # of the sensor, from the lens
    sharp_distance = 1 / (1 / focal_length - 1 / depth)
    on_sensor = 2 * lens.radius * abs(image_distance - sharp_distance) / sharp_distance
    found = lens.circle_of_confusion(np.array([depth, focus, np.inf]))
    np.testing.assert_allclose(found, [on_sensor / image_distance, 0, 2 * lens.radius / focus], atol=1e-12)


@pytest.mark.parametrize("blades", [0, 3, 5, 16])
def test_points_of_the_aperture_are_uniform(blades: int) -> None:
    points = Lens(2.0, 1.0, blades).points(Sobol(2, scramble=False).random(1 << 14))
    np.testing.assert_allclose(points.mean(axis=0), 0, atol=2e-2)
    second_moment = np.square(points).sum(axis=1).mean()
    step = 2 * np.pi / blades if blades else 0.0
    assert second_moment == pytest.approx(4 * (2 + np.cos(step)) / 6, rel=1e-2)  # a disk: half its squared radius
    assert np.hypot(*points.T).max() <= 2 + 1e-12
    if blades:
        assert points[:, 1].max() == pytest.approx(2, abs=0.05)  # a corner at the top
