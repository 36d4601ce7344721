"""What the numbers of a .mtl file mean, by who wrote it.

Wavefront's illumination model 2 is Kd (n·l) + Ks (n·h)^Ns, for lights without size and no surroundings. So Ks is how
bright a highlight is, not which share of all light is reflected: programs write 0.33, 0.5 or 1 for plastic and wood.
Read as a reflectance it makes metal of everything. Hence, in this order:

1. Pr or Pm: the PBR extension. A dielectric of F0 0.04, or a metal, or between; Pc and Pcr are a clear coat.
2. Blender without them: the inverse of its exporter. F0 = 0.08 Ks, metallic = Ka where illum is 3 or 6, and
   roughness = 1 - sqrt(Ns / 1000), 900 before its exporter named its version.
3. A gray Ks over a Kd that is not black, without mirror (illum 3 or 8): a dielectric, F0 = min(Ks, 0.04), and a facet
   distribution as wide as the highlight, α² = 2 / (Ns + 2) (Walter 2007).
4. All else is meant as it stands, as metals in this format are: blinn_phong with the color Ks.
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

from relume.brdf.registry import TERMS
from relume.scene.model import Texture
from relume.scene_io.gltf.to_terms import CoatLayer, PbrSurface, Terms, dielectric_reflectance, make_terms

F64 = NDArray[np.float64]
GRAY = [0.6, 0.6, 0.6]
PLASTIC_F0 = 0.04
BLENDER_F0 = 0.08  # of a specular level of 1
GRAY_SPREAD = 0.05  # between the channels of a gray, relative to the largest
MIRROR_MODELS = (3, 8)  # illumination models with reflection and without Fresnel
BLENDER_METAL_MODELS = (3, 6)


class Dialect(Enum):
    """Who wrote a library: the largest Ns of Blender's exporters, 0 for all others."""

    COMMON = 0
    OLD_BLENDER = 900
    BLENDER = 1000


class Gloss(Enum):
    """How a Ks was read that was not read as it stands; stands behind "Ks of material …" in a sentence."""

    BLENDER = "is read as the specular level of Blender, which wrote the file: 0.5 is a reflectance of 4 % (F0 0.04)"
    DIELECTRIC = (
        "is read as the gloss of plastic, a reflectance of 4 % (F0 0.04): a gray Ks over a Kd that is not black is "
        "taken for no metal; for a metal write Pm 1, a colored Ks, or Kd 0"
    )


@dataclass
class MtlMaterial:
    """One `newmtl`: its numbers, and the names of its images by keyword, as the file in `folder` gives them; and how
    strong its bump maps are, where that is said."""

    folder: str = ""
    dialect: Dialect = Dialect.COMMON
    numbers: dict[str, list[float]] = field(default_factory=dict)
    maps: dict[str, str] = field(default_factory=dict)
    strengths: dict[str, float] = field(default_factory=dict)


def detect_dialect(lines: Sequence[str]) -> Dialect:
    """Who wrote a library, by the comments that it begins with."""
    header = takewhile(lambda line: not line or line.startswith("#"), (line.strip() for line in lines))
    for line in header:
        if re.match(r"#\s*Blender\b", line, re.IGNORECASE):
            return Dialect.BLENDER if re.match(r"#\s*Blender v?\d", line, re.IGNORECASE) else Dialect.OLD_BLENDER
    return Dialect.COMMON


def gray_terms() -> Terms:
    """What stands for a material of which nothing is known."""
    return make_terms(_surface(np.array(GRAY), PLASTIC_F0, 0.0, 0.5, {}), CoatLayer())


def make_mtl_terms(
    mtl_material: MtlMaterial, textures: Mapping[str, Texture], roughness: float | None, *, has_normal_map: bool
) -> tuple[Terms, Gloss | None]:
    """The terms of a material, and how its Ks was read where that is to be said.

    Args:
        mtl_material: its numbers. textures: its images by channel.
        roughness: of the PBR extension, its map counted in; None where there is none.
        has_normal_map: which widens its highlights where they are seen from far.
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
    """A color that an image multiplies; where exporters write zeros, or nothing, they mean the image."""
    color = numbers.get(keyword, [0.0, 0.0, 0.0] if image is not None else default)
    return color if any(color) or image is None else [1.0, 1.0, 1.0]


def _metallic(numbers: Mapping[str, list[float]]) -> float:
    """What Blender writes as Ka of a material that reflects."""
    is_metal = numbers.get("illum", [2.0])[0] in BLENDER_METAL_MODELS
    return min(float(np.mean(numbers.get("Ka", [0.0]))), 1.0) if is_metal else 0.0


def _blender_roughness(mtl_material: MtlMaterial) -> float:
    """The inverse of Blender's Ns; one half where that is an image."""
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
    """A dielectric that reflects `f0` head-on, or a metal, or between. base: (3,)"""
    specular_reflectance = dielectric_reflectance(f0, 1.0)
    return PbrSurface(
        base * (1 - metallic), f0 + (base - f0) * metallic, 1.0, roughness, specular_reflectance, dict(textures)
    )
