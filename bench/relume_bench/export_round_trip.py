"""export.glb_rmse, export.errors: scenes written as GLB and read again.

Five scenes of a ball on a checkered floor, with what glTF can express: glass, clear coat, sheen, textures (base color,
roughness, normals, opacity), and lights (point, spot, directional, emissive). `export.glb_rmse` is the relative RMS
difference of the pictures before and after, method `gather`, the worst of five; every scene is in the context.
`export.errors`: errors that validators find in the five scenes as GLB, USD and MaterialX, see
`relume_bench.export_validators`.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.assets.environments.studio import studio
from relume.core.cache import Cache
from relume.export.export_document import look_of_scene, prepare_export
from relume.export.export_scene import FORMATS
from relume.live.opened.openers import open_transfer
from relume.look import validate
from relume.output.render_image import render_image
from relume.scene.examples.cornell import rectangle
from relume.scene.examples.still_life.grids import sphere
from relume.scene.examples.still_life.still_life import look_at
from relume.scene.model import Glass, Light, Material, Opacity, Scene, Texture, TextureEncoding
from relume.scene.scene_folder import make_scene
from relume.scene_io.import_scene import import_scene
from relume.scene_io.surfaces.to_terms import CoatLayer, PbrSurface, make_terms
from relume.store.bake_protocol import Recipe
from relume_bench.export_validators import find_glb_errors, find_materialx_errors, find_usd_errors
from relume_bench.figure import Figure
from relume_bench.gather import bake

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

_SIZE, _LIGHTS = (320, 240), 400
_SIDE = 64  # texels
_FIND_ERRORS: dict[str, Callable[[Path], list[str] | None]] = {
    "glb": find_glb_errors,
    "usd": find_usd_errors,
    "materialx": find_materialx_errors,
}
_GRAY_F0 = np.full(3, 0.04)
_PLASTIC = PbrSurface(np.array([0.6, 0.25, 0.1]), _GRAY_F0, 1.0, 0.3, 0.043537)


def measure(tiny: bool) -> list[Figure]:
    """Two bakes a scene."""
    size, lights = ((32, 24), 20) if tiny else (_SIZE, _LIGHTS)
    errors: dict[str, float] = {}
    found: dict[str, list[list[str] | None]] = {file_format: [] for file_format in _FIND_ERRORS}
    with tempfile.TemporaryDirectory() as folder:
        for name, make in SCENES.items():
            scene = make()
            export = prepare_export(scene, look_of_scene(scene, {}, "look"))
            for file_format, find in _FIND_ERRORS.items():
                path = Path(folder) / f"{name}{FORMATS[file_format].suffix}"
                FORMATS[file_format].write(export, path)
                found[file_format].append(find(path))
            again = import_scene(Path(folder) / f"{name}.glb", name, scene.environment)
            before, after = (_picture(each, size, lights, Path(folder)) for each in (scene, again))
            errors[name] = float(np.sqrt(np.mean((after - before) ** 2) / np.mean(before**2)))
    rmse = Figure("export.glb_rmse", max(errors.values()), "relative RMS", {"scenes": errors, "size": list(size)})
    if None in found["glb"]:
        why = "RELUME_GLTF_VALIDATOR does not name the npm package gltf-validator"
        return [rmse, Figure("export.errors", None, "errors", {"skipped": why})]
    sums = {file_format: sum(map(len, filter(None, lists))) for file_format, lists in found.items()}
    return [rmse, Figure("export.errors", float(sum(sums.values())), "errors", {**sums, "files": len(SCENES)})]


def _picture(scene: Scene, size: tuple[int, int], lights: int, folder: Path) -> F64:
    """Radiance of the first view. (height, width, 3)"""
    store = Path(tempfile.mkdtemp(dir=folder)) / "gather.zarr"
    view = scene.cameras[0].name
    transfer = open_transfer(bake(scene, Recipe("gather", (view,), size, lights), store).path, Cache(1 << 30))
    return np.asarray(render_image(transfer, view, validate({}, transfer.default_look))[..., :3], np.float64)


def _scene(name: str, ball: Material, lights: tuple[Light, ...] = (), further: tuple[Material, ...] = ()) -> Scene:
    """A ball of a material on a floor with a checkered texture; further balls beside it."""
    texture = Texture(_checker([[230, 225, 215], [70, 80, 95]]), encoding=TextureEncoding("srgb"))
    floor = PbrSurface(np.ones(3), _GRAY_F0, 1.0, 0.6, 0.043537, {"diffuse": texture})
    materials = [Material("Floor", make_terms(floor, CoatLayer()), {"diffuse": texture}), ball, *further]
    ball_mesh, rotation = sphere(0.6, 48), np.eye(3)
    meshes = [rectangle([-2, 0, 2], [4, 0, 0], [0, 0, -4]).mesh("floor", 0)]
    for number, material in enumerate(materials[1:], 1):
        meshes.append(ball_mesh.transform(rotation, [1.3 * (number - 1), 0.6, 0.0]).mesh(material.name, number))
    camera = replace(look_at("front", (0.5, 1.4, 4.0), (0.3, 0.5, 0.0), 0.7), aspect=4 / 3)
    return make_scene(name, meshes, materials, [camera], studio(), lights=lights)


def _glass() -> Scene:
    surface = PbrSurface(np.zeros(3), _GRAY_F0, 1.0, 0.02)
    solid = Glass((1.0, 1.0, 1.0), 1.5, 1.2, (0.2, 0.6, 0.9), 0.02)
    pane = Glass((0.9, 0.6, 0.5), 1.5, 0.0, (0.0, 0.0, 0.0), 0.02)
    terms = make_terms(surface, CoatLayer())
    return _scene("glass", Material("Solid", terms, glass=solid), further=(Material("Thin", terms, glass=pane),))


def _coat() -> Scene:
    return _scene("coat", Material("Lacquer", make_terms(_PLASTIC, CoatLayer(coat=0.9, coat_roughness=0.05))))


def _sheen() -> Scene:
    coat = CoatLayer(sheen=(0.5, 0.4, 0.6), sheen_roughness=0.4)
    return _scene("sheen", Material("Felt", make_terms(_PLASTIC, coat)))


def _textures() -> Scene:
    base = Texture(_checker([[255, 90, 40], [40, 160, 220]]), encoding=TextureEncoding("srgb"))
    share = Texture(_checker([[60], [180]]), encoding=TextureEncoding("share", (2.125, 2.125, 2.125)))
    normals = Texture(_checker([[128, 128, 255], [150, 120, 250]]), encoding=TextureEncoding("normal"))
    textures = {"diffuse": base, "roughness": share}
    surface = PbrSurface(np.full(3, 0.8), _GRAY_F0, 1.0, 0.4, 0.043537, textures, has_normal_map=True)
    opacity = Opacity(_checker([255, 0]), cutoff=0.5)
    ball = Material("Tiles", make_terms(surface, CoatLayer()), textures, normals)
    return _scene("textures", ball, further=(Material("Lattice", make_terms(_PLASTIC, CoatLayer()), opacity=opacity),))


def _lights() -> Scene:
    bulb = Material("Bulb", make_terms(_PLASTIC, CoatLayer()))
    cone = {"direction": [0.0, -1.0, 0.0], "cone": [15.0, 30.0]}
    lights = (
        Light("Bulb", {"kind": "mesh", "material": "Bulb", "emission": [3.0, 2.0, 1.0]}),
        Light("Point", {"kind": "point", "position": [-1.0, 2.0, 1.0], "emission": [2.0, 3.0, 4.0]}),
        Light("Spot", {"kind": "spot", "position": [0.0, 3.0, 0.5], "emission": [9.0, 8.0, 7.0], **cone}),
        Light("Sun", {"kind": "directional", "direction": [0.5, -0.8, -0.3], "emission": [1.0, 0.9, 0.8]}),
    )
    return _scene("lights", Material("Ball", make_terms(_PLASTIC, CoatLayer())), lights, (bulb,))


def _checker(values: Any) -> U8:
    rows, columns = np.indices((_SIDE, _SIDE)) // 8
    return np.asarray(np.asarray(values, np.uint8)[(rows + columns) % 2])


SCENES: dict[str, Callable[[], Scene]] = {
    "glass": _glass,
    "coat": _coat,
    "sheen": _sheen,
    "textures": _textures,
    "lights": _lights,
}
