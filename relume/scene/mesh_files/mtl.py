"""Material libraries of OBJ files: numbers and images by keyword, and materials made from them.

Wavefront's Material Library File format, and the common PBR extension of it.
"""

from __future__ import annotations

import posixpath
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from relume.errors import SceneError
from relume.imageio.decoding import U8, Decoder
from relume.remarks import Remark, simplified, unused, wrong
from relume.scene.companions import Companions
from relume.scene.gltf.names import unique_name
from relume.scene.gltf.raster import NOISE
from relume.scene.mesh_files.mtl_dialects import Described, Gloss, dialect_of, gray_terms, terms_of
from relume.scene.model import Coding, Material, Opacity, Texture
from relume.scene.opacity import make_opacity

F64 = NDArray[np.float64]
MAX_LIBRARY_BYTES = 8 << 20
MAX_MATERIALS = 1_000
NUMBERS = {"Kd": 3, "Ks": 3, "Ke": 3, "Ns": 1, "Pr": 1, "Pm": 1, "d": 1, "Tr": 1}
MINOR_NUMBERS = {"Ka": 3, "illum": 1, "Pc": 1, "Pcr": 1, "Ps": 1, "aniso": 1}  # nothing is refused for these
OPTIONS = {"-blendu": 1, "-blendv": 1, "-boost": 1, "-mm": 2, "-o": 3, "-s": 3, "-t": 3, "-texres": 1, "-clamp": 1}
OPTIONS |= {"-bm": 1, "-imfchan": 1, "-type": 1, "-cc": 1}
BUMPS = ("norm", "map_Bump", "map_bump", "bump")
MAX_STRENGTH = 100.0
USED_MAPS = {"map_Kd", "map_Ks", "map_Ke", "map_d", "map_Pr", *BUMPS}
HARMLESS_MAPS = {"map_Ka", "map_aat"}  # of ambient light, and how to smooth the edges of images


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
    lines = data.decode("utf-8", "replace").splitlines()
    dialect = dialect_of(lines)
    material = Described(dialect=dialect)
    for line in lines:
        word, _, rest = line.strip().partition(" ")
        if word == "newmtl":
            material = materials[rest.strip()[:1_000]] = Described(folder, dialect)
            if len(materials) > MAX_MATERIALS:
                raise SceneError(f"the material file has more than {MAX_MATERIALS:,} materials; remove some")
        elif word in NUMBERS:
            material.numbers[word] = _numbers(rest.split(), NUMBERS[word], word)
        elif word in MINOR_NUMBERS:
            with suppress(SceneError):
                material.numbers[word] = _numbers(rest.split(), MINOR_NUMBERS[word], word)
        elif word.startswith("map_") or word in ("bump", "norm", "disp", "refl"):
            material.maps[word] = _image_name(rest.split())
            with suppress(SceneError, ValueError, IndexError):
                words = rest.split()
                material.strengths[word] = _numbers(words[words.index("-bm") + 1 :], 1, "-bm")[0]
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
        self._glosses: dict[str, Gloss] = {}

    def make(self, name: str, described: Described | None) -> Material:
        """One material under a name of its own; grey where nothing is known of it. Raises SceneError."""
        own_name = unique_name(name or "material", self._names)
        what = f"material {own_name!r}"
        if described is None:
            return Material(own_name, gray_terms())
        textures = self._textures(described, what)
        self._warn_of_the_rest(described, what)
        normal_map = self._normal_map(described, what)
        opacity = self._opacity(described, what)
        roughness = self._roughness(described, textures, what)
        terms, gloss = terms_of(described, textures, roughness, has_normal_map=normal_map is not None)
        if gloss is not None:
            self._glosses[own_name] = gloss
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
            self._warnings.append(wrong(f"{what} ({_shown(name)!r}) is not beside the scene; it is left out"))
        return self._pixels[path]

    def _normal_map(self, described: Described, what: str) -> Texture | None:
        """That of `norm`, or of a bump map whose image is one; heights are said to be lost."""
        for keyword in (keyword for keyword in BUMPS if described.maps.get(keyword)):
            called = f"the normal map of {what}" if keyword == "norm" else f"{keyword} of {what}"
            strength = min(described.strengths.get(keyword, 1.0), MAX_STRENGTH)
            try:
                texture = self._image(described, keyword, called, Coding("normal", (strength, strength, 1.0)))
            except SceneError as error:
                if keyword == "norm":
                    raise
                self._warnings.append(wrong(f"{error}; until then it is left out"))
                continue
            if texture is None or keyword == "norm" or holds_normals(texture.pixels):
                return texture
            name = _shown(described.maps[keyword])
            self._warnings.append(wrong(f"{called} ({name!r}) is a map of heights; it is left out, give a normal map"))
        return None

    def _warn_of_the_rest(self, described: Described, what: str) -> None:
        for keyword in sorted(described.maps.keys() - USED_MAPS):
            say = unused if keyword in HARMLESS_MAPS else wrong
            name = _shown(described.maps[keyword])
            self._warnings.append(say(f"{keyword[:40]} of {what} ({name!r}) is not used"))
        lost = [word for word in ("Ps", "aniso") if described.numbers.get(word, [0.0])[0] > 0]
        self._warnings.extend(simplified(f"{word} of {what} is not used") for word in lost)

    def warn_of_gloss(self) -> None:
        """Say once for all materials that were made how Ks was read, where it was not read as it stands."""
        for gloss in Gloss:
            names = [name for name, found in self._glosses.items() if found is gloss]
            if names:
                more = f" and {len(names) - 1} more" if len(names) > 1 else ""
                self._warnings.append(simplified(f"Ks of material {names[0]!r}{more} {gloss.value}"))


def holds_normals(pixels: U8) -> bool:
    """Whether an image, (height, width, 3 or 4), holds unit vectors about +z, as normal maps do and heights do not."""
    step = 1 + max(pixels.shape[:2]) // 512  # these tell it as well as all
    vectors = pixels[::step, ::step, :3].reshape(-1, 3) / np.float32(127.5) - 1
    x, y, z = vectors.mean(axis=0)
    length = np.abs(np.linalg.norm(vectors, axis=1) - 1).mean()
    return bool(z > 0.5 and max(abs(x), abs(y)) < 0.25 and length < 0.15)


def _shown(name: str) -> str:
    """The end of a file's name, which tells more than its beginning, in ASCII."""
    return ("…" if len(name) > 60 else "") + name[-60:].encode("ascii", "replace").decode()
