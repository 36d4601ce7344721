"""The job that sums an image again that was accumulated in steps, to remove rounding errors."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.jobs import CancelCheck, Job, Priority, ProgressCallback
from relume.live.fixed_camera.view_images import TermTarget

F32 = NDArray[np.float32]


def resum_job(
    target: TermTarget, key: tuple[Hashable, ...], sum_into: Callable[[F32], object], rounding: float = 0.0
) -> Job:
    """Return the job; its cost is one pass over the summed arrays.

    Args:
        target: the term after the steps. key: of its image. sum_into: adds the same image, summed once, to zeros.
        rounding: of such a sum, see `DisplayedImage`.
    """
    live, ready = target.live, target.live.ready

    def run(progress: ProgressCallback, is_canceled: CancelCheck) -> F32:
        image = np.zeros_like(ready.image)
        sum_into(image)
        progress(1.0)
        return image

    def apply(image: F32) -> None:
        if live.ready is ready:  # else another step has been added
            live.set_ready(replace(ready, image=image, rounding=rounding, fidelity=Fidelity.EXACT))

    return Job(("resum", *key), target.label, Priority.REFINEMENT, run, apply)
