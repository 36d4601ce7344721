"""Thumbnails: a diffuse ball against the sum over its lights, a highlight added, a ball of every term."""

import numpy as np
import pytest

from relume.brdf.registry import TERMS
from relume.brdf.term_validation import complete_term
from relume.output.material_previews.preview import _lights, render_preview
from relume.scene.model import Texture, TextureEncoding


def term(model: str, **given: object) -> dict[str, object]:
    return complete_term(("ball",), {"model": model, "color": [1.0, 1.0, 1.0], **given}, None)


def test_the_center_of_a_diffuse_ball_is_the_light_of_its_hemisphere() -> None:
    size = 33
    center = render_preview([term("lambert")], size)[size // 2, size // 2]
    cosine = np.maximum(_lights().direction[:, 2].astype(float), 0)
    expected = (cosine[:, None] * _lights().irradiance).sum(axis=0) / np.pi
    # the pixel is as wide as 3.6 degrees of the ball
    np.testing.assert_allclose(center, expected, rtol=0.05)


def test_highlight_adds_to_the_body_and_corners_stay_empty() -> None:
    body = render_preview([term("lambert")], 24)
    combined = render_preview([term("lambert"), term("cook_torrance", params={"sigma": 0.2})], 24)
    assert np.all(combined >= body - 1e-6)
    assert combined.max() > 1.05 * body.max()
    np.testing.assert_array_equal(combined[0, 0], body[-1, -1])


@pytest.mark.parametrize("model", sorted(name for name, term_class in TERMS.items() if not name.startswith("measured")))
def test_every_term_renders_a_ball(model: str) -> None:
    image = render_preview([term(model)], 8)
    assert np.isfinite(image).all()
    assert image.min() >= 0
    assert image[3:5, 3:5].max() > 0


def test_a_ball_shows_its_images() -> None:
    """Red above, blue below; a channel without an image leaves the color."""
    pixels = np.zeros((70, 30, 3), np.uint8)
    pixels[:35, :, 0] = pixels[35:, :, 2] = 255
    images = {"diffuse": Texture(pixels, encoding=TextureEncoding("srgb", (1.0, 1.0, 1.0)))}
    plain = render_preview([term("lambert", texture=None)], 32)
    textured = render_preview([term("lambert", texture="diffuse")], 32, images)
    ratio = textured[2:30, 14:18] / plain[2:30, 14:18]
    reds, blues = (ratio[..., channel].mean(axis=1) > 0.5 for channel in (0, 2))
    assert reds.any()
    assert blues.any()
    assert not (reds & blues)[ratio.max(axis=(1, 2)) > 0.99].any()
    np.testing.assert_array_equal(render_preview([term("lambert", texture="specular")], 32, images), plain)
