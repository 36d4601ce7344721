"""glTF to Scene: what relume understands, and one warning for each thing it does not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.environments.model import Environment
from relume.environments.studio import studio
from relume.errors import SceneError
from relume.remarks import Remark, simplified, unused, wrong
from relume.scene.checks import MAX_TRIANGLES
from relume.scene.companions import Alone, Companions
from relume.scene.finish import finished_scene
from relume.scene.gltf.accessors import AccessorReader
from relume.scene.gltf.cameras import framing_camera, rigid, slug
from relume.scene.gltf.container import READ_EXTENSIONS, Container, read_container
from relume.scene.gltf.document import Document, Node, Primitive
from relume.scene.gltf.document import Material as GltfMaterial
from relume.scene.gltf.flattened import cofactors, determinant, dimensions, plane_normal, with_area
from relume.scene.gltf.geometry import MAX_COORDINATE, Geometry, num_corners, read_primitive
from relume.scene.gltf.images import ImageReader
from relume.scene.gltf.instances import instances_of
from relume.scene.gltf.lights import LightReader
from relume.scene.gltf.materials import WHITE, MaterialReader, Understood, VertexColors, has_textures
from relume.scene.gltf.names import unique_name
from relume.scene.gltf.nodes import placed_nodes
from relume.scene.gltf.uvs import made_tangents, turned_tangents
from relume.scene.gltf.variants import Choices, choices, variant_looks, variant_names
from relume.scene.joined import joined
from relume.scene.lights import LightCollector
from relume.scene.model import F32, Camera, Mesh, Scene
from relume.scene.vertex_colors import MAX_COLORED, are_alike, colors_as_image

F64 = NDArray[np.float64]
Key = tuple[int, int]  # a mesh and a primitive of it
MAX_VERTICES = MAX_CORNERS = 3 * MAX_TRIANGLES
MAX_PLACED = 100_000  # primitives times the nodes and the instances that show them
_MANY = 2_000  # meshes; more of one material are joined, for each is a handful of arrays in files and in memory


def import_gltf(
    data: bytes, name: str, environment: Environment | None = None, companions: Companions | None = None
) -> Scene:
    """Reads a .glb file, or a .gltf file.

    Args:
        data: the file's bytes.
        name: what people call the scene.
        environment: the light; the studio of the built-in scene where None.
        companions: the files that it may name; none where None.

    Returns:
        The scene, nodes applied: one mesh per primitive and node, cameras or one view "front", lights and materials
        that shine.

    Raises:
        SceneError: the file cannot be used; the message says why and what to do.
    """
    reading = _Reading(read_container(data, companions or Alone()))
    materials = [understood.material for understood in reading.materials]
    parts = (name, reading.meshes, materials, reading.cameras, environment or studio())
    return finished_scene(*parts, reading.warnings, reading.variants, reading.lights)


class _Dressed(NamedTuple):
    """A primitive, its places in textures, and the material that it wears."""

    geometry: Geometry
    uvs: F32
    understood: Understood
    material: int


class _Reading:
    """One file on its way to a scene: walks the nodes, reading meshes and materials when they are first met."""

    def __init__(self, container: Container) -> None:
        self._document = container.document
        self._accessors = AccessorReader(container)
        self.warnings: list[Remark] = []
        self._material_reader = MaterialReader(ImageReader(container), self.warnings)
        self._collector = LightCollector(self.warnings)
        self._light_reader = LightReader(container.document, self._collector, self.warnings)
        self._geometry: dict[Key, Geometry | None] = {}
        self._material_index: dict[tuple[int | None, Choices], int] = {}
        self._choices = _choices(container.document)
        self._wearing = _wearing(container.document, self._choices)
        self._worn: dict[tuple[Key, int], _Dressed] = {}
        self._mesh_names: dict[str, int] = {}
        self._flattened: list[str] = []
        self._camera_names: dict[str, int] = {}
        self._places_left, self._corners_left = MAX_PLACED, MAX_CORNERS
        self._triangles_left, self._vertices_left = MAX_TRIANGLES, MAX_VERTICES
        self.materials: list[Understood] = []
        self.meshes: list[Mesh] = []
        self.cameras: list[Camera] = []
        self._warn_of_the_rest()
        for node, to_world in placed_nodes(self._document, self.warnings):
            self._place(node, to_world)
        if self._flattened:
            num, first = len(self._flattened), self._flattened[0]
            self.warnings.append(simplified(f"{num:,} meshes are flattened by their nodes, {first!r} among them"))
        if len(self.meshes) > _MANY:
            self.meshes = joined(self.meshes)
        if not self.meshes:
            raise SceneError("the scene has no triangles with an area; export at least one mesh made of triangles")
        emissions = [np.array(understood.emission) for understood in self.materials]
        own = [understood.material for understood in self.materials]
        lit = self._collector.shine(own, emissions, self.meshes)
        self.materials = [replace(u, material=material) for u, material in zip(self.materials, lit, strict=True)]
        self.lights = self._collector.lights
        self.variants = self._read_variants()
        if not self.cameras:
            self.cameras.append(framing_camera(self.meshes, slug("front", self._camera_names)))

    def _place(self, node: Node, to_world: F64) -> None:
        if node.camera is not None:
            self._place_camera(node, to_world)
        self._light_reader.place(node, to_world)
        if node.mesh is None:
            return
        if node.mesh >= len(self._document.meshes):
            raise SceneError(f"mesh {node.mesh} does not exist; export the scene again")
        if node.skin is not None:
            self.warnings.append(simplified(f"the skin of node {node.name[:80]!r} is not used; it has its rest pose"))
        mesh = self._document.meshes[node.mesh]
        instances = instances_of(node, self._accessors, self._places_left, self.warnings)
        self._places_left -= len(mesh.primitives) * len(instances)
        if self._places_left < 0:
            raise SceneError(f"the scene shows more than {MAX_PLACED:,} meshes; join them (gltf-transform join)")
        for instance in instances:
            for i, primitive in enumerate(mesh.primitives):
                name = unique_name(node.name or mesh.name or "mesh", self._mesh_names)
                self._place_primitive((node.mesh, i), primitive, name, to_world @ instance)

    def _read_geometry(self, key: Key, primitive: Primitive, name: str) -> Geometry | None:
        if key not in self._geometry:
            self._corners_left -= num_corners(self._document, primitive)
            if self._corners_left < 0:
                raise SceneError(f"the file describes more than {MAX_TRIANGLES:,} triangles; simplify it")
            self._accessors.unpack(primitive, f"mesh {name!r}")
            self._geometry[key] = read_primitive(self._accessors, primitive, f"mesh {name!r}", self.warnings)
        return self._geometry[key]

    def _place_primitive(self, key: Key, primitive: Primitive, name: str, to_world: F64) -> None:
        if self._read_geometry(key, primitive, name) is None:
            return
        material = self._material(key, primitive)
        geometry = self._geometry[key]
        assert geometry is not None
        self._triangles_left -= len(geometry.faces)
        self._vertices_left -= len(geometry.positions)
        if min(self._triangles_left, self._vertices_left) < 0:
            raise SceneError(f"the scene has more than {MAX_TRIANGLES:,} triangles; simplify it")
        num_dimensions = dimensions(to_world[:3, :3])
        placed = _placed(self._dressed(key, geometry, material), to_world, num_dimensions, name)
        if placed is not None and num_dimensions == 2:
            self._flattened.append(name)
        if placed is None:
            self.warnings.append(wrong(f"mesh {name!r} is scaled to nothing or out of range; it is left out"))
        else:
            self.meshes.append(placed)

    def _dressed(self, key: Key, geometry: Geometry, material: int) -> _Dressed:
        """A primitive with its material, made once for all the nodes that show it."""
        if (key, material) not in self._worn:
            understood = self.materials[material]
            uvs = understood.uv_use.apply(geometry.uvs, len(geometry.positions))
            self._worn[key, material] = _Dressed(geometry, uvs, understood, material)
        return self._worn[key, material]

    def _material(self, key: Key, primitive: Primitive) -> int:
        """Number of the primitive's material; those that variants exchange differently are different ones."""
        exchanges = self._choices[key]
        worn = (primitive.material, exchanges)
        if worn not in self._material_index:
            self._material_index[worn] = len(self.materials)
            colors = self._vertex_colors(primitive.material, exchanges)
            self.materials.append(self._read_material(primitive.material, colors))
        return self._material_index[worn]

    def _vertex_colors(self, index: int | None, exchanges: Choices) -> VertexColors:
        """The colours of all vertices that wear a material; where they become an image, geometries get places in it."""
        wearing = self._wearing[index, exchanges]
        if not any("COLOR_0" in primitive.attributes for _, primitive in wearing):
            return WHITE
        read = {key: self._read_geometry(key, primitive, f"of {key[0]}") for key, primitive in wearing}
        worn = {key: geometry for key, geometry in read.items() if geometry is not None}
        colored = {key: geometry.colors for key, geometry in worn.items() if geometry.colors is not None}
        if not colored:
            return WHITE
        white = [np.ones((1, 4), np.float32)] if len(colored) < len(worn) else []
        colors = np.concatenate([*colored.values(), *white])
        red, green, blue, alpha = colors.mean(axis=0, dtype=np.float64).tolist()
        material = self._gltf_material(index)
        if are_alike(colors):
            return VertexColors((red, green, blue, alpha))
        num_triangles = sum(len(worn[key].faces) for key in colored)
        if has_textures(material) or num_triangles > MAX_COLORED:
            why = "has textures" if has_textures(material) else f"colours more than {MAX_COLORED:,} triangles"
            told = f"vertex colours of material {material.name[:80]!r}, which {why}, are replaced by their mean"
            self.warnings.append(simplified(told))
            return VertexColors((red, green, blue, alpha))
        return VertexColors(image=self._drawn(worn))

    def _drawn(self, worn: dict[Key, Geometry]) -> NDArray[np.uint8]:
        """Draw the colours of geometries, and place these in the image."""
        has = {key: geometry.colors for key, geometry in worn.items() if geometry.colors is not None}
        corners = [colors[worn[key].faces] for key, colors in has.items()]
        image, places, white = colors_as_image(np.concatenate(corners))
        parts = np.split(places, np.cumsum([len(part) for part in corners])[:-1])
        self._geometry |= {key: worn[key].with_own_corners(part) for key, part in zip(has, parts, strict=True)}
        for key in worn.keys() - has.keys():
            nowhere = np.tile(white, (len(worn[key].positions), 1))
            self._geometry[key] = replace(worn[key], uvs=(nowhere,))
        return image

    def _read_material(self, index: int | None, colors: VertexColors = WHITE) -> Understood:
        return self._material_reader.read(self._gltf_material(index), colors)

    def _gltf_material(self, index: int | None) -> GltfMaterial:
        if index is not None and index >= len(self._document.materials):
            raise SceneError(f"material {index} does not exist; export the scene again")
        return GltfMaterial(name="default") if index is None else self._document.materials[index]

    def _read_variants(self) -> dict[str, dict[str, Any]]:
        known = {index: self.materials[number] for (index, _), number in self._material_index.items()}
        wanted = {index for _, exchanges in self._material_index for _, index in exchanges}
        wardrobe = {index: known.get(index) or self._read_material(index) for index in sorted(wanted)}
        worn = [(self.materials[number], exchanges) for (_, exchanges), number in self._material_index.items()]
        return variant_looks(variant_names(self._document), worn, wardrobe, self.warnings)

    def _place_camera(self, node: Node, to_world: F64) -> None:
        if node.camera is None or node.camera >= len(self._document.cameras):
            raise SceneError(f"camera {node.camera} does not exist; export the scene again")
        camera = self._document.cameras[node.camera]
        name = camera.name or node.name or "camera"
        frame = rigid(to_world)
        if camera.perspective is None or camera.type != "perspective":
            self.warnings.append(wrong(f"camera {name[:80]!r} is not a perspective one; it is left out"))
        elif frame is None:
            self.warnings.append(wrong(f"camera {name[:80]!r} is scaled to nothing; it is left out"))
        else:
            yfov, aspect = camera.perspective.yfov, camera.perspective.aspectRatio
            self.cameras.append(Camera(slug(name, self._camera_names), frame, yfov, aspect))

    def _warn_of_the_rest(self) -> None:
        document = self._document
        if document.animations:
            many = len(document.animations)
            animations = "1 animation is" if many == 1 else f"{many} animations are"
            self.warnings.append(unused(f"{animations} not used; everything has its rest pose"))
        for extension in document.extensionsRequired:
            if extension not in READ_EXTENSIONS:
                self.warnings.append(
                    wrong(f"the file requires {extension[:60]!r}, which is not understood; it may look wrong")
                )


def _choices(document: Document) -> dict[Key, Choices]:
    """How the primitives of all meshes exchange their materials."""
    return {
        (m, i): choices(primitive)
        for m, mesh in enumerate(document.meshes)
        for i, primitive in enumerate(mesh.primitives)
    }


def _wearing(
    document: Document, exchanges: Mapping[Key, Choices]
) -> dict[tuple[int | None, Choices], list[tuple[Key, Primitive]]]:
    """The primitives that wear each material, and exchange it alike."""
    found: dict[tuple[int | None, Choices], list[tuple[Key, Primitive]]] = {}
    for (m, i), chosen in exchanges.items():
        primitive = document.meshes[m].primitives[i]
        found.setdefault((primitive.material, chosen), []).append(((m, i), primitive))
    return found


def _placed(dressed: _Dressed, to_world: F64, num_dimensions: int, name: str) -> Mesh | None:
    """The geometry in world space; None where the transform leaves nothing of it. A mirror turns the faces round."""
    geometry, uvs, understood, material = dressed
    linear = to_world[:3, :3]
    positions = geometry.positions @ linear.T + to_world[:3, 3]
    if num_dimensions < 2 or np.abs(positions).max() > MAX_COORDINATE:
        return None
    hand = np.sign(determinant(linear)) if num_dimensions == 3 else 1.0
    faces = geometry.faces if hand > 0 else np.ascontiguousarray(geometry.faces[:, ::-1])
    normals = _unit(geometry.normals @ (hand * cofactors(linear)).T)
    if num_dimensions == 2:
        faces = with_area(positions, faces)
        normals = np.where(normals.any(axis=1, keepdims=True), normals, plane_normal(linear))
        if not len(faces):
            return None
    tangents = np.zeros((len(positions), 4))
    tangents[:, :3] = _unit(geometry.tangents[:, :3] @ linear.T)
    tangents[:, 3] = geometry.tangents[:, 3] * hand
    placed = Mesh(
        name,
        positions.astype(np.float32),
        normals.astype(np.float32),
        tangents.astype(np.float32),
        uvs,
        faces,
        material,
    )
    if understood.material.normal_map is None and understood.turn is None:
        return placed
    if not placed.tangents.any():
        placed = replace(placed, tangents=made_tangents(placed.positions, placed.normals, placed.uvs, faces))
    if not understood.turn:
        return placed
    return replace(placed, tangents=turned_tangents(placed.tangents, placed.normals, understood.turn))


def _unit(vectors: F64) -> F64:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1))
