"""export.cryptomatte_error: mattes of the still life, read back by OpenImageIO and decoded as Cryptomatte's
specification says, against rays that are counted one by one.

The figure is the largest difference of a coverage from the fraction of the pixel's own rays. The context has the names
that differ, and the difference from 8 × 8 rays of each pixel, which is that of the sampling.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.look import default_look, validate
from relume.output.exr.aovs import POSITIONS, SAMPLES, AovTracer
from relume.output.exr.export import AovPass, export_exr
from relume.raytrace.camera_rays import camera_directions, trace_rays
from relume.scene.examples.still_life import demo_scene
from relume.scene.model import Camera
from relume_bench.figure import Figure

F64 = NDArray[np.float64]
_SIZE, _SIDE, _LAYER = (320, 240), 8, "CryptoObject"


def measure(tiny: bool) -> list[Figure]:
    """Write a file and read it."""
    scene = demo_scene()
    size, side = ((16, 12), 4) if tiny else (_SIZE, _SIDE)
    look = validate({}, default_look(scene.materials, scene.lights))
    tracer, camera = AovTracer.from_look(scene, look), scene.cameras[0]
    image = np.zeros((size[1], size[0], 3), np.float32)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.exr"
        export_exr(path, lambda *_: image, look, [], {}, aovs=AovPass(tracer, camera, size))
        coverage = read_coverage(path, _LAYER)
    names = [mesh.name for mesh in scene.meshes]
    own = _count(tracer, camera, size, POSITIONS)
    fine = _count(tracer, camera, size, _grid(side))
    errors = [np.abs(coverage[name] - own[k]).max() for k, name in enumerate(names)]
    sampling = np.array([coverage[name] - fine[k] for k, name in enumerate(names)])
    context = {
        "size": "{}×{}".format(*size),
        "names": len(names),
        "wrong_names": len(set(coverage) ^ set(names)),
        "rays_of_a_pixel": SAMPLES,
        "mean_difference_from_finer_rays": float(np.abs(sampling).mean()),
        "largest_difference_from_finer_rays": float(np.abs(sampling).max()),
    }
    return [Figure("export.cryptomatte_error", 100 * float(max(errors)), "%", context)]


def read_coverage(path: Path, layer: str) -> dict[str, Shaped[F64, "height width"]]:
    """Decode the coverage of each name in a layer's manifest."""
    buffer = OpenImageIO.ImageBuf(str(path))
    spec = buffer.spec()
    pixels = np.asarray(buffer.get_pixels(OpenImageIO.FLOAT))
    values = dict(zip(spec.channelnames, np.moveaxis(pixels, 2, 0), strict=True))
    attributes = {attribute.name: str(attribute.value) for attribute in spec.extra_attribs}
    prefix = next(k.removesuffix("name") for k, v in attributes.items() if k.startswith("cryptomatte/") and v == layer)
    ranks = [
        (values[f"{layer}{k:02d}.{channel}"], values[f"{layer}{k:02d}.{alpha}"])
        for k in range(3)
        for channel, alpha in ("RG", "BA")
    ]
    manifest: dict[str, Any] = json.loads(attributes[f"{prefix}manifest"])
    return {
        name: sum(
            (np.where(np.ascontiguousarray(ids).view(np.uint32) == int(text, 16), part, 0.0) for ids, part in ranks),
            np.zeros((spec.height, spec.width)),
        )
        for name, text in manifest.items()
    }


def _grid(side: int) -> Shaped[F64, "n 2"]:
    return (np.stack(np.divmod(np.arange(side * side), side), axis=1) + 0.5) / side


def _count(
    tracer: AovTracer, camera: Camera, size: tuple[int, int], positions: F64
) -> Shaped[F64, "names height width"]:
    """Fraction of the rays through some positions in each pixel that meet each mesh, counted position by position."""
    y, x = np.divmod(np.arange(size[0] * size[1]), size[0])
    origin = camera.to_world[:3, 3].astype(np.float32)
    counts = np.zeros((len(tracer.scene.meshes), len(x)))
    for offset_x, offset_y in positions:
        directions = camera_directions(
            camera, size, (x + offset_x).astype(np.float32), (y + offset_y).astype(np.float32)
        )
        face = trace_rays(tracer.geometry.embree, origin, directions).face
        hit = np.flatnonzero(face >= 0)
        counts[tracer.geometry.face_mesh[face[hit]], hit] += 1
    return counts.reshape(-1, size[1], size[0]) / len(positions)
