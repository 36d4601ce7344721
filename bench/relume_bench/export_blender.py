"""export.blender_error: materials and lights from Blender to relume, edited there, and back.

Sixteen Principled BSDFs with base color, roughness and metallic over their ranges, and a point, a spot, a sun and an
area light, through the operators of the add-on and a running server. In relume each diffuse color and f0 of a metal is
multiplied by 0.8, each roughness by 1.1, each light by 1.5. The figure is the largest relative error of a value in
Blender; of metallic, which is not edited, the largest error. RELUME_BLENDER_PYTHON is a Python 3.11 with bpy, httpx and
websockets.
"""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume_bench.baked_server import BakedFolder, serving
from relume_bench.figure import Figure, skipped
from relume_client import Client

_NAME = "export.blender_error"
_COLOR, _ROUGHNESS, _LIGHT = 0.8, 1.1, 1.5
_ROOT = Path(__file__).resolve().parents[2]


def measure(tiny: bool) -> list[Figure]:
    """One bake, two runs of Blender."""
    python = os.environ.get("RELUME_BLENDER_PYTHON")
    if not python:
        return skipped((_NAME,), "%", "RELUME_BLENDER_PYTHON does not name a Python with bpy")
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder) / "data"
        data.mkdir()
        with serving(BakedFolder(data, "", "", 0.0)) as server:
            url = f"http://127.0.0.1:{server.port}"
            before = _blender(python, "send", url, Path(folder), 2 if tiny else 16)
            with Client(url) as client:
                bake = client.bake(before["sent"]["bake"])
                link = bake.share(_edited(bake.look(before["sent"]["look"]).to_document()))
            after = _blender(python, "pull", url, Path(folder), link)
    errors = {
        "base color": _error(before, after, "materials", "Base Color", _COLOR),
        "roughness": _error(before, after, "materials", "Roughness", _ROUGHNESS),
        "metallic": float(
            np.abs(_values(after, "materials", "Metallic") - _values(before, "materials", "Metallic")).max()
        ),
        "light power": _error(before, after, "lights", "power", _LIGHT),
    }
    return [Figure(_NAME, 100 * max(errors.values()), "%", {**errors, "materials": len(before["materials"])})]


def _blender(python: str, phase: str, url: str, folder: Path, argument: object) -> dict[str, Any]:
    """Run one phase in Blender; returns its values."""
    script = Path(__file__).with_name("peer_blender_exchange.py")
    paths = os.pathsep.join(str(_ROOT / name) for name in ("blender", "client"))
    command = [python, "-P", "-W", "ignore", str(script), phase, url, str(folder), str(argument)]
    subprocess.run(command, check=True, timeout=900, env={**os.environ, "PYTHONPATH": paths}, stdout=subprocess.DEVNULL)
    result: dict[str, Any] = json.loads((folder / f"{phase}.json").read_text())
    return result


def _edited(look: Any) -> Any:
    """The look with other colors, roughnesses and lights."""
    for material in look["materials"].values():
        for term in material["terms"]:
            if term["model"] == "lambert":
                term["color"] = [_COLOR * channel for channel in term["color"]]
            elif max(term["color"]) > 0:
                term["params"]["roughness"] *= _ROUGHNESS
                f0 = np.broadcast_to(term["params"]["f0"], 3)
                if f0.max() > 0.05:  # a metal
                    term["params"]["f0"] = (_COLOR * f0).tolist()
    for light in look["lights"].values():
        light["intensity"] *= _LIGHT
    return look


def _values(state: Mapping[str, Any], group: str, name: str) -> NDArray[np.float64]:
    return np.array([member[name] for member in state[group].values()], np.float64)


def _error(before: Mapping[str, Any], after: Mapping[str, Any], group: str, name: str, factor: float) -> float:
    expected = factor * _values(before, group, name)
    return float(np.abs(_values(after, group, name) / expected - 1).max())
