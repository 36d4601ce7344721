"""The scene model: triangles in world space, materials by name, cameras, one environment, local lights.

Right-handed, +Y up, meters. Importers create scenes and bakes read them; they are immutable.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.environment import Environment
from relume.assets.ies.ies_file import IesFile
from relume.core.import_warnings import ImporterWarning
from relume.scene.lens import Lens
from relume.scene.light_members import LightMembers

F32 = NDArray[np.float32]
U32 = NDArray[np.uint32]


WRAPS = ("repeat", "mirror", "clamp")
"""Wrap modes of textures; stores and kernels identify them by their index."""


@dataclass(frozen=True)
class TextureEncoding:
    """Meaning of a texture's bytes: see `relume.image_io.decode`.

    Attributes:
        kind: "srgb" for colors in sRGB, "normal" for tangent-space normals, or "share" for one number in [0, 1].
        scale: multiplies the values. turn: rotation of normals about +Z, radians.
    """

    kind: str
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    turn: float = 0.0


@dataclass(frozen=True)
class Texture:
    """An image that can be sampled.

    Attributes:
        pixels: top row first. uint8 with three channels, or one for kind "share", if there is an encoding; otherwise
            float32 with three.
        wrap: wrap modes of u and v outside [0, 1): "repeat", "mirror" or "clamp".
        encoding: encoding of bytes; None if pixels are linear RGB or normals.
    """

    pixels: Shaped[NDArray[Any], "height width channels"]
    wrap: tuple[str, str] = ("repeat", "repeat")
    encoding: TextureEncoding | None = None


@dataclass(frozen=True)
class Opacity:
    """Opacity texture of a surface.

    Attributes:
        alpha: 255 is opaque. Top row first. (height, width)
        wrap: as in `Texture`.
        cutoff: alpha-test threshold as a fraction of 255; None for stochastic transparency, with alpha the probability.
    """

    alpha: NDArray[np.uint8]
    wrap: tuple[str, str] = ("repeat", "repeat")
    cutoff: float | None = None


@dataclass(frozen=True)
class Glass:
    """Transmission through a surface.

    Attributes:
        tint: transmittance of one passage, without reflection. Three numbers in [0, 1].
        ior: index of refraction, in [1, 4].
        thickness: approximate thickness of a solid with this boundary, meters; 0 for a thin pane without refraction.
        absorbed: absorption coefficients inside a solid, per meter. Three numbers.
        roughness: of the surface as the transmitted light shows it, in [0, 1]: square root of the width of GGX facets.
    """

    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)
    ior: float = 1.5
    thickness: float = 0.0
    absorbed: tuple[float, float, float] = (0.0, 0.0, 0.0)
    roughness: float = 0.0


@dataclass(frozen=True)
class Mesh:
    """Triangles of one material, with node transforms applied.

    Attributes:
        positions: world space, meters.
        normals: unit, world space.
        tangents: unit, world space, with handedness in w; zero if the file has none.
        uvs: UV coordinates, v from the top as in glTF; zero if the file has none.
        faces: counterclockwise from outside.
        material: index into `Scene.materials`.
    """

    name: str
    positions: Shaped[F32, "vertices 3"]
    normals: Shaped[F32, "vertices 3"]
    tangents: Shaped[F32, "vertices 4"]
    uvs: Shaped[F32, "vertices 2"]
    faces: Shaped[U32, "triangles 3"]
    material: int


@dataclass(frozen=True)
class Material:
    """A named material: its default terms and its textures.

    Attributes:
        terms: default terms, as in a look document.
        textures: textures by channel. "diffuse" and "specular" multiply the terms that name them, such as
            `"texture": "diffuse"`. "roughness" is relative to the roughness of the terms and scales the width of those
            with `"roughness_map": "roughness"`. "emission" is relative to the mean emission of the surfaces.
        normal_map: tangent-space normals in [-1, 1]; None without normal mapping.
        double_sided: both sides are visible; back faces of single-sided materials are shaded with a flipped normal.
        shadow_catcher: a ground that looks may use as a shadow catcher, as the default look does.
        opacity: None for an opaque surface.
        glass: None for a surface without transmission.
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
        """True if rays can pass the surface, through its opacity texture or as glass."""
        return self.opacity is not None or self.glass is not None


@dataclass(frozen=True)
class Camera:
    """A view: looks along its -Z, with the vertical field of view `yfov` in radians.

    Attributes:
        to_world: camera to world, rigid.
        aspect: width ÷ height from the file, or None. Images may have any other.
        near: distance of the near clipping plane, meters; camera rays begin there, light and shadows do not change.
        lens: of fixed cameras; None: everything is sharp.
    """

    name: str
    to_world: Shaped[NDArray[np.float64], "4 4"]
    yfov: float
    aspect: float | None = None
    near: float = 0.0
    lens: Lens | None = None


@dataclass(frozen=True)
class Light:
    """A named local light.

    Attributes:
        fields: `kind` and all fields that differ from its defaults, as in a look document.
        group: light group that the default look proposes; "" for none.
        members: the lights of a source of many; None for a single light.
    """

    name: str
    fields: dict[str, Any]
    group: str = ""
    members: LightMembers | None = None


@dataclass(frozen=True)
class Scene:
    """Everything that a bake traces.

    Attributes:
        id: hash of the content, hexadecimal.
        warnings: warnings of the importer, one sentence each.
        variants: partial looks by name, from the file.
        offset: what was subtracted from the positions of the file, meters with +Y up; zeros unless it was recentered.
        import_options: `relume.scene_io.import_options.ImportOptions` other than the defaults; not part of the id.
        ies_files: IES files of an import that its lights name; empty once they are stored.
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
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    import_options: dict[str, str] = field(default_factory=dict)
    ies_files: tuple[IesFile, ...] = ()
