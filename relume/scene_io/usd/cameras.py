"""UsdGeomCamera as a view, with its depth of field.

Focal length and apertures are in tenths of the stage's unit, the focus distance in the unit.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import ParameterError
from relume.core.import_warnings import ImporterWarning, quote, unsupported
from relume.scene.lens import make_lens
from relume.scene.model import Camera
from relume.scene_io.gltf.cameras import make_slug, rigid_frame


def read_camera(
    prim: Any,
    to_world: Shaped[NDArray[np.float64], "4 4"],
    time: Any,
    unit: float,
    used_names: dict[str, int],
    warnings: list[ImporterWarning],
) -> Camera | None:
    """Read a camera; None with a warning if it is none of perspective.

    Args:
        prim: of type UsdGeomCamera. to_world: of the camera. time: a UsdTimeCode. unit: of the stage, in that of
            `to_world`.
        used_names: see `make_slug`. warnings: gets a sentence if the camera is skipped or moved.
    """
    from pxr import UsdGeom

    camera, name = UsdGeom.Camera(prim), quote(prim.GetName())
    if camera.GetProjectionAttr().Get(time) != "perspective":
        warnings.append(unsupported(f"Skipped camera {name}: only perspective cameras are supported."))
        return None
    attributes = (
        camera.GetFocalLengthAttr(), camera.GetHorizontalApertureAttr(), camera.GetVerticalApertureAttr(),
        camera.GetHorizontalApertureOffsetAttr(), camera.GetVerticalApertureOffsetAttr(),
    )  # fmt: skip
    focal_length, width, height, right, up = (float(attribute.Get(time) or 0.0) for attribute in attributes)
    frame = rigid_frame(to_world)
    is_possible = np.isfinite([focal_length, width, height]).all() and min(focal_length, width, height) > 0
    if frame is None or not is_possible:
        warnings.append(unsupported(f"Skipped camera {name}: its scale, focal length or aperture is not possible."))
        return None
    if right or up:
        warnings.append(unsupported(f"The shift of the lens of camera {name} isn't supported; its image is centered."))
    f_stop, focus_distance = (
        float(attribute.Get(time) or 0.0) for attribute in (camera.GetFStopAttr(), camera.GetFocusDistanceAttr())
    )
    lens = None
    if f_stop != 0:
        try:
            lens = make_lens(unit * focal_length / (20 * f_stop), unit * focus_distance)
        except ParameterError as error:
            warnings.append(unsupported(f"The depth of field of camera {name} isn't possible, its {error}."))
    yfov = float(np.clip(2 * np.arctan(height / (2 * focal_length)), 1e-3, 3.1))
    return Camera(make_slug(prim.GetName(), used_names), frame, yfov, width / height, lens=lens)
