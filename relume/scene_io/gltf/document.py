"""The JSON of a glTF file as typed models with limits on counts, offsets and numbers.

Only properties that relume reads are declared; others are ignored. Objects and indices are checked when they are used.
glTF 2.0 specification, sections 3 and 5.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from relume.core.import_warnings import ImporterWarning
from relume.scene_io.gltf.tolerant import GltfObjects

MAX_COUNT = 2**32 - 1
MAX_WEIGHTS = 10_000
Index = int  # is checked when it is used
Indices = Annotated[tuple[Index, ...], Field(max_length=100_000, fail_fast=True)]
Bytes = Annotated[int, Field(ge=0, lt=2**40)]
Number = Annotated[float, Field(allow_inf_nan=False, ge=-1e30, le=1e30)]
Factor = Annotated[float, Field(allow_inf_nan=False, ge=0, le=1)]
Weights = Annotated[tuple[Number, ...], Field(max_length=MAX_WEIGHTS, fail_fast=True)]
Name = Annotated[str, Field(max_length=65_536)]
Names = Annotated[list[Name], Field(max_length=1_000, fail_fast=True)]
Extensions = Annotated[dict[str, Any], BeforeValidator(lambda value: value if value else {})]  # [] of some exporters


class GltfPrimitivePart(BaseModel):
    """A glTF object; each may have a name and extensions."""

    model_config = ConfigDict(frozen=True, extra="ignore")
    name: Name = ""
    extensions: Extensions = {}


class Asset(GltfPrimitivePart):
    version: Annotated[str, BeforeValidator(str), Field(pattern=r"^2(\.|$)")]
    generator: Name = ""


class Buffer(GltfPrimitivePart):
    uri: str | None = None
    byteLength: Bytes  # noqa: N815  (glTF's own spelling, here and below)


class BufferView(GltfPrimitivePart):
    buffer: Index
    byteOffset: int = 0  # noqa: N815
    byteLength: Bytes  # noqa: N815
    byteStride: Bytes | None = None  # noqa: N815


class SparseIndices(GltfPrimitivePart):
    bufferView: Index  # noqa: N815
    byteOffset: int = 0  # noqa: N815
    componentType: Literal[5121, 5123, 5125]  # noqa: N815


class SparseValues(GltfPrimitivePart):
    bufferView: Index  # noqa: N815
    byteOffset: int = 0  # noqa: N815


class Sparse(GltfPrimitivePart):
    count: Annotated[int, Field(ge=0, le=MAX_COUNT)]
    indices: SparseIndices
    values: SparseValues


class Accessor(GltfPrimitivePart):
    bufferView: Index | None = None  # noqa: N815
    byteOffset: int = 0  # noqa: N815
    componentType: Literal[5120, 5121, 5122, 5123, 5125, 5126]  # noqa: N815
    normalized: bool = False
    count: Annotated[int, Field(ge=0, le=MAX_COUNT)]
    type: Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"]
    sparse: Sparse | None = None


class Image(GltfPrimitivePart):
    uri: str | None = None
    bufferView: Index | None = None  # noqa: N815


class Sampler(GltfPrimitivePart):
    wrapS: int = 10_497  # noqa: N815
    wrapT: int = 10_497  # noqa: N815


class GltfTexture(GltfPrimitivePart):
    sampler: Index | None = None
    source: Index | None = None


class TextureInfo(GltfPrimitivePart):
    index: Index
    texCoord: Annotated[int, Field(ge=0, le=63)] = 0  # noqa: N815
    scale: Number = 1.0


class MetallicRoughness(GltfPrimitivePart):
    baseColorFactor: Annotated[list[Factor], Field(min_length=4, max_length=4)] = [1.0, 1.0, 1.0, 1.0]  # noqa: N815
    baseColorTexture: TextureInfo | None = None  # noqa: N815
    metallicFactor: Factor = 1.0  # noqa: N815
    roughnessFactor: Factor = 1.0  # noqa: N815
    metallicRoughnessTexture: TextureInfo | None = None  # noqa: N815


class GltfMaterial(GltfPrimitivePart):
    pbrMetallicRoughness: MetallicRoughness = MetallicRoughness()  # noqa: N815
    normalTexture: TextureInfo | None = None  # noqa: N815
    occlusionTexture: TextureInfo | None = None  # noqa: N815
    emissiveTexture: TextureInfo | None = None  # noqa: N815
    emissiveFactor: Annotated[list[Number], Field(min_length=3, max_length=3)] = [0.0, 0.0, 0.0]  # noqa: N815
    alphaMode: str = "OPAQUE"  # noqa: N815
    alphaCutoff: Annotated[Number, Field(ge=0)] = 0.5  # noqa: N815
    doubleSided: bool = False  # noqa: N815


class Primitive(GltfPrimitivePart):
    attributes: Annotated[dict[str, Index], Field(max_length=256)]
    indices: Index | None = None
    material: Index | None = None
    mode: Annotated[int, Field(ge=0, le=6)] = 4
    targets: Annotated[list[dict[str, Index]], Field(max_length=10_000, fail_fast=True)] = []


class GltfMesh(GltfPrimitivePart):
    """A mesh; its primitives are unchecked."""

    primitives: Annotated[list[Any], Field(max_length=65_536)] = []
    weights: Weights = ()


class Skin(GltfPrimitivePart):
    joints: Indices
    inverseBindMatrices: Index | None = None  # noqa: N815


class Perspective(GltfPrimitivePart):
    yfov: Annotated[float, Field(gt=0, lt=3.1, allow_inf_nan=False)]
    aspectRatio: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None  # noqa: N815


class GltfCamera(GltfPrimitivePart):
    type: Literal["perspective", "orthographic"]
    perspective: Perspective | None = None


class Node(GltfPrimitivePart):
    children: Indices = ()
    matrix: Annotated[list[Number], Field(min_length=16, max_length=16)] | None = None
    # tuples: pydantic would copy a default list for each of up to 100,000 nodes
    translation: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)
    rotation: tuple[Number, Number, Number, Number] = (0.0, 0.0, 0.0, 1.0)
    scale: tuple[Number, Number, Number] = (1.0, 1.0, 1.0)
    mesh: Index | None = None
    camera: Index | None = None
    skin: Index | None = None
    weights: Weights = ()


class AnimationSampler(GltfPrimitivePart):
    input: Index
    output: Index
    interpolation: Literal["LINEAR", "STEP", "CUBICSPLINE"] = "LINEAR"


class AnimationTarget(GltfPrimitivePart):
    node: Index | None = None
    path: Name = ""


class AnimationChannel(GltfPrimitivePart):
    sampler: Index
    target: AnimationTarget


class Animation(GltfPrimitivePart):
    channels: Annotated[list[AnimationChannel], Field(max_length=100_000, fail_fast=True)] = []
    samplers: Annotated[list[AnimationSampler], Field(max_length=100_000, fail_fast=True)] = []


class SceneRoot(GltfPrimitivePart):
    nodes: Indices = ()


LIMITS = {
    "accessors": 1_000_000,
    "animations": 10_000,
    "buffers": 10_000,
    "bufferViews": 1_000_000,
    "cameras": 1_000,
    "images": 10_000,
    "materials": 1_000,
    "meshes": 100_000,
    "nodes": 100_000,
    "samplers": 10_000,
    "scenes": 10_000,
    "skins": 10_000,
    "textures": 10_000,
}
"""Largest allowed number of objects in each list of a file."""


class Root(GltfPrimitivePart):
    """The outermost object of a file; the objects of its lists are unchecked."""

    asset: Asset
    extensionsUsed: Names = []  # noqa: N815
    extensionsRequired: Names = []  # noqa: N815
    accessors: list[Any] = []
    animations: list[Any] = []
    buffers: list[Any] = []
    bufferViews: list[Any] = []  # noqa: N815
    cameras: list[Any] = []
    images: list[Any] = []
    materials: list[Any] = []
    meshes: list[Any] = []
    nodes: list[Any] = []
    samplers: list[Any] = []
    scene: Index | None = None
    scenes: list[Any] = []
    skins: list[Any] = []
    textures: list[Any] = []


class Document:
    """A whole file: its outermost object, and its objects by kind."""

    def __init__(self, root: Root, warnings: list[ImporterWarning]) -> None:
        """
        Args:
            root: outermost object. warnings: gets a sentence for each repair of an object that is used.
        """
        self.root, self._warnings = root, warnings
        self._primitives: dict[int, GltfObjects[Primitive]] = {}
        self.accessors = GltfObjects(Accessor, root.accessors, "accessor", warnings)
        self.animations = GltfObjects(Animation, root.animations, "animation", warnings)
        self.buffers = GltfObjects(Buffer, root.buffers, "buffer", warnings)
        self.buffer_views = GltfObjects(BufferView, root.bufferViews, "buffer view", warnings)
        self.cameras = GltfObjects(GltfCamera, root.cameras, "camera", warnings)
        self.images = GltfObjects(Image, root.images, "image", warnings)
        self.materials = GltfObjects(GltfMaterial, root.materials, "material", warnings)
        self.meshes = GltfObjects(GltfMesh, root.meshes, "mesh", warnings)
        self.nodes = GltfObjects(Node, root.nodes, "node", warnings)
        self.samplers = GltfObjects(Sampler, root.samplers, "sampler", warnings)
        self.scenes = GltfObjects(SceneRoot, root.scenes, "scene", warnings)
        self.skins = GltfObjects(Skin, root.skins, "skin", warnings)
        self.textures = GltfObjects(GltfTexture, root.textures, "texture", warnings)

    def used(self) -> list[tuple[str, Any]]:
        """Return label and JSON of each object that was read, the outermost one aside."""
        return [item for objects in vars(self).values() if isinstance(objects, GltfObjects) for item in objects.used()]

    def primitives(self, mesh: int) -> GltfObjects[Primitive]:
        """The primitives of a mesh. Raises SceneError if the mesh does not exist or is invalid."""
        if mesh not in self._primitives:
            items, kind = self.meshes.get(mesh).primitives, f"primitive of {self.meshes.label(mesh)}"
            self._primitives[mesh] = GltfObjects(Primitive, items, kind, self._warnings)
        return self._primitives[mesh]
