"""sharp.rmse_room: polished shapes in a room with a sun, against Mitsuba.

A chrome ball, a brass cylinder and a lacquered block in a diffuse room, open toward the camera, lit by an environment
through that opening and by its sun through a window. They reflect the sunlit floor and are in shadow themselves: the
sun's mirror image would outweigh all other pixels, and its caustics would be noise in Mitsuba's. Method `gather`, all
light, exact image of 640×480; errors as those of `relume_bench.sharp`, over the pixels of the three shapes, because the
sunlit floor would outweigh them.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from relume.look import validate
from relume.output.render_image import render_image
from relume.scene.examples.cornell import block, rectangle, sunny_environment
from relume.scene.examples.still_life.grids import GridSurface, merge_surfaces, revolve, rotation_y, sphere
from relume.scene.examples.still_life.still_life import look_at
from relume.scene.model import Material, Scene
from relume.scene.scene_folder import make_scene
from relume_bench import sharp
from relume_bench.figure import Figure, skipped
from relume_bench.indirect import PASSES
from relume_bench.mitsuba import bsdf, cached_passes, missing

_NAME, _SPP = "sharp.rmse_room", 16
_SUN = np.array([-0.8, 0.6, -0.1])
_WALLS = {
    "Floor": (0.45, 0.40, 0.34), "Ceiling": (0.75, 0.75, 0.72), "Back": (0.62, 0.60, 0.56), "Left": (0.60, 0.34, 0.26),
    "Right": (0.28, 0.42, 0.55),
}  # fmt: skip
_POLISHED = ("Chrome", "Brass", "Lacquer")


def measure(tiny: bool) -> list[Figure]:
    """A bake and a render."""
    if (why := missing()) is not None:
        return skipped((_NAME,), sharp.UNIT, why)
    scene, sizes, spp = polished_room(), sharp.Sizes.choose(tiny), 2 if tiny else _SPP
    with tempfile.TemporaryDirectory() as folder:
        transfer = sharp.bake_and_open(scene, tiny, Path(folder))
        image = render_image(transfer, sharp.VIEW, validate({}, transfer.default_look))
        indices = [transfer.material_names.index(name) for name in _POLISHED]
        is_polished = np.isin(transfer.views[sharp.VIEW].material_ids(), indices)
    job = sharp.make_job([bsdf(scene.materials[mesh.material].terms) for mesh in scene.meshes])
    passes = cached_passes(scene, sizes.size, {**job, "spp": [spp]})
    context = {"size": list(sizes.size), "lights": sizes.lights, "spp": PASSES * spp}
    return [sharp.compare_images(_NAME, image, passes, is_polished, context, "inside")]


def polished_room() -> Scene:
    """The scene of this benchmark: x = −1.2 to 1.2, y = 0 to 2, z = −1.2 to 1.2, a window on the left."""
    objects = {
        "Floor": rectangle((-1.2, 0, 1.2), (2.4, 0, 0), (0, 0, -2.4)),
        "Ceiling": rectangle((-1.2, 2, -1.2), (2.4, 0, 0), (0, 0, 2.4)),
        "Back": rectangle((-1.2, 0, -1.2), (2.4, 0, 0), (0, 2, 0)),
        "Left": _make_left_wall(),
        "Right": rectangle((1.2, 0, -1.2), (0, 0, 2.4), (0, 2, 0)),
        "Chrome": sphere(0.36, 96).transform(np.eye(3), [-0.5, 0.36, 0.55]),
        "Brass": _make_cylinder(0.17, 0.8).transform(np.eye(3), [0.75, 0, 0.6]),
        "Lacquer": block(0.2, 0.3, 0.2).transform(rotation_y(28), [0.12, 0, 0.7]),
    }
    materials = [Material(name, _make_terms(name)) for name in objects]
    meshes = [surface.mesh(name, k) for k, (name, surface) in enumerate(objects.items())]
    camera = look_at(sharp.VIEW, (0.3, 0.95, 3.2), (0.1, 0.48, 0.4), float(np.radians(34.0)))
    return make_scene("polished room", meshes, materials, [camera], sunny_environment(_SUN))


def _make_terms(name: str) -> tuple[dict[str, Any], ...]:
    def gloss(roughness: float, f0: list[float]) -> dict[str, Any]:
        return {"model": "ggx", "color": [1.0] * 3, "params": {"roughness": roughness, "f0": f0}}

    if name in _WALLS:
        return ({"model": "lambert", "color": list(_WALLS[name])},)
    if name == "Lacquer":
        return {"model": "lambert", "color": [0.35, 0.03, 0.02]}, gloss(0.05, [0.04] * 3)
    return (gloss(0.05, [0.55, 0.556, 0.554]) if name == "Chrome" else gloss(0.15, [0.91, 0.78, 0.42]),)


def _make_left_wall() -> GridSurface:
    """Strips below, above, behind and in front of the window, y = 0.6 to 1.7, z = −0.95 to −0.05."""
    strips = [((0, -1.2), (0.6, 1.2)), ((1.7, -1.2), (2, 1.2)), ((0.6, -1.2), (1.7, -0.95)), ((0.6, -0.05), (1.7, 1.2))]
    return merge_surfaces([rectangle((-1.2, y, w), (0, 0, z - w), (0, v - y, 0)) for (y, z), (v, w) in strips])


def _make_cylinder(radius: float, height: float) -> GridSurface:
    """A closed cylinder on y = 0 around the y axis, without its invisible bottom."""
    profile = [(0, height, 0, 1), (radius, height, 0, 1), (radius, height, 1, 0), (radius, 0, 1, 0)]
    return revolve(np.array(profile, float), 192)
