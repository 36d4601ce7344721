"""Hands scenes to Mitsuba 3, which lives in its own environment.

`python3 -m venv bench/.venv-peers` and `bench/.venv-peers/bin/pip install mitsuba numpy`, or RELUME_PEERS_PYTHON names
an interpreter that has it. DRJIT_LIBLLVM_PATH names the LLVM library if it is not found under /usr/lib.
"""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from relume.scene.model import Scene

_MOST_SPP = 32  # at once; more would not fit in memory


def missing() -> str | None:
    """What Mitsuba lacks to run here; None where it can."""
    if _interpreter() is None:
        return "Mitsuba is not installed; bench/mitsuba.py says where it is looked for"
    if _llvm() is None:
        return "there is no LLVM library; install libllvm19 or set DRJIT_LIBLLVM_PATH"
    return None


def _interpreter() -> Path | None:
    default = Path(__file__).parent / ".venv-peers" / "bin" / "python"
    python = Path(os.environ.get("RELUME_PEERS_PYTHON", default))
    return python if python.is_file() else None


def _llvm() -> str | None:
    found = sorted(map(str, Path("/usr/lib").glob("*/libLLVM*19*")))
    return os.environ.get("DRJIT_LIBLLVM_PATH") or (found[0] if found else None)


def bsdf(lambert: Mapping[str, Any], glossy: Mapping[str, Any]) -> dict[str, Any]:
    """Two complete grey terms, `lambert` and dielectric `cook_torrance`, as the plugin of peer_mitsuba_render.py."""
    return {
        "type": "lambert_cook_torrance", "albedo": lambert["color"][0], "gain": glossy["color"][0],
        "sigma": glossy["params"]["sigma"], "ior": glossy["params"]["ior"],
    }  # fmt: skip


def render(scene: Scene, size: tuple[int, int], job: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Hand the scene's first view over as arrays and let the peer render.

    Args:
        job: "spp", counts to render with; "bsdfs", one a mesh; "passes" where independent passes are wanted; "bounces"
            and "seen" where reflected light alone is (peer_mitsuba_render.py); "finer", texels for each of the map's;
            "emitters", Mitsuba's own descriptions of lights beside the map.
    Returns:
        What it wrote to result.json in `folder`.
    """
    camera, llvm = scene.cameras[0], _llvm()
    arrays: dict[str, Any] = {"camera": camera.to_world, "environment": scene.environment.radiance}
    for k, mesh in enumerate(scene.meshes):
        arrays |= {f"positions_{k}": mesh.positions, f"normals_{k}": mesh.normals, f"faces_{k}": mesh.faces}
    np.savez(folder / "scene.npz", allow_pickle=False, **arrays)
    whole = {"yfov": camera.yfov, "size": list(size), "most": _MOST_SPP, "finer": 1, **job}
    (folder / "job.json").write_text(json.dumps(whole))
    script = Path(__file__).with_name("peer_mitsuba_render.py")
    environment = {**os.environ, "DRJIT_LIBLLVM_PATH": str(llvm)}
    command = [str(_interpreter()), "-I", str(script), str(folder)]
    subprocess.run(command, env=environment, check=True, timeout=3600)
    found: dict[str, Any] = json.loads((folder / "result.json").read_text())
    return found
