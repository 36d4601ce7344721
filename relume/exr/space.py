"""The colour space of an exported picture: ours, or a linear one of the OpenColorIO config in use."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from relume.errors import ParameterError
from relume.imageio.ocio.current import current
from relume.imageio.primaries import KNOWN, REC_709, Chromaticities, chromaticities_of, known_as

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class Space:
    """A linear colour space.

    Attributes:
        name: that people read.
        interop: the id that files name it by; None: it has none.
        chromaticities: of its primaries and white.
        convert: turns light into it, in place, (n, 3); None: it is ours.
    """

    name: str
    interop: str | None
    chromaticities: Chromaticities
    convert: Callable[[F32], None] | None

    def converted(self, image: F32) -> F32:
        """A picture in it. (height, width, 3 or 4), coverage as it is"""
        if self.convert is None:
            return image
        light = np.array(image[..., :3], np.float32, order="C").reshape(-1, 3)
        self.convert(light)
        return np.concatenate([light.reshape(*image.shape[:2], 3), image[..., 3:]], axis=-1)


OURS = Space("Rec. 709", "lin_rec709_scene", REC_709, None)


def space_called(name: str | None) -> Space:
    """The colour space that a request names; None: ours.

    Raises:
        ParameterError: there is no config, or it has no linear space that is called so, or no file can say what it is.
    """
    if name is None:
        return OURS
    config = current()
    if config is None:
        raise ParameterError("color_space", name, "none: there is no OpenColorIO config here (RELUME_OCIO)")
    found = config.space_of(name)
    try:
        matrix = config.primaries(found)
        interop = known_as(matrix)
        chromaticities = chromaticities_of(matrix) if interop is None else KNOWN[interop]
    except (ValueError, np.linalg.LinAlgError) as error:
        raise ParameterError("color_space", name, f"another: {error}") from None
    return Space(found, interop, chromaticities, partial(config.convert, space=found))
