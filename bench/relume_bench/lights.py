"""lights.rmse_…: direct light of each kind, and of a linked light, against Mitsuba 3; lights.intensity_fps: frames per
second of a dimmed light.

The Cornell box, 128×128 pixels, diffuse; the environment is black. Images are compared by means over blocks of 4×4
pixels, with Mitsuba's noise removed: a pixel has one view sample inside surfaces and many in Mitsuba, which differ
along the edges of hard shadows. Mitsuba's spot falls off in angle and ours in cosine: the compared cone has an edge of
a tenth of a degree. Mitsuba has no links: for the linked light, surfaces that are not linked are black there and still
cast shadows, which is the same direct light. Its sun is a disk 1 km away. An IES file and a gobo are textures of its
spot (`relume_bench.light_assets`); because of the gobo's edges, ours is the mean of 4×4 pixels. For the installation
of Mitsuba see bench/relume_bench/mitsuba.py.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.assets.environments.environment import Environment
from relume.core.cache import Cache
from relume.lights.light_axes import light_axes
from relume.lights.surface_hits import surface_radiance
from relume.live.fixed_camera.picture import Picture
from relume.live.fixed_camera.protocols import FixedViewTransfer
from relume.live.opened.openers import open_transfer
from relume.look import LightGeometry, Look, validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.scene.examples.cornell import cornell_box
from relume.scene.model import Mesh, Scene
from relume.scene.scene_folder import make_scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume_bench.figure import Figure, skipped
from relume_bench.indirect import PASSES
from relume_bench.light_assets import light_assets, mitsuba_texture
from relume_bench.mitsuba import averaged, bsdf, missing, read_passes, render
from relume_bench.standard_error import compare_with_passes
from relume_bench.until_exact import run_until_exact

F64 = NDArray[np.float64]

_LIGHTS: dict[str, dict[str, Any]] = {
    "point": {"kind": "point", "position": [0.4, 1.5, 0.6], "emission": [3.0, 2.0, 1.0]},
    "spot": {
        "kind": "spot", "position": [0.0, 1.9, 0.9], "direction": [0.0, -1.0, -0.5], "cone": [29.9, 30.0],
        "emission": [3.0, 3.0, 3.0],
    },
    "directional": {"kind": "directional", "direction": [-0.4, -1.0, -0.5], "emission": [2.0, 2.0, 2.0]},
    "linked": {
        "kind": "point", "position": [0.4, 1.5, 0.6], "emission": [3.0, 2.0, 1.0],
        "link": {"exclude": {"materials": ["Red wall"], "objects": ["Tall block"]}},
    },
    "rectangle": {  # in front of the room and above the image: Mitsuba would show it
        "kind": "rectangle", "position": [0.1, 2.3, 1.3], "direction": [0.0, -0.7, -1.0], "rotation": 20.0,
        "size": [0.5, 0.3], "emission": [20.0, 18.0, 15.0],
    },
    "disc": {
        "kind": "disc", "position": [0.1, 2.3, 1.3], "direction": [0.0, -0.7, -1.0], "radius": 0.2,
        "emission": [20.0, 18.0, 15.0],
    },
    "sphere": {"kind": "sphere", "position": [0.1, 2.3, 1.3], "radius": 0.15, "emission": [40.0, 36.0, 30.0]},
    "tube": {
        "kind": "tube", "position": [0.1, 2.3, 1.3], "direction": [1.0, 0.1, 0.0], "radius": 0.03, "length": 1.2,
        "emission": [40.0, 36.0, 30.0],
    },
    "sun": {"kind": "directional", "direction": [-0.4, -1.0, -0.5], "angle": 5.0, "emission": [2.0, 2.0, 2.0]},
    "ies": {
        "kind": "spot", "position": [0.0, 1.9, 0.9], "direction": [0.0, -1.0, -0.5], "cone": [59.9, 60.0],
        "rotation": 30.0, "emission": [6.0, 6.0, 6.0], "profile": "ies",
    },
    "gobo": {
        "kind": "spot", "position": [0.0, 1.9, 0.9], "direction": [0.0, -1.0, -0.5], "cone": [49.9, 50.0],
        "rotation": 30.0, "emission": [6.0, 6.0, 6.0], "gobo": "gobo",
    },
}  # fmt: skip
_BLOCK = 4
_GOBO_FINER = 4  # pixels of ours per side of one of Mitsuba's: many are at edges of fields
_SUN_DISTANCE = 1000.0  # meters, of Mitsuba's sun disk
_NAMES = tuple(f"lights.rmse_{kind}" for kind in _LIGHTS)
_FPS = "lights.intensity_fps"


def measure(tiny: bool) -> list[Figure]:
    """Errors, and frames per second while one of two lights is dimmed, including encoding."""
    with tempfile.TemporaryDirectory() as folder:
        return [*_errors(Path(folder), tiny), _gain_fps(Path(folder), tiny)]


def _errors(folder: Path, tiny: bool) -> list[Figure]:
    if (why := missing()) is not None:
        return skipped(_NAMES, "relative RMSE", why)
    size, spp = ((32, 32), 4) if tiny else ((128, 128), 128)
    room = cornell_box()
    night = Environment("night", np.full((4, 8, 3), 1e-7, np.float32))
    scene = make_scene("night", room.meshes, room.materials, room.cameras, night)
    transfers = {finer: _bake(scene, size, finer, folder) for finer in (1, _GOBO_FINER)}
    figures = []
    for name, (kind, light) in zip(_NAMES, _LIGHTS.items(), strict=True):
        finer = _GOBO_FINER if kind == "gobo" else 1
        transfer = transfers[finer]
        with light_assets(folder) as names:
            named = light | {field: names[light[field]] for field in ("profile", "gobo") if field in light}
            look = _make_look(transfer, {"A": named})
            rendered = averaged(render_image(transfer, "front", look), finer)
        bsdfs = [bsdf(_lit_terms(scene, mesh, light)) for mesh in scene.meshes]
        emitter = _emitter(light, look.lights["A"].geometry, mitsuba_texture(folder, light))
        job = {"spp": [spp], "passes": PASSES, "bsdfs": bsdfs, "emitters": [emitter]}
        render(scene, size, job, folder)
        reference_passes = read_passes(folder)
        comparison = compare_with_passes(
            _average_blocks(rendered),
            np.array([_average_blocks(block_pass) for block_pass in reference_passes], np.float32),
        )
        context = {**comparison.context, "size": list(size), "spp": PASSES * spp, "kind": kind, "finer": finer}
        figures.append(Figure(name, comparison.error.value, "relative RMSE", context, comparison.error.standard_error))
    return figures


def _bake(scene: Scene, size: tuple[int, int], finer: int, folder: Path) -> FixedViewTransfer:
    """Bake the view with `finer` times as many pixels per side."""
    recipe = Recipe("direct", ("front",), (finer * size[0], finer * size[1]), 20)
    store = bake_in_process(METHODS["direct"], scene, recipe, folder / f"direct_{finer}.zarr")
    return open_transfer(store, Cache(4 << 30))


def _lit_terms(scene: Scene, mesh: Mesh, light: dict[str, Any]) -> Sequence[dict[str, Any]]:
    """Terms of a mesh; black if the light is not linked to it."""
    material, excluded = scene.materials[mesh.material], light.get("link", {"exclude": {}})["exclude"]
    is_dark = material.name in excluded.get("materials", ()) or mesh.name in excluded.get("objects", ())
    return ({"model": "lambert", "color": [0.0, 0.0, 0.0]},) if is_dark else material.terms


def _make_look(transfer: FixedViewTransfer, lights: dict[str, Any]) -> Look:
    return validate({"environment": {"intensity": 0.0}, "lights": lights}, transfer.default_look)


def _average_blocks(picture: NDArray[np.floating]) -> F64:
    height, width, _ = picture.shape
    blocks = picture.reshape(height // _BLOCK, _BLOCK, width // _BLOCK, _BLOCK, 3)
    return np.asarray(blocks.mean(axis=(1, 3), dtype=np.float64))


def _emitter(light: dict[str, Any], geometry: LightGeometry, texture: dict[str, Any]) -> dict[str, Any]:
    """A light of a look as Mitsuba's description; `to_world` row by row. texture: of a spot, or empty"""
    emission = {"type": "rgb", "value": light["emission"]}
    if light["kind"] == "point":
        return {"type": "point", "position": light["position"], "intensity": emission}
    if (shape := _mitsuba_shape(geometry)) is not None:
        radiance = surface_radiance(geometry) * np.array(light["emission"])
        return {**shape, "emitter": {"type": "area", "radiance": {"type": "rgb", "value": radiance.tolist()}}}
    if light["kind"] == "directional":
        return {"type": "directional", "direction": light["direction"], "irradiance": emission}
    to_world = np.eye(4)
    to_world[:3, :3] = light_axes(geometry.direction, geometry.rotation).T * (-1, -1, 1)  # Mitsuba's u runs along X
    to_world[:3, 3] = geometry.position
    inner, outer = geometry.cone
    angles = {"beam_width": inner, "cutoff_angle": outer}
    return {"type": "spot", "intensity": emission, "to_world": to_world.ravel().tolist(), **angles, **texture}


def _mitsuba_shape(geometry: LightGeometry) -> dict[str, Any] | None:
    """The surface of a light; of a soft sun, a disk at a distance. None for a light without one."""
    position, radius = np.array(geometry.position), geometry.radius
    *sides, facing = light_axes(geometry.direction, geometry.rotation)
    match geometry.kind:
        case "sphere":
            return {"type": "sphere", "center": position.tolist(), "radius": radius}
        case "tube":
            ends = {
                f"p{k}": (position + sign * geometry.length / 2 * facing).tolist() for k, sign in enumerate((-1, 1))
            }
            return {"type": "cylinder", **ends, "radius": radius}
        case "rectangle":  # Mitsuba's covers [-1, 1]²
            shape, sides = "rectangle", [side * size / 2 for side, size in zip(sides, geometry.size, strict=True)]
        case "disc":
            shape, sides = "disk", [side * radius for side in sides]
        case "directional" if geometry.angle > 0:
            shape, sides = "disk", [side * _SUN_DISTANCE * np.tan(np.radians(geometry.angle / 2)) for side in sides]
            position = -_SUN_DISTANCE * facing
        case _:
            return None
    to_world = np.eye(4)
    to_world[:3] = np.column_stack([*sides, facing, position])
    return {"type": shape, "to_world": to_world.ravel().tolist()}


def _gain_fps(folder: Path, tiny: bool) -> Figure:
    """Time frames of an image with indirect light, 400×400, while one of two lights is dimmed."""
    scene: Scene = cornell_box()
    size, method = ((32, 32), "direct") if tiny else ((400, 400), "gather")
    store = bake_in_process(
        METHODS[method], scene, Recipe(method, ("front",), size, 20 if tiny else 1000), folder / "gather.zarr"
    )
    transfer = open_transfer(store, Cache(4 << 30))
    picture = Picture(transfer, "front", Cache(1 << 30))
    durations = []
    for k in range(5 if tiny else 60):
        panel = _LIGHTS["rectangle"] | {"intensity": 1 + k / 60}
        picture.set_look(validate({"lights": {"A": _LIGHTS["point"], "B": panel}}, transfer.default_look))
        start_time = time.perf_counter()
        if k > 1:  # the first shades all, the second one light alone
            picture.encode(picture.advance(None).tiles, "rgb9e5")
            durations.append(time.perf_counter() - start_time)
        run_until_exact(picture)
    return Figure(_FPS, 1 / float(np.median(durations)), "fps", {"size": list(size), "method": method})
