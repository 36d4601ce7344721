"""Surface models by the category of their shader."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

from relume.core.import_warnings import ImporterWarning, approximated, quote, unsupported
from relume.scene_io.surfaces.gltf_pbr import gltf_pbr
from relume.scene_io.surfaces.node_values import NodeValues, Port, PrimvarReference
from relume.scene_io.surfaces.open_pbr import open_pbr
from relume.scene_io.surfaces.preview_surface import preview_surface
from relume.scene_io.surfaces.standard_surface import standard_surface
from relume.scene_io.surfaces.surface_images import ImageInput, SurfaceImages
from relume.scene_io.surfaces.surface_inputs import SurfaceInputs, Value
from relume.scene_io.surfaces.surface_parameters import WHITE, SurfaceParameters

MODELS = {
    "open_pbr_surface": open_pbr,
    "standard_surface": standard_surface,
    "gltf_pbr": gltf_pbr,
    "UsdPreviewSurface": preview_surface,
}
MESH_COLORS = "displayColor"  # primvar
_BASE_COLORS = ("base_color", "diffuseColor")
_TANGENTS = ("tangent", "geometry_tangent", "geometry_coat_tangent")
_NORMALS = ("normal", "geometry_normal", "coat_normal", "geometry_coat_normal", "clearcoat_normal")
_FRAME = dict.fromkeys(_NORMALS, "normal") | dict.fromkeys(_TANGENTS, "tangent")
_COAT_NORMALS = ("coat_normal", "geometry_coat_normal", "clearcoat_normal")


def warn_black_outside(
    surface: SurfaceParameters,
    label: str,
    warnings: list[ImporterWarning],
    leaves_bounds: Callable[[ImageInput], bool] = lambda image: True,
) -> None:
    """Warn once if an image is seen where the file has black.

    Args:
        surface: a surface. label: names the material. warnings: gets the sentence.
        leaves_bounds: True for images that some surfaces use outside [0, 1]; by default for all.
    """
    if any(map(leaves_bounds, surface.black_outside())):
        message = f"An image of {label} is black outside its bounds in the file, which isn't supported."
        warnings.append(approximated(message))


class SurfaceReader:
    """Reads the surfaces of one document.

    Args:
        nodes: evaluate its inputs. images: of the document. warnings: gets a sentence for each approximation.
    """

    def __init__(self, nodes: NodeValues, images: SurfaceImages, warnings: list[ImporterWarning]) -> None:
        self._nodes, self._images, self._warnings = nodes, images, warnings

    def read(self, category: str, ports: Iterable[tuple[str, Port]], label: str) -> SurfaceParameters:
        """Read a surface.

        Args:
            category: one of `MODELS`. ports: names and inputs of its shader. label: names the material in warnings.
        """
        values, has_mesh_colors = dict[str, Value](), False
        for name, value in self._nodes.surface(ports, label).items():
            if isinstance(value, PrimvarReference) and _FRAME.get(name) == value.name:
                continue  # that of the surface, which is the default
            if name in _TANGENTS or (name in _COAT_NORMALS and isinstance(value, ImageInput)):
                self._warnings.append(unsupported(f"{name} of {label} isn't supported."))
            elif not isinstance(value, PrimvarReference):
                values[name] = value
            elif value.name == MESH_COLORS and name in _BASE_COLORS:
                values[name], has_mesh_colors = WHITE, True
            else:
                primvar = f"a primvar {quote(value.name)}, which isn't supported"
                self._warnings.append(unsupported(f"{name} of {label} is {primvar}."))
                values |= {} if value.default is None else {name: value.default}
        inputs = SurfaceInputs(values, self._images, label, self._warnings)
        return replace(MODELS[category](inputs), has_mesh_colors=has_mesh_colors)
