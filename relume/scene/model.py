"""A scene as relume sees it: triangles in world space, materials by name, cameras, one environment, local lights.

Right-handed, +Y up, metres. Importers produce it, bakes read it; nothing changes it afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.assets.environments.environment import Environment
from relume.core.import_warnings import ImporterWarning

F32 = NDArray[np.float32]
U32 = NDArray[np.uint32]


WRAPS = ("repeat", "mirror", "clamp")
"""How textures may continue; stores and kernels know them by their places here."""


@dataclass(frozen=True)
class TextureEncoding:
    """What the bytes of a texture stand for: see `relume.image_io.decode`.

    Attributes:
        kind: "srgb", display values of colours; "normal", normals of tangent space; or "share", one number of [0, 1].
        scale: multiplies the values. turn: of normals about +Z, radians.
    """

    kind: str
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    turn: float = 0.0


@dataclass(frozen=True)
class Texture:
    """An image, ready to be sampled.

    Attributes:
        pixels: top row first. (height, width, 3) uint8 where it has a coding, else float32, the values themselves;
            (height, width, 1) of shares
        wrap: how u and v continue outside [0, 1): "repeat", "mirror" or "clamp" each.
        encoding: what bytes stand for; None where pixels are linear RGB, or normals.
    """

    pixels: NDArray[Any]
    wrap: tuple[str, str] = ("repeat", "repeat")
    encoding: TextureEncoding | None = None


@dataclass(frozen=True)
class Opacity:
    """Where a surface is there.

    Attributes:
        alpha: 255 where it is. Top row first. (height, width) uint8
        wrap: as that of a texture.
        cutoff: share of 255 from which it is there; None where it is there for as many rays as alpha says.
    """

    alpha: NDArray[np.uint8]
    wrap: tuple[str, str] = ("repeat", "repeat")
    cutoff: float | None = None


@dataclass(frozen=True)
class Glass:
    """A surface that light passes.

    Attributes:
        tint: share of the light that passes once, but for what is reflected. Three numbers within [0, 1].
        ior: index of refraction, within [1, 4].
        thickness: of a solid whose rim it is, about, metres; 0 for a pane, which bends nothing.
        absorbed: inside of a solid, per metre. Three numbers.
    """

    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)
    ior: float = 1.5
    thickness: float = 0.0
    absorbed: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Mesh:
    """Triangles of one material, node transforms applied.

    Attributes:
        positions: world space, metres. (num_vertices, 3) float32
        normals: unit, world space. (num_vertices, 3) float32
        tangents: unit, world space, with handedness in w; zeros where the file has none. (num_vertices, 4) float32
        uvs: texture coordinates, v from the top as in glTF; zeros where there are none. (num_vertices, 2) float32
        faces: counter-clockwise seen from outside. (num_faces, 3) uint32
        material: index into `Scene.materials`.
    """

    name: str
    positions: F32
    normals: F32
    tangents: F32
    uvs: F32
    faces: U32
    material: int


@dataclass(frozen=True)
class Material:
    """A named material: its default terms (look-document form) and its images.

    Attributes:
        terms: the material's default terms as they stand in a look document.
        textures: per-sample multipliers by channel name; a term that names `"texture": "diffuse"` is multiplied by
            `textures["diffuse"]`. Known channels: "diffuse", "specular"; and "roughness", over the roughness that
            terms say, which scales the width of those with `"roughness_map": "roughness"`; and "emission", over the
            mean of what the material's surfaces shine.
        normal_map: tangent-space normals in [-1, 1]; None where there is none.
        double_sided: whether both sides are seen; single-sided back faces are shaded as if turned round.
        shadow_catcher: it is a ground that looks may show by its shadows alone, and the default look does.
        opacity: where it has holes; None where it is whole.
        glass: how light passes it; None where none does.
    """

    name: str
    terms: tuple[dict[str, Any], ...]
    textures: dict[str, Texture] = field(default_factory=dict)
    normal_map: Texture | None = None
    double_sided: bool = True
    shadow_catcher: bool = False
    opacity: Opacity | None = None
    glass: Glass | None = None

    @property
    def is_alpha_tested(self) -> bool:
        """Whether rays may pass it, by holes or as glass."""
        return self.opacity is not None or self.glass is not None


@dataclass(frozen=True)
class Camera:
    """A view: looks along its -Z, `yfov` vertical, in radians.

    Attributes:
        to_world: camera to world. (4, 4) float64, rigid
        aspect: width ÷ height, as its file says; None where it does not. Pictures may have any other.
    """

    name: str
    to_world: NDArray[np.float64]
    yfov: float
    aspect: float | None = None


@dataclass(frozen=True)
class Light:
    """A named local light.

    Attributes:
        fields: `kind` and what else is not that kind's default, as they stand in a look document.
    """

    name: str
    fields: dict[str, Any]


@dataclass(frozen=True)
class Scene:
    """Everything that a bake needs to know of what is seen.

    Attributes:
        id: hash of the content, hexadecimal; the same content has the same id.
        warnings: what the importer did not understand, one sentence each.
        variants: partial looks by the names that the file gives them.
    """

    id: str
    name: str
    meshes: tuple[Mesh, ...]
    materials: tuple[Material, ...]
    cameras: tuple[Camera, ...]
    environment: Environment
    warnings: tuple[ImporterWarning, ...] = ()
    variants: dict[str, dict[str, Any]] = field(default_factory=dict)
    lights: tuple[Light, ...] = ()
