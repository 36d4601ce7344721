"""Renders a look exactly, offline."""

from __future__ import annotations

from relume.core.errors import CancelledError
from relume.live.fixed_camera.jobs import CancelCheck, ProgressCallback
from relume.live.fixed_camera.picture import Picture
from relume.look import Look


def render_exact(picture: Picture, look: Look, progress: ProgressCallback, is_canceled: CancelCheck) -> None:
    """Run all jobs of a picture until it shows its look exactly.

    Args:
        picture: its look has been set. look: the same look.
        progress: called with the approximate fraction done. is_canceled: polled regularly.
    Raises:
        CancelledError: `is_canceled` returned true.
    """
    num_terms, num_images = sum(len(material.terms) for material in look.materials.values()), 0
    while True:
        if is_canceled():
            raise CancelledError("the picture was canceled")
        exact = picture.advance(None).exact
        if picture.next_job() is None and exact:
            progress(1.0)
            return

        def report_overall(fraction: float, num_images: int = num_images) -> None:
            # most looks need at most one image per term
            progress(min(num_images + fraction, num_terms) / max(1, num_terms))

        picture.run_next_job(report_overall, is_canceled)
        num_images += 1
