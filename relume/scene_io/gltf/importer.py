"""Conversion of glTF to a scene, with a warning for each unsupported feature."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.environment import Environment
from relume.assets.environments.studio import studio
from relume.core.errors import SceneError
from relume.core.import_warnings import approximated, ignored, quote, unsupported
from relume.math.bounding_box import bounding_box, box_corners
from relume.scene.collect_lights import LightCollector
from relume.scene.finalize import finalize, no_triangles
from relume.scene.merge_meshes import merge_by_material
from relume.scene.model import Camera, Mesh, Scene
from relume.scene.tangents import compute_tangents
from relume.scene.textured_vertex_colors import TexturedColors, draw_textured_colors
from relume.scene.unique_names import unique_name
from relume.scene.validate import MAX_TRIANGLES
from relume.scene.vertex_colors import MAX_COLORED, WRAP, draw_color_image, is_uniform
from relume.scene_io.gltf.accessors import AccessorReader
from relume.scene_io.gltf.animation import pose_nodes
from relume.scene_io.gltf.cameras import framing_camera, make_slug, rigid_frame
from relume.scene_io.gltf.container import GltfContainer, read_container
from relume.scene_io.gltf.degenerate_transforms import (
    count_dimensions,
)
from relume.scene_io.gltf.document import GltfMaterial as GltfMaterial
from relume.scene_io.gltf.document import Node, Primitive
from relume.scene_io.gltf.geometry import GltfGeometry, count_corners, read_primitive
from relume.scene_io.gltf.images import ImageReader
from relume.scene_io.gltf.instances import read_instances
from relume.scene_io.gltf.lights import LightReader
from relume.scene_io.gltf.materials import MaterialReader
from relume.scene_io.gltf.nodes import PlacedNode, place_nodes, scene_roots
from relume.scene_io.gltf.skins import read_skins, skin_geometry
from relume.scene_io.gltf.unknown_extensions import warn_unknown_extensions
from relume.scene_io.gltf.variants import Choices, read_choices, variant_looks, variant_names
from relume.scene_io.gltf.world_mesh import BoundPrimitive, make_world_mesh
from relume.scene_io.import_options import ImportOptions, Recenter
from relume.scene_io.origin import choose_origin, moved_warning
from relume.scene_io.referenced_files import Companions, NoFiles
from relume.scene_io.surfaces.make_material import NO_COLORS, ReadMaterial, VertexColors
from relume.scene_io.surfaces.material_textures import TextureLayout

F64 = NDArray[np.float64]
MAX_VERTICES = MAX_CORNERS = 3 * MAX_TRIANGLES
MAX_INSTANCES = 100_000  # primitives times the nodes and instances that show them
_DEFAULT_MATERIAL = GltfMaterial(name="default")
_MAX_SEPARATE_MESHES = 2_000  # beyond, meshes are merged by material: each has its own arrays in files and memory


def import_gltf(
    data: bytes,
    name: str,
    environment: Environment | None = None,
    companions: Companions | None = None,
    options: ImportOptions | None = None,
) -> Scene:
    """Import a .glb or .gltf file.

    Args:
        data: the file's bytes.
        name: name of the scene, shown to users.
        environment: None for the built-in studio.
        companions: files that it may refer to; None for none.
        options: `light_unit`, `scene_name`, `time`, and `recenter` of a scene far from zero; None for the defaults.

    Returns:
        The scene, with node transforms applied: one mesh per primitive and node, cameras or one view "front", lights
        and emissive materials.

    Raises:
        SceneError: the file is unusable; the message says why and what to do.
    """
    builder = _SceneBuilder(read_container(data, companions or NoFiles(), []), options or ImportOptions())
    materials = [read_material.material for read_material in builder.materials]
    contents = (name, builder.meshes, materials, builder.cameras, environment or studio())
    x, y, z = builder.origin.tolist()
    return finalize(*contents, builder.warnings, builder.variants, builder.lights, (x, y, z))


class PrimitiveKey(NamedTuple):
    """A primitive as it is shown: mesh and number in it, weights of its morph targets, and skin."""

    mesh: int
    number: int
    weights: tuple[float, ...]
    skin: int | None


class _SceneBuilder:
    """Builds the scene of one file: walks the nodes, and reads meshes and materials on first use."""

    def __init__(self, container: GltfContainer, options: ImportOptions) -> None:
        self._document = container.document
        self._accessors = AccessorReader(container)
        self.warnings = container.warnings
        self._material_reader = MaterialReader(ImageReader(container, self.warnings), self.warnings)
        self._collector = LightCollector(self.warnings)
        self._light_reader = LightReader(container.document, self._collector, options.light_unit, self.warnings)
        self._geometry: dict[PrimitiveKey, GltfGeometry | None] = {}
        self._material_index: dict[tuple[int | None, Choices], int] = {}
        if options.time is None:
            self._warn_animations()
        else:
            pose_nodes(self._document, options.time, self._accessors, self.warnings)
        self._nodes = place_nodes(
            self._document, scene_roots(self._document, options.scene_name, self.warnings), self.warnings
        )
        self._skins = read_skins(self._document, self._nodes, self._accessors, self.warnings)
        self._choices: dict[PrimitiveKey, Choices] = {}
        self._primitives: dict[tuple[int | None, Choices], list[PrimitiveKey]] = {}
        self._bound_primitives: dict[tuple[PrimitiveKey, int], BoundPrimitive] = {}
        self._mesh_names: dict[str, int] = {}
        self._flattened: list[str] = []
        self._camera_names: dict[str, int] = {}
        self._remaining_instances, self._remaining_corners = MAX_INSTANCES, MAX_CORNERS
        self._remaining_triangles, self._remaining_vertices = MAX_TRIANGLES, MAX_VERTICES
        self.materials: list[ReadMaterial] = []
        self.meshes: list[Mesh] = []
        self.cameras: list[Camera] = []
        self._shown: list[tuple[PrimitiveKey, str, F64]] = []  # with the name and transform of each mesh
        self._list_primitives()
        for placed in self._nodes:
            self._list_meshes(placed)
        self.origin = self._choose_origin(options.recenter)
        self.warnings.extend(moved_warning(self.origin))
        for key, name, to_world in self._shown:
            self._add_primitive(key, name, self._moved(to_world))
        for placed in self._nodes:
            self._add_view_and_light(placed)
        if self._flattened:
            num, first = len(self._flattened), self._flattened[0]
            message = f"{num:,} meshes are flattened by the scale of their nodes, for example {quote(first)}."
            self.warnings.append(approximated(message))
        if len(self.meshes) > _MAX_SEPARATE_MESHES:
            self.meshes = merge_by_material(self.meshes)
        if not self.meshes:
            raise SceneError(no_triangles(self.warnings, self._contents()))
        emissions = [np.array(read_material.emission) for read_material in self.materials]
        scene_materials = [read_material.material for read_material in self.materials]
        lit = self._collector.emissive_light(scene_materials, emissions, self.meshes)
        self.materials = [replace(u, material=material) for u, material in zip(self.materials, lit, strict=True)]
        self._light_reader.warn_dim_lights(self._document.root.asset.generator)
        self.lights = self._collector.lights
        self.variants = self._read_variants()
        self._material_reader.warn_occlusion_maps()
        warn_unknown_extensions(self._document, self.warnings)
        if not self.cameras:
            self.cameras.append(framing_camera(self.meshes, make_slug("front", self._camera_names)))

    def _contents(self) -> str:
        """Contents of a file that shows nothing, as a clause."""
        if not len(self._document.meshes):
            return "the file has no meshes"
        shown = any(placed.node.mesh is not None and placed.is_visible for placed in self._nodes)
        return "its triangles have no area" if shown else "no node of the scene shows a mesh"

    def _list_primitives(self) -> None:
        """Group the primitives of visible nodes by material and its variants."""
        for key in dict.fromkeys(key for placed in self._nodes for key in self._keys(placed)):
            primitive = self._primitive(key)
            label = self._document.meshes.label(key.mesh)
            self._choices[key] = read_choices(primitive, label, self.warnings)
            self._primitives.setdefault((primitive.material, self._choices[key]), []).append(key)

    def _keys(self, placed: PlacedNode) -> list[PrimitiveKey]:
        """The valid primitives of a visible node."""
        node = placed.node
        if node.mesh is None or not placed.is_visible:
            return []
        keys = []
        try:
            primitives = self._document.primitives(node.mesh)
            weights = node.weights or self._document.meshes.get(node.mesh).weights
        except SceneError as problem:
            self._warn_once(f"A mesh was left out: {problem}.")
            return []
        for number in range(len(primitives)):
            try:
                primitive = primitives.get(number)
            except SceneError as problem:
                self._warn_once(f"A mesh was left out: {problem}.")
                continue
            is_skinned = node.skin in self._skins and "JOINTS_0" in primitive.attributes
            is_morphed = bool(primitive.targets) and any(weights)
            keys.append(
                PrimitiveKey(node.mesh, number, weights if is_morphed else (), node.skin if is_skinned else None)
            )
        return keys

    def _primitive(self, key: PrimitiveKey) -> Primitive:
        return self._document.primitives(key.mesh).get(key.number)

    def _warn_once(self, message: str) -> None:
        if message not in self.warnings:
            self.warnings.append(unsupported(message))

    def _add_view_and_light(self, placed: PlacedNode) -> None:
        to_world = self._moved(placed.to_world)
        if placed.node.camera is not None:
            self._add_camera(placed.node, to_world)
        if placed.is_visible:
            self._light_reader.add(placed.node, self._document.nodes.label(placed.number), to_world)

    def _list_meshes(self, placed: PlacedNode) -> None:
        """List what a visible node shows."""
        node, keys = placed.node, self._keys(placed)
        if node.mesh is None or not keys:
            return
        mesh_name = self._document.meshes.get(node.mesh).name
        instances = read_instances(node, self._accessors, self._remaining_instances, self.warnings)
        self._remaining_instances -= len(keys) * len(instances)
        if self._remaining_instances < 0:
            raise SceneError(f"the scene shows more than {MAX_INSTANCES:,} meshes; merge them (gltf-transform join)")
        for instance in instances:
            for key in keys:
                name = unique_name(node.name or mesh_name or "mesh", self._mesh_names)
                self._shown.append((key, name, instance if key.skin is not None else placed.to_world @ instance))

    def _choose_origin(self, recenter: Recenter) -> Shaped[F64, " 3"]:
        """The new origin of a scene so far from zero that rounding to single precision would change its shape.

        Others, and zero if there is nothing to show, are left to `relume.scene_io.placement.place`.
        """
        boxes, shown = list[F64](), list[tuple[GltfGeometry, F64]]()
        for key, name, to_world in self._shown:
            geometry = self._read_geometry(key, name)
            if geometry is not None and len(geometry.positions):
                shown.append((geometry, to_world))
                boxes.append(_world_bounds(box_corners(geometry.positions), to_world))
        if recenter == "never" or not boxes or not choose_origin(*_union(boxes), "auto").any():
            return np.zeros(3)
        return choose_origin(*_union([_world_bounds(each.positions, to_world) for each, to_world in shown]), "always")

    def _moved(self, to_world: F64) -> F64:
        moved = to_world.copy()
        moved[:3, 3] -= self.origin
        return moved

    def _read_geometry(self, key: PrimitiveKey, name: str) -> GltfGeometry | None:
        if key not in self._geometry:
            primitive = self._primitive(key)
            self._remaining_corners -= count_corners(self._document, primitive)
            if self._remaining_corners < 0:
                raise SceneError(f"the file contains more than {MAX_TRIANGLES:,} triangles; simplify it")
            label = f"mesh {quote(name)}"
            try:
                geometry = read_primitive(self._accessors, primitive, key.weights, label, self.warnings)
                if geometry is not None and key.skin is not None and geometry.joints is not None:
                    geometry = skin_geometry(geometry, self._skins[key.skin], label)
            except SceneError as problem:
                self.warnings.append(unsupported(f"A mesh was left out: {problem}."))
                geometry = None
            self._geometry[key] = geometry
        return self._geometry[key]

    def _add_primitive(self, key: PrimitiveKey, name: str, to_world: F64) -> None:
        if self._read_geometry(key, name) is None:
            return
        material_index = self._find_material_index(key)
        geometry = self._geometry[key]
        assert geometry is not None
        self._remaining_triangles -= len(geometry.faces)
        self._remaining_vertices -= len(geometry.positions)
        if min(self._remaining_triangles, self._remaining_vertices) < 0:
            raise SceneError(f"the scene has more than {MAX_TRIANGLES:,} triangles; simplify it")
        num_dimensions = count_dimensions(to_world[:3, :3])
        mesh = make_world_mesh(self._bind_material(key, geometry, material_index), to_world, num_dimensions, name)
        if mesh is not None and num_dimensions == 2:
            self._flattened.append(name)
        if mesh is None:
            self.warnings.append(unsupported(f"Skipped mesh {quote(name)}: its scale is zero or it is too large."))
        else:
            self.meshes.append(mesh)

    def _bind_material(self, key: PrimitiveKey, geometry: GltfGeometry, material_index: int) -> BoundPrimitive:
        """A primitive with its material, cached for all nodes that show it."""
        if (key, material_index) not in self._bound_primitives:
            read_material = self.materials[material_index]
            self._warn_missing_uvs(key, geometry, read_material)
            uvs = read_material.uv_slot.apply(geometry.uvs, len(geometry.positions))
            self._bound_primitives[key, material_index] = BoundPrimitive(geometry, uvs, read_material, material_index)
        return self._bound_primitives[key, material_index]

    def _warn_missing_uvs(self, key: PrimitiveKey, geometry: GltfGeometry, read_material: ReadMaterial) -> None:
        material, uv_set = read_material.material, read_material.uv_slot.uv_set
        is_textured = material.textures or material.normal_map is not None or material.opacity is not None
        if not is_textured or uv_set in geometry.uvs:
            return
        substitute = f"TEXCOORD_{min(geometry.uvs)} is used" if geometry.uvs else "its textures show one texel"
        mesh = self._document.meshes.label(key.mesh)
        self._warn_once(f"TEXCOORD_{uv_set} of {mesh}, for material {quote(material.name)}, is missing; {substitute}.")

    def _find_material_index(self, key: PrimitiveKey) -> int:
        """Index of the primitive's material; one material with different variants counts as several."""
        material, choices = self._primitive(key).material, self._choices[key]
        if (material, choices) not in self._material_index:
            self._material_index[material, choices] = len(self.materials)
            self.materials.append(self._read_material(material, self._vertex_colors(material, choices)))
        return self._material_index[material, choices]

    def _vertex_colors(self, index: int | None, choices: Choices) -> VertexColors:
        """Vertex colors of a material's primitives; if they need an image, geometries get UV coordinates in it."""
        keys = self._primitives[index, choices]
        if not any("COLOR_0" in self._primitive(key).attributes for key in keys):
            return NO_COLORS
        read = {key: self._read_geometry(key, self._document.meshes.get(key.mesh).name or "mesh") for key in keys}
        geometries = {key: geometry for key, geometry in read.items() if geometry is not None}
        vertex_colors = {key: geometry.colors for key, geometry in geometries.items() if geometry.colors is not None}
        if not vertex_colors:
            return NO_COLORS
        white = [np.ones((1, 4), np.float32)] if len(vertex_colors) < len(geometries) else []
        colors = np.concatenate([*vertex_colors.values(), *white])
        red, green, blue, alpha = colors.mean(axis=0, dtype=np.float64).tolist()
        material = self._gltf_material(index)
        if is_uniform(colors):
            return VertexColors((red, green, blue, alpha))
        num_triangles = sum(len(geometries[key].faces) for key in vertex_colors)
        reason = f"it has more than {MAX_COLORED:,} triangles"
        if num_triangles <= MAX_COLORED:
            layout = self._material_reader.texture_layout(material)
            if layout is None:
                return VertexColors(textured=self._draw_color_image(geometries))
            # variants replace images, and would not know of the colors
            textured = None if choices else self._draw_textured_colors(geometries, layout)
            if textured is not None:
                return VertexColors(textured=textured)
            reason = "it has variants" if choices else "its textures would have too many texels"
        message = f"Vertex colors of material {quote(material.name)} were replaced by their average: {reason}."
        self.warnings.append(approximated(message))
        return VertexColors((red, green, blue, alpha))

    def _draw_textured_colors(
        self, geometries: dict[PrimitiveKey, GltfGeometry], layout: TextureLayout
    ) -> TexturedColors | None:
        """Draw the vertex colors of geometries for a material with textures; they may get other UV coordinates."""
        uvs = {key: layout.slot.apply(g.uvs, len(g.positions)) for key, g in geometries.items()}
        colors = {key: g.colors_or_white() for key, g in geometries.items()}
        corners = [np.concatenate([values[key][g.faces] for key, g in geometries.items()]) for values in (uvs, colors)]
        textured = draw_textured_colors(corners[0], corners[1], layout.size, layout.wrap)
        if textured is None or textured.corner_uvs is None:
            return textured
        blocks = np.split(textured.corner_uvs, np.cumsum([len(g.faces) for g in geometries.values()])[:-1])
        for (key, geometry), block in zip(geometries.items(), blocks, strict=True):
            if not geometry.tangents.any():  # along the textures, not along the blocks
                tangents = compute_tangents(geometry.positions, geometry.normals, uvs[key], geometry.faces)
                geometry = replace(geometry, tangents=tangents)
            self._geometry[key] = geometry.with_corner_uvs(block)
        return textured

    def _draw_color_image(self, geometries: dict[PrimitiveKey, GltfGeometry]) -> TexturedColors:
        """Draw the vertex colors of geometries, and set their UV coordinates in the image."""
        colors_by_key = {key: geometry.colors for key, geometry in geometries.items() if geometry.colors is not None}
        corners = [colors[geometries[key].faces] for key, colors in colors_by_key.items()]
        image, uvs, white_uv = draw_color_image(np.concatenate(corners))
        uv_blocks = np.split(uvs, np.cumsum([len(block) for block in corners])[:-1])
        self._geometry |= {
            key: geometries[key].with_corner_uvs(block) for key, block in zip(colors_by_key, uv_blocks, strict=True)
        }
        for key in geometries.keys() - colors_by_key.keys():
            white_uvs = np.tile(white_uv, (len(geometries[key].positions), 1))
            self._geometry[key] = replace(geometries[key], uvs={0: white_uvs})
        return TexturedColors(image, WRAP)

    def _read_material(self, index: int | None, colors: VertexColors = NO_COLORS) -> ReadMaterial:
        return self._material_reader.read(self._gltf_material(index), colors)

    def _gltf_material(self, index: int | None) -> GltfMaterial:
        if index is None:
            return _DEFAULT_MATERIAL
        try:
            return self._document.materials.get(index)
        except SceneError as problem:
            self._warn_once(f"A material was replaced by the default: {problem}.")
            return _DEFAULT_MATERIAL

    def _read_variants(self) -> dict[str, dict[str, Any]]:
        read_materials = {index: self.materials[number] for (index, _), number in self._material_index.items()}
        variant_indices = {index for _, choices in self._material_index for _, index in choices}
        variant_materials = {
            index: read_materials.get(index) or self._read_material(index) for index in sorted(variant_indices)
        }
        scene_materials = [(self.materials[number], choices) for (_, choices), number in self._material_index.items()]
        return variant_looks(
            variant_names(self._document, self.warnings), scene_materials, variant_materials, self.warnings
        )

    def _add_camera(self, node: Node, to_world: F64) -> None:
        assert node.camera is not None
        try:
            camera = self._document.cameras.get(node.camera)
        except SceneError as problem:
            self.warnings.append(unsupported(f"A camera was left out: {problem}."))
            return
        name = camera.name or node.name or "camera"
        frame = rigid_frame(to_world)
        if camera.perspective is None or camera.type != "perspective":
            self.warnings.append(unsupported(f"Skipped camera {quote(name)}: only perspective cameras are supported."))
        elif frame is None:
            self.warnings.append(unsupported(f"Skipped camera {quote(name)}: its scale is zero."))
        else:
            yfov, aspect = camera.perspective.yfov, camera.perspective.aspectRatio
            self.cameras.append(Camera(make_slug(name, self._camera_names), frame, yfov, aspect))

    def _warn_animations(self) -> None:
        if num_animations := len(self._document.root.animations):
            animations = "1 animation was" if num_animations == 1 else f"{num_animations} animations were"
            self.warnings.append(ignored(f"{animations} ignored: objects are shown in their rest pose."))


def _world_bounds(positions: Shaped[Any, "points 3"], to_world: F64) -> Shaped[F64, "2 3"]:
    """Lowest and highest coordinates in world space."""
    world = positions.astype(np.float64) @ to_world[:3, :3].T + to_world[:3, 3]
    return np.stack(bounding_box(world))


def _union(boxes: list[F64]) -> tuple[Shaped[F64, " 3"], Shaped[F64, " 3"]]:
    """Lowest and highest coordinates of bounding boxes."""
    return np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)
