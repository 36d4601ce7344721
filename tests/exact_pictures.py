"""Exact pictures that share no cache and no file with the picture that is tested, and no shading code either.

A session keeps images beside its store, and in the cache it was given: a render of the same store would read them, and
compare a picture with itself. What is rendered here comes from a copy of the store without them, opened for it alone.
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
from relume.methods.registry import open_transfer
from relume.output.render_image import render_image

DERIVED_FOLDERS = ("derived", "edited")  # folders of images that sessions keep in a store


@contextmanager
def open_copy(transfer) -> Iterator[FixedViewTransfer]:
    """The bake of a transfer, opened anew from a place where nobody has shown it; its files are links."""
    store = Path(transfer.key)
    with TemporaryDirectory(dir=store.parent) as folder:
        copy = Path(folder) / store.name
        shutil.copytree(store, copy, copy_function=os.link, ignore=shutil.ignore_patterns(*DERIVED_FOLDERS))
        yield open_transfer(copy, Cache(1 << 30))


def render_uncached(transfer, look, view="front", **options):
    """`render_image` from a copy."""
    with open_copy(transfer) as copy:
        return render_image(copy, view, look, **options)


def exact_image(transfer, look, view="front"):
    """The same, held against projector and NumPy: a shade that is wrong the same way everywhere is found here.

    Both sum the same light in float32, in another order: a relative error of its unit, 6e-8, for each of up to 1000
    lights and rays that come to a sample.
    """
    with open_copy(transfer) as copy:
        image, expected = render_image(copy, view, look), ref.full_evaluation(copy, view, look)
    np.testing.assert_allclose(image, expected, rtol=1e-4, atol=1e-7 * expected.max())
    return image
