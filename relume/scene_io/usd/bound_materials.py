"""Materials that prims are bound to, as materials of the scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.import_warnings import ImporterWarning, approximated, quote, unsupported
from relume.scene.model import F32
from relume.scene.textured_vertex_colors import TexturedColors
from relume.scene.vertex_colors import MAX_COLORED, WRAP, draw_color_image, is_uniform
from relume.scene_io.surfaces.make_material import NO_COLORS, ReadMaterial, SurfaceMaterials, VertexColors
from relume.scene_io.surfaces.models import warn_black_outside
from relume.scene_io.surfaces.surface_images import ImageInput, SurfaceImages
from relume.scene_io.surfaces.surface_parameters import SurfaceParameters
from relume.scene_io.surfaces.uv_transforms import UvSlot
from relume.scene_io.usd.networks import UsdSurfaceReader
from relume.scene_io.usd.polygon_mesh import COLOR, OPACITY, PrimTriangles, Primvar

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
_UV_TOLERANCE = 1e-3
GRAY = (0.5, 0.5, 0.5, 1.0)  # of prims without material and color
UNBOUND = SurfaceParameters(has_mesh_colors=True, roughness=0.5, alpha_mode="BLEND")


class MaterialKey(NamedTuple):
    """Identity of a material, common to its prims.

    Attributes:
        path: of the material; empty for prims without one.
        color: of prims without a material, if it is the same everywhere. emission: radiance of a mesh light.
    """

    path: str = ""
    color: tuple[float, ...] | None = None
    emission: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class UsdMaterial:
    """A material, and the texture coordinates of its prims.

    Attributes:
        uv_name: primvar with the texture coordinates; None without textures.
        color_uvs: texture coordinates in the image of the colors, by the identity of the triangles; (triangles, 3, 2).
    """

    read_material: ReadMaterial
    uv_name: str | None
    color_uvs: Mapping[int, Shaped[F32, "triangles 3 2"]]


class UsdMaterialReader:
    """Reads the materials of one stage; each gets a unique name."""

    def __init__(
        self, stage: Any, time: Any, meters: float, images: SurfaceImages, warnings: list[ImporterWarning]
    ) -> None:
        self._stage, self._meters, self._warnings = stage, meters, warnings
        self._reader = UsdSurfaceReader(time, images, warnings)
        self._maker = SurfaceMaterials(images, warnings)

    def surface(self, key: MaterialKey, name: str) -> tuple[str, SurfaceParameters]:
        """Read the name and the surface of a material. name: for prims without one."""
        from pxr import UsdShade

        surface = UNBOUND
        if key.path:
            material = UsdShade.Material(self._stage.GetPrimAtPath(key.path))
            name = material.GetPrim().GetName()
            surface = self._reader.read(material, f"material {quote(name)}")
            surface = replace(surface, attenuation_distance=surface.attenuation_distance * self._meters)
        if key.emission is not None:
            surface = replace(surface, emission=key.emission, emission_strength=1.0)
        return name, surface

    def read(
        self,
        name: str,
        surface: SurfaceParameters,
        shapes: Sequence[PrimTriangles],
        thickness: float,
        *,
        double_sided: bool,
    ) -> UsdMaterial:
        """Make a material.

        Args:
            name, surface: from `surface`. shapes: all triangles that have it. thickness: of the solids that it bounds,
                meters. double_sided: whether a prim shows both sides.
        """
        label = f"material {quote(name)}"
        warn_black_outside(surface, label, self._warnings, lambda image: _leaves_bounds(image, shapes))
        colors, color_uvs = NO_COLORS, dict[int, F32]()
        if surface.has_mesh_colors:
            has_textures = self._maker.texture_layout(name, surface) is not None
            colors, color_uvs = self._colors(shapes, label, has_textures=has_textures)
        if surface.thickness > 0:
            surface = replace(surface, thickness=thickness)
        read_material = self._maker.make(name, surface, colors, double_sided=double_sided)
        uv_set = read_material.uv_slot.uv_set
        return UsdMaterial(read_material, uv_set if isinstance(uv_set, str) else None, color_uvs)

    def _colors(
        self, shapes: Sequence[PrimTriangles], label: str, *, has_textures: bool
    ) -> tuple[VertexColors, dict[int, F32]]:
        """Colors of the prims: one factor, or an image with texture coordinates for each prim."""
        blocks = [display_colors(shape) for shape in shapes]
        corners = np.concatenate(blocks)
        red, green, blue, alpha = corners.mean(axis=(0, 1), dtype=np.float64).tolist()
        mean = VertexColors((red, green, blue, alpha))
        if is_uniform(corners.reshape(-1, 4)):
            return mean, {}
        if has_textures or len(corners) > MAX_COLORED:
            reason = "it has textures" if has_textures else f"it has more than {MAX_COLORED:,} triangles"
            message = f"Vertex colors of {label} were replaced by their average: {reason}."
            self._warnings.append(approximated(message))
            return mean, {}
        image, uvs, _ = draw_color_image(corners)
        parts = np.split(uvs, np.cumsum([len(block) for block in blocks])[:-1])
        return VertexColors(textured=TexturedColors(image, WRAP)), {
            id(shape): uv for shape, uv in zip(shapes, parts, strict=True)
        }

    def warn_occlusion_maps(self) -> None:
        """Add one warning for the occlusion textures of all materials that were read."""
        self._maker.warn_occlusion_maps()


def bound_material(prim: Any, warnings: list[ImporterWarning]) -> str:
    """Path of the material of a prim; empty without one, with a warning if it is missing."""
    from pxr import UsdShade

    binding = UsdShade.MaterialBindingAPI(prim)
    for purpose in (UsdShade.Tokens.full, UsdShade.Tokens.preview):
        material, _ = binding.ComputeBoundMaterial(purpose)
        if material:
            shared = material.GetPrim().GetPrimInPrototype()  # by all instances
            return str((shared or material.GetPrim()).GetPath())
    path = binding.GetDirectBinding().GetMaterialPath()
    if not path.isEmpty:
        message = f"Material {quote(path.name)} of {quote(prim.GetName())} is missing; it has its display color."
        warnings.append(unsupported(message))
    return ""


def _leaves_bounds(image: ImageInput, shapes: Sequence[PrimTriangles]) -> bool:
    """True if texture coordinates of an image are outside [0, 1], or unknown."""
    slot = UvSlot(image.uv_set, image.transform)
    for shape in shapes:
        primvar = shape.primvars.get(str(image.uv_set))
        if primvar is None:
            return True
        upward = primvar.values[np.unique(primvar.index[primvar.index >= 0])]
        uv = slot.apply({image.uv_set: (upward * (1, -1) + (0, 1)).astype(np.float32)}, len(upward))
        if len(uv) and (uv.min() < -_UV_TOLERANCE or uv.max() > 1 + _UV_TOLERANCE):
            return True
    return False


def display_colors(shape: PrimTriangles) -> Shaped[F32, "triangles 3 4"]:
    """Color and opacity of corners, gray without any."""
    colors = np.empty((len(shape.vertex), 3, 4), np.float32)
    for name, slots, default in ((COLOR, slice(0, 3), GRAY[:3]), (OPACITY, slice(3, 4), GRAY[3:])):
        primvar = shape.primvars.get(name, Primvar(np.zeros((0, len(default))), np.full(shape.vertex.shape, -1)))
        values = np.concatenate([np.clip(primvar.values, 0, 1), [default]])
        colors[..., slots] = values[primvar.index]
    return colors
