"""sharp.rmse_checker: a chrome ball over a checkered floor beside a pane of tinted glass, against Mitsuba.

The checks are a texture of the floor, 16 × 16 on 3 m; a pane of thin green glass stands between the ball and a white
wall. The environment is overcast, because the mirror image of a sun would outweigh the floor. Method `gather`, all
light, exact image of 640×480; errors as those of `relume_bench.sharp`, over the pixels of the ball. Mitsuba's path
tracer has the same texture and its own thin glass.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.assets.environments.environment import Environment
from relume.assets.environments.equirect import texel_directions
from relume.look import validate
from relume.output.render_image import render_image
from relume.scene.examples.cornell import rectangle
from relume.scene.examples.still_life.grids import sphere
from relume.scene.examples.still_life.still_life import look_at
from relume.scene.model import Glass, Material, Scene, Texture
from relume.scene.scene_folder import make_scene
from relume_bench import sharp
from relume_bench.figure import Figure, skipped
from relume_bench.indirect import PASSES
from relume_bench.mitsuba import bsdf, cached_passes, dielectric, missing

_NAME, _SPP = "sharp.rmse_checker", 64
_CHECKS, _TEXELS = 16, 16  # along each side of the floor; of a check
_LIGHT_CHECK, _DARK_CHECK = (0.75, 0.72, 0.66), (0.06, 0.07, 0.10)
_CHROME = ({"model": "ggx", "color": [1.0] * 3, "params": {"roughness": 0.05, "f0": [0.55, 0.556, 0.554]}},)
_CLEAR = ({"model": "ggx", "color": [1.0] * 3, "params": {"roughness": 0.03, "f0": [0.04] * 3}},)


def measure(tiny: bool) -> list[Figure]:
    """A bake and a render."""
    if (why := missing()) is not None:
        return skipped((_NAME,), sharp.UNIT, why)
    scene, sizes, spp = checkered_scene(), sharp.Sizes.choose(tiny), 2 if tiny else _SPP
    with tempfile.TemporaryDirectory() as folder:
        transfer = sharp.bake_and_open(scene, tiny, Path(folder))
        image = render_image(transfer, sharp.VIEW, validate({}, transfer.default_look))
        is_ball = transfer.views[sharp.VIEW].material_ids() == transfer.material_names.index("Chrome")
    context = {"size": list(sizes.size), "lights": sizes.lights, "spp": PASSES * spp}
    passes = mitsuba_passes(scene, sizes.size, spp)
    return [sharp.compare_images(_NAME, image, passes, np.asarray(is_ball), context, "inside")]


def mitsuba_passes(scene: Scene, size: tuple[int, int], spp: int) -> NDArray[np.float32]:
    """Mitsuba's independent images. (passes, height, width, 3)

    Args:
        scene: from `checkered_scene`. size: width and height, pixels. spp: paths a pixel of each.
    """
    bsdfs = [_describe_material(scene.materials[mesh.material]) for mesh in scene.meshes]
    job = {**sharp.make_job(bsdfs), "spp": [spp]}
    return cached_passes(scene, size, job, {"checks": scene.materials[0].textures["diffuse"].pixels})


def _describe_material(material: Material) -> dict[str, Any]:
    if material.glass is not None:
        return dict(dielectric(material.glass))
    checks = {"albedo": {"array": "checks"}} if material.textures else {}
    return bsdf(tuple({**term, "texture": None} for term in material.terms)) | checks


def checkered_scene() -> Scene:
    """The scene of this benchmark; the floor is its first material."""
    floor = {"model": "lambert", "color": [1.0] * 3, "texture": "diffuse"}
    materials = [
        Material("Floor", (floor,), textures={"diffuse": Texture(_checks())}),
        Material("Wall", ({"model": "lambert", "color": [0.7, 0.7, 0.68]},)),
        Material("Chrome", _CHROME),
        Material("Glass", _CLEAR, glass=Glass((0.35, 0.85, 0.45))),
    ]
    meshes = [
        rectangle((-1.5, 0, 1.5), (3, 0, 0), (0, 0, -3)).mesh("Floor", 0),
        rectangle((-1.5, 0, -1.5), (3, 0, 0), (0, 1.2, 0)).mesh("Wall", 1),
        sphere(0.4, 128).transform(np.eye(3), [-0.2, 0.401, 0.0]).mesh("Chrome", 2),
        rectangle((0.45, 0.01, 0.6), (0, 0, -1.0), (0, 0.8, 0)).mesh("Glass", 3),
    ]
    camera = look_at(sharp.VIEW, (-0.3, 0.9, 2.6), (0.0, 0.4, 0.0), float(np.radians(34.0)))
    return make_scene("checkered floor", meshes, materials, [camera], _overcast_environment())


def _overcast_environment() -> Environment:
    """Three times as bright at the zenith as at the horizon, as the CIE's; dim below it."""
    height = texel_directions(128, 256)[..., 1:2]
    radiance = np.where(height > 0, 0.4 * (1 + 2 * height), 0.1) * [0.9, 0.97, 1.0]
    return Environment("overcast", radiance.astype(np.float32))


def _checks() -> NDArray[np.float32]:
    """The checks as a texture. (height, width, 3)"""
    check = np.arange(_CHECKS * _TEXELS) // _TEXELS
    is_light = (check[:, None] + check) % 2 == 0
    return np.where(is_light[..., None], _LIGHT_CHECK, _DARK_CHECK).astype(np.float32)
