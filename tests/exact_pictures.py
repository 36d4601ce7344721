"""Exact images that share no cache, no file and no shading code with the picture under test.

A session stores images beside its bake and in its cache: a render of the same store would read them and compare the
picture with itself. These images are rendered from a copy of the store without them, opened separately.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import numpy_reference as ref

from relume.core.cache import Cache
from relume.live.fixed_camera.protocols import FixedViewTransfer
from relume.live.opened.openers import open_transfer
from relume.output.render_image import render_image

DERIVED_FOLDERS = ("derived", "edited")  # folders of images that sessions store


@contextmanager
def open_copy(transfer) -> Iterator[FixedViewTransfer]:
    """Open the bake of a transfer again from a fresh folder without stored images; its files are hard links."""
    store = Path(transfer.key)
    with TemporaryDirectory(dir=store.parent) as folder:
        copy = Path(folder) / store.name
        shutil.copytree(store, copy, copy_function=os.link, ignore=shutil.ignore_patterns(*DERIVED_FOLDERS))
        yield open_transfer(copy, Cache(1 << 30))


def render_uncached(transfer, look, view="front", **options):
    """Call `render_image` on a copy."""
    with open_copy(transfer) as copy:
        return render_image(copy, view, look, **options)


def exact_image(transfer, look, view="front"):
    """Return the image of a copy after checking it against projector and NumPy, which finds common shading errors.

    Both sum the same light in float32 in different order: a relative error of 6e-8 for each of up to 1000 lights and
    gather rays of a sample.
    """
    with open_copy(transfer) as copy:
        image, expected = render_image(copy, view, look), ref.full_evaluation(copy, view, look)
    np.testing.assert_allclose(image, expected, rtol=1e-4, atol=1e-7 * expected.max())
    return image
