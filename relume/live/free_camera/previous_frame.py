"""The last frame of a free camera, which the next one may update."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.live.free_camera.frame import Frame, FrameRequestState
from relume.live.free_camera.primary_visibility import GBuffer
from relume.views.resolve import pack_pixels

F32 = NDArray[np.float32]


@dataclass
class PreviousImage:
    """The last rendered image.

    Attributes:
        state: its target. gbuffer: G-buffer of its rays. frame: the finished frame.
        shadow_visibility: shadow visibility of hard-shadow lights along its rays.
        has_highlight_edges: its highlight edges are
            antialiased.
        rgb9e5: its pixels, encoded as RGB9_E5; None until requested.
    """

    state: FrameRequestState
    gbuffer: GBuffer
    frame: Frame
    shadow_visibility: Sequence[F32]
    has_highlight_edges: bool
    rgb9e5: Shaped[NDArray[np.uint32], " pixels"] | None = None

    def to_rgb9e5(self) -> Shaped[NDArray[np.uint32], " pixels"]:
        """Return its pixels encoded as RGB9_E5; cached."""
        if self.rgb9e5 is None:
            self.rgb9e5 = pack_pixels(self.frame.image.reshape(-1, 3))
        return self.rgb9e5
