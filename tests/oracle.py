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
import twins

from relume.memory import Memory
from relume.methods.registry import open_transfer
from relume.picture.transfer import Transfer
from relume.render.image import render_image

KEPT = ("derived", "edited")  # folders of images that sessions keep in a store


@contextmanager
def copied(transfer) -> Iterator[Transfer]:
    """The bake of a transfer, opened anew from a place where nobody has shown it; its files are links."""
    store = Path(transfer.key)
    with TemporaryDirectory(dir=store.parent) as folder:
        other = Path(folder) / store.name
        shutil.copytree(store, other, copy_function=os.link, ignore=shutil.ignore_patterns(*KEPT))
        yield open_transfer(other, Memory(1 << 30))


def rendered_afresh(transfer, look, view="front", **options):
    """`render_image` from a copy."""
    with copied(transfer) as other:
        return render_image(other, view, look, **options)


def exact_image(transfer, look, view="front"):
    """The same, held against projector and NumPy: a shade that is wrong the same way everywhere is found here.

    Both sum the same light in float32, in another order: a relative error of its unit, 6e-8, for each of up to 1000
    lights and rays that come to a sample.
    """
    with copied(transfer) as other:
        image, twin = render_image(other, view, look), twins.full_evaluation(other, view, look)
    np.testing.assert_allclose(image, twin, rtol=1e-4, atol=1e-7 * twin.max())
    return image
