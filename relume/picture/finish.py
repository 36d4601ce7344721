"""Brings a picture to its look exactly, with nobody watching."""

from __future__ import annotations

from relume.errors import CancelledError
from relume.look import Look
from relume.picture.jobs import Cancelled, Progress
from relume.picture.picture import Picture


def finish(picture: Picture, look: Look, progress: Progress, cancelled: Cancelled) -> None:
    """Make all that a picture lacks until it shows a look exactly.

    Args:
        picture: that has been given the look. look: that it shall show.
        progress: called with about the share done. cancelled: asked now and then.
    Raises:
        CancelledError: `cancelled` said so.
    """
    num_terms, made = sum(len(material.terms) for material in look.materials.values()), 0
    while True:
        if cancelled():
            raise CancelledError("the picture was cancelled")
        exact = picture.advance(None).exact
        if picture.next_job() is None and exact:
            progress(1.0)
            return

        def share_of_all(share: float, made: int = made) -> None:
            progress(min(made + share, num_terms) / max(1, num_terms))  # seldom is more made than an image a term

        picture.freeze(share_of_all, cancelled)
        made += 1
