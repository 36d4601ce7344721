"""Materials from which lobe rays go on, and the share of their light that does not."""

import numpy as np
import pytest

from relume.brdf.albedo import material_reflectance
from relume.live.opened.lobe_light import broad_share, reflects_narrowly

COLOR = [1.0] * 3


def ggx(roughness, f0):
    return {"model": "ggx", "color": COLOR, "params": {"roughness": roughness, "f0": f0}, "curves": {}, "texture": None}


def lambert(color):
    return {"model": "lambert", "color": [color] * 3, "params": {}, "curves": {}, "texture": None}


@pytest.mark.parametrize(
    ("terms", "is_followed"),
    [
        ([ggx(0.05, 0.9)], True),
        ([ggx(0.05, 0.04), lambert(0.5)], False),
        ([ggx(0.05, 0.04), ggx(0.4, 0.9)], False),
        ([ggx(0.4, 0.9)], False),
        ([ggx(0.05, 0.04), ggx(0.1, 0.9)], True),
    ],
)
def test_rays_go_on_from_strong_narrow_highlights_not_from_the_coat_of_a_rough_metal(terms, is_followed):
    assert reflects_narrowly(material_reflectance(terms)) == is_followed


def test_the_broad_share_is_what_narrow_highlights_do_not_reflect():
    assert broad_share(material_reflectance([ggx(0.05, 1.0)])) == pytest.approx(0, abs=1e-3)
    mixed = material_reflectance([ggx(0.05, 0.3), lambert(0.5)])
    assert np.isclose(broad_share(mixed), 0.5 / (0.5 + 0.33), atol=0.06)
    assert broad_share(material_reflectance([ggx(0.05, 0.04), ggx(0.4, 0.9)])) == 1
