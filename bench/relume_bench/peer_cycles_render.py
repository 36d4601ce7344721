"""Render a scene with Blender's Cycles at increasing sample counts, in its own environment, without relume.

python -I peer_cycles_render.py FOLDER     reads cycles.npz and cycles.json there, writes cycles_result.json and
                                           picture.npy
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

bpy: Any = __import__("bpy")
Matrix: Any = __import__("mathutils").Matrix

Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # from Y up


def material(index: int, colors: dict[str, Any]) -> Any:
    """A mixture of diffuse and glossy."""
    node_material = bpy.data.materials.new(f"material {index}")
    tree = node_material.node_tree
    tree.nodes.clear()
    diffuse, output = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = (*colors["diffuse"], 1)
    surface = diffuse.outputs[0]
    if any(colors["glossy"]):
        glossy, total = (tree.nodes.new(f"ShaderNode{name}") for name in ("BsdfAnisotropic", "AddShader"))
        glossy.distribution = "BECKMANN"
        glossy.inputs["Color"].default_value = (*colors["glossy"], 1)
        glossy.inputs["Roughness"].default_value = colors["roughness"]
        tree.gather_hits.new(surface, total.inputs[0])
        tree.gather_hits.new(glossy.outputs[0], total.inputs[1])
        surface = total.outputs[0]
    tree.gather_hits.new(surface, output.inputs["Surface"])
    return node_material


def environment(radiance: Any) -> None:
    """The environment. Both maps have +X in the center, our +Z is Blender's −Y; Blender's rows go upward."""
    height, width = radiance.shape[:2]
    image = bpy.data.images.new("sky", width, height, float_buffer=True, is_data=True)
    opaque = np.concatenate([radiance[::-1], np.ones((height, width, 1))], axis=2)
    image.pixels.foreach_set(opaque.astype(np.float32).ravel())
    world = bpy.data.worlds.new("world")
    tree = world.node_tree
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    tree.gather_hits.new(texture.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    bpy.context.scene.world = world


def load(folder: Path, job: dict[str, Any]) -> None:
    """Load the scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    arrays, scene = np.load(folder / "cycles.npz", allow_pickle=False), bpy.context.scene
    for k, colors in enumerate(job["materials"]):
        mesh = bpy.data.meshes.new(f"mesh {k}")
        mesh.from_pydata((arrays[f"positions_{k}"] @ Z_UP[:3, :3].T).tolist(), [], arrays[f"faces_{k}"].tolist())
        mesh.materials.append(material(k, colors))
        scene.collection.objects.link(bpy.data.objects.new(f"object {k}", mesh))
    environment(arrays["environment"])
    lens = bpy.data.cameras.new("camera")
    lens.sensor_fit, lens.angle = "VERTICAL", job["yfov"]
    camera = bpy.data.objects.new("camera", lens)
    camera.matrix_world = Matrix((Z_UP @ arrays["camera"]).tolist())
    scene.collection.objects.link(camera)
    scene.camera = camera
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y = job["size"]
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    cycles.device, cycles.use_adaptive_sampling, cycles.use_denoising = "CPU", False, False
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = job["bounces"]
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0
    cycles.pixel_filter_type = "BOX"


def render(folder: Path, spp: int, seed: int) -> tuple[Any, float]:
    """Render the loaded scene.

    Args:
        folder: for the image file.
        spp: samples per pixel. seed: seed of the samples.
    Returns:
        The image, (height, width, 3) float64, and its seconds.
    """
    scene = bpy.context.scene
    scene.cycles.samples, scene.cycles.seed = spp, seed
    scene.render.filepath = str(folder / "cycles.exr")
    start_time = time.perf_counter()
    bpy.ops.render.render(write_still=True)
    taken_s = time.perf_counter() - start_time
    image = bpy.data.images.load(scene.render.filepath)
    pixels = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(pixels)
    picture = pixels.reshape(image.size[1], image.size[0], 4)[::-1, :, :3].astype(np.float64)
    bpy.data.images.remove(image)
    return picture, taken_s


def main(folder: Path) -> None:
    """Render the job of cycles.json, and write cycles_result.json and picture.npy."""
    job = json.loads((folder / "cycles.json").read_text())
    load(folder, job)
    step_results = []
    render(folder, 1, 99)  # loads kernels
    for spp in job["spp"]:
        (first_image, first_s), (second_image, second_s) = (render(folder, spp, seed) for seed in (1, 2))
        noise = float(np.sqrt(np.mean((first_image - second_image) ** 2) / 2))
        step_results.append({"spp": spp, "seconds": (first_s + second_s) / 2, "noise": noise})
    np.save(folder / "picture.npy", ((first_image + second_image) / 2).astype(np.float32))
    (folder / "cycles_result.json").write_text(json.dumps({"steps": step_results, "version": bpy.app.version_string}))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
