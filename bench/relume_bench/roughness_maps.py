"""roughness.rmse: surfaces with roughness maps, against Mitsuba with the same maps as textures of its own conductors.

A tiled floor and a spotted ball, both tinted mirrors except for their roughness, under an environment with a sun:
direct light only, so that only roughness levels and environment triangles differ. The context has the error with the
mean roughness instead of the maps.
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
from relume.scene.model import Material, Scene, Texture, TextureEncoding
from relume.scene.scene_folder import make_scene
from relume.store.bake_protocol import Recipe
from relume_bench.figure import Figure, skipped
from relume_bench.gather import bake
from relume_bench.indirect import PASSES
from relume_bench.mitsuba import averaged, missing, read_passes, render
from relume_bench.standard_error import compare_with_passes

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_NAME, _UNIT = "roughness.rmse", "relative RMSE"
_SIZE, _FINER, _SPP, _LIGHTS = (400, 300), 2, 64, 4000
_COLORS = {"Floor": (0.5, 0.5, 0.6), "Ball": (0.9, 0.6, 0.3)}


def measure(tiny: bool) -> list[Figure]:
    """A bake and two renders."""
    if (why := missing()) is not None:
        return skipped((_NAME,), _UNIT, why)
    size, spp = ((40, 30), 2) if tiny else (_SIZE, _SPP)
    scene = make_roughness_map_scene()
    with tempfile.TemporaryDirectory() as folder:
        rendered, mean = _render_relume(scene, size, 60 if tiny else _LIGHTS, Path(folder))
        reference_passes = _render_mitsuba(scene, size, spp, Path(folder))
    comparison, mean_comparison = (
        compare_with_passes(rendered, reference_passes),
        compare_with_passes(mean, reference_passes),
    )
    details = {
        **comparison.context,
        "size": list(size),
        "spp": PASSES * spp,
        "lights": _LIGHTS,
        "mean_roughness": mean_comparison.summary,
    }
    return [Figure(_NAME, comparison.error.value, _UNIT, details, comparison.error.standard_error)]


def make_roughness_map_scene() -> Scene:
    """The scene of this benchmark."""
    maps = {"Floor": _tiles(), "Ball": _spots()}
    materials = [Material(name, (_mirror(name, texels),), {"roughness": _map(texels)}) for name, texels in maps.items()]
    meshes = [
        rectangle([-2, 0, 2], [4, 0, 0], [0, 0, -4]).mesh("floor", 0),
        sphere(0.6, 64).transform(np.eye(3), [0, 0.6, 0]).mesh("ball", 1),
    ]
    camera = look_at("front", (0.3, 1.2, 3.4), (0.0, 0.45, 0.0), 0.7)
    return make_scene("rough", meshes, materials, [camera], sunny_environment())


def _tiles(side: int = 256) -> F32:
    """Roughness of tiles that are rough, or smoother from left to right. (side, side)"""
    y, x = np.mgrid[0:side, 0:side]
    return np.asarray(np.where((x // 32 + y // 32) % 2, 0.8 - 0.4 * x / side, 0.9), np.float32)


def _spots(side: int = 256) -> F32:
    y, x = np.mgrid[0:side, 0:side] * (2 * np.pi / side)
    return np.asarray(0.6 + 0.3 * np.sin(5 * x) * np.cos(4 * y), np.float32)


def _map(texels: F32) -> Texture:
    mean = float(texels.mean())
    pixels = np.round(255 * texels).astype(np.uint8)[..., None]
    return Texture(pixels, encoding=TextureEncoding("share", (1 / mean, 1 / mean, 1 / mean)))


def _mirror(name: str, texels: F32) -> dict[str, object]:
    params = {"roughness": round(float(texels.mean()), 6), "f0": 1.0}
    return {
        "model": "ggx",
        "color": list(_COLORS[name]),
        "params": params,
        "texture": None,
        "roughness_map": "roughness",
    }


def _render_relume(scene: Scene, size: tuple[int, int], lights: int, folder: Path) -> tuple[F64, F64]:
    """The image with the maps, and with their means."""
    width, height = size
    recipe = Recipe("direct", ("front",), (_FINER * width, _FINER * height), lights)
    transfer = open_transfer(bake(scene, recipe, folder / "rough.zarr").path, Cache(4 << 30))
    materials = transfer.default_look["materials"]
    plain = {name: {"terms": [{**material["terms"][0], "roughness_map": None}]} for name, material in materials.items()}

    def picture(changes: dict[str, object]) -> F64:
        return averaged(render_image(transfer, "front", validate(changes, transfer.default_look)), _FINER)

    return picture({}), picture({"materials": plain})


def _render_mitsuba(scene: Scene, size: tuple[int, int], spp: int, folder: Path) -> F32:
    images = {"alpha_0": np.square(_tiles())[..., None], "alpha_1": np.square(_spots())[..., None]}
    bsdfs = [
        {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": {"array": f"alpha_{k}"},
         "specular_reflectance": {"type": "rgb", "value": list(_COLORS[material.name])}}
        for k, material in enumerate(scene.materials)
    ]  # fmt: skip
    render(scene, size, {"spp": [spp], "passes": PASSES, "bsdfs": bsdfs}, folder, images)
    return read_passes(folder)
