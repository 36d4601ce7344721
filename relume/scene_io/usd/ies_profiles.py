"""IES files of UsdLuxShapingAPI.

The intensity of a light is multiplied by the candela of its file or, if that is normalized, by its intensity over the
mean of all directions. C0 is +X of the light, C90 +Y.
"""

from __future__ import annotations

import posixpath
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.ies.ies_file import IesFile
from relume.assets.ies.read_ies import mean_intensity, parse_ies
from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, unsupported
from relume.lights.light_axes import light_axes
from relume.scene_io.surfaces.surface_images import DocumentFiles

F64 = NDArray[np.float64]

_MAX_NAME = 80


class UsdProfile(NamedTuple):
    """The IES file of a light. factor: its maximum intensity, over that of the light without the file."""

    file: IesFile
    factor: float


def read_profile(
    prim: Any, time: Any, files: DocumentFiles, label: str, warnings: list[ImporterWarning]
) -> UsdProfile | None:
    """Read the IES file of a light; None without one.

    Args:
        prim: the light. time: time code. files: of the stage. label: of the light, in warnings. warnings: added to.
    """
    asset = prim.GetAttribute("inputs:shaping:ies:file").Get(time)
    if not asset or not asset.path:
        return None
    name = (
        "".join(filter(str.isprintable, posixpath.basename(files.printable_name(asset.path))))[:_MAX_NAME].strip()
        or "IES file"
    )
    try:
        data = files.read(asset.path, f"IES file of {label}")  # warns if it is missing
        if data is None:
            return None
        web, web_warnings = parse_ies(data, name)
    except SceneError as error:
        warnings.append(unsupported(f"The IES file of {label} was skipped: {error}."))
        return None
    warnings.extend(web_warnings)
    if prim.GetAttribute("inputs:shaping:ies:angleScale").Get(time):
        warnings.append(unsupported(f"The angle scale of the IES file of {label} isn't supported."))
    is_normalized = bool(prim.GetAttribute("inputs:shaping:ies:normalize").Get(time))
    return UsdProfile(IesFile(name, data), 1 / mean_intensity(web.relative_intensity) if is_normalized else web.candela)


def profile_rotation(to_world: Shaped[F64, "4 4"], direction: list[float]) -> float:
    """Return the rotation of a light that has its C0 along +X of a transform, degrees. direction: −Z of it."""
    across, up, _ = light_axes(direction)
    return float(np.degrees(np.arctan2(to_world[:3, 0] @ up, to_world[:3, 0] @ across)))
