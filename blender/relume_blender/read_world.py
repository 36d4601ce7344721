"""The world of a Blender scene as an equirectangular map, rendered by Cycles with all its nodes.

Its directions are those of relume's maps: the middle is +X, up is up.
"""

from __future__ import annotations

import hashlib
import math
from pathlib import Path
from typing import Any, NamedTuple

import bpy
import numpy as np
from numpy.typing import NDArray

_SIZES = 1024, 4096  # pixels: of procedural worlds, and of the largest map
_UNIFORM_WIDTH = 64
_NO_CYCLES = "The world could not be rendered: switch the add-on Cycles Render Engine on."


class WorldMap(NamedTuple):
    """A written map.

    Attributes:
        key: hash of its pixels; Cycles writes times into its files, so that those of equal worlds differ.
        intensity: 0 for a black world, whose map is white because the server rejects a black one; else 1.
        omitted: sentences about what is left out.
    """

    key: str
    intensity: float
    omitted: tuple[str, ...]


def write_world(context: Any, path: Path) -> WorldMap:
    """Write the world of the scene as .exr.

    Raises:
        RuntimeError: Cycles is switched off or cannot render.
    """
    world = context.scene.world
    scene = bpy.data.scenes.new("relume world")
    camera = bpy.data.cameras.new("relume world")
    holder = bpy.data.objects.new("relume world", camera)
    try:
        scene.world = world
        _look_along_x(scene, camera, holder)
        _set_render(scene, _width(world), path)
        bpy.ops.render.render(scene=scene.name, write_still=True)
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.objects.remove(holder)
        bpy.data.cameras.remove(camera)
    if not path.is_file():
        raise RuntimeError(_NO_CYCLES)
    has_volume = world is not None and any(
        node.type == "OUTPUT_WORLD" and node.inputs["Volume"].is_linked for node in _nodes(world)
    )
    pixels = _read_pixels(path)
    is_black = not pixels.any()
    if is_black:
        _write_white(path)
    omitted = ("The volume of the world is left out.",) if has_volume else ()
    return WorldMap(hashlib.sha256(pixels.tobytes()).hexdigest(), 0.0 if is_black else 1.0, omitted)


def _read_pixels(path: Path) -> NDArray[np.float32]:
    image = bpy.data.images.load(str(path), check_existing=False)
    try:
        pixels = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
        return np.ascontiguousarray(pixels.reshape(-1, image.channels)[:, :3])
    finally:
        bpy.data.images.remove(image)


def _write_white(path: Path) -> None:
    image = bpy.data.images.new("relume world", _UNIFORM_WIDTH, _UNIFORM_WIDTH // 2, float_buffer=True)
    try:
        image.pixels.foreach_set(np.ones(len(image.pixels), np.float32))
        image.file_format, image.filepath_raw = "OPEN_EXR", str(path)
        image.save()
    finally:
        bpy.data.images.remove(image)


def _look_along_x(scene: Any, camera: Any, holder: Any) -> None:
    camera.type = "PANO"
    panorama = camera if hasattr(camera, "panorama_type") else camera.cycles  # a property of Cycles before Blender 5
    panorama.panorama_type = "EQUIRECTANGULAR"
    holder.rotation_euler = (math.pi / 2, 0.0, -math.pi / 2)
    scene.collection.objects.link(holder)
    scene.camera = holder


def _set_render(scene: Any, width: int, path: Path) -> None:
    render = scene.render
    try:
        render.engine = "CYCLES"
    except TypeError:  # one of its add-ons
        raise RuntimeError(_NO_CYCLES) from None
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, width // 2, 100
    render.filepath, render.use_file_extension, render.film_transparent = str(path), False, False
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_mode, render.image_settings.color_depth = "RGB", "32"
    render.use_compositing = render.use_sequencer = False
    cycles = scene.cycles
    cycles.samples, cycles.use_denoising, cycles.use_adaptive_sampling, cycles.device = 1, False, False, "CPU"
    cycles.pixel_filter_type, cycles.filter_width, cycles.film_exposure = "BLACKMAN_HARRIS", 0.01, 1.0


def _width(world: Any) -> int:
    """Width of the map: of the largest image of the world."""
    if world is None or not any(node.type.startswith("TEX") for node in _nodes(world)):
        return _UNIFORM_WIDTH
    widths = [int(node.image.size[0]) for node in _nodes(world) if node.type == "TEX_ENVIRONMENT" and node.image]
    return min(max([_SIZES[0], *widths]), _SIZES[1])


def _nodes(world: Any) -> list[Any]:
    return [] if world.node_tree is None else [*world.node_tree.nodes]
