"""Hands scenes to Blender's Cycles, which lives in its own environment.

`python3.11 -m venv bench/.venv-cycles` and `bench/.venv-cycles/bin/pip install bpy==5.0.1`, which asks for Python 3.11,
or RELUME_CYCLES_PYTHON names an interpreter that has it.
"""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from relume.scene.model import Scene


def missing() -> str | None:
    """What Cycles lacks to run here; None where it can."""
    return (
        None
        if _interpreter()
        else "Blender's bpy is not installed; bench/relume_bench/cycles.py says where it is looked for"
    )


def _interpreter() -> Path | None:
    default = Path(__file__).parents[1] / ".venv-cycles" / "bin" / "python"
    python = Path(os.environ.get("RELUME_CYCLES_PYTHON", default))
    return python if python.is_file() else None


def render(
    scene: Scene, size: tuple[int, int], materials: Sequence[Mapping[str, Any]], spp: Sequence[int], bounces: int,
    folder: Path,
) -> dict[str, Any]:  # fmt: skip
    """Let Cycles render the scene's first view at rising sample counts, all light, with two seeds each.

    Args:
        scene: handed over as arrays. size: width and height, pixels.
        materials: of each mesh "diffuse" and "glossy" colours, and "roughness".
        spp: sample counts, rising. bounces: reflections of a path at most.
        folder: where files of the exchange are written.
    Returns:
        "version", and "steps" with "spp", "seconds" of one picture and its "noise", absolute. Writes picture.npy.
    """
    camera = scene.cameras[0]
    arrays: dict[str, Any] = {"camera": camera.to_world, "environment": scene.environment.radiance}
    for k, mesh in enumerate(scene.meshes):
        arrays |= {f"positions_{k}": mesh.positions, f"faces_{k}": mesh.faces}
    np.savez(folder / "cycles.npz", allow_pickle=False, **arrays)
    job = {"yfov": camera.yfov, "size": size, "materials": list(materials), "spp": list(spp), "bounces": bounces}
    (folder / "cycles.json").write_text(json.dumps(job))
    script = Path(__file__).with_name("peer_cycles_render.py")
    command = [str(_interpreter()), "-I", str(script), str(folder)]
    subprocess.run(command, check=True, timeout=3600, stdout=subprocess.DEVNULL)
    result: dict[str, Any] = json.loads((folder / "cycles_result.json").read_text())
    return result
