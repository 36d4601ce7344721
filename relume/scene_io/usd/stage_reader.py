"""Conversion of USD to a scene, with a warning for each unsupported feature."""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.environment import Environment
from relume.assets.environments.studio import studio
from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, ignored, quote, unsupported
from relume.scene.collect_lights import LightCollector
from relume.scene.finalize import finalize, no_triangles
from relume.scene.merge_meshes import merge_by_material
from relume.scene.model import Camera, Mesh, Scene
from relume.scene.tangents import compute_tangents, rotate_tangents
from relume.scene.unique_names import unique_name
from relume.scene.validate import MAX_TRIANGLES
from relume.scene_io.gltf.cameras import framing_camera
from relume.scene_io.gltf.degenerate_transforms import cofactors, determinant
from relume.scene_io.import_options import ImportOptions
from relume.scene_io.obj_ply.weld import Corners, make_mesh
from relume.scene_io.origin import choose_origin, moved_warning
from relume.scene_io.placement import TO_Y_UP
from relume.scene_io.referenced_files import Companions, NoFiles
from relume.scene_io.surfaces.surface_images import SurfaceImages
from relume.scene_io.surfaces.surface_parameters import SurfaceParameters
from relume.scene_io.usd.bound_materials import (
    MaterialKey,
    UsdMaterial,
    UsdMaterialReader,
    bound_material,
    display_colors,
)
from relume.scene_io.usd.cameras import read_camera
from relume.scene_io.usd.images import LayerImages
from relume.scene_io.usd.instances import instance_transforms
from relume.scene_io.usd.layers import INSTALL, LayerFolder
from relume.scene_io.usd.lights import KINDS, UsdLightReader, radiance
from relume.scene_io.usd.meshes import MeshReader
from relume.scene_io.usd.polygon_mesh import NORMALS, PrimTriangles, Primvar, make_triangles
from relume.scene_io.usd.primvars import read_primvars
from relume.scene_io.usd.shapes import shape_mesh
from relume.scene_io.usd.skinning import bake_skinning

F64 = NDArray[np.float64]
MAX_PRIMS = 1_000_000
MAX_INSTANCES = 100_000  # prims with triangles, counted for each instance
MAX_NESTING = 8  # point instancers within prototypes of others
MAX_PLAIN_COLORS = 100  # materials for prims that have a color but no material
_MAX_SEPARATE_MESHES = 2_000  # beyond, meshes are merged by material
SKIPPED = {
    "Points": "points", "BasisCurves": "curves", "NurbsCurves": "curves", "HermiteCurves": "curves",
    "NurbsPatch": "NURBS surfaces", "TetMesh": "tetrahedra", "Volume": "volumes", "GeometryLight": "geometry lights",
    "PluginLight": "lights of plug-ins", "PortalLight": "light portals", "ParticleField": "particle fields",
}  # fmt: skip


def import_usd(
    data: bytes,
    name: str,
    environment: Environment | None = None,
    companions: Companions | None = None,
    options: ImportOptions | None = None,
) -> Scene:
    """Import a USD layer with those that it names.

    Args:
        data: text or crate.
        name: name of the scene, shown to users.
        environment: replaces the dome light of the file; None for that, or the built-in studio.
        companions: files that the layers may name; None for none.
        options: `up` and `unit` are of the stage where they are "file"; see `recenter` and `time` there.

    Returns:
        The scene at one time, in meters with +Y up as far as the options say "file".

    Raises:
        SceneError: the file is unusable, or usd-core is not installed; the message says what to do.
    """
    try:
        import pxr.Usd  # noqa: F401
    except ImportError:
        raise SceneError(INSTALL) from None
    options = options or ImportOptions()
    warnings: list[ImporterWarning] = []
    with tempfile.TemporaryDirectory() as folder:
        layers = LayerFolder(Path(folder), warnings)
        stage = layers.open_stage(data, NoFiles() if companions is None else companions)
        return _StageReader(stage, layers, options, warnings).scene(name, environment)


@dataclass(frozen=True)
class _Shape:
    """Triangles of a prim, or of a subset of it, at one place. path: of the prim"""

    path: str
    name: str
    triangles: PrimTriangles
    to_world: F64
    key: MaterialKey
    double_sided: bool


class _StageReader:
    """Reads the prims of a stage: shapes first, then the materials of all of them, lights and cameras."""

    def __init__(
        self, stage: Any, layers: LayerFolder, options: ImportOptions, warnings: list[ImporterWarning]
    ) -> None:
        from pxr import Usd, UsdGeom

        self._stage, self._options, self._warnings = stage, options, warnings
        self._samples = {time for layer in stage.GetUsedLayers() for time in layer.ListAllTimeSamples()}
        start = stage.GetStartTimeCode() if stage.HasAuthoredTimeCodeRange() else min(self._samples, default=0.0)
        self._time = Usd.TimeCode(start if options.time is None else options.time)
        bake_skinning(stage, self._time, warnings)
        self._transforms = UsdGeom.XformCache(self._time)
        self._images = SurfaceImages(LayerImages(layers, warnings), warnings)
        self._mesh_reader = MeshReader(self._time, warnings)
        self._triangles: dict[str, PrimTriangles | None] = {}
        self._parts: dict[tuple[str, MaterialKey], list[tuple[str, PrimTriangles, MaterialKey]]] = {}
        self._colors: set[tuple[float, ...]] = set()
        self._shapes: list[_Shape] = []
        self._objects: dict[str, str] = {}  # names of meshes by the paths of their prims
        self._placed: list[tuple[Any, F64]] = []  # lights and cameras
        self._other_uvs: dict[tuple[str, str], list[str]] = {}  # meshes by the set that they lack and the one they have
        self._skipped: Counter[str] = Counter()
        self._num_prims, self._remaining_triangles = 0, MAX_TRIANGLES

    def scene(self, name: str, environment: Environment | None) -> Scene:
        """Return the scene. Raises SceneError."""
        root, meters = self._root_transform()
        self._visit(self._stage.GetPseudoRoot(), root, self._transforms.GetLocalToWorldTransform, 0)
        self._warn_stage()
        if not self._shapes:
            raise SceneError(no_triangles(self._warnings, "the stage shows no mesh or shape"))
        origin = self._recenter()
        materials, meshes = self._materials_and_meshes(meters, origin)
        if not meshes:
            raise SceneError(no_triangles(self._warnings, "its triangles have no area"))
        if len(meshes) > _MAX_SEPARATE_MESHES:
            meshes, self._objects = merge_by_material(meshes), {}
        collector = LightCollector(self._warnings)
        lights = UsdLightReader(self._time, meters, self._images, collector, self._warnings, self._objects)
        cameras = self._lights_and_cameras(lights, origin, meters)
        emissions = [np.array(material.read_material.emission) for material in materials]
        scene_materials = collector.emissive_light(
            [material.read_material.material for material in materials], emissions, meshes
        )
        scene = finalize(
            name, meshes, scene_materials, cameras or [framing_camera(meshes, "front")],
            environment or lights.environment or studio(), self._warnings, lights=collector.lights,
            offset=(float(origin[0]), float(origin[1]), float(origin[2])),
        )  # fmt: skip
        return replace(scene, ies_files=tuple(lights.ies_files.values()))

    def _root_transform(self) -> tuple[F64, float]:
        """From the space of the stage to that of the reader, and the unit of the stage in it."""
        from pxr import UsdGeom

        up, meters = str(UsdGeom.GetStageUpAxis(self._stage)), float(UsdGeom.GetStageMetersPerUnit(self._stage))
        root = np.eye(4)
        if up not in ("Y", "Z"):
            self._warnings.append(unsupported(f"The up axis {quote(up)} isn't allowed in USD; +Y is up."))
        if not (np.isfinite(meters) and meters > 0):
            self._warnings.append(unsupported("The unit of the file is not positive; it is read as meters."))
            meters = 1.0
        if self._options.up == "file" and up == "Z":
            root[:3, :3] = TO_Y_UP["z"]
        if self._options.unit != "file":
            meters = 1.0
        root[:3, :3] *= meters
        return root, meters

    def _visit(self, root: Any, base: F64, transform: Any, nesting: int) -> None:
        """Read a prim and all below it.

        Args:
            base: transform of the space in which `transform` gives matrices. nesting: number of instancers around.
        """
        from pxr import Usd, UsdGeom

        prims = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)))
        for prim in prims:
            self._num_prims += 1
            if self._num_prims > MAX_PRIMS:
                raise SceneError(f"the scene has more than {MAX_PRIMS:,} prims; merge some")
            imageable = UsdGeom.Imageable(prim)
            if not imageable:
                continue
            if imageable.GetVisibilityAttr().Get(self._time) == UsdGeom.Tokens.invisible:
                prims.PruneChildren()
                continue
            is_shown = imageable.ComputePurpose() in (UsdGeom.Tokens.default_, UsdGeom.Tokens.render)
            if prim.IsA(UsdGeom.PointInstancer):
                prims.PruneChildren()
            if is_shown:
                with self._only_costing(prim):
                    self._add(prim, base @ np.array(transform(prim)).T, nesting)

    @contextmanager
    def _only_costing(self, prim: Any) -> Iterator[None]:
        """Turn an error of USD into a warning about one prim."""
        from pxr import Tf

        try:
            yield
        except Tf.ErrorException:
            self._warnings.append(unsupported(f"Skipped {quote(prim.GetName())}: USD cannot read it."))

    def _add(self, prim: Any, to_world: F64, nesting: int) -> None:
        from pxr import UsdGeom

        kind = str(prim.GetTypeName())
        if not np.isfinite(to_world).all() or np.abs(to_world).max() > 1e12:
            self._warnings.append(unsupported(f"Skipped {quote(prim.GetName())}: its transform is out of range."))
        elif prim.IsA(UsdGeom.PointInstancer):
            self._add_instances(UsdGeom.PointInstancer(prim), to_world, nesting)
        elif kind in KINDS or prim.IsA(UsdGeom.Camera):
            self._placed.append((prim, to_world))
        elif kind in SKIPPED:
            self._skipped[SKIPPED[kind]] += 1
        elif prim.IsA(UsdGeom.Gprim):
            self._add_shape(prim, to_world)

    def _add_instances(self, instancer: Any, to_world: F64, nesting: int) -> None:
        """Read the prototypes of a point instancer at each of its instances."""
        prim = instancer.GetPrim()
        if nesting >= MAX_NESTING:
            self._warnings.append(unsupported(f"Skipped {quote(prim.GetName())}: instancers are nested too deeply."))
            return
        for prototype, matrices in instance_transforms(instancer, self._time, self._warnings):
            for matrix in matrices:

                def relative(prim: Any, prototype: Any = prototype) -> Any:
                    return self._transforms.ComputeRelativeTransform(prim, prototype)[0]

                self._visit(prototype, to_world @ matrix, relative, nesting + 1)

    def _add_shape(self, prim: Any, to_world: F64) -> None:
        for name, triangles, key in self._read_parts(prim):
            self._remaining_triangles -= len(triangles.vertex)
            if self._remaining_triangles < 0:
                raise SceneError(f"the scene has more than {MAX_TRIANGLES:,} triangles; simplify it")
            if len(self._shapes) == MAX_INSTANCES:
                raise SceneError(f"the scene shows more than {MAX_INSTANCES:,} meshes; merge them")
            double_sided = bool(prim.GetAttribute("doubleSided").Get(self._time))
            self._shapes.append(_Shape(str(prim.GetPath()), name, triangles, to_world, key, double_sided))

    def _read_parts(self, prim: Any) -> list[tuple[str, PrimTriangles, MaterialKey]]:
        """Triangles of a prim for each of its materials, cached for its instances."""
        source = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        path = str(source.GetPath())
        if path not in self._triangles:
            self._triangles[path] = self._read_triangles(prim)
        triangles = self._triangles[path]
        if triangles is None:
            return []
        key = (path, self._key(prim, triangles))
        if key not in self._parts:
            self._parts[key] = list(self._split(prim, triangles, key[1]))
        return self._parts[key]

    def _read_triangles(self, prim: Any) -> PrimTriangles | None:
        from pxr import UsdGeom

        label = f"mesh {quote(prim.GetName())}"
        if prim.IsA(UsdGeom.Mesh):
            triangles = self._mesh_reader.read(prim, label)
        else:
            mesh = shape_mesh(prim, self._time)
            if mesh is None:
                self._warnings.append(
                    unsupported(f"Skipped {quote(prim.GetName())}: {prim.GetTypeName()} isn't shown.")
                )
                return None
            mesh = replace(mesh, primvars=read_primvars(prim, mesh, self._time, label, self._warnings))
            triangles = make_triangles(mesh, self._warnings)
        return triangles if triangles is not None and len(triangles.vertex) else None

    def _split(
        self, prim: Any, triangles: PrimTriangles, key: MaterialKey
    ) -> Iterator[tuple[str, PrimTriangles, MaterialKey]]:
        """Triangles of each subset with a material, and those of none."""
        from pxr import UsdShade

        rest = np.ones(len(triangles.vertex), np.bool_)
        for subset in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets():
            indices = subset.GetIndicesAttr().Get(self._time)
            rows = rest & np.isin(triangles.face, np.zeros(0) if indices is None else np.asarray(indices, np.int64))
            rest &= ~rows
            if rows.any():
                part = triangles.select(rows)
                yield subset.GetPrim().GetName(), part, self._key(subset.GetPrim(), part)
        if rest.all():
            yield prim.GetName(), triangles, key
        elif rest.any():
            yield prim.GetName(), triangles.select(rest), key

    def _key(self, prim: Any, triangles: PrimTriangles) -> MaterialKey:
        """The material of a prim; prims without one share it with those of the same color."""
        emission = None
        if "MeshLightAPI" in prim.GetAppliedSchemas():
            red, green, blue = radiance(prim, self._time).tolist()
            emission = (red, green, blue)
        path = bound_material(prim, self._warnings)
        if path:
            return MaterialKey(path, None, emission)
        colors = np.round(display_colors(triangles).reshape(-1, 4), 4)
        color = tuple(colors[0].tolist())
        if (colors != colors[0]).any() or (color not in self._colors and len(self._colors) == MAX_PLAIN_COLORS):
            return MaterialKey("", None, emission)
        self._colors.add(color)
        return MaterialKey("", color, emission)

    def _recenter(self) -> Shaped[F64, " 3"]:
        """The new origin, in double precision before positions are rounded."""
        bounds = [_bounds(shape) for shape in self._shapes]
        low = np.nanmin([low for low, _ in bounds], axis=0)
        high = np.nanmax([high for _, high in bounds], axis=0)
        origin = choose_origin(low, high, self._options.recenter)
        self._warnings.extend(moved_warning(origin))
        return origin

    def _materials_and_meshes(self, meters: float, origin: F64) -> tuple[list[UsdMaterial], list[Mesh]]:
        reader = UsdMaterialReader(self._stage, self._time, meters, self._images, self._warnings)
        surfaces: dict[MaterialKey, tuple[str, SurfaceParameters]] = {}
        groups: dict[tuple[str, SurfaceParameters, tuple[float, ...] | None], list[_Shape]] = {}
        for shape in self._shapes:
            if shape.key not in surfaces:
                surfaces[shape.key] = reader.surface(shape.key, shape.name)
            groups.setdefault((*surfaces[shape.key], shape.key.color), []).append(shape)
        materials, meshes = list[UsdMaterial](), list[Mesh]()
        names: dict[str, int] = {}
        for (material_name, surface, _), shapes in groups.items():
            unique = list({id(shape.triangles): shape.triangles for shape in shapes}.values())
            low, high = _bounds(shapes[0])
            thickness, is_double_sided = float((high - low).min()), any(shape.double_sided for shape in shapes)
            material = reader.read(material_name, surface, unique, thickness, double_sided=is_double_sided)
            for shape in shapes:
                mesh = self._make_mesh(shape, material, len(materials), origin, unique_name(shape.name, names))
                if mesh is not None:
                    meshes.append(mesh)
                    self._objects[shape.path] = mesh.name
            materials.append(material)
        reader.warn_occlusion_maps()
        for (wanted, other), without in self._other_uvs.items():
            count = f"{len(without):,} {'mesh' if len(without) == 1 else 'meshes'}"
            message = f"Texture coordinates {quote(wanted)} are missing in {count}, for example {quote(without[0])}"
            instead = f"{quote(other)} are used" if other else "textures show one color there"
            self._warnings.append((approximated if other else unsupported)(f"{message}; {instead}."))
        return materials, meshes

    def _make_mesh(self, shape: _Shape, material: UsdMaterial, number: int, origin: F64, name: str) -> Mesh | None:
        """The triangles of a shape in world space."""
        triangles, linear = shape.triangles, shape.to_world[:3, :3]
        orientation = 1.0 if determinant(linear) >= 0 else -1.0
        uvs, uv_index = self._texture_coordinates(triangles, material, name)
        empty = Primvar(np.zeros((0, 3)), np.full(triangles.vertex.shape, -1))
        normals = triangles.primvars.get(NORMALS, empty)
        corners = np.stack([triangles.vertex, uv_index, normals.index], axis=-1)
        if orientation < 0:
            corners = corners[:, ::-1]
        transformed = normals.values @ (orientation * cofactors(linear)).T
        transformed /= np.maximum(np.linalg.norm(transformed, axis=1, keepdims=True), 1e-300)
        points = triangles.points @ linear.T + (shape.to_world[:3, 3] - origin)
        label = f"mesh {quote(name)}"
        read_material = material.read_material
        mesh = make_mesh(
            Corners(points, uvs, transformed, corners), name, number, read_material.material, label, self._warnings
        )
        rotation = read_material.tangent_rotation
        if mesh is None or rotation is None:
            return mesh
        tangents = mesh.tangents
        if not tangents.any():
            tangents = compute_tangents(mesh.positions, mesh.normals, mesh.uvs, mesh.faces)
        return replace(mesh, tangents=rotate_tangents(tangents, mesh.normals, rotation))

    def _texture_coordinates(
        self, triangles: PrimTriangles, material: UsdMaterial, name: str
    ) -> tuple[F64, NDArray[np.int64]]:
        """Texture coordinates, v from the top, and the index of each corner; −1 without any."""
        if id(triangles) in material.color_uvs:
            uvs = material.color_uvs[id(triangles)].reshape(-1, 2)
            return uvs.astype(np.float64), np.arange(len(uvs)).reshape(-1, 3)
        none = np.zeros((0, 2)), np.full(triangles.vertex.shape, -1)
        if material.uv_name is None:
            return none
        candidates = {key: value for key, value in triangles.primvars.items() if value.values.shape[1] == 2}
        primvar = candidates.get(material.uv_name)
        if primvar is None:
            other = next(iter(candidates)) if len(candidates) == 1 else ""
            self._other_uvs.setdefault((material.uv_name, other), []).append(name)
            if not other:
                return none
            primvar = candidates[other]
        uvs = np.column_stack([primvar.values[:, 0], 1 - primvar.values[:, 1]]).astype(np.float32)
        return material.read_material.uv_slot.apply({material.uv_name: uvs}, len(uvs)).astype(np.float64), primvar.index

    def _lights_and_cameras(self, lights: UsdLightReader, origin: F64, meters: float) -> list[Camera]:
        from pxr import UsdGeom

        cameras, names = list[Camera](), dict[str, int]()
        for prim, to_world in self._placed:
            moved = to_world.copy()
            moved[:3, 3] -= origin
            if not prim.IsA(UsdGeom.Camera):
                lights.add(prim, moved)
            elif (camera := read_camera(prim, moved, self._time, meters, names, self._warnings)) is not None:
                cameras.append(camera)
        return cameras

    def _warn_stage(self) -> None:
        """Warnings about the stage as a whole."""
        self._mesh_reader.warn_subdivision()
        for kind, count in sorted(self._skipped.items()):
            self._warnings.append(unsupported(f"Skipped {count:,} prims: {kind} aren't supported."))
        for prim in self._stage.GetPseudoRoot().GetChildren():
            sets = prim.GetVariantSets()
            for variant_set in map(sets.GetVariantSet, sets.GetNames()):
                chosen, names = variant_set.GetVariantSelection(), variant_set.GetVariantNames()
                others = ", ".join(quote(name) for name in names if name != chosen)[:200]
                if others:
                    message = f"{quote(prim.GetName())} is shown in its {variant_set.GetName()[:80]} {quote(chosen)}"
                    self._warnings.append(ignored(f"{message}; the file also has {others}."))
        self._warn_time()

    def _warn_time(self) -> None:
        time = self._options.time
        if not self._samples and time is not None:
            self._warnings.append(ignored(f"The file has no animation; its time code {time:g} has no effect."))
        elif self._samples and time is None:
            self._warnings.append(ignored("The animation is ignored: the scene is shown at its first time."))
        elif self._samples:
            first, last = min(self._samples), max(self._samples)
            message = f"The scene is shown at time code {time:g}; its animation has {first:g} to {last:g}."
            self._warnings.append(ignored(message))


def _bounds(shape: _Shape) -> tuple[F64, F64]:
    """Lowest and highest coordinates of the points that are used."""
    points = shape.triangles.points[np.unique(shape.triangles.vertex)] @ shape.to_world[:3, :3].T
    return points.min(axis=0) + shape.to_world[:3, 3], points.max(axis=0) + shape.to_world[:3, 3]
