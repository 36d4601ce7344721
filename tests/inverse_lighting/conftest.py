"""Images of looks, rendered once."""

from __future__ import annotations

import pytest

from relume.inverse_lighting.sources import image_key
from relume.output.render_image import render_image


@pytest.fixture(scope="module")
def render(gathered):
    images = {}

    def render(look):
        key = image_key(look)
        if key not in images:
            images[key] = render_image(gathered, "front", look)
        return images[key]

    return render
