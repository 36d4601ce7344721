"""The list of steps that run apart. To add one: write its function and add a line here."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from relume.errors import CancelledError
from relume.picture.jobs import Cancelled, Progress
from server.apart import bakes, btfs
from server.apart.claim import until_taken_over
from server.apart.frames import pack, paint_frame
from server.apart.passes import make_frame, make_pass, time_pass
from server.apart.step import Step
from server.apart.workshop import Workshop

STEPS: Mapping[str, Callable[..., Mapping[str, Any]]] = {
    "BTF": btfs.make,
    "first picture of a bake": bakes.shade,
    "thumbnail of a bake": bakes.paint_thumbnail,
    "frame of a batch": paint_frame,
    "pack of a batch": pack,
    "frame of a comparison": make_frame,
    "pass of a comparison": make_pass,
    "time of a pass": time_pass,
}


def do_step(shop: Workshop, step: Step, tell: Progress, cancelled: Cancelled) -> Mapping[str, Any]:
    """Do one step in this process.

    Args:
        shop: what it works with.
        step: of a kind that is listed.
        tell: called with the share done. cancelled: asked now and then.
    Raises:
        CancelledError: `cancelled` said so, or another server has taken the work over. And what the step raises.
    """
    if step.claim is not None:
        folder, owner = step.claim
        cancelled = until_taken_over(Path(folder), owner, cancelled)
        if cancelled():
            raise CancelledError("the work was taken over")
    return STEPS[step.kind](shop, tell, cancelled, **step.values)
