"""What a moving picture has drawn last, and what the next frame may go on from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.moving.frame import Frame, Wanted
from relume.moving.look_up import Seen
from relume.views.resolve import packed

F32 = NDArray[np.float32]


@dataclass
class Drawn:
    """What a picture has drawn last.

    Attributes:
        wanted: what it shows. seen: by the rays of its eye. frame: the finished one.
        shares: of beams, along its rays. has_rims: it is fine, and all of its rims are found.
        words: its pixels, packed as RGB9_E5; None where nobody has asked for them. (pixels,) uint32
    """

    wanted: Wanted
    seen: Seen
    frame: Frame
    shares: Sequence[F32]
    has_rims: bool
    words: NDArray[np.uint32] | None = None

    def packed(self) -> NDArray[np.uint32]:
        """Its pixels, packed, from when somebody asks for them first."""
        if self.words is None:
            self.words = packed(self.frame.image.reshape(-1, 3))
        return self.words
