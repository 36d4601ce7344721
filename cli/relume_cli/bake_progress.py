"""Progress of a bake in the terminal."""

from __future__ import annotations

import time
from collections.abc import Callable

from relume.core.errors import NotFoundError
from relume_cli.terminal.progress import progress
from relume_worker.status import PHASE_LABELS, BakeStatus
from relume_worker.status_bus import Subscription


def follow(changes: Subscription, label: str, interrupted: Callable[[], bool] = lambda: False) -> BakeStatus:
    """Show progress until the bake ends, and return its last status.

    Args:
        changes: changes of the bake. label: label of the progress. interrupted: polled; true stops.
    Raises:
        KeyboardInterrupt: `interrupted` returned true. NotFoundError: the bake was deleted.
    """
    with progress(label) as report:
        while not (status := changes.latest).final:
            report(status.progress, detail(status))
            changes.get(timeout=0.5)
            if changes.is_closed:
                raise NotFoundError(
                    f"bake {status.id} was deleted; bake again, and import the scene first if it was deleted as well"
                )
            if interrupted():
                raise KeyboardInterrupt
    return status


def detail(status: BakeStatus) -> str:
    """Phase, rate and remaining time of a bake."""
    if status.state == "queued":
        return "waiting" if status.queue_position == 0 else f"waiting, {status.queue_position} before it in the queue"
    if status.phase is None:
        return "starting"
    since_s = time.time() - (status.phase_since or time.time())
    if status.phase not in ("sampling", "tracing"):
        return f"{PHASE_LABELS[status.phase]}, {since_s:.0f} s"
    texts = [PHASE_LABELS[status.phase]]
    if status.rays_per_second:
        texts.append(f"{status.rays_per_second / 1e6:.1f} M rays/s")
    remaining = "estimating the time left" if status.seconds_left is None else f"{status.seconds_left:.0f} s left"
    return ", ".join([*texts, remaining])
