"""Interpretation of the numbers in a .mtl file, depending on the program that wrote it.

Wavefront's illumination model 2 is Kd (n·l) + Ks (n·h)^Ns, for lights without size and no environment. Ks is therefore
the brightness of a highlight, not a reflectance: programs write 0.33, 0.5 or 1 for plastic and wood. As a reflectance,
it would turn everything into metal. Hence, in this order:

1. Pr or Pm: the PBR extension. A dielectric of F0 0.04, a metal, or a blend; Pc and Pcr are a clearcoat.
2. Blender without them: the inverse of its exporter. F0 = 0.08 Ks, metallic = Ka if illum is 3 or 6, and
   roughness = 1 - sqrt(Ns / 1000), or 900 in old exporters, which do not write their version.
3. A gray Ks with a Kd that is not black, without mirror (illum 3 or 8): a dielectric, F0 = min(Ks, 0.04), and a
   microfacet distribution as wide as the highlight, α² = 2 / (Ns + 2) (Walter 2007).
4. Everything else literally, as metals in this format are: blinn_phong with the color Ks.

Illumination models 6, 7 and 9 with an index Ni above 1 are glass: a solid that refracts, and that Tf passes. Exporters
write them with d below 1 as well, for surfaces that are blended, and model 4 for opaque ones (Maya, with Ni 1).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from itertools import takewhile
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from relume.brdf.fresnel import normal_reflectance
from relume.brdf.registry import TERMS
from relume.scene.model import Glass, Texture
from relume.scene.validate import MAX_IOR
from relume.scene_io.surfaces.to_terms import CoatLayer, PbrSurface, Terms, dielectric_reflectance, make_terms

F64 = NDArray[np.float64]
GRAY = [0.6, 0.6, 0.6]
PLASTIC_F0 = 0.04
BLENDER_F0 = 0.08  # at a specular level of 1
GRAY_SPREAD = 0.05  # between the channels of a gray, relative to the largest
MIRROR_MODELS = (3, 8)  # illumination models with reflection and without Fresnel
BLENDER_METAL_MODELS = (3, 6)
GLASS_MODELS = (6, 7, 9)
SOLID_M = 1.0  # thickness, which the format does not have, of glass that does not absorb


class Dialect(Enum):
    """Program that wrote a library: the largest Ns of Blender's exporters, 0 for all others."""

    COMMON = 0
    OLD_BLENDER = 900
    BLENDER = 1000


class Gloss(Enum):
    """Interpretation of a Ks that is not used literally, as the end of the sentence "Ks of material …"."""

    BLENDER = "was read as Blender's specular level, because Blender wrote the file: 0.5 reflects 4 % (F0 0.04)."
    DIELECTRIC = (
        "was read as the gloss of plastic, which reflects 4 % (F0 0.04), because it is gray and Kd isn't black. For "
        "metal, write Pm 1, a colored Ks, or Kd 0."
    )


@dataclass(frozen=True)
class MtlMap:
    """An image of a material, with the options of its line.

    Attributes:
        name: file name, relative to the folder of the library.
        scale, offset: UV coordinates in the image are UV · scale + offset, v from the bottom.
        strength: of a bump map. clamp: the image does not repeat. channel: "r", "g", "b", "m" (alpha), "l" (luminance),
            or "" for none in particular.
        ignored_options: options that change the image and are not supported.
    """

    name: str
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    strength: float = 1.0
    clamp: bool = False
    channel: str = ""
    ignored_options: tuple[str, ...] = ()


@dataclass
class MtlMaterial:
    """One `newmtl`: its numbers and its images, by keyword; `folder` of the library, relative to the scene."""

    folder: str = ""
    dialect: Dialect = Dialect.COMMON
    numbers: dict[str, list[float]] = field(default_factory=dict)
    maps: dict[str, MtlMap] = field(default_factory=dict)


def detect_dialect(lines: Sequence[str]) -> Dialect:
    """Detect the program that wrote a library from the comments at its start."""
    header = takewhile(lambda line: not line or line.startswith("#"), (line.strip() for line in lines))
    for line in header:
        if re.match(r"#\s*Blender\b", line, re.IGNORECASE):
            return Dialect.BLENDER if re.match(r"#\s*Blender v?\d", line, re.IGNORECASE) else Dialect.OLD_BLENDER
    return Dialect.COMMON


def gray_terms() -> Terms:
    """Terms of a material without a definition."""
    return make_terms(_surface(np.array(GRAY), PLASTIC_F0, 0.0, 0.5, {}), CoatLayer())


def make_glass(mtl_material: MtlMaterial, roughness: float | None) -> Glass | None:
    """The glass that a material describes, else None.

    Args:
        mtl_material: its numbers; it is not blended. roughness: as for `make_mtl_terms`.
    """
    numbers = mtl_material.numbers
    ior = numbers.get("Ni", [1.0])[0]
    red, green, blue = (min(value, 1.0) for value in numbers.get("Tf", [1.0, 1.0, 1.0]))
    if numbers.get("illum", [2.0])[0] not in GLASS_MODELS or not 1 < ior <= MAX_IOR or max(red, green, blue) == 0:
        return None
    return Glass((red, green, blue), ior, SOLID_M, roughness=roughness or 0.0)


def make_glass_terms(mtl_material: MtlMaterial, glass: Glass, textures: Mapping[str, Texture]) -> Terms:
    """Terms of a glass: Fresnel reflection, and what Kd reflects of the light that does not pass.

    Args:
        mtl_material: its numbers. glass: of `make_glass`. textures: textures by channel.
    """
    base = np.array(_color(mtl_material.numbers, "Kd", [0.0, 0.0, 0.0], textures.get("diffuse")))
    f0 = normal_reflectance(glass.ior)
    return make_terms(_surface(base * (1 - np.array(glass.tint)), f0, 0.0, glass.roughness, textures), CoatLayer())


def make_mtl_terms(
    mtl_material: MtlMaterial, textures: Mapping[str, Texture], roughness: float | None, *, has_normal_map: bool
) -> tuple[Terms, Gloss | None]:
    """Convert a material to terms; also return the interpretation of Ks if users should know it.

    Args:
        mtl_material: its numbers. textures: textures by channel.
        roughness: roughness of the PBR extension, including its map; None without it.
        has_normal_map: minification widens its highlights.
    """
    numbers = mtl_material.numbers
    base = np.array(_color(numbers, "Kd", GRAY, textures.get("diffuse")))
    tint = np.array(_color(numbers, "Ks", [0.0, 0.0, 0.0], textures.get("specular")))
    gloss = Gloss.BLENDER if mtl_material.dialect is not Dialect.COMMON and tint.any() else None
    f0 = BLENDER_F0 * min(1.0, float(tint.mean()))
    if roughness is not None or "Pm" in numbers:
        metallic = min(numbers.get("Pm", [0.0])[0], 1.0)
        f0 = f0 if gloss else PLASTIC_F0
        surface = _surface(base, f0, metallic, 0.5 if roughness is None else roughness, textures)
    elif not tint.any():
        return (_diffuse(base, textures),), None
    elif gloss:
        surface = _surface(base, f0, _metallic(numbers), _blender_roughness(mtl_material), textures)
    elif _is_dielectric(base, tint, numbers):
        gloss = Gloss.DIELECTRIC if tint.mean() > PLASTIC_F0 else None
        width = (2 / (_exponent(numbers) + 2)) ** 0.25
        surface = _surface(base, min(float(tint.mean()), PLASTIC_F0), 0.0, width, textures)
    else:
        return (_diffuse(base, textures), _highlight(tint, numbers, textures)), None
    return make_terms(replace(surface, has_normal_map=has_normal_map), _coat(numbers)), gloss


def _color(
    numbers: Mapping[str, list[float]], keyword: str, default: list[float], image: Texture | None
) -> list[float]:
    """A color that multiplies an image; exporters that write zero or nothing mean white."""
    color = numbers.get(keyword, [0.0, 0.0, 0.0] if image is not None else default)
    return color if any(color) or image is None else [1.0, 1.0, 1.0]


def _metallic(numbers: Mapping[str, list[float]]) -> float:
    """Metallic value, which Blender writes as Ka of a reflective material."""
    is_metal = numbers.get("illum", [2.0])[0] in BLENDER_METAL_MODELS
    return min(float(np.mean(numbers.get("Ka", [0.0]))), 1.0) if is_metal else 0.0


def _blender_roughness(mtl_material: MtlMaterial) -> float:
    """The inverse of Blender's Ns; one half if Ns is missing, as with a texture."""
    largest = float(mtl_material.dialect.value)
    return 1 - sqrt(min(mtl_material.numbers.get("Ns", [largest / 4])[0] / largest, 1.0))


def _is_dielectric(base: F64, tint: F64, numbers: Mapping[str, list[float]]) -> bool:
    is_gray = np.ptp(tint) <= GRAY_SPREAD * tint.max()
    return bool(is_gray and base.any() and numbers.get("illum", [2.0])[0] not in MIRROR_MODELS)


def _exponent(numbers: Mapping[str, list[float]]) -> float:
    return numbers.get("Ns", [TERMS["blinn_phong"].parameter("exponent").default])[0]


def _coat(numbers: Mapping[str, list[float]]) -> CoatLayer:
    return CoatLayer(coat=min(numbers.get("Pc", [0.0])[0], 1.0), coat_roughness=numbers.get("Pcr", [0.0])[0])


def _diffuse(base: F64, textures: Mapping[str, Texture]) -> dict[str, object]:
    return {"model": "lambert", "color": base.tolist(), "texture": "diffuse" if "diffuse" in textures else None}


def _highlight(tint: F64, numbers: Mapping[str, list[float]], textures: Mapping[str, Texture]) -> dict[str, object]:
    parameter = TERMS["blinn_phong"].parameter("exponent")
    exponent = float(np.clip(_exponent(numbers), parameter.minimum, parameter.maximum))
    channel = "specular" if "specular" in textures else None
    color = np.clip(tint, 0, 1).tolist()
    return {"model": "blinn_phong", "color": color, "params": {"exponent": exponent}, "texture": channel}


def _surface(base: F64, f0: float, metallic: float, roughness: float, textures: Mapping[str, Texture]) -> PbrSurface:
    """A dielectric with reflectance `f0`, a metal, or a blend. base: (3,)"""
    specular_reflectance = dielectric_reflectance(f0, 1.0)
    return PbrSurface(
        base * (1 - metallic), f0 + (base - f0) * metallic, 1.0, roughness, specular_reflectance, dict(textures)
    )
