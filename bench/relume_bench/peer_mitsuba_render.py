"""Render a scene with Mitsuba 3 at increasing sample counts, in its own environment, without relume.

python -I peer_mitsuba_render.py FOLDER     reads scene.npz and job.json there, writes result.json, and picture.npy
                                            or passes.npy (independent images, as many as in the job)
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

mi: Any = __import__("mitsuba")
mi.set_variant("llvm_ad_rgb")
sys.path.append(str(Path(__file__).parent))  # the interpreter is isolated
plugins: Any = __import__("peer_mitsuba_plugins")
__import__("peer_mitsuba_gltf")

_CROP = ("crop_offset_x", "crop_offset_y", "crop_width", "crop_height")


def resolve_description(arrays: Any, value: Any) -> Any:
    """Resolve the images of a description.

    Args:
        arrays: arrays of scene.npz.
        value: {"array": name} becomes a texture of that array, (height, width, 1 or 3), with raw values; optional
            "wrap_mode" and "filter_type".
    """
    if isinstance(value, dict) and "array" in value:
        plain_entries = {key: entry for key, entry in value.items() if key != "array"}
        return {"type": "bitmap", "bitmap": mi.Bitmap(arrays[value["array"]]), "raw": True, **plain_entries}
    if isinstance(value, dict) and value.get("type") != "rgb":
        return {key: resolve_description(arrays, entry) for key, entry in value.items()}
    return mi.ScalarVector3f(value) if isinstance(value, list) else value


def mesh(arrays: Any, k: int, bsdf: dict[str, Any]) -> Any:
    """Create one mesh of the scene.

    Args:
        arrays: arrays of scene.npz. k: index of the mesh; "NAME_of_k" in the arrays are attributes of its vertices.
        bsdf: its material, as from `relume_bench.mitsuba.bsdf`; "interior" is the medium inside, "emitter" its
            emission. Without dielectric and "sides" it is made two-sided.
    """
    props = mi.Properties()
    attached = {
        key: mi.load_dict(resolve_description(arrays, bsdf[key])) for key in ("interior", "emitter") if key in bsdf
    }
    bsdf_entries = {
        key: resolve_description(arrays, value)
        for key, value in bsdf.items()
        if key not in ("interior", "emitter", "sides")
    }
    has_sides = "dielectric" in bsdf_entries["type"] or "sides" in bsdf
    props["mesh_bsdf"] = mi.load_dict(bsdf_entries if has_sides else {"type": "twosided", "front": bsdf_entries})
    for key, value in attached.items():
        props[key] = value
    positions, faces = arrays[f"positions_{k}"], arrays[f"faces_{k}"]
    vertex_flags = {"has_vertex_normals": True, "has_vertex_texcoords": True}
    shape = mi.Mesh(f"mesh_{k}", len(positions), len(faces), **vertex_flags, props=props)
    for name in (name for name in arrays if name.endswith(f"_of_{k}")):
        values = arrays[name]
        shape.add_attribute(f"vertex_{name.removesuffix(f'_of_{k}')}", values.shape[1], values.ravel())
    params = mi.traverse(shape)
    params["vertex_texcoords"] = arrays[f"uvs_{k}"].ravel()
    params["vertex_positions"], params["vertex_normals"] = positions.ravel(), arrays[f"normals_{k}"].ravel()
    params["faces"] = faces.ravel()
    params.update()
    return shape


def load(folder: Path, job: dict[str, Any], bsdfs: list[dict[str, Any]]) -> Any:
    """Load the scene with a BSDF for each mesh.

    Our cameras look along -Z with +X to the right, Mitsuba's along +Z with +X to the left; our maps have +X in the
    center, Mitsuba's +Z.

    Args:
        folder: folder of scene.npz.
        job: content of job.json: size, "crop", sampler, emitters, integrator, by default of direct light; "yfov",
            "lens" with the parameters of a thin lens, and names of the arrays of the "camera" and the "environment",
            by default those.
        bsdfs: descriptions, one per mesh.
    """
    arrays = np.load(folder / "scene.npz", allow_pickle=False)
    transform = mi.ScalarTransform4f
    sensor = {
        "type": "thinlens" if "lens" in job else "perspective",
        **job.get("lens", {}),
        "fov": float(np.degrees(job["yfov"])),
        "fov_axis": "y",
        "to_world": transform((arrays[job.get("camera", "camera")] @ np.diag([-1.0, 1.0, -1.0, 1.0])).tolist()),
        "film": {
            "type": "hdrfilm", "width": job["size"][0], "height": job["size"][1],
            "rfilter": {"type": "box"}, "pixel_format": "rgb", "component_format": "float32",
            **dict(zip(_CROP, job.get("crop", ()), strict=False)),
        },
        "sampler": {"type": job.get("sampler", "independent")},
    }  # fmt: skip
    environment = {
        "type": "envmap",
        "bitmap": mi.Bitmap(arrays[job.get("environment", "environment")]),
        "to_world": transform().rotate([0, 1, 0], 90),
    }
    integrator = job.get("integrator", {"type": "direct"})
    scene = {"type": "scene", "integrator": integrator, "sensor": sensor, "light": environment}
    for k, emitter in enumerate(job.get("emitters", [])):
        placed = {key: transform(np.reshape(emitter[key], (4, 4)).tolist()) for key in ("to_world",) if key in emitter}
        scene[f"emitter_{k}"] = {**emitter, **placed}
    for k, bsdf in enumerate(bsdfs):
        scene[f"shape_{k}"] = mesh(arrays, k, bsdf)
    return mi.load_dict(scene)


def renderer(folder: Path, job: dict[str, Any]) -> Callable[[int, int], Any]:
    """Return a function that renders an image from a sample count and a seed, `job["most"]` samples at once.

    Direct light; or with "bounces" in the job, indirect light alone with at most so many bounces. "bsdfs" are for the
    surfaces on the path, "seen" for those at the first hit.
    """
    scene, max_spp = load(folder, job, job["bsdfs"]), job["most"]
    is_direct = "bounces" not in job
    integrator = None if is_direct else plugins.Indirect(load(folder, job, job["seen"]), job["bounces"])

    def render(spp: int, seed: int) -> Any:
        total: Any = 0.0
        passes = max(1, spp // max_spp)
        for k in range(passes):
            picture = mi.render(scene, integrator=integrator, spp=min(spp, max_spp), seed=seed * 10_000 + k)
            total = total + np.array(picture)
        return total / passes

    return render


def steps(render: Callable[[int, int], Any], job: dict[str, Any], folder: Path) -> None:
    """Render two images with different seeds at each count: their difference is √2 times the error of one.

    Args:
        render: from a sample count and a seed.
        job: with increasing counts "spp"; "most" of them are rendered at once.
        folder: for picture.npy, of the last count, and result.json.
    """
    render(job["spp"][0], 99)  # compiles
    step_results = []
    for spp in job["spp"]:
        if spp >= job["most"]:
            render(job["most"], 98)  # warm up each wavefront size
        start_time = time.perf_counter()
        first_image, second_image = (render(spp, seed) for seed in (1, 2))
        taken_s = (time.perf_counter() - start_time) / 2
        picture = (first_image + second_image) / 2
        scale = np.sqrt(np.mean(picture[..., :3] ** 2))
        error = np.sqrt(np.mean((first_image - second_image) ** 2) / 2) / scale
        step_results.append({"spp": spp, "seconds": taken_s, "error": float(error)})
    np.save(folder / "picture.npy", np.ascontiguousarray(picture[..., :3], np.float32))
    (folder / "result.json").write_text(json.dumps({"steps": step_results, "version": mi.__version__}))


def passes(job: dict[str, Any], folder: Path) -> None:
    """Render independent images.

    Args:
        job: its first "spp" is the count, and "passes" the number of images; "shots" are changes of the job, such as
            another camera, each with its own images. With "noise" and "rounds" the images are means of as many rounds
            as make the relative noise of the mean image so small, and of so many at most.
        folder: for passes.npy, (passes, height, width, 3), with "shots" (shots, passes, height, width, 3), and
            result.json.
    """
    pictures = [_quiet_passes({**job, **shot}, folder) for shot in job.get("shots", [{}])]
    np.save(folder / "passes.npy", np.array(pictures if "shots" in job else pictures[0], np.float32))
    (folder / "result.json").write_text(json.dumps({"version": mi.__version__}))


def _quiet_passes(job: dict[str, Any], folder: Path) -> Any:
    """Independent images of a job. (passes, height, width, 3)"""
    render, num = renderer(folder, job), job["passes"]
    total: Any = 0.0
    for step in range(job.get("rounds", 1)):
        total = total + np.array([render(job["spp"][0], num * step + k)[..., :3] for k in range(num)], np.float64)
        mean = total.mean(axis=0)
        noise = np.sqrt(((total - mean) ** 2).mean() / (num - 1) / (mean**2).mean())
        if noise <= job.get("noise", 0):
            break
    return total / (step + 1)


def main(folder: Path) -> None:
    """Render the job of job.json."""
    job = json.loads((folder / "job.json").read_text())
    if "passes" in job:
        passes(job, folder)
    else:
        steps(renderer(folder, job), job, folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
