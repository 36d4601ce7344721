"""What a moving picture has drawn last, and what the next frame may go on from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.live.free_camera.frame import Frame, FrameRequestState
from relume.live.free_camera.primary_visibility import GBuffer
from relume.views.resolve import pack_pixels

F32 = NDArray[np.float32]


@dataclass
class PreviousImage:
    """What a picture has drawn last.

    Attributes:
        state: what it shows. gbuffer: by the rays of its eye. frame: the finished one.
        shadow_visibility: of beams, along its rays. has_highlight_edges: it is fine, and all of its rims are found.
        rgb9e5: its pixels, packed as RGB9_E5; None where nobody has asked for them. (pixels,) uint32
    """

    state: FrameRequestState
    gbuffer: GBuffer
    frame: Frame
    shadow_visibility: Sequence[F32]
    has_highlight_edges: bool
    rgb9e5: NDArray[np.uint32] | None = None

    def to_rgb9e5(self) -> NDArray[np.uint32]:
        """Its pixels, packed, from when somebody asks for them first."""
        if self.rgb9e5 is None:
            self.rgb9e5 = pack_pixels(self.frame.image.reshape(-1, 3))
        return self.rgb9e5
