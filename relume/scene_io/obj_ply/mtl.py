"""Material libraries of OBJ files: numbers and images by keyword, and their conversion to materials.

Wavefront's Material Library File format, and its common PBR extension.
"""

from __future__ import annotations

import posixpath
from contextlib import suppress

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, ignored, quote, unsupported
from relume.image_io.decode import U8, Decoder
from relume.scene.model import Material, Opacity, Texture, TextureEncoding
from relume.scene.opacity import make_opacity
from relume.scene.unique_names import unique_name
from relume.scene_io.gltf.texture_resampling import NOISE
from relume.scene_io.obj_ply.mtl_dialects import Gloss, MtlMaterial, detect_dialect, gray_terms, make_mtl_terms
from relume.scene_io.referenced_files import Companions

F64 = NDArray[np.float64]
MAX_LIBRARY_BYTES = 8 << 20
MAX_MATERIALS = 1_000
NUMBERS = {"Kd": 3, "Ks": 3, "Ke": 3, "Ns": 1, "Pr": 1, "Pm": 1, "d": 1, "Tr": 1}
MINOR_NUMBERS = {"Ka": 3, "illum": 1, "Pc": 1, "Pcr": 1, "Ps": 1, "aniso": 1}  # invalid values are ignored
OPTIONS = {"-blendu": 1, "-blendv": 1, "-boost": 1, "-mm": 2, "-o": 3, "-s": 3, "-t": 3, "-texres": 1, "-clamp": 1}
OPTIONS |= {"-bm": 1, "-imfchan": 1, "-type": 1, "-cc": 1}
NORMAL_MAP_KEYWORDS = ("norm", "map_Bump", "map_bump", "bump")
MAX_STRENGTH = 100.0
USED_MAPS = {"map_Kd", "map_Ks", "map_Ke", "map_d", "map_Pr", *NORMAL_MAP_KEYWORDS}
HARMLESS_MAPS = {"map_Ka", "map_aat"}  # ambient light, and antialiasing of textures


def read_library(data: bytes, folder: str = "") -> dict[str, MtlMaterial]:
    """Read the materials of a library by name.

    Args:
        folder: folder of the library, relative to the scene.
    Raises:
        SceneError: too large, too many materials, or a line is invalid.
    """
    if len(data) > MAX_LIBRARY_BYTES:
        raise SceneError(f"the material file is larger than {MAX_LIBRARY_BYTES >> 20} MB; export it again")
    materials: dict[str, MtlMaterial] = {}
    lines = data.decode("utf-8", "replace").splitlines()
    dialect = detect_dialect(lines)
    material = MtlMaterial(dialect=dialect)
    for line in lines:
        keyword, _, arguments = line.strip().partition(" ")
        if keyword == "newmtl":
            material = materials[arguments.strip()[:1_000]] = MtlMaterial(folder, dialect)
            if len(materials) > MAX_MATERIALS:
                raise SceneError(f"the material file has more than {MAX_MATERIALS:,} materials; remove some")
        elif keyword in NUMBERS:
            material.numbers[keyword] = _numbers(arguments.split(), NUMBERS[keyword], keyword)
        elif keyword in MINOR_NUMBERS:
            with suppress(SceneError):
                material.numbers[keyword] = _numbers(arguments.split(), MINOR_NUMBERS[keyword], keyword)
        elif keyword.startswith("map_") or keyword in ("bump", "norm", "disp", "refl"):
            material.maps[keyword] = _image_name(arguments.split())
            with suppress(SceneError, ValueError, IndexError):
                tokens = arguments.split()
                material.strengths[keyword] = _numbers(tokens[tokens.index("-bm") + 1 :], 1, "-bm")[0]
    return materials


def _numbers(tokens: list[str], count: int, keyword: str) -> list[float]:
    """Parse `count` numbers; a single number is used for all channels."""
    try:
        values = [float(token) for token in tokens[:count]]
    except ValueError:
        raise SceneError(f"{keyword} of the material file has values that are not numbers; export it again") from None
    if len(values) == 1:
        values *= count
    if len(values) != count or not np.isfinite(values).all() or not 0 <= min(values) <= max(values) <= 1e6:
        raise SceneError(f"{keyword} of the material file is out of range; export it again")
    return values


def _image_name(tokens: list[str]) -> str:
    """File name after the options; it may contain spaces."""
    while tokens and tokens[0] in OPTIONS:
        tokens = tokens[1 + OPTIONS[tokens[0]] :]
    return " ".join(tokens)[:1_000]


class MaterialMaker:
    """Converts materials of a library; each image is decoded once."""

    def __init__(self, companions: Companions, warnings: list[ImporterWarning]) -> None:
        self._companions = companions
        self._warnings = warnings
        self._decoder = Decoder()
        self._names: dict[str, int] = {}
        self._pixels: dict[str, U8 | None] = {}
        self._glosses: dict[str, Gloss] = {}

    def make(self, name: str, mtl_material: MtlMaterial | None) -> Material:
        """Make a material with a unique name; gray if the library lacks it. Raises SceneError."""
        material_name = unique_name(name or "material", self._names)
        label = f"material {quote(material_name)}"
        if mtl_material is None:
            return Material(material_name, gray_terms())
        textures = self._textures(mtl_material, label)
        self._warn_unsupported(mtl_material, label)
        normal_map = self._normal_map(mtl_material, label)
        opacity = self._opacity(mtl_material, label)
        roughness = self._roughness(mtl_material, textures, label)
        terms, gloss = make_mtl_terms(mtl_material, textures, roughness, has_normal_map=normal_map is not None)
        if gloss is not None:
            self._glosses[material_name] = gloss
        return Material(material_name, terms, textures, normal_map, opacity=opacity)

    def _roughness(self, mtl_material: MtlMaterial, textures: dict[str, Texture], label: str) -> float | None:
        """Roughness: Pr times the mean of map_Pr; None without both. A map that varies also becomes a texture."""
        factor = mtl_material.numbers.get("Pr", [None])[0]
        pixels = self._decode(mtl_material, "map_Pr", f"map_Pr of {label}")
        if pixels is None:
            return factor
        mean = float(pixels[..., 0].mean()) / 255
        if mean > 0 and np.ptp(pixels[..., 0]) > NOISE:
            encoding = TextureEncoding("share", (1 / mean, 1 / mean, 1 / mean))
            textures["roughness"] = Texture(np.ascontiguousarray(pixels[..., :1]), encoding=encoding)
        return (factor or 1.0) * mean  # exporters write zero if there is an image

    def _opacity(self, mtl_material: MtlMaterial, label: str) -> Opacity | None:
        """Opacity: d, or 1 − Tr, times map_d."""
        numbers = mtl_material.numbers
        alpha_factor = min(1.0, numbers["d"][0] if "d" in numbers else 1 - min(1.0, numbers.get("Tr", [0.0])[0]))
        if alpha_factor == 0 and "map_d" in mtl_material.maps:
            alpha_factor = 1.0  # exporters write zero if there is an image
        pixels = self._decode(mtl_material, "map_d", f"map_d of {label}")
        # a gray image, or the image of map_Kd with opacity in its alpha channel
        alpha = None if pixels is None else pixels[..., 3 if np.ptp(pixels[..., 3]) else 0]
        return make_opacity(alpha, ("repeat", "repeat"), alpha_factor, None, label, self._warnings)

    def emission(self, material: Material, mtl_material: MtlMaterial | None) -> Shaped[F64, " 3"]:
        """Ke, the emitted radiance; the caller multiplies it by the emission texture."""
        if mtl_material is None:
            return np.zeros(3)
        factor = np.array(mtl_material.numbers.get("Ke", [0.0, 0.0, 0.0]))
        # exporters write zero if there is an image
        return np.ones(3) if "emission" in material.textures and not factor.any() else factor

    def _textures(self, mtl_material: MtlMaterial, label: str) -> dict[str, Texture]:
        textures = {}
        for keyword, channel in (("map_Kd", "diffuse"), ("map_Ks", "specular"), ("map_Ke", "emission")):
            texture = self._image(mtl_material, keyword, f"{keyword} of {label}", TextureEncoding("srgb"))
            if texture is not None:
                textures[channel] = texture
        return textures

    def _image(self, mtl_material: MtlMaterial, keyword: str, label: str, encoding: TextureEncoding) -> Texture | None:
        pixels = self._decode(mtl_material, keyword, label)
        return None if pixels is None else Texture(np.ascontiguousarray(pixels[..., :3]), encoding=encoding)

    def _decode(self, mtl_material: MtlMaterial, keyword: str, label: str) -> U8 | None:
        """Decoded RGBA image. (height, width, 4)"""
        name = mtl_material.maps.get(keyword)
        if not name:
            return None
        path = posixpath.join(mtl_material.folder, name.replace("\\", "/"))
        if path not in self._pixels:
            data = self._companions.read(path, label)
            if data is None and mtl_material.folder and not name.startswith(".."):
                data = self._companions.read(name, label)  # some exporters write paths relative to the scene
            self._pixels[path] = None if data is None else self._decoder.decode(data, label)
        if self._pixels[path] is None:
            self._warnings.append(unsupported(f"Missing image “{_printable(name)}” ({label})."))
        return self._pixels[path]

    def _normal_map(self, mtl_material: MtlMaterial, label: str) -> Texture | None:
        """The normal map of `norm`, or of a bump map if its image is a normal map; warns about height maps."""
        for keyword in (keyword for keyword in NORMAL_MAP_KEYWORDS if mtl_material.maps.get(keyword)):
            map_label = f"the normal map of {label}" if keyword == "norm" else f"{keyword} of {label}"
            strength = min(mtl_material.strengths.get(keyword, 1.0), MAX_STRENGTH)
            try:
                texture = self._image(
                    mtl_material, keyword, map_label, TextureEncoding("normal", (strength, strength, 1.0))
                )
            except SceneError as error:
                if keyword == "norm":
                    raise
                self._warnings.append(unsupported(f"Skipped a normal map: {error}."))
                continue
            if texture is None or keyword == "norm" or is_normal_map(texture.pixels):
                return texture
            name = _printable(mtl_material.maps[keyword])
            message = f"“{name}” ({map_label}) is a height map, which isn't supported; use a normal map instead."
            self._warnings.append(unsupported(message))
        return None

    def _warn_unsupported(self, mtl_material: MtlMaterial, label: str) -> None:
        for keyword in sorted(mtl_material.maps.keys() - USED_MAPS):
            make_warning = ignored if keyword in HARMLESS_MAPS else unsupported
            name = _printable(mtl_material.maps[keyword])
            self._warnings.append(make_warning(f"Ignored “{name}” ({keyword[:40]} of {label}): not supported."))
        unused_keywords = [
            number_keyword
            for number_keyword in ("Ps", "aniso")
            if mtl_material.numbers.get(number_keyword, [0.0])[0] > 0
        ]
        self._warnings.extend(
            approximated(f"Ignored {number_keyword} of {label}: not supported.") for number_keyword in unused_keywords
        )

    def warn_gloss(self) -> None:
        """Warn once for all materials about each interpretation of Ks."""
        for gloss in Gloss:
            names = [name for name, material_gloss in self._glosses.items() if material_gloss is gloss]
            if names:
                suffix = f" and {len(names) - 1} more" if len(names) > 1 else ""
                self._warnings.append(approximated(f"Ks of material {quote(names[0])}{suffix} {gloss.value}"))


def is_normal_map(pixels: Shaped[U8, "height width channels"]) -> bool:
    """True if an image with 3 or 4 channels contains unit vectors about +z, unlike a height map."""
    step = 1 + max(pixels.shape[:2]) // 512  # a subset is enough
    vectors = pixels[::step, ::step, :3].reshape(-1, 3) / np.float32(127.5) - 1
    x, y, z = vectors.mean(axis=0)
    length = np.abs(np.linalg.norm(vectors, axis=1) - 1).mean()
    return bool(z > 0.5 and max(abs(x), abs(y)) < 0.25 and length < 0.15)


def _printable(name: str) -> str:
    """Return the last 60 characters of a file name, in ASCII; its end is more informative than its start."""
    return ("…" if len(name) > 60 else "") + name[-60:].encode("ascii", "replace").decode()
