"""Pictures without pending jobs."""

from __future__ import annotations

from relume.live.fixed_camera.picture import Picture


def run_until_exact(picture: Picture) -> None:
    """Run all pending jobs."""
    while not picture.advance(None).exact or picture.next_job() is not None:
        if picture.next_job() is not None:
            picture.run_next_job(lambda share: None, lambda: False)
