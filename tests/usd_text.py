"""USD layers as text, for tests."""

from __future__ import annotations

import io
from collections.abc import Mapping

import numpy as np
import PIL.Image

from relume.assets.environments.environment import Environment
from relume.scene.model import Scene
from relume.scene_io.import_options import ImportOptions
from relume.scene_io.import_scene import import_scene
from relume.scene_io.referenced_files import Companions

WHITE = Environment("white", np.ones((2, 4, 3), np.float32))


class Files:
    """Companions of a layer by name."""

    def __init__(self, contents: Mapping[str, bytes] | None = None) -> None:
        self._contents = dict(contents or {})

    def read(self, name: str, label: str) -> bytes | None:
        """See `Companions.read`."""
        return self._contents.get(name)


def usda(body: str, metadata: str = "") -> bytes:
    """A layer with meters and +Y up unless the metadata say otherwise."""
    plain = "" if "metersPerUnit" in metadata else "metersPerUnit = 1\n"
    return f"#usda 1.0\n(\n{plain}{metadata}\n)\n{body}".encode()


def quad(name: str = "Quad", properties: str = "", metadata: str = "", children: str = "") -> str:
    """A square of side 2 around the origin that faces +Z."""
    return f"""
def Mesh "{name}" (
    {metadata}
)
{{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    uniform token subdivisionScheme = "none"
    {properties}
    {children}
}}
"""


ST = """texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (
        interpolation = "vertex"
    )"""
BOUND = 'prepend apiSchemas = ["MaterialBindingAPI"]'


def material(inputs: str, nodes: str = "", name: str = "Paint") -> str:
    """A material with a UsdPreviewSurface; `nodes` stand in it."""
    return f"""
def Material "{name}"
{{
    token outputs:surface.connect = </{name}/Surface.outputs:surface>
    def Shader "Surface"
    {{
        uniform token info:id = "UsdPreviewSurface"
        {inputs}
        token outputs:surface
    }}
    {nodes}
}}
"""


def texture(name: str, file: str, inputs: str = "") -> str:
    """A UsdUVTexture; it repeats, and takes `st` without a node."""
    return f"""
    def Shader "{name}"
    {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @{file}@
        token inputs:wrapS = "repeat"
        token inputs:wrapT = "repeat"
        {inputs}
        float3 outputs:rgb
        float outputs:r
        float outputs:g
        float outputs:b
        float outputs:a
    }}
"""


def painted(inputs: str, nodes: str = "", properties: str = ST) -> str:
    """A quad with a material."""
    binding = "rel material:binding = </Paint>"
    return quad(properties=f"{properties}\n    {binding}", metadata=BOUND) + material(inputs, nodes)


def imported(
    layer: bytes,
    companions: Companions | None = None,
    options: ImportOptions | None = None,
    environment: Environment | None = WHITE,
) -> Scene:
    """The scene of a layer."""
    return import_scene(layer, "test", environment, companions or Files(), options)


def png(pixels: object) -> bytes:
    """A PNG image of bytes, (height, width, channels)."""
    encoded = io.BytesIO()
    PIL.Image.fromarray(np.asarray(pixels, np.uint8)).save(encoded, "PNG")
    return encoded.getvalue()


RGB = "color3f inputs:diffuseColor.connect = </Paint/Image.outputs:rgb>"
CHECKER = png([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]])
