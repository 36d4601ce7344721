"""GLB files of exports: glTF 2.0 with its geometry, materials, images, lights, cameras and variants.

Lights have photometric units in glTF: 683 lm/W, as in `relume.scene_io.gltf.lights`.
"""

from __future__ import annotations

import json
import shutil
import struct
import tempfile
from importlib.metadata import version
from pathlib import Path
from typing import IO, Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import LUMENS_PER_WATT
from relume.core.filesystem import atomic_write
from relume.export.export_document import ExportDocument
from relume.export.export_materials import ExportMaterial, emissive_surface
from relume.export.glb_buffer import INDICES, GlbBuffer
from relume.export.gltf_materials import GltfMaterials
from relume.export.light_frames import light_frame, local_triangles
from relume.look.model import AreaLook, SingleLightLook
from relume.raytrace.tangents import any_tangent, unit
from relume.scene.model import WRAPS, Camera, Mesh
from relume.scene_io.gltf.lights import EXTENSION as PUNCTUAL
from relume.scene_io.gltf.variants import EXTENSION as VARIANTS
from relume.scene_io.surfaces.surface_images import ImageInput

F32 = NDArray[np.float32]
_REPEAT = dict(zip(WRAPS, (10497, 33648, 33071), strict=True))
_LINEAR, _MIPMAPS = 9729, 9987
_JSON, _BINARY = b"JSON", b"BIN\0"
_MIN_NEAR = 1e-3  # meters; glTF has no 0
_MIN_CONE = 1e-6  # radians; in glTF the inner half-angle of a spot is smaller than the outer
_UP = np.array([[0, 1, 0]], np.float32)


def omitted_from_glb(export: ExportDocument) -> tuple[str, ...]:
    """Sentences about what a GLB file does not have."""
    has_profile = any(getattr(light, "profile", None) for _, light in export.lights())
    is_linked = any(light.link or light.shadow_link for _, light in export.lights())
    has_area_light = any(isinstance(light, AreaLook) for _, light in export.lights())
    return (
        f"The environment {export.environment_name} is not part of the file.",
        *(["Area lights become visible emissive meshes."] if has_area_light else []),
        *(["IES files of lights are not exported."] if has_profile else []),
        *(["Lights light all objects in the file, and all cast shadows: glTF has no links."] if is_linked else []),
    )


def write_glb(export: ExportDocument, path: Path) -> None:
    """Write a GLB file, atomically.

    Args:
        export: the scene and its materials. path: ends in .glb.
    Raises:
        SceneError: it is too large for the format. DiskFullError, RelumeError: the file cannot be written.
    """
    with atomic_write(path) as unfinished, tempfile.TemporaryFile(dir=path.parent) as binary:
        buffer = GlbBuffer(binary)
        document = _GlbDocument(export, buffer).build()
        with unfinished.open("wb") as file:
            _write_chunks(file, document, binary, buffer.num_bytes)


def _write_chunks(file: IO[bytes], document: dict[str, Any], binary: IO[bytes], num_bytes: int) -> None:
    text = json.dumps(document, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode("utf-8", "replace")
    text += b" " * (-len(text) % 4)
    padding = -num_bytes % 4
    file.write(struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + num_bytes + padding))
    file.write(struct.pack("<I4s", len(text), _JSON) + text)
    file.write(struct.pack("<I4s", num_bytes + padding, _BINARY))
    binary.seek(0)
    shutil.copyfileobj(binary, file, 1 << 20)
    file.write(b"\0" * padding)


class _GlbDocument:
    """A document under construction."""

    def __init__(self, export: ExportDocument, buffer: GlbBuffer) -> None:
        self._export, self._buffer = export, buffer
        self._materials: list[dict[str, Any]] = []
        self._meshes: list[dict[str, Any]] = []
        self._nodes: list[dict[str, Any]] = []
        self._textures: dict[tuple[str, tuple[str, str]], int] = {}
        self._lights: list[dict[str, Any]] = []

    def build(self) -> dict[str, Any]:
        """Add everything to the buffer and return the document."""
        export, scene = self._export, self._export.scene
        self._materials += map(GltfMaterials(export.images, self._add_texture).document, export.all_materials())
        for number, mesh in enumerate(scene.meshes):
            self._nodes.append({"name": mesh.name, "mesh": number})
            self._meshes.append({"name": mesh.name, "primitives": [self._primitive(mesh)]})
        for name, light in export.lights():
            self._nodes.append({"name": name, "matrix": _matrix(light_frame(light)), **self._light(name, light)})
        for number, camera in enumerate(scene.cameras):
            self._nodes.append({"name": camera.name, "camera": number, "matrix": _matrix(camera.to_world)})
        document = {
            "asset": {"version": "2.0", "generator": f"relume {version('relume')}"},
            "scene": 0,
            "scenes": [{"name": scene.name, "nodes": self._roots(), "extras": {"relume": _extras(export)}}],
            "nodes": self._nodes,
            "meshes": self._meshes,
            "materials": self._materials,
            "cameras": [*map(_camera, scene.cameras)],
            **self._texture_members(),
            "accessors": self._buffer.accessors,
            "extensions": self._extensions(),
        }
        document |= {"bufferViews": self._buffer.views, "extensionsUsed": sorted(_extension_names(document))}
        document["buffers"] = [{"byteLength": self._buffer.num_bytes + -self._buffer.num_bytes % 4}]
        return {key: value for key, value in document.items() if value not in ([], {})}

    def _roots(self) -> list[int]:
        """Nodes of the scene: all of them, or one that moves them to the coordinates of the original file."""
        nodes = [*range(len(self._nodes))]
        if not any(self._export.scene.offset):
            return nodes
        self._nodes.append({"name": "offset", "translation": [*self._export.scene.offset], "children": nodes})
        return [len(nodes)]

    def _primitive(self, mesh: Mesh) -> dict[str, Any]:
        uses_tangents = any(material.uses_tangents for material in self._export.materials_of(mesh.material))
        attributes = {
            "POSITION": self._buffer.add_array(mesh.positions, has_bounds=True),
            "NORMAL": self._buffer.add_array(unit(mesh.normals, _UP)),
        }
        if mesh.uvs.any():
            attributes["TEXCOORD_0"] = self._buffer.add_array(mesh.uvs)
        if uses_tangents and mesh.tangents.any():
            attributes["TANGENT"] = self._buffer.add_array(_unit_tangents(mesh))
        primitive: dict[str, Any] = {
            "attributes": attributes,
            "indices": self._buffer.add_array(mesh.faces.ravel(), INDICES),
            "material": mesh.material,
        }
        replacements = self._export.variants_of(mesh.material)
        if replacements:
            mappings = [{"material": material, "variants": variants} for material, variants in replacements.items()]
            primitive["extensions"] = {VARIANTS: {"mappings": mappings}}
        return primitive

    def _light(self, name: str, light: SingleLightLook) -> dict[str, Any]:
        """Members of the node of a light; an area light is an emissive mesh."""
        if isinstance(light, AreaLook):
            return {"mesh": self._add_area_light(name, light)}
        strength = max(light.gain)
        fields: dict[str, Any] = {"name": name, "type": light.kind, "intensity": strength * LUMENS_PER_WATT}
        if strength > 0:
            fields["color"] = [channel / strength for channel in light.gain]
        if light.kind == "spot":
            inner, outer = np.radians(light.cone).tolist()
            fields["spot"] = {"innerConeAngle": min(inner, outer - _MIN_CONE), "outerConeAngle": outer}
        self._lights.append(fields)
        return {"extensions": {PUNCTUAL: {"light": len(self._lights) - 1}}}

    def _add_area_light(self, name: str, light: AreaLook) -> int:
        corners = local_triangles(light)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        attributes = {
            "POSITION": self._buffer.add_array(corners.reshape(-1, 3), has_bounds=True),
            "NORMAL": self._buffer.add_array(unit(np.repeat(normals, 3, axis=0), _UP)),
        }
        indices = self._buffer.add_array(np.arange(3 * len(corners), dtype=np.uint32), INDICES)
        surface = emissive_surface(light.gain)
        material = ExportMaterial(name, surface, is_double_sided=False, error=0.0)
        self._materials.append(GltfMaterials(self._export.images, self._add_texture).document(material))
        primitive = {"attributes": attributes, "indices": indices, "material": len(self._materials) - 1}
        self._meshes.append({"name": name, "primitives": [primitive]})
        return len(self._meshes) - 1

    def _add_texture(self, image: ImageInput) -> int:
        return self._textures.setdefault((image.file, image.wrap), len(self._textures))

    def _texture_members(self) -> dict[str, Any]:
        """Textures, samplers and images; the images are added to the buffer."""
        files = list(dict.fromkeys(file for file, _ in self._textures))
        wraps = list(dict.fromkeys(wrap for _, wrap in self._textures))
        images = self._export.images
        return {
            "textures": [{"sampler": wraps.index(w), "source": files.index(f)} for f, w in self._textures],
            "samplers": [_sampler(wrap) for wrap in wraps],
            "images": [
                {"name": file, "mimeType": "image/png", "bufferView": self._buffer.add_view(images.png(file))}
                for file in files
            ],
        }

    def _extensions(self) -> dict[str, Any]:
        names = [{"name": name} for name in self._export.variants]
        extensions = {PUNCTUAL: {"lights": self._lights}, VARIANTS: {"variants": names}}
        return {name: members for name, members in extensions.items() if any(members.values())}


def _extension_names(member: Any) -> set[str]:
    """Names of all extensions in a member of a document."""
    children = member.values() if isinstance(member, dict) else member if isinstance(member, list) else ()
    names = set(member.get("extensions", ())) if isinstance(member, dict) else set()
    return names.union(*map(_extension_names, children))


def _extras(export: ExportDocument) -> dict[str, Any]:
    """Members of a look that glTF does not have."""
    environment = export.look.environment
    return {"environment": {**environment.model_dump(), "map": environment.map or export.scene.environment.name}}


def _unit_tangents(mesh: Mesh) -> F32:
    """Tangents with a length of one, and any where the mesh has none; handedness in w."""
    direction = unit(mesh.tangents[:, :3], any_tangent(unit(mesh.normals, _UP)))
    handedness = np.where(mesh.tangents[:, 3:] < 0, -1, 1)
    return np.concatenate([direction, handedness], axis=1).astype(np.float32)


def _matrix(to_world: Shaped[NDArray[np.float64], "4 4"]) -> list[float]:
    """Column-major, as in glTF."""
    return [float(value) for value in to_world.T.ravel()]


def _camera(camera: Camera) -> dict[str, Any]:
    aspect = {} if camera.aspect is None else {"aspectRatio": camera.aspect}
    perspective = {"yfov": camera.yfov, "znear": max(camera.near, _MIN_NEAR), **aspect}
    return {"name": camera.name, "type": "perspective", "perspective": perspective}


def _sampler(wrap: tuple[str, str]) -> dict[str, int]:
    return {"magFilter": _LINEAR, "minFilter": _MIPMAPS, "wrapS": _REPEAT[wrap[0]], "wrapT": _REPEAT[wrap[1]]}
