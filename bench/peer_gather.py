"""peer.mitsuba_gather_time_ratio and peer.cycles_time_ratio: how long they render, after an edit of a material under
global illumination, until their noise is as small as our error ÷ our time for the edit's frame.

The bake and the edit of bench/gather.py: the exponent of the floor's highlight. Our error: the reflected light of the
whole picture against Mitsuba's path tracer, its noise taken off. Mitsuba renders reflected light alone, as bench/
indirect.py has it, which is less work than a picture. Cycles renders whole pictures, a Beckmann highlight as wide as
ours in place of Blinn and Phong's; its noise is compared with our error in the same units. Both stop where we do: one
bounce of any kind to the eye, diffuse ones before it. Noise is the difference of two seeds over √2; where our error is
not reached at the largest count, the time is extrapolated by noise ∝ 1/√spp, time ∝ spp, and the context says so.
Scene loading and compiling are not counted; nor is our bake.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bench import cycles, mitsuba
from bench.figure import Figure, skipped
from bench.gather import FLOOR, bake, edit_frames_s, opened, recipe_of, settle
from bench.indirect import error_without_noise, mitsuba_job, reflected
from relume.look.document import MAX_BOUNCES
from relume.scene.cornell import GLOSSY_FLOOR, cornell_box
from relume.scene.model import Scene
from relume.transfer.opened import Transfer, open_transfer

_NAMES = ("peer.mitsuba_gather_time_ratio", "peer.cycles_time_ratio")
_LEAST_ERROR = 1e-3  # what a short render can tell


class _Ours(NamedTuple):
    """Error of reflected light, absolute; seconds of an edit's frame."""

    error: float
    edit_s: float


def measure(tiny: bool) -> list[Figure]:
    """Our edit and its error, then theirs."""
    if (why := mitsuba.missing()) is not None:
        return skipped(_NAMES, "ratio", f"our error is not known: {why}")
    scene, recipe = cornell_box(is_floor_glossy=True), recipe_of(tiny)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        transfer = open_transfer(bake(scene, recipe, folder / "gather.zarr").path)
        edit_s = _edit_s(transfer, 5 if tiny else 60)
        light = reflected(transfer, {})
        job = {"spp": [1, 2] if tiny else [8, 64], **mitsuba_job(*_bsdfs(scene))}
        steps = mitsuba.render(scene, recipe.size, job, folder)
        halves = np.load(folder / "passes.npy", allow_pickle=False)
        scale = float(np.sqrt(np.mean(light**2)))
        found = error_without_noise(light, halves)
        ours = _Ours(max(found["error"], _LEAST_ERROR) * scale, edit_s)
        of_mitsuba = [{**step, "noise": step["error"] * scale} for step in steps["steps"]]
        figures = [_ratio(_NAMES[0], of_mitsuba, ours, {"mitsuba": steps["version"], **found})]
        if (why := cycles.missing()) is not None:
            return figures + skipped(_NAMES[1:], "ratio", why)
        spp = [1, 2] if tiny else [4, 32]
        rendered = cycles.render(scene, recipe.size, _materials(scene), spp, MAX_BOUNCES, folder)
    return [*figures, _ratio(_NAMES[1], rendered["steps"], ours, {"blender": rendered["version"]})]


def _ratio(name: str, steps: list[dict[str, Any]], ours: _Ours, about: dict[str, Any]) -> Figure:
    last = steps[-1]
    theirs_s = last["seconds"] * max(1.0, (last["noise"] / ours.error) ** 2)
    context = {
        "our_error": ours.error, "our_edit_ms": 1e3 * ours.edit_s, "their_seconds": theirs_s,
        "extrapolated_from_spp": last["spp"] if last["noise"] > ours.error else 0, "their_steps": steps, **about,
    }  # fmt: skip
    return Figure(name, theirs_s / ours.edit_s, "ratio", context)


def _edit_s(transfer: Transfer, num_frames: int) -> float:
    """Median seconds of the frames of a drag."""
    picture = opened(transfer)
    picture.touch(f"{FLOOR}/params/exponent")
    settle(picture)
    return float(np.median(edit_frames_s(transfer, picture, num_frames)))


def _bsdfs(scene: Scene) -> tuple[list[Any], list[Any]]:
    """Of the meshes as the camera sees them, and beyond."""
    beyond = [mitsuba.bsdf(scene.materials[mesh.material].terms[:1]) for mesh in scene.meshes]
    return [mitsuba.bsdf(GLOSSY_FLOOR), *beyond[1:]], beyond


def _materials(scene: Scene) -> list[dict[str, Any]]:
    """The same for Cycles; its highlight has the floor's albedo, four times its colour, and width, α² = 2/(s + 2)."""
    floor = GLOSSY_FLOOR[1]
    alpha = (2 / (floor["params"]["exponent"] + 2)) ** 0.5
    black = {"glossy": [0.0, 0.0, 0.0], "roughness": 0.0}
    made = [{"diffuse": scene.materials[mesh.material].terms[0]["color"], **black} for mesh in scene.meshes]
    made[0] |= {"glossy": [4 * channel for channel in floor["color"]], "roughness": alpha**0.5}
    return made
