"""Fixtures: an image file and a library with it; bakes skip the measurement of their error."""

import numpy as np
import pytest
from PIL import Image
from shared_bakes import unmeasured

from relume.brdf.texture_slots import IMAGES
from relume.images.image_store import store

__all__ = ["unmeasured"]  # a fixture

SIDE = 32


def stripes(side=SIDE):
    """Colors that differ everywhere. (side, side, 3) uint8"""
    ramp = np.linspace(20, 250, side).astype(np.uint8)
    rows, columns = np.meshgrid(ramp, ramp, indexing="ij")
    return np.stack([rows, columns, 255 - rows // 2], axis=-1)


@pytest.fixture(scope="session")
def image_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("image") / "stripes.png"
    Image.fromarray(stripes()).save(path)
    return path


@pytest.fixture(scope="session")
def named(image_file, tmp_path_factory):
    """The name of the image in looks."""
    with IMAGES.with_search_folder(tmp_path_factory.mktemp("library") / "images") as library_folder:
        yield store(library_folder, image_file, "Stripes").texture
