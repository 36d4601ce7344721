"""Brings a picture to its look exactly, with nobody watching."""

from __future__ import annotations

from relume.core.errors import CancelledError
from relume.live.fixed_camera.jobs import CancelCheck, ProgressCallback
from relume.live.fixed_camera.picture import Picture
from relume.look import Look


def render_exact(picture: Picture, look: Look, progress: ProgressCallback, is_canceled: CancelCheck) -> None:
    """Make all that a picture lacks until it shows a look exactly.

    Args:
        picture: that has been given the look. look: that it shall show.
        progress: called with about the share done. is_canceled: asked now and then.
    Raises:
        CancelledError: `is_canceled` said so.
    """
    num_terms, num_images = sum(len(material.terms) for material in look.materials.values()), 0
    while True:
        if is_canceled():
            raise CancelledError("the picture was cancelled")
        exact = picture.advance(None).exact
        if picture.next_job() is None and exact:
            progress(1.0)
            return

        def report_overall(fraction: float, num_images: int = num_images) -> None:
            # seldom is more made than an image a term
            progress(min(num_images + fraction, num_terms) / max(1, num_terms))

        picture.run_next_job(report_overall, is_canceled)
        num_images += 1
