"""Color spaces of exported images: linear Rec. 709, or a linear space of the active OpenColorIO config."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import ParameterError
from relume.image_io.ocio.active_config import get_config
from relume.image_io.primaries import INTEROP_SPACES, REC_709, Chromaticities, chromaticities_from_matrix, interop_id

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class ExportColorSpace:
    """A linear color space.

    Attributes:
        name: name for users.
        interop: id in files; None if it has none.
        chromaticities: chromaticities of its primaries and white.
        convert: converts linear Rec. 709 to it, in place, (n, 3); None for linear Rec. 709.
    """

    name: str
    interop: str | None
    chromaticities: Chromaticities
    convert: Callable[[F32], None] | None

    def convert_image(self, image: Shaped[F32, "height width channels"]) -> Shaped[F32, "height width channels"]:
        """Convert an image of 3 or 4 channels; alpha is unchanged."""
        if self.convert is None:
            return image
        light = np.array(image[..., :3], np.float32, order="C").reshape(-1, 3)
        self.convert(light)
        return np.concatenate([light.reshape(*image.shape[:2], 3), image[..., 3:]], axis=-1)


REC_709_SPACE = ExportColorSpace("Rec. 709", "lin_rec709_scene", REC_709, None)


def find_space(name: str | None) -> ExportColorSpace:
    """Look up the color space of a request; None is linear Rec. 709.

    Raises:
        ParameterError: there is no config, or it has no linear space of that name, or no file can describe the space.
    """
    if name is None:
        return REC_709_SPACE
    config = get_config()
    if config is None:
        allowed = "no color space, because there is no OpenColorIO config here (RELUME_OCIO)"
        raise ParameterError("color_space", name, allowed)
    canonical_name = config.canonical_space(name)
    try:
        matrix = config.primaries(canonical_name)
        interop = interop_id(matrix)
        chromaticities = chromaticities_from_matrix(matrix) if interop is None else INTEROP_SPACES[interop]
    except (ValueError, np.linalg.LinAlgError) as error:
        raise ParameterError("color_space", name, f"another color space, because {error}") from None
    return ExportColorSpace(canonical_name, interop, chromaticities, partial(config.convert, space=canonical_name))
