"""Cameras that users place: part of a recipe, in addition to the cameras of the scene."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from relume.core.errors import Description, ParameterError, count_text
from relume.scene.lens import Lens, read_lens
from relume.scene.model import Camera, Scene
from relume.scene.validate import MAX_METERS

MAX_NAME = 80
MIN_YFOV, MAX_YFOV = 1.0, 170.0  # degrees
_FIELDS, _OPTIONAL_FIELDS = ("name", "to_world", "yfov"), ("near", "lens")
# largest allowed deviation from right angles; deviation below which axes are kept as they are
_ANGLE_TOLERANCE, _RIGID_TOLERANCE = 1e-3, 1e-8


@dataclass(frozen=True)
class CustomCamera:
    """A camera in a recipe, made by `make_custom_camera`.

    Attributes:
        to_world: camera to world, 16 numbers by row; rigid.
        yfov: vertical field of view, degrees.
        near: distance of the near clipping plane, meters.
        lens: None: everything is sharp.
    """

    name: str
    to_world: tuple[float, ...]
    yfov: float
    near: float = 0.0
    lens: Lens | None = None

    @property
    def camera(self) -> Camera:
        """Convert to a camera of a scene."""
        return Camera(
            self.name, np.array(self.to_world).reshape(4, 4), math.radians(self.yfov), near=self.near, lens=self.lens
        )

    def document(self) -> dict[str, Any]:
        """Convert to JSON; the inverse of `read_custom_camera`."""
        near = {"near": self.near} if self.near else {}  # recipes without one keep their identity
        lens = {"lens": self.lens.document()} if self.lens else {}
        return {"name": self.name, "to_world": list(self.to_world), "yfov": self.yfov} | near | lens


def make_custom_camera(
    name: str, to_world: Sequence[float], yfov: float, near: float = 0.0, lens: Lens | None = None
) -> CustomCamera:
    """Validate a camera that a user placed.

    Args:
        name: name of its views.
        to_world: camera to world, 16 numbers by row; the camera looks along its -Z. Scale is removed.
        yfov: vertical field of view, degrees.
        near: distance of the near clipping plane, meters; 0: nothing is clipped.
        lens: made by `make_lens`.
    Raises:
        ParameterError: a value is invalid.
    """
    _check_name(name)
    if not (math.isfinite(yfov) and MIN_YFOV <= yfov <= MAX_YFOV):
        raise ParameterError("yfov", yfov, f"a vertical field of view of {MIN_YFOV:g} to {MAX_YFOV:g} degrees")
    if not (math.isfinite(near) and 0 <= near <= MAX_METERS):
        raise ParameterError("near", near, f"0 to {MAX_METERS:,.0f} m")
    return CustomCamera(name, _rigid(to_world), float(yfov), float(near), lens)


def read_custom_camera(document: object) -> CustomCamera:
    """Read the camera of a JSON document. Raises ParameterError."""
    if not isinstance(document, Mapping) or set(document) - set(_OPTIONAL_FIELDS) != set(_FIELDS):
        raise ParameterError("camera", document, "an object with " + ", ".join(_FIELDS) + ", and perhaps near or lens")
    name, to_world, yfov = (document[field] for field in _FIELDS)
    near, lens = document.get("near", 0.0), document.get("lens")
    if not isinstance(name, str):
        raise ParameterError("name", name, "text")
    if not isinstance(to_world, list) or not all(map(_is_number, to_world)):
        raise ParameterError("to_world", to_world, "16 numbers by row")
    if not _is_number(yfov):
        raise ParameterError("yfov", yfov, "a number of degrees")
    if not _is_number(near):
        raise ParameterError("near", near, "a number of meters")
    return make_custom_camera(name, to_world, yfov, near, None if lens is None else read_lens(lens))


def with_cameras(scene: Scene, cameras: Iterable[Camera]) -> Scene:
    """Add cameras to a scene; they replace cameras of the same name. The scene's id stays the same."""
    added = {camera.name: camera for camera in cameras}
    scene_cameras = [camera for camera in scene.cameras if camera.name not in added]
    return replace(scene, cameras=(*scene_cameras, *added.values()))


def _check_name(name: str) -> None:
    is_plain = name.isprintable() and name == name.strip() and not set("/\\") & set(name) and name not in (".", "..")
    if not is_plain or not 1 <= len(name) <= MAX_NAME:
        raise ParameterError("name", name, f"1 to {MAX_NAME} printable characters without slashes")


def _rigid(to_world: Sequence[float]) -> tuple[float, ...]:
    """Remove the scale of a frame. Raises ParameterError if its axes are not those of a camera."""
    allowed = "16 finite numbers by row, the last four 0, 0, 0, 1"
    if len(to_world) != 16:
        value = Description(f"a list of {count_text(len(to_world), 'number', 'numbers')}")
        raise ParameterError("to_world", value, allowed)
    frame = np.array(to_world, np.float64).reshape(4, 4)
    if not np.isfinite(frame).all() or not np.array_equal(frame[3], (0, 0, 0, 1)):
        raise ParameterError("to_world", list(to_world), allowed)
    if np.abs(frame[:3, 3]).max() > MAX_METERS:
        allowed = f"a camera position at most {MAX_METERS:,.0f} m from the origin"
        raise ParameterError("to_world", frame[:3, 3].tolist(), allowed)
    max_value = np.abs(frame[:3, :3]).max()  # checked first: squares of larger values overflow
    lengths = np.linalg.norm(frame[:3, :3], axis=0) if max_value <= 1e12 else np.full(3, max_value)
    if lengths.min() < 1e-12 or lengths.max() > 1e12:
        raise ParameterError("to_world", frame[:3, :3].tolist(), "three axes with a length between 1e-12 and 1e12")
    axes = frame[:3, :3] / lengths
    if not np.allclose(axes.T @ axes, np.eye(3), rtol=0, atol=_ANGLE_TOLERANCE):
        raise ParameterError("to_world", frame[:3, :3].tolist(), "three axes at right angles")
    if np.linalg.det(axes) < 0:
        raise ParameterError("to_world", frame[:3, :3].tolist(), "axes that are not mirrored")
    if not np.allclose(frame[:3, :3].T @ frame[:3, :3], np.eye(3), rtol=0, atol=_RIGID_TOLERANCE):
        u, _, v = np.linalg.svd(axes)  # the nearest rotation
        frame[:3, :3] = u @ v
    return tuple((frame + 0.0).ravel().tolist())  # -0 becomes 0: equal cameras have equal text


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
