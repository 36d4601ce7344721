"""USD packages of exports: geometry, materials, lights, cameras, and looks as variants of the variant set "look"."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.assets.environments.environment_names import load_environment
from relume.assets.ies.ies_store import IES_FILES, load_web, read_source
from relume.assets.ies.read_ies import mean_intensity
from relume.core.errors import SceneError
from relume.core.filesystem import UNFINISHED, atomic_write
from relume.core.import_warnings import quote
from relume.export.export_document import ExportDocument
from relume.export.export_materials import ExportMaterial
from relume.export.light_frames import light_frame
from relume.export.open_pbr_inputs import IMAGE_FOLDER, omitted_from_open_pbr
from relume.export.usd_light_links import write_links
from relume.export.usd_materials import UsdMaterials, omitted_from_preview
from relume.image_io.write_image import write_image
from relume.look.model import AreaLook, SingleLightLook
from relume.raytrace.tangents import unit
from relume.scene.model import Camera, Mesh
from relume.scene.unique_names import append_number
from relume.scene_io.usd.layers import INSTALL

VARIANT_SET = "look"
_ROOT = "/Scene"
_FOCAL_LENGTH = 0.5  # 50 mm in tenths of a meter
_DEFAULT_ASPECT = 4 / 3
_CLIPPING = 1e-3, 1e6  # meters
_POINT_RADIUS = 1e-3
_IES_FOLDER = "ies"
_DOME_TURN = 90.0  # the middle of an image faces +Z in USD, and +X in an environment
_UP = np.array([[0, 1, 0]], np.float32)


def omitted_from_usd(export: ExportDocument) -> tuple[str, ...]:
    """Sentences about what a USD file does not have."""
    materials = export.all_materials()
    names = ", ".join(dict.fromkeys(quote(m.name) for m in materials if omitted_from_preview(m)))
    sentences = [sentence for material in materials for sentence in omitted_from_open_pbr(material)]
    profiles = [(name, getattr(light, "profile", None)) for name, light in export.lights()]
    sentences += [
        f"The IES file of {quote(name)} is not exported; upload it again."
        for name, profile in profiles
        if profile is not None and read_source(profile) is None
    ]
    if names:
        sentences.append(f"Programs that read UsdPreviewSurface alone show {names} simplified.")
    return tuple(sentences)


def write_usd(export: ExportDocument, path: Path) -> None:
    """Write a .usdz package, atomically.

    Args:
        export: the scene and its materials. path: ends in .usdz.
    Raises:
        SceneError: usd-core is not installed. DiskFullError, RelumeError: the file cannot be written.
    """
    try:
        from pxr import Tf, Usd, UsdUtils
    except ImportError:
        raise SceneError(INSTALL) from None
    prefix = UNFINISHED.rstrip("*")
    with atomic_write(path) as unfinished, tempfile.TemporaryDirectory(dir=path.parent, prefix=prefix) as folder:
        layer = Path(folder) / "scene.usdc"
        try:
            stage = Usd.Stage.CreateNew(str(layer))
            files = _StageWriter(export, stage, Path(folder)).build()
            (Path(folder) / IMAGE_FOLDER).mkdir(exist_ok=True)
            for file in files:
                (Path(folder) / IMAGE_FOLDER / file).write_bytes(export.images.png(file))
            stage.Save()
            is_packed = UsdUtils.CreateNewUsdzPackage(str(layer), str(unfinished))
        except Tf.ErrorException as error:
            raise OSError(str(error).partition("\n")[0]) from error
        if not is_packed:
            raise OSError("the package cannot be made")


class _StageWriter:
    """Builds a stage in a folder, which gets the image of the environment."""

    def __init__(self, export: ExportDocument, stage: Any, folder: Path) -> None:
        self._export, self._stage, self._folder = export, stage, folder
        self._used_paths: dict[str, int] = {}
        self._materials = UsdMaterials(stage, export.images)

    def build(self) -> list[str]:
        """Define everything; return the images that the materials name."""
        from pxr import UsdGeom

        export, stage = self._export, self._stage
        UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
        UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        root = UsdGeom.Xform.Define(stage, _ROOT)
        stage.SetDefaultPrim(root.GetPrim())
        if any(export.scene.offset):
            root.AddTranslateOp().Set(tuple(export.scene.offset))
        for group in ("Materials", "Meshes", "Lights", "Cameras"):
            UsdGeom.Scope.Define(stage, f"{_ROOT}/{group}")
        defined = {id(m): self._materials.define(self._path("Materials", m.name), m) for m in export.all_materials()}
        meshes = [self._mesh(mesh) for mesh in export.scene.meshes]
        mesh_paths = [mesh.GetPath() for mesh in meshes]
        self._bind(root.GetPrim(), meshes, defined)
        for name, light in export.lights():
            write_links(self._light(name, light), light.link, light.shadow_link, export.scene, mesh_paths)
        self._dome(mesh_paths)
        for camera in export.scene.cameras:
            self._camera(camera)
        return list(self._materials.files)

    def _path(self, group: str, name: str) -> Any:
        """An unused path; the prim's display name is the name as it is."""
        from pxr import Sdf, Tf

        identifier = Tf.MakeValidIdentifier(name.strip() or group[:-1])
        return Sdf.Path(append_number(f"{_ROOT}/{group}/{identifier}", "_", self._used_paths))

    def _bind(self, root: Any, meshes: list[Any], defined: dict[int, Any]) -> None:
        """Bind materials; those that a variant replaces in each variant, since others are stronger."""
        variants = {} if not self._export.variants else {"exported": self._export.materials, **self._export.variants}
        if not variants:
            self._bind_all(meshes, self._export.materials, defined)
            return
        variant_set = root.GetVariantSets().AddVariantSet(VARIANT_SET)
        names, used_names = dict[str, str](), dict[str, int]()
        for name in variants:
            names[name] = append_number(_variant_name(name), "_", used_names)
            variant_set.AddVariant(names[name])
        for name, materials in variants.items():
            variant_set.SetVariantSelection(names[name])
            with variant_set.GetVariantEditContext():
                self._bind_all(meshes, materials, defined)
        variant_set.SetVariantSelection(names["exported"])

    def _bind_all(self, meshes: list[Any], materials: list[ExportMaterial], defined: dict[int, Any]) -> None:
        from pxr import UsdShade

        for mesh, prim in zip(self._export.scene.meshes, meshes, strict=True):
            UsdShade.MaterialBindingAPI.Apply(prim).Bind(defined[id(materials[mesh.material])])

    def _mesh(self, mesh: Mesh) -> Any:
        from pxr import Sdf, UsdGeom, Vt

        prim = UsdGeom.Mesh.Define(self._stage, self._path("Meshes", mesh.name))
        prim.GetPrim().SetDisplayName(mesh.name)
        prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(mesh.positions)))
        prim.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(mesh.faces), 3, np.int32)))
        prim.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(mesh.faces.ravel().astype(np.int32)))
        prim.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(unit(mesh.normals, _UP)))
        prim.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
        prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        prim.CreateDoubleSidedAttr(self._export.materials[mesh.material].is_double_sided)
        bounds = np.stack([mesh.positions.min(axis=0), mesh.positions.max(axis=0)])
        prim.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(bounds))
        if mesh.uvs.any():
            coordinates = np.ascontiguousarray(np.stack([mesh.uvs[:, 0], 1 - mesh.uvs[:, 1]], axis=1), np.float32)
            primvar = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(
                "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
            )
            primvar.Set(Vt.Vec2fArray.FromNumpy(coordinates))
        return prim.GetPrim()

    def _light(self, name: str, light: SingleLightLook) -> Any:
        from pxr import UsdLux

        path, strength = self._path("Lights", name), max(light.gain)
        color = tuple(channel / strength for channel in light.gain) if strength > 0 else (1.0, 1.0, 1.0)
        if isinstance(light, AreaLook):
            prim = self._area_light(path, light)
        elif light.kind == "directional":
            prim = UsdLux.DistantLight.Define(self._stage, path)
            prim.CreateAngleAttr(light.angle)
            prim.CreateNormalizeAttr(True)
        else:
            prim = UsdLux.SphereLight.Define(self._stage, path)
            prim.CreateRadiusAttr(_POINT_RADIUS)
            prim.CreateTreatAsPointAttr(True)
            prim.CreateNormalizeAttr(True)
            strength *= 4  # radiance L / (4 π r²) of a section π r²
        if light.kind in ("point", "spot") and light.profile is not None:
            strength *= self._ies_file(prim, light.profile)
        if light.kind == "spot":
            shaping = UsdLux.ShapingAPI.Apply(prim.GetPrim())
            inner, outer = light.cone
            shaping.CreateShapingConeAngleAttr(outer)
            shaping.CreateShapingConeSoftnessAttr(1 - inner / outer)
        prim.GetPrim().SetDisplayName(name)
        prim.CreateIntensityAttr(strength)
        prim.CreateColorAttr(color)
        _transform(prim, light_frame(light))
        return prim

    def _ies_file(self, prim: Any, profile: str) -> float:
        """Write the IES file of a light; return the mean of its intensity over the maximum."""
        from pxr import UsdLux

        source, web = read_source(profile), load_web(profile)
        if source is None:
            return 1.0
        file = f"{profile.removeprefix(IES_FILES.prefix)}.ies"
        (self._folder / _IES_FOLDER).mkdir(exist_ok=True)
        (self._folder / _IES_FOLDER / file).write_bytes(source)
        shaping = UsdLux.ShapingAPI.Apply(prim.GetPrim())
        shaping.CreateShapingIesFileAttr(f"{_IES_FOLDER}/{file}")
        shaping.CreateShapingIesNormalizeAttr(True)
        return mean_intensity(web)

    def _area_light(self, path: Any, light: AreaLook) -> Any:
        from pxr import UsdLux

        match light.kind:
            case "rectangle":
                prim = UsdLux.RectLight.Define(self._stage, path)
                prim.CreateWidthAttr(light.size[0])
                prim.CreateHeightAttr(light.size[1])
                return prim
            case "disc":
                prim = UsdLux.DiskLight.Define(self._stage, path)
            case "sphere":
                prim = UsdLux.SphereLight.Define(self._stage, path)
            case "tube":
                prim = UsdLux.CylinderLight.Define(self._stage, path)
                prim.CreateLengthAttr(light.length)
        prim.CreateRadiusAttr(light.radius)
        return prim

    def _dome(self, mesh_paths: list[Any]) -> None:
        """The environment, as an image. mesh_paths: path of each mesh"""
        from pxr import UsdLux

        look = self._export.look.environment
        if max(look.gain) == 0:
            return
        environment = self._export.scene.environment if look.map is None else load_environment(look.map)
        (self._folder / IMAGE_FOLDER).mkdir(exist_ok=True)
        write_image(self._folder / IMAGE_FOLDER / "environment.exr", environment.radiance)
        dome = UsdLux.DomeLight.Define(self._stage, self._path("Lights", "environment"))
        dome.GetPrim().SetDisplayName(environment.name)
        write_links(dome, look.link, None, self._export.scene, mesh_paths)
        dome.CreateTextureFileAttr(f"./{IMAGE_FOLDER}/environment.exr")
        dome.CreateTextureFormatAttr(UsdLux.Tokens.latlong)
        dome.CreateIntensityAttr(look.intensity)
        dome.CreateColorAttr(tuple(look.color))
        dome.AddRotateYOp().Set(_DOME_TURN + look.rotation)

    def _camera(self, camera: Camera) -> None:
        from pxr import Gf, UsdGeom

        prim = UsdGeom.Camera.Define(self._stage, self._path("Cameras", camera.name))
        prim.GetPrim().SetDisplayName(camera.name)
        height = 2 * _FOCAL_LENGTH * float(np.tan(camera.yfov / 2))
        prim.CreateFocalLengthAttr(_FOCAL_LENGTH)
        prim.CreateVerticalApertureAttr(height)
        prim.CreateHorizontalApertureAttr(height * (camera.aspect or _DEFAULT_ASPECT))
        prim.CreateClippingRangeAttr(Gf.Vec2f(max(camera.near, _CLIPPING[0]), _CLIPPING[1]))
        if camera.lens is not None:
            prim.CreateFStopAttr(_FOCAL_LENGTH / (20 * camera.lens.radius))
            prim.CreateFocusDistanceAttr(camera.lens.focus_distance)
        _transform(prim, camera.to_world)


def _transform(prim: Any, to_world: NDArray[np.float64]) -> None:
    from pxr import Gf

    prim.AddTransformOp().Set(Gf.Matrix4d(*to_world.T.ravel().tolist()))


def _variant_name(name: str) -> str:
    """Letters, digits, dashes and underscores."""
    return "".join(letter if letter.isascii() and (letter.isalnum() or letter in "-_") else "_" for letter in name)
