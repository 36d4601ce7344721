"""glass.rmse, glass.rmse_frosted: scenes with glass against Mitsuba's full path tracer with its own dielectrics.

A gray floor with a clear ball, an absorbing ball and a green pane in front of a red ball, under an environment with a
sun, all paths. Mitsuba's volpath refracts light paths as well: caustics and internal reflections are part of the error.
Regions of the image are in the context: the floor in front of the glass, the pane, the balls.

Frosted: a ball of glass and a slab before the red ball, with GGX facets, in uniform light, in the pixels that show
them.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relume.assets.environments.environment import Environment
from relume.core.cache import Cache
from relume.live.opened.openers import open_transfer
from relume.look import validate
from relume.output.render_image import render_image
from relume.scene.examples.cornell import rectangle, sunny_environment
from relume.scene.examples.still_life.grids import sphere
from relume.scene.examples.still_life.still_life import look_at
from relume.scene.model import Glass, Material, Scene
from relume.scene.scene_folder import make_scene
from relume.store.bake_protocol import Recipe
from relume_bench.figure import Figure, skipped
from relume_bench.gather import bake
from relume_bench.indirect import PASSES
from relume_bench.mitsuba import averaged, bsdf, dielectric, missing, read_passes, render
from relume_bench.standard_error import NoiseCorrectedError, compare_with_passes

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_NAME, _FROSTED_NAME, _UNIT = "glass.rmse", "glass.rmse_frosted", "relative RMSE"
_FROST = 0.4  # roughness
_FROSTED_REGIONS = {"slab": (0.44, 0.66, 0.32, 0.6), "ball": (0.12, 0.3, 0.38, 0.6)}
_SIZE, _FINER, _SPP = (400, 300), 2, 128
_DEPTH = 24
_ABSORBED = (0.3, 1.5, 4.0)
_IMAGE_REGIONS = {
    "floor": (0.0, 1.0, 0.8, 1.0), "pane": (0.41, 0.64, 0.3, 0.7), "clear": (0.1, 0.32, 0.35, 0.62),
    "absorbing": (0.73, 0.9, 0.43, 0.66),
}  # fmt: skip


def measure(tiny: bool) -> list[Figure]:
    """A bake and a render."""
    if (why := missing()) is not None:
        return skipped((_NAME, _FROSTED_NAME), _UNIT, why)
    size, spp = ((40, 30), 2) if tiny else (_SIZE, _SPP)
    scene = glass_scene()
    with tempfile.TemporaryDirectory() as folder:
        rendered, reference_passes = (
            _render_relume(scene, size, tiny, Path(folder)),
            _render_mitsuba(scene, size, spp, Path(folder)),
        )
    comparison = compare_with_passes(rendered, reference_passes)
    region_summaries = {
        name: _compare_region(rendered, reference_passes, *bounds).summary for name, bounds in _IMAGE_REGIONS.items()
    }
    details = {**comparison.context, "size": list(size), "spp": PASSES * spp, **region_summaries}
    clear = Figure(_NAME, comparison.error.value, _UNIT, details, comparison.error.standard_error)
    return [clear, _measure_frosted(tiny, size, spp)]


def _measure_frosted(tiny: bool, size: tuple[int, int], spp: int) -> Figure:
    """Compare the pixels of frosted glass."""
    scene = frosted_scene()
    with tempfile.TemporaryDirectory() as folder:
        rendered = _render_relume(scene, size, tiny, Path(folder))
        reference_passes = _render_mitsuba(scene, size, spp, Path(folder))
    slab, ball = (_compare_region(rendered, reference_passes, *bounds) for bounds in _FROSTED_REGIONS.values())
    details = {"size": list(size), "spp": PASSES * spp, "ball": ball.summary, **slab.context}
    return Figure(_FROSTED_NAME, slab.error.value, _UNIT, details, slab.error.standard_error)


def _compare_region(
    rendered: F64, reference_passes: F32, left: float, right: float, top: float, bottom: float
) -> NoiseCorrectedError:
    """Compare a region of the image, given in fractions of width and height."""
    height, width, _ = rendered.shape
    rows, columns = slice(int(top * height), int(bottom * height)), slice(int(left * width), int(right * width))
    return compare_with_passes(rendered[rows, columns], reference_passes[:, rows, columns])


def glass_scene() -> Scene:
    """The scene of this benchmark."""
    clear = {"model": "ggx", "color": [1.0, 1.0, 1.0], "params": {"roughness": 0.03, "f0": [0.04, 0.04, 0.04]}}
    materials = [
        Material("Floor", ({"model": "lambert", "color": [0.6, 0.6, 0.6]},)),
        Material("Clear", (clear,), glass=Glass(thickness=0.9)),
        Material("Pane", (clear,), glass=Glass((0.4, 0.9, 0.5))),
        Material("Absorbing", (clear,), glass=Glass(thickness=0.7, absorbed=_ABSORBED)),
        Material("Red", ({"model": "lambert", "color": [0.8, 0.1, 0.1]},)),
    ]
    rotation = np.eye(3)
    meshes = [
        rectangle([-2, 0, 2], [4, 0, 0], [0, 0, -4]).mesh("floor", 0),
        sphere(0.45, 48).transform(rotation, [-0.9, 0.46, 0.2]).mesh("clear", 1),
        rectangle([-0.3, 0.01, 0.5], [0.8, 0, 0], [0, 1, 0]).mesh("pane", 2),
        sphere(0.35, 48).transform(rotation, [1.0, 0.36, 0.2]).mesh("absorbing", 3),
        sphere(0.35, 48).transform(rotation, [0.1, 0.36, -0.3]).mesh("red", 4),
    ]
    camera = look_at("front", (0.3, 1.1, 3.4), (0.0, 0.4, 0.0), 0.7)
    return make_scene("glass", meshes, materials, [camera], sunny_environment())


def frosted_scene() -> Scene:
    """A red ball behind a slab of frosted glass, and a frosted ball, in uniform light."""
    clear = {"model": "ggx", "color": [1.0, 1.0, 1.0], "params": {"roughness": _FROST, "f0": [0.04, 0.04, 0.04]}}
    glass = Glass(thickness=0.05, roughness=_FROST)
    materials = [
        Material("Floor", ({"model": "lambert", "color": [0.6, 0.6, 0.6]},)),
        Material("Frosted", (clear,), glass=glass),
        Material("Red", ({"model": "lambert", "color": [0.8, 0.1, 0.1]},)),
    ]
    left, bottom, width, height, front, depth = -0.3, 0.01, 1.2, 1.0, 0.5, 0.05
    meshes = [
        rectangle([-2, 0, 2], [4, 0, 0], [0, 0, -4]).mesh("floor", 0),
        sphere(0.45, 48).transform(np.eye(3), [-0.9, 0.46, 0.2]).mesh("ball", 1),
        rectangle([left, bottom, front], [width, 0, 0], [0, height, 0]).mesh("front", 1),
        rectangle([left, bottom, front - depth], [0, height, 0], [width, 0, 0]).mesh("back", 1),
        sphere(0.35, 48).transform(np.eye(3), [0.3, 0.36, -0.3]).mesh("red", 2),
    ]
    camera = look_at("front", (0.3, 1.1, 3.4), (0.0, 0.4, 0.0), 0.7)
    environment = Environment("uniform", np.ones((16, 32, 3), np.float32))
    return make_scene("frosted", meshes, materials, [camera], environment)


def _render_relume(scene: Scene, size: tuple[int, int], tiny: bool, folder: Path) -> F64:
    width, height = size
    recipe = Recipe("gather", ("front",), (_FINER * width, _FINER * height), 60 if tiny else 2000)
    transfer = open_transfer(bake(scene, recipe, folder / "gather.zarr").path, Cache(4 << 30))
    return averaged(render_image(transfer, "front", validate({}, transfer.default_look)), _FINER)


def _render_mitsuba(scene: Scene, size: tuple[int, int], spp: int, folder: Path) -> F32:
    materials = [scene.materials[mesh.material] for mesh in scene.meshes]
    bsdfs = [bsdf(m.terms) if m.glass is None else dielectric(m.glass) for m in materials]
    job = {"integrator": {"type": "volpath", "max_depth": _DEPTH}, "spp": [spp], "passes": PASSES, "bsdfs": bsdfs}
    render(scene, size, job, folder)
    return read_passes(folder)
