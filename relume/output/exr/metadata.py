"""Provenance of an exported image: camera, look, environment, units, scene, bake, version."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.look import Look
from relume.output.exr.color_space import REC_709_SPACE, ExportColorSpace
from relume.output.exr.layers import Layer
from relume.scene.model import Camera

F64 = NDArray[np.float64]

UNITS = "radiance in W/(sr m^2), {space}; lengths in m, right-handed, +Y up; angles in degrees"
_FLIP_Z = np.diag([1.0, 1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Provenance:
    """Source of an image.

    Attributes:
        scene, bake: ids.
        scene_name: scene name for users.
    """

    scene: str
    scene_name: str
    bake: str


def build_attributes(
    origin: Provenance,
    camera: Camera,
    size: tuple[int, int],
    look: Look,
    layers: Sequence[Layer],
    space: ExportColorSpace = REC_709_SPACE,
) -> dict[str, str | float | F64]:
    """Make the attributes of an OpenEXR file; those with a colon are relume's, and hold JSON or plain text.

    Args:
        origin: scene and bake of the image.
        camera: camera of the view.
        size: width and height, in pixels.
        look: the complete look.
        layers: layers of the file, besides the image itself; their contents are listed by name.
        space: color space of the values.
    """
    environment = look.environment.map
    camera_document = {"view": camera.name, "to_world": camera.to_world.ravel().tolist(), "yfov": camera.yfov}
    camera_document |= {"near": camera.near} if camera.near else {}
    return {
        "Software": f"relume {version('relume')}",
        "chromaticities": np.array(space.chromaticities),
        **({} if space.interop is None else {"oiio:ColorSpace": space.interop}),
        "worldToCamera": world_to_camera(camera),
        "worldToNDC": world_to_ndc(camera, size),
        "screenWindowWidth": 2 * float(np.tan(camera.yfov / 2)) * size[0] / size[1],
        "relume:camera": _json(camera_document),
        "relume:look": _json(look.model_dump(mode="json", exclude_unset=True)),  # only grounds may have a catcher
        "relume:environment": "of the scene" if environment is None else environment,
        **({} if space is REC_709_SPACE else {"relume:colorSpace": _json(space.name)}),
        "relume:units": UNITS.format(
            space="linear Rec. 709" if space is REC_709_SPACE else "linear as chromaticities say"
        ),
        "relume:scene": origin.scene,
        "relume:sceneName": _json(origin.scene_name),
        "relume:bake": origin.bake,
        "relume:layers": _json({layer.name: layer.source for layer in layers}),
    }


def world_to_camera(camera: Camera) -> Shaped[F64, "4 4"]:
    """Transform to OpenEXR's camera space, left-handed, x right, y up, z forward. Row vectors multiply on the left."""
    return np.asarray((_FLIP_Z @ np.linalg.inv(camera.to_world)).T)


def world_to_ndc(camera: Camera, size: tuple[int, int]) -> Shaped[F64, "4 4"]:
    """Projection to image space: after division (0, 0) is the upper left corner, (1, 1) the lower right corner.

    Row vectors multiply on the left.
    """
    half_height = np.tan(camera.yfov / 2)
    half_width = half_height * size[0] / size[1]
    project = np.array([[0.5 / half_width, 0, 0.5, 0], [0, -0.5 / half_height, 0.5, 0], [0, 0, 1.0, 0], [0, 0, 1.0, 0]])
    return np.asarray(world_to_camera(camera) @ project.T)


def _json(value: Mapping[str, Any] | str) -> str:
    """Encode JSON in ASCII, because readers differ in text encodings."""
    return json.dumps(value, separators=(",", ":"))
