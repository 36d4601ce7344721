"""Material libraries of OBJ files: Kd as lambert, Ks and Ns as blinn_phong, Pr and Pm as ggx, Ke as radiance.

Wavefront's Material Library File format (illumination model 2: Ks (n·h)^Ns), and the common PBR extension of it.
"""

from __future__ import annotations

import posixpath
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.registry import TERMS
from relume.errors import SceneError
from relume.imageio.decoding import U8, Decoder
from relume.remarks import Remark, simplified, wrong
from relume.scene.companions import Companions
from relume.scene.gltf.names import unique_name
from relume.scene.gltf.raster import NOISE
from relume.scene.gltf.terms import Over, Surface, dielectric_share, make_terms
from relume.scene.model import Coding, Material, Opacity, Texture
from relume.scene.opacity import make_opacity

F64 = NDArray[np.float64]
MAX_LIBRARY_BYTES = 8 << 20
MAX_MATERIALS = 1_000
GREY = [0.6, 0.6, 0.6]
NUMBERS = {"Kd": 3, "Ks": 3, "Ke": 3, "Ns": 1, "Pr": 1, "Pm": 1, "d": 1, "Tr": 1}
OPTIONS = {"-blendu": 1, "-blendv": 1, "-boost": 1, "-mm": 2, "-o": 3, "-s": 3, "-t": 3, "-texres": 1, "-clamp": 1}
OPTIONS |= {"-bm": 1, "-imfchan": 1, "-type": 1, "-cc": 1}


@dataclass
class Described:
    """One `newmtl`: its numbers, and the names of its images by keyword, as the file in `folder` gives them."""

    folder: str = ""
    numbers: dict[str, list[float]] = field(default_factory=dict)
    maps: dict[str, str] = field(default_factory=dict)


def read_library(data: bytes, folder: str = "") -> dict[str, Described]:
    """The materials of a library by name.

    Args:
        folder: that the library lies in, seen from the scene.
    Raises:
        SceneError: too large, too many, or a line is not what its first word says.
    """
    if len(data) > MAX_LIBRARY_BYTES:
        raise SceneError(f"the material file is larger than {MAX_LIBRARY_BYTES >> 20} MB; export it again")
    materials: dict[str, Described] = {}
    material = Described()
    for line in data.decode("utf-8", "replace").splitlines():
        word, _, rest = line.strip().partition(" ")
        if word == "newmtl":
            material = materials[rest.strip()[:1_000]] = Described(folder)
            if len(materials) > MAX_MATERIALS:
                raise SceneError(f"the material file has more than {MAX_MATERIALS:,} materials; remove some")
        elif word in NUMBERS:
            material.numbers[word] = _numbers(rest.split(), NUMBERS[word], word)
        elif word.startswith("map_") or word in ("bump", "norm", "disp", "refl"):
            material.maps[word] = _image_name(rest.split())
    return materials


def _numbers(words: list[str], count: int, keyword: str) -> list[float]:
    """`count` numbers; one stands for three."""
    try:
        values = [float(word) for word in words[:count]]
    except ValueError:
        raise SceneError(f"{keyword} of the material file is not made of numbers; export it again") from None
    if len(values) == 1:
        values *= count
    if len(values) != count or not np.isfinite(values).all() or not 0 <= min(values) <= max(values) <= 1e6:
        raise SceneError(f"{keyword} of the material file is out of range; export it again")
    return values


def _image_name(words: list[str]) -> str:
    """The file name after the options; it may have spaces in it."""
    while words and words[0] in OPTIONS:
        words = words[1 + OPTIONS[words[0]] :]
    return " ".join(words)[:1_000]


class MaterialMaker:
    """Turns described materials into relume's, each image decoded once."""

    def __init__(self, companions: Companions, warnings: list[Remark]) -> None:
        self._companions = companions
        self._warnings = warnings
        self._decoder = Decoder()
        self._names: dict[str, int] = {}
        self._pixels: dict[str, U8 | None] = {}

    def make(self, name: str, described: Described | None) -> Material:
        """One material under a name of its own; grey where nothing is known of it. Raises SceneError."""
        own_name = unique_name(name or "material", self._names)
        what = f"material {own_name!r}"
        if described is None:
            return Material(own_name, make_terms(_plastic(np.array(GREY), 0.0, 0.5, {}), Over()))
        textures = self._textures(described, what)
        self._warn_of_the_rest(described, what)
        normal_map = self._image(described, "norm", f"the normal map of {what}", Coding("normal"))
        opacity = self._opacity(described, what)
        roughness = self._roughness(described, textures, what)
        terms = _terms(described, textures, roughness, has_normal_map=normal_map is not None)
        return Material(own_name, terms, textures, normal_map, opacity=opacity)

    def _roughness(self, described: Described, textures: dict[str, Texture], what: str) -> float | None:
        """Pr times the mean of map_Pr, which becomes a texture where it says more; None where there are neither."""
        given = described.numbers.get("Pr", [None])[0]
        pixels = self._decoded(described, "map_Pr", f"map_Pr of {what}")
        if pixels is None:
            return given
        mean = float(pixels[..., 0].mean()) / 255
        if mean > 0 and np.ptp(pixels[..., 0]) > NOISE:
            share = Coding("share", (1 / mean, 1 / mean, 1 / mean))
            textures["roughness"] = Texture(np.ascontiguousarray(pixels[..., :1]), coding=share)
        return (given or 1.0) * mean  # exporters write zeros where they mean the image

    def _opacity(self, described: Described, what: str) -> Opacity | None:
        """Where the material has holes: d, or 1 − Tr, times map_d."""
        numbers = described.numbers
        share = min(1.0, numbers["d"][0] if "d" in numbers else 1 - min(1.0, numbers.get("Tr", [0.0])[0]))
        if share == 0 and "map_d" in described.maps:
            share = 1.0  # exporters write zeros where they mean the image
        pixels = self._decoded(described, "map_d", f"map_d of {what}")
        # grey, or the picture that map_Kd names as well, with the holes in its alpha
        alpha = None if pixels is None else pixels[..., 3 if np.ptp(pixels[..., 3]) else 0]
        return make_opacity(alpha, ("repeat", "repeat"), share, None, what, self._warnings)

    def emission(self, material: Material, described: Described | None) -> F64:
        """Radiance of the surfaces of a material that was made, which its image multiplies: Ke. (3,)"""
        if described is None:
            return np.zeros(3)
        factor = np.array(described.numbers.get("Ke", [0.0, 0.0, 0.0]))
        # exporters write zeros where they mean the image
        return np.ones(3) if "emission" in material.textures and not factor.any() else factor

    def _textures(self, described: Described, what: str) -> dict[str, Texture]:
        textures = {}
        for keyword, channel in (("map_Kd", "diffuse"), ("map_Ks", "specular"), ("map_Ke", "emission")):
            texture = self._image(described, keyword, f"{keyword} of {what}", Coding("srgb"))
            if texture is not None:
                textures[channel] = texture
        return textures

    def _image(self, described: Described, keyword: str, what: str, coding: Coding) -> Texture | None:
        pixels = self._decoded(described, keyword, what)
        return None if pixels is None else Texture(np.ascontiguousarray(pixels[..., :3]), coding=coding)

    def _decoded(self, described: Described, keyword: str, what: str) -> U8 | None:
        """The bytes of an image, RGBA. (height, width, 4)"""
        name = described.maps.get(keyword)
        if not name:
            return None
        path = posixpath.join(described.folder, name.replace("\\", "/"))
        if path not in self._pixels:
            data = self._companions.read(path, what)
            if data is None and described.folder and not name.startswith(".."):
                data = self._companions.read(name, what)  # some exporters name it as the scene sees it
            self._pixels[path] = None if data is None else self._decoder.decode(data, what)
        if self._pixels[path] is None:
            shown = name[:60].encode("ascii", "replace").decode()
            self._warnings.append(wrong(f"{what} ({shown!r}) is not beside the scene; it is left out"))
        return self._pixels[path]

    def _warn_of_the_rest(self, described: Described, what: str) -> None:
        for keyword in sorted(described.maps.keys() - {"map_Kd", "map_Ks", "map_Ke", "map_d", "map_Pr", "norm"}):
            self._warnings.append(simplified(f"{keyword[:40]} of {what} is not used"))


def _terms(
    described: Described, textures: dict[str, Texture], roughness: float | None, *, has_normal_map: bool
) -> tuple[dict[str, Any], ...]:
    numbers = described.numbers
    base = numbers.get("Kd", GREY)
    if "diffuse" in textures and not any(base):
        base = [1.0, 1.0, 1.0]  # exporters write zeros where they mean the image
    if roughness is not None or "Pm" in numbers:
        metallic = min(numbers.get("Pm", [0.0])[0], 1.0)
        surface = _plastic(np.array(base), metallic, 0.5 if roughness is None else roughness, textures)
        return make_terms(replace(surface, has_normal_map=has_normal_map), Over())
    diffuse = {"model": "lambert", "color": base, "texture": "diffuse" if "diffuse" in textures else None}
    tint = numbers.get("Ks", [0.0, 0.0, 0.0])
    if not any(tint):
        return (diffuse,)
    exponent = TERMS["blinn_phong"].parameter("exponent")
    held = float(np.clip(numbers.get("Ns", [exponent.default])[0], exponent.minimum, exponent.maximum))
    gloss = {"model": "blinn_phong", "color": np.clip(tint, 0, 1).tolist(), "params": {"exponent": held}}
    return (diffuse, gloss | {"texture": "specular" if "specular" in textures else None})


def _plastic(base: F64, metallic: float, roughness: float, textures: dict[str, Texture]) -> Surface:
    """A dielectric of index 1.5, or a metal, or between. base: (3,)"""
    f0 = 0.04 + (base - 0.04) * metallic
    return Surface(base * (1 - metallic), f0, 1.0, roughness, dielectric_share(0.04, 1.0), textures)
