"""Small valid files with random tokens replaced: shown, or refused for a reason; never another error."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from for_all import for_all
from glb_builder import Glb
from hypothesis import strategies as st

from relume.assets.environments.environment import Environment
from relume.core.errors import RelumeError
from relume.scene_io.import_options import ImportOptions
from relume.scene_io.import_scene import import_scene
from relume.scene_io.materialx.import_document import import_materialx
from relume.scene_io.referenced_files import NoFiles

LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))
TOKEN = re.compile(r'"[^"]*"|[A-Za-z_:.]+|-?\d[\d.eE+-]*|\s+|.')
TOKENS = [
    "0",
    "-1",
    "2",
    "1e39",
    "nan",
    "inf",
    '"x"',
    "[0]",
    "[]",
    "(0, 0, 0)",
    "{}",
    "None",
    "@x@",
    "</>",
    "4294967295",
]
JSON: list[Any] = [None, True, 0, -1, 1e39, 2**32, 2**63, "", "x", "data:,", [], {}, [0], [1e30] * 3, {"index": 0}]
USD = """#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Y"
)
def Cube "Box" (
    prepend apiSchemas = ["MaterialBindingAPI"]
) {
    double size = 2
    color3f[] primvars:displayColor = [(1, 0, 0)]
    double3 xformOp:translate.timeSamples = {0: (0, 0, 0), 10: (1, 0, 0)}
    uniform token[] xformOpOrder = ["xformOp:translate"]
    rel material:binding = </Paint>
}
def Mesh "Quad" {
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    uniform token subdivisionScheme = "catmullClark"
    float[] creaseSharpnesses = [1]
    int[] creaseLengths = [2]
    int[] creaseIndices = [0, 1]
}
def Material "Paint" {
    token outputs:surface.connect = </Paint/Surface.outputs:surface>
    def Shader "Surface" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (1, 0.5, 0)
        float inputs:roughness = 0.5
        token outputs:surface
    }
}
def Camera "Camera" {
    float focalLength = 50
    float fStop = 0
}
def RectLight "Light" {
    float inputs:intensity = 2
    float inputs:width = 1
}
"""
MATERIALX = """<?xml version="1.0"?>
<materialx version="1.39">
  <constant name="c" type="color3"><input name="value" type="color3" value="0.5, 0.2, 0.1" /></constant>
  <open_pbr_surface name="S" type="surfaceshader">
    <input name="base_color" type="color3" nodename="c" />
    <input name="specular_roughness" type="float" value="0.3" />
    <input name="transmission_weight" type="float" value="0.5" />
  </open_pbr_surface>
  <surfacematerial name="M" type="material"><input name="surfaceshader" type="surfaceshader" nodename="S" />
  </surfacematerial>
</materialx>
"""
PLY = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
element face 1
property list uchar int vertex_indices
property list uchar float texcoord
element tristrips 1
property list int int vertex_indices
end_header
0 0 0 255 0 0
1 0 0 0 255 0
1 1 0 0 0 255
0 1 0 9 9 9
3 0 1 2 6 0 0 1 0 1 1
5 0 1 3 2 -1
"""
OBJ = "v 0 0 0 1 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nusemtl A\nf 1/1/1 2/1/1 3/1/1 4\nf -1 -2 -3\n"

pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")


def changes_of(values: st.SearchStrategy[Any]) -> st.SearchStrategy[list[tuple[int, Any]]]:
    """One to four changes: where, and the new value."""
    return st.lists(st.tuples(st.integers(0, 10_000), values), min_size=1, max_size=4)


def open_scene(data: bytes) -> None:
    import_scene(data, "test", LIGHT, NoFiles(), ImportOptions(time=0.5))


def open_materialx(data: bytes) -> None:
    import_materialx(data, NoFiles())


def only_refused(read: Callable[[bytes], None], data: bytes) -> None:
    with suppress(RelumeError):
        read(data)


@pytest.mark.parametrize(
    ("text", "read", "module"),
    [
        (USD, open_scene, "pxr.Usd"),
        (MATERIALX, open_materialx, "MaterialX"),
        (PLY, open_scene, "numpy"),
        (OBJ, open_scene, "numpy"),
    ],
    ids=["usd", "materialx", "ply", "obj"],
)
@for_all(30, changes=changes_of(st.sampled_from(TOKENS) | st.integers(0, 10_000)))
def test_mutated_texts(
    text: str, read: Callable[[bytes], None], module: str, changes: list[tuple[int, str | int]]
) -> None:
    """Tokens are replaced by others, or by another one of the file."""
    pytest.importorskip(module)
    tokens = TOKEN.findall(text)
    mutated = tokens.copy()
    for number, token in changes:
        mutated[number % len(tokens)] = token if isinstance(token, str) else tokens[token % len(tokens)]
    only_refused(read, "".join(mutated).encode())


def places(value: Any) -> list[tuple[Any, Any]]:
    """All containers in a document with each of their keys."""
    keys = list(value) if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else []
    return [(value, key) for key in keys] + [place for key in keys for place in places(value[key])]


def animated() -> Glb:
    material = {
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
        "extensions": {"KHR_materials_sheen": {"sheenColorFactor": [1, 0, 0]}},
    }
    glb = Glb().quad(material, JOINTS_0=np.zeros((4, 4), np.uint8), WEIGHTS_0=np.ones((4, 4), np.float32))
    glb.texture(np.zeros((2, 2, 3)), {"wrapS": 33071})
    sampler = {
        "input": glb.accessor(np.array([0, 1], np.float32)),
        "output": glb.accessor(np.array([[0, 0, 0], [0, 0, 1]], np.float32)),
    }
    glb.document["animations"] = [
        {"samplers": [sampler], "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]}
    ]
    glb.document["nodes"] = [{"mesh": 0, "skin": 0, "children": [1]}, {"camera": 0}]
    glb.document["skins"] = [{"joints": [1]}]
    glb.document["cameras"] = [{"type": "perspective", "perspective": {"yfov": 0.5}}]
    return glb


@for_all(30, changes=changes_of(st.sampled_from(JSON)))
def test_mutated_gltf_documents(changes: list[tuple[int, Any]]) -> None:
    glb = animated()
    for number, value in changes:
        candidates = places(glb.document)
        container, key = candidates[number % len(candidates)]
        container[key] = json.loads(json.dumps(value))
    only_refused(open_scene, glb.bytes())
