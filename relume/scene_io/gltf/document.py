"""The JSON of a glTF file as typed models with limits on counts, offsets and numbers.

Only properties that relume reads are declared; others are ignored. Indices are checked when they are used.
glTF 2.0 specification, sections 3 and 5.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

MAX_COUNT = 2**32 - 1
Index = Annotated[int, Field(ge=0, lt=2**31, strict=True)]
Indices = Annotated[tuple[Index, ...], Field(max_length=100_000, fail_fast=True)]
Bytes = Annotated[int, Field(ge=0, lt=2**40, strict=True)]
Number = Annotated[float, Field(allow_inf_nan=False, ge=-1e30, le=1e30)]
Factor = Annotated[float, Field(allow_inf_nan=False, ge=0, le=1)]
Name = Annotated[str, Field(max_length=65_536)]
Names = Annotated[list[Name], Field(max_length=1_000, fail_fast=True)]
Extensions = dict[str, Any]


class GltfPrimitivePart(BaseModel):
    """A glTF object; each may have a name and extensions."""

    model_config = ConfigDict(frozen=True, extra="ignore")
    name: Name = ""
    extensions: Extensions = {}


class Asset(GltfPrimitivePart):
    version: Annotated[str, Field(pattern=r"^2\.\d+$")]


class Buffer(GltfPrimitivePart):
    uri: str | None = None
    byteLength: Bytes  # noqa: N815  (glTF's own spelling, here and below)


class BufferView(GltfPrimitivePart):
    buffer: Index
    byteOffset: Bytes = 0  # noqa: N815
    byteLength: Annotated[Bytes, Field(ge=1)]  # noqa: N815
    byteStride: Annotated[int, Field(ge=4, le=252)] | None = None  # noqa: N815


class SparseIndices(GltfPrimitivePart):
    bufferView: Index  # noqa: N815
    byteOffset: Bytes = 0  # noqa: N815
    componentType: Literal[5121, 5123, 5125]  # noqa: N815


class SparseValues(GltfPrimitivePart):
    bufferView: Index  # noqa: N815
    byteOffset: Bytes = 0  # noqa: N815


class Sparse(GltfPrimitivePart):
    count: Annotated[int, Field(ge=1, le=MAX_COUNT)]
    indices: SparseIndices
    values: SparseValues


class Accessor(GltfPrimitivePart):
    bufferView: Index | None = None  # noqa: N815
    byteOffset: Bytes = 0  # noqa: N815
    componentType: Literal[5120, 5121, 5122, 5123, 5125, 5126]  # noqa: N815
    normalized: bool = False
    count: Annotated[int, Field(ge=1, le=MAX_COUNT)]
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
    targets: list[Any] = []


class GltfMesh(GltfPrimitivePart):
    primitives: Annotated[list[Primitive], Field(min_length=1, max_length=65_536, fail_fast=True)]


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


class SceneRoot(GltfPrimitivePart):
    nodes: Indices = ()


class Document(GltfPrimitivePart):
    """The whole file. Lists over the limit are rejected before their items are validated."""

    asset: Asset
    extensionsUsed: Names = []  # noqa: N815
    extensionsRequired: Names = []  # noqa: N815
    accessors: Annotated[list[Accessor], Field(max_length=1_000_000, fail_fast=True)] = []
    animations: list[Any] = []
    buffers: Annotated[list[Buffer], Field(max_length=10_000, fail_fast=True)] = []
    bufferViews: Annotated[list[BufferView], Field(max_length=1_000_000, fail_fast=True)] = []  # noqa: N815
    cameras: Annotated[list[GltfCamera], Field(max_length=1_000, fail_fast=True)] = []
    images: Annotated[list[Image], Field(max_length=10_000, fail_fast=True)] = []
    materials: Annotated[list[GltfMaterial], Field(max_length=1_000, fail_fast=True)] = []
    meshes: Annotated[list[GltfMesh], Field(max_length=100_000, fail_fast=True)] = []
    nodes: Annotated[list[Node], Field(max_length=100_000, fail_fast=True)] = []
    samplers: Annotated[list[Sampler], Field(max_length=10_000, fail_fast=True)] = []
    scene: Index | None = None
    scenes: Annotated[list[SceneRoot], Field(max_length=10_000, fail_fast=True)] = []
    skins: list[Any] = []
    textures: Annotated[list[GltfTexture], Field(max_length=10_000, fail_fast=True)] = []
