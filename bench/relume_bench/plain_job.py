"""A file as a job for Mitsuba: its surfaces, materials and lights. See `relume_bench.gltf_plain`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume_bench.gltf_plain import File, Shape, read_plain
from relume_bench.mesh_plain import read_obj, read_ply
from relume_bench.plain_materials import Materials

F64 = NDArray[np.float64]

_DEPTH = 24
_RR_DEPTH = 8  # russian roulette from this depth
_GAP = 1e-4  # between the sides of a luminous surface, of its size
_CANDELA = 1 / 683  # W/sr, as in importers


def read_file(path: Path) -> File:
    """Read a file that is known to be valid, by its suffix."""
    return {".obj": read_obj, ".ply": read_ply}.get(path.suffix.lower(), read_plain)(path)


def make_job(file: File) -> tuple[dict[str, Any], dict[str, Any]]:
    """Arrays and job of a file, without cameras, environments and counts."""
    materials, arrays, bsdfs = Materials(file), dict[str, Any](), []
    shapes = [side for shape in file.shapes for side in _luminous_sides(file, shape)]
    for k, shape in enumerate(shapes):
        attributes, num = shape.attributes, len(shape.attributes["POSITION"])
        arrays |= {
            f"positions_{k}": attributes["POSITION"],
            f"normals_{k}": attributes["NORMAL"],
            f"faces_{k}": shape.faces,
        }
        uv_set = f"TEXCOORD_{materials.uv_set(shape.material)}"
        arrays[f"uvs_{k}"] = attributes.get(uv_set, np.zeros((num, 2), np.float32))
        if "TANGENT" in attributes:
            arrays |= {
                f"tangent_of_{k}": attributes["TANGENT"][:, :3] * 0.5 + 0.5,
                f"hand_of_{k}": attributes["TANGENT"][:, 3:] * 0.5 + 0.5,
            }
        if "COLOR_0" in attributes:
            arrays[f"colors_of_{k}"] = np.ascontiguousarray(attributes["COLOR_0"][:, :3])
            if attributes["COLOR_0"].shape[1] == 4:
                arrays[f"alpha_of_{k}"] = np.ascontiguousarray(attributes["COLOR_0"][:, 3:])
        bsdfs.append(materials.bsdf(shape.material, attributes))
    job = {
        "integrator": {"type": "volpath", "max_depth": _DEPTH, "rr_depth": _RR_DEPTH}, "bsdfs": bsdfs,
        "sampler": "multijitter",
        "emitters": [emitter for attributes, to_world in file.lights for emitter in _emitter(attributes, to_world)],
    }  # fmt: skip
    return {**arrays, **materials.arrays}, job


def _luminous_sides(file: File, shape: Shape) -> list[Shape]:
    """The surface; if both sides of it shine, two that face apart, because the peer's emitters have one side."""
    description = {} if shape.material is None else file.json["materials"][shape.material]
    if not (description.get("doubleSided") and any(description.get("emissiveFactor", [0]))):
        return [shape]
    sides = []
    for sign in (1, -1):
        attributes = {**shape.attributes, "NORMAL": sign * shape.attributes["NORMAL"]}
        extent = np.ptp(attributes["POSITION"], axis=0).max()
        attributes["POSITION"] = attributes["POSITION"] + np.float32(_GAP * extent) * attributes["NORMAL"]
        faces = shape.faces if sign > 0 else np.ascontiguousarray(shape.faces[:, ::-1])
        sides.append(Shape(attributes, faces, shape.material))
    return sides


def _emitter(light: dict[str, Any], to_world: F64) -> list[dict[str, Any]]:
    """A light of KHR_lights_punctual."""
    gain = [_CANDELA * light.get("intensity", 1.0) * c for c in light.get("color", [1, 1, 1])]
    spectrum = {"type": "rgb", "value": gain}
    if light["type"] == "point":
        return [{"type": "point", "position": to_world[:3, 3].tolist(), "intensity": spectrum}]
    if light["type"] == "directional":
        return [{"type": "directional", "direction": (-to_world[:3, 2]).tolist(), "irradiance": spectrum}]
    raise ValueError(f"{light['type']} lights are not in these files")
