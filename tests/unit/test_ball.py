"""Thumbnails: a diffuse ball against the sum over its lights, a highlight on top of it, a ball of every term."""

import numpy as np
import pytest

from relume.balls.ball import _lights, ball_image
from relume.brdf.document import complete_term
from relume.brdf.registry import TERMS


def term(model: str, **given: object) -> dict[str, object]:
    return complete_term(("ball",), {"model": model, "color": [1.0, 1.0, 1.0], **given}, None)


def test_middle_of_a_diffuse_ball_is_the_light_of_its_half_space() -> None:
    size = 33
    middle = ball_image([term("lambert")], size)[size // 2, size // 2]
    cosine = np.maximum(_lights().direction[:, 2].astype(float), 0)
    expected = (cosine[:, None] * _lights().irradiance).sum(axis=0) / np.pi
    # the pixel is as wide as 3.6 degrees of the ball
    np.testing.assert_allclose(middle, expected, rtol=0.05)


def test_highlight_adds_to_the_body_and_corners_stay_empty() -> None:
    body = ball_image([term("lambert")], 24)
    both = ball_image([term("lambert"), term("cook_torrance", params={"sigma": 0.2})], 24)
    assert np.all(both >= body - 1e-6)
    assert both.max() > 1.05 * body.max()
    np.testing.assert_array_equal(both[0, 0], body[-1, -1])


@pytest.mark.parametrize("model", sorted(name for name, found in TERMS.items() if not name.startswith("measured")))
def test_every_term_makes_a_ball(model: str) -> None:
    image = ball_image([term(model)], 8)
    assert np.isfinite(image).all()
    assert image.min() >= 0
    assert image[3:5, 3:5].max() > 0
