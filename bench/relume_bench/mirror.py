"""mirror.rmse, mirror.sharp_rmse: a room with mirrors against Mitsuba's full path tracer with its own conductors.

A corner of two colored walls with a chrome ball, a brass ball and a clay ball on a polished table, under a hazy sun in
an environment, all paths. `mirror.sharp_rmse` is over the pixels of the two metal balls.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.live.opened.openers import open_transfer
from relume.look import validate
from relume.output.render_image import render_image
from relume.scene.examples.cornell import rectangle, sunny_environment
from relume.scene.examples.still_life.grids import sphere
from relume.scene.examples.still_life.still_life import look_at
from relume.scene.model import Material, Scene
from relume.scene.scene_folder import make_scene
from relume.store.bake_protocol import Recipe
from relume_bench.figure import Figure, skipped
from relume_bench.gather import bake
from relume_bench.indirect import PASSES
from relume_bench.mitsuba import averaged, missing, read_passes, render
from relume_bench.standard_error import compare_pixels

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_NAMES, _UNIT = ("mirror.rmse", "mirror.sharp_rmse"), "relative RMSE"
_SIZE, _FINER, _SPP, _LIGHTS = (400, 300), 2, 128, 2000
_DEPTH = 24
_DIFFUSE = {"Table": (0.3, 0.15, 0.08), "Left": (0.6, 0.2, 0.15), "Back": (0.5, 0.5, 0.45), "Clay": (0.2, 0.4, 0.6)}
_MIRRORS = {"Chrome": (0.6, 0.6, 0.62), "Brass": (0.9, 0.65, 0.3), "Table": (0.1, 0.1, 0.1)}


def measure(tiny: bool) -> list[Figure]:
    """A bake and a render."""
    if (why := missing()) is not None:
        return skipped(_NAMES, _UNIT, why)
    size, spp, lights = ((40, 30), 2, 60) if tiny else (_SIZE, _SPP, _LIGHTS)
    scene = mirror_room()
    with tempfile.TemporaryDirectory() as folder:
        rendered, is_ball = _render_relume(scene, size, lights, Path(folder))
        reference_passes = _render_mitsuba(scene, size, spp, Path(folder))
    whole, balls, background = (
        compare_pixels(rendered, reference_passes, mask) for mask in (is_ball | True, is_ball, ~is_ball)
    )
    details = {"size": list(size), "spp": PASSES * spp, "lights": lights}
    return [
        Figure(
            name,
            comparison.error.value,
            _UNIT,
            {**comparison.context, **details, **more},
            comparison.error.standard_error,
        )
        for name, comparison, more in zip(_NAMES, (whole, balls), ({"background": background.summary}, {}), strict=True)
    ]


def mirror_room() -> Scene:
    """The scene of this benchmark."""
    names = ("Table", "Left", "Back", "Clay", "Chrome", "Brass")
    rotation = np.eye(3)
    meshes = [
        rectangle([-2, 0, 2], [4, 0, 0], [0, 0, -4]).mesh("table", 0),
        rectangle([-2, 0, 2], [0, 0, -4], [0, 2.5, 0]).mesh("left", 1),
        rectangle([-2, 0, -2], [4, 0, 0], [0, 2.5, 0]).mesh("back", 2),
        sphere(0.25, 64).transform(rotation, [-0.1, 0.25, 0.8]).mesh("clay", 3),
        sphere(0.6, 96).transform(rotation, [-0.8, 0.6, 0.0]).mesh("chrome", 4),
        sphere(0.45, 96).transform(rotation, [0.7, 0.45, 0.2]).mesh("brass", 5),
    ]
    camera = look_at("front", (0.6, 1.3, 4.0), (-0.1, 0.5, 0.0), 0.7)
    return make_scene("mirrors", meshes, [_material(name) for name in names], [camera], sunny_environment())


def _material(name: str) -> Material:
    diffuse = [{"model": "lambert", "color": list(_DIFFUSE[name])}] if name in _DIFFUSE else []
    sharp = {"roughness": 0.03, "f0": 1.0}
    mirror = [{"model": "ggx", "color": list(_MIRRORS[name]), "params": sharp}] if name in _MIRRORS else []
    return Material(name, (*diffuse, *mirror))


def _render_relume(scene: Scene, size: tuple[int, int], lights: int, folder: Path) -> tuple[F64, NDArray[np.bool_]]:
    """The image, and the mask of the metal balls."""
    width, height = size
    recipe = Recipe("gather", ("front",), (_FINER * width, _FINER * height), lights)
    transfer = open_transfer(bake(scene, recipe, folder / "gather.zarr").path, Cache(4 << 30))
    fine = render_image(transfer, "front", validate({}, transfer.default_look))
    is_ball = np.isin(transfer.views["front"].material_ids(), (4, 5))
    return (
        averaged(fine, _FINER),
        np.asarray(is_ball.reshape(height, _FINER, width, _FINER).all(axis=(1, 3)), np.bool_),
    )


def _render_mitsuba(scene: Scene, size: tuple[int, int], spp: int, folder: Path) -> F32:
    bsdfs = [_bsdf(material.name) for material in scene.materials]
    job = {"integrator": {"type": "path", "max_depth": _DEPTH}, "spp": [spp], "passes": PASSES, "bsdfs": bsdfs}
    render(scene, size, job, folder)
    return read_passes(folder)


def _bsdf(name: str) -> dict[str, object]:
    """A material as Mitsuba's: diffuse, a smooth conductor, or a mixture that equals the sum of our terms."""

    def rgb(value: tuple[float, ...]) -> dict[str, object]:
        return {"type": "rgb", "value": list(value)}

    if name not in _MIRRORS:
        return {"type": "diffuse", "reflectance": rgb(_DIFFUSE[name])}
    if name not in _DIFFUSE:
        return {"type": "conductor", "material": "none", "specular_reflectance": rgb(_MIRRORS[name])}
    return {"type": "mirror_over_diffuse", "albedo": rgb(_DIFFUSE[name]), "share": _MIRRORS[name][0]}
