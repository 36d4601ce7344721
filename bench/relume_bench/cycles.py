"""Render scenes with Blender's Cycles, in its own environment.

`python3.11 -m venv bench/.venv-cycles` and `bench/.venv-cycles/bin/pip install bpy==5.0.1`, which needs Python 3.11; or
set RELUME_CYCLES_PYTHON to an interpreter with it.
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
    """Reason why Cycles cannot run here; None if it can."""
    return (
        None
        if _interpreter()
        else "Blender's bpy is not installed; bench/relume_bench/cycles.py describes the installation"
    )


def _interpreter() -> Path | None:
    default = Path(__file__).parents[1] / ".venv-cycles" / "bin" / "python"
    python = Path(os.environ.get("RELUME_CYCLES_PYTHON", default))
    return python if python.is_file() else None


def render(
    scene: Scene, size: tuple[int, int], materials: Sequence[Mapping[str, Any]], spp: Sequence[int], bounces: int,
    folder: Path,
) -> dict[str, Any]:  # fmt: skip
    """Render the scene's first view with Cycles at increasing sample counts, all light, with two seeds each.

    Args:
        scene: passed as arrays. size: width and height, pixels.
        materials: for each mesh "diffuse" and "glossy" colors, and "roughness".
        spp: increasing sample counts. bounces: maximum number per path.
        folder: for exchanged files.
    Returns:
        "version", and "steps" with "spp", "seconds" per image and its absolute "noise". Writes picture.npy.
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
