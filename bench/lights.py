"""lights.rmse_…: direct light of each kind against Mitsuba 3; lights.gain_fps: frames a second while one is dimmed.

The Cornell box, 128×128 pixels, diffuse; the environment is dark. Pictures are compared by means over squares of 4×4
pixels, Mitsuba's noise taken off: a pixel has one view sample inside surfaces and Mitsuba's many, which differ along
every edge of a hard shadow.
Mitsuba's spot falls off in angle and ours in cosine: the cone compared has an edge of a tenth of a degree.
bench/mitsuba.py says where Mitsuba is looked for.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.figure import Figure, skipped
from bench.indirect import PASSES
from bench.mitsuba import bsdf, missing, passes_of, render
from bench.standard_error import over_passes
from relume.bake import Recipe
from relume.environments.model import Environment
from relume.light.local import rectangle
from relume.look import Look, validate
from relume.memory import Memory
from relume.methods.registry import METHODS, open_transfer
from relume.picture.picture import Picture
from relume.picture.transfer import Transfer
from relume.render.image import render_image
from relume.scene.archive import make_scene
from relume.scene.cornell import cornell_box
from relume.scene.model import Scene
from relume.store import bake_here

F64 = NDArray[np.float64]

_LIGHTS: dict[str, dict[str, Any]] = {
    "point": {"kind": "point", "position": [0.4, 1.5, 0.6], "emission": [3.0, 2.0, 1.0]},
    "spot": {
        "kind": "spot", "position": [0.0, 1.9, 0.9], "direction": [0.0, -1.0, -0.5], "cone": [29.9, 30.0],
        "emission": [3.0, 3.0, 3.0],
    },
    "directional": {"kind": "directional", "direction": [-0.4, -1.0, -0.5], "emission": [2.0, 2.0, 2.0]},
    "rectangle": {  # before the room and above the picture: Mitsuba would show it
        "kind": "rectangle", "position": [0.1, 2.3, 1.3], "direction": [0.0, -0.7, -1.0], "rotation": 20.0,
        "size": [0.5, 0.3], "emission": [20.0, 18.0, 15.0],
    },
}  # fmt: skip
_BLOCK = 4
_NAMES = tuple(f"lights.rmse_{kind}" for kind in _LIGHTS)
_FPS = "lights.gain_fps"


def measure(tiny: bool) -> list[Figure]:
    """Errors, and frames per second while one of two lights is dimmed; compute and encode."""
    with tempfile.TemporaryDirectory() as folder:
        return [*_errors(Path(folder), tiny), _gain_fps(Path(folder), tiny)]


def _errors(folder: Path, tiny: bool) -> list[Figure]:
    if (why := missing()) is not None:
        return skipped(_NAMES, "relative RMSE", why)
    size, spp = ((32, 32), 4) if tiny else ((128, 128), 128)
    room = cornell_box()
    night = Environment("night", np.full((4, 8, 3), 1e-7, np.float32))
    scene = make_scene("night", room.meshes, room.materials, room.cameras, night)
    recipe = Recipe("direct", ("front",), size, 20)
    transfer = open_transfer(bake_here(METHODS["direct"], scene, recipe, folder / "direct.zarr"), Memory(4 << 30))
    bsdfs = [bsdf(scene.materials[mesh.material].terms) for mesh in scene.meshes]
    figures = []
    for name, (kind, light) in zip(_NAMES, _LIGHTS.items(), strict=True):
        ours = render_image(transfer, "front", _look(transfer, {"A": light})).astype(np.float64)
        job = {"spp": [spp], "passes": PASSES, "bsdfs": bsdfs, "emitters": [_emitter(light, transfer)]}
        render(scene, size, job, folder)
        theirs = passes_of(folder)
        found = over_passes(_blocks(ours), np.array([_blocks(one) for one in theirs], np.float32))
        context = {**found.context, "size": list(size), "spp": PASSES * spp, "kind": kind}
        figures.append(Figure(name, found.error.value, "relative RMSE", context, found.error.standard_error))
    return figures


def _look(transfer: Transfer, lights: dict[str, Any]) -> Look:
    return validate({"environment": {"scale": 0.0}, "lights": lights}, transfer.default_look)


def _blocks(picture: NDArray[np.floating]) -> F64:
    height, width, _ = picture.shape
    blocks = picture.reshape(height // _BLOCK, _BLOCK, width // _BLOCK, _BLOCK, 3)
    return np.asarray(blocks.mean(axis=(1, 3), dtype=np.float64))


def _emitter(light: dict[str, Any], transfer: Transfer) -> dict[str, Any]:
    """A light of a look as Mitsuba describes it; `to_world` by rows."""
    made = _look(transfer, {"A": light}).lights["A"].geometry
    shine = {"type": "rgb", "value": light["emission"]}
    if light["kind"] == "point":
        return {"type": "point", "position": light["position"], "intensity": shine}
    if light["kind"] == "directional":
        return {"type": "directional", "direction": light["direction"], "irradiance": shine}
    to_world = np.eye(4)
    if light["kind"] == "spot":
        forward = np.array(made.direction) / np.linalg.norm(made.direction)
        right = np.cross([1.0, 0.0, 0.0], forward)
        right /= np.linalg.norm(right)
        to_world[:3, :3] = np.stack([np.cross(forward, right), right, forward], axis=1)
        to_world[:3, 3] = made.position
        inner, outer = made.cone
        angles = {"beam_width": inner, "cutoff_angle": outer}
        return {"type": "spot", "intensity": shine, "to_world": to_world.ravel().tolist(), **angles}
    corner, edges = rectangle(made)  # Mitsuba's covers [-1, 1]²
    to_world[:3, :2] = edges.T / 2
    to_world[:3, 2] = np.array(made.direction) / np.linalg.norm(made.direction)
    to_world[:3, 3] = corner + edges.sum(axis=0) / 2
    area = {"type": "area", "radiance": shine}
    return {"type": "rectangle", "emitter": area, "to_world": to_world.ravel().tolist()}


def _gain_fps(folder: Path, tiny: bool) -> Figure:
    """Time frames of a picture with reflected light, 400×400, while one of two lights is dimmed."""
    scene: Scene = cornell_box()
    size, method = ((32, 32), "direct") if tiny else ((400, 400), "gather")
    store = bake_here(
        METHODS[method], scene, Recipe(method, ("front",), size, 20 if tiny else 1000), folder / "gather.zarr"
    )
    transfer = open_transfer(store, Memory(4 << 30))
    picture = Picture(transfer, "front", Memory(1 << 30))
    taken = []
    for k in range(5 if tiny else 60):
        panel = _LIGHTS["rectangle"] | {"scale": 1 + k / 60}
        picture.set_look(validate({"lights": {"A": _LIGHTS["point"], "B": panel}}, transfer.default_look))
        began = time.perf_counter()
        if k > 1:  # the first shades all, the second one light alone
            picture.encode(picture.advance(None).tiles, "rgb9e5")
            taken.append(time.perf_counter() - began)
        while not picture.advance(None).exact or picture.next_job() is not None:
            picture.freeze(lambda share: None, lambda: False)
    return Figure(_FPS, 1 / float(np.median(taken)), "fps", {"size": list(size), "method": method})
