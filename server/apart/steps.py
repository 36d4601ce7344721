"""The list of steps that run apart. To add one: write its function and add a line here."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from relume.errors import CancelledError
from relume.picture.jobs import CancelCheck, ProgressCallback
from server.apart import bakes, btfs
from server.apart.claim import cancelled_or_taken_over
from server.apart.frames import pack, paint_frame
from server.apart.passes import make_frame, make_pass, time_pass
from server.apart.step import Step
from server.apart.workshop import BatchContext

STEPS: Mapping[str, Callable[..., Mapping[str, Any]]] = {
    "BTF": btfs.run_btf_slice,
    "first picture of a bake": bakes.render_first,
    "thumbnail of a bake": bakes.paint_thumbnail,
    "frame of a batch": paint_frame,
    "pack of a batch": pack,
    "frame of a comparison": make_frame,
    "pass of a comparison": make_pass,
    "time of a pass": time_pass,
}


def do_step(context: BatchContext, step: Step, report: ProgressCallback, is_canceled: CancelCheck) -> Mapping[str, Any]:
    """Do one step in this process.

    Args:
        context: what it works with.
        step: of a kind that is listed.
        report: called with the share done. is_canceled: asked now and then.
    Raises:
        CancelledError: `is_canceled` said so, or another server has taken the work over. And what the step raises.
    """
    if step.claim is not None:
        folder, owner = step.claim
        is_canceled = cancelled_or_taken_over(Path(folder), owner, is_canceled)
        if is_canceled():
            raise CancelledError("the work was taken over")
    return STEPS[step.kind](context, report, is_canceled, **step.values)
