"""Registry of batch steps. To add one, write its function and add a line here."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from relume.core.errors import CancelledError
from relume.live.fixed_camera.jobs import CancelCheck, ProgressCallback
from relume_server.batch import bake_previews, btf_steps
from relume_server.batch.context import BatchContext
from relume_server.batch.frames import pack, paint_frame
from relume_server.batch.reference_passes import make_frame, make_pass, time_pass
from relume_worker.jobs.claim import canceled_or_taken_over
from relume_worker.jobs.step import Step

STEPS: Mapping[str, Callable[..., Mapping[str, Any]]] = {
    "BTF": btf_steps.run_btf_slice,
    "first image of a bake": bake_previews.render_first,
    "thumbnail of a bake": bake_previews.paint_thumbnail,
    "frame of a batch": paint_frame,
    "archive of a batch": pack,
    "frame of a comparison": make_frame,
    "pass of a comparison": make_pass,
    "time of a pass": time_pass,
}


def do_step(context: BatchContext, step: Step, report: ProgressCallback, is_canceled: CancelCheck) -> Mapping[str, Any]:
    """Run one step in this process.

    Args:
        context: context of the process.
        step: step of a registered kind.
        report: called with the fraction done. is_canceled: polled.
    Raises:
        CancelledError: `is_canceled` returned true, or another server has taken the job over. Also what the step
            raises.
    """
    if step.claim is not None:
        folder, owner = step.claim
        is_canceled = canceled_or_taken_over(Path(folder), owner, is_canceled)
        if is_canceled():
            raise CancelledError("the job was taken over")
    return STEPS[step.kind](context, report, is_canceled, **step.values)
