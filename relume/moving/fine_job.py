"""The fine frame of a picture whose eye and look rest for a moment, made beside the frames."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from relume.moving.frame import Frame, Wanted, frame_of
from relume.moving.look_up import Seen
from relume.moving.rims import add_rims
from relume.moving.transfer import MovingTransfer
from relume.picture.jobs import Cancelled, Progress
from relume.scene.model import Camera

F32 = NDArray[np.float32]


def fine_frame(
    transfer: MovingTransfer, wanted: Wanted, seen: Seen, camera: Camera, size: tuple[int, int], shares: Sequence[F32]
) -> Frame:
    """Find what an eye sees, its rims too.

    Args:
        transfer, wanted, seen, camera, size, shares: as of `relume.moving.frame.frame_of`; `wanted` is fine.
    """
    frame = frame_of(transfer, wanted, seen, camera, size, shares)
    return add_rims(transfer, wanted, seen, camera, frame, shares)


@dataclass(frozen=True)
class FineJob:
    """Finds it; a `relume.picture.jobs.Job`.

    Attributes:
        find: makes the frame, of what was shown when the job was begun. key: equal for jobs of one eye and look.
        take: gets it.
    """

    find: Callable[[], Frame]
    key: tuple[Hashable, ...]
    take: Callable[[Frame], None]

    what = "finer highlights"
    state: ClassVar[Literal["shading"]] = "shading"
    refines = True
    goes_on = False

    def make(self, progress: Progress, cancelled: Cancelled) -> Frame:
        """Find it: as long as a few frames take."""
        return self.find()

    def install(self, made: Frame) -> None:
        """Hand it over."""
        self.take(made)
