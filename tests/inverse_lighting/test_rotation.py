"""The search for the rotation of an environment."""

from __future__ import annotations

import math

import pytest

from relume.inverse_lighting.rotation import best_rotation


@pytest.mark.parametrize("best", [0.0, 14.0, 123.4, 359.5])
def test_the_least_error_is_found_across_the_full_circle(best):
    def error(rotation):
        return 1.0 - math.cos(math.radians(rotation - best)) + 0.2 * math.sin(math.radians(2 * (rotation - best))) ** 2

    rotation = best_rotation(error, current=77.0)
    assert (rotation - best + 180) % 360 - 180 == pytest.approx(0.0, abs=1.0)


def test_equal_errors_keep_the_current_rotation():
    assert best_rotation(lambda rotation: 1.0, current=77.0) == 77.0
