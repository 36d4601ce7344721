"""Materials of OBJ, PLY and STL files, with their images; an image that cannot be used is left out."""

from __future__ import annotations

import posixpath
from dataclasses import replace

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import luminance
from relume.core.errors import SceneError
from relume.core.import_warnings import UNREADABLE, ImporterWarning, approximated, ignored, quote, unsupported
from relume.image_io.decode import U8, Decoder
from relume.math.uv_transform import UvTransform
from relume.scene.model import Material, Opacity, Texture, TextureEncoding
from relume.scene.opacity import make_opacity
from relume.scene.unique_names import unique_name
from relume.scene_io.obj_ply.mtl import NORMAL_MAP_KEYWORDS, USED_MAPS
from relume.scene_io.obj_ply.mtl_dialects import (
    Gloss,
    MtlMap,
    MtlMaterial,
    gray_terms,
    make_glass,
    make_glass_terms,
    make_mtl_terms,
)
from relume.scene_io.referenced_files import Companions
from relume.scene_io.surfaces.texture_resampling import NOISE
from relume.scene_io.surfaces.uv_transforms import UvSlot, UvTransforms

F64 = NDArray[np.float64]
MAX_STRENGTH = 100.0
HARMLESS_MAPS = {"map_Ka", "map_aat"}  # ambient light, and antialiasing of textures
TEXTURES = (("map_Kd", "diffuse"), ("map_Ks", "specular"), ("map_Ke", "emission"))


class MaterialMaker:
    """Converts materials of a library; each image is decoded once."""

    def __init__(self, companions: Companions, warnings: list[ImporterWarning]) -> None:
        self._companions = companions
        self._warnings = warnings
        self._decoder = Decoder()
        self._names: dict[str, int] = {}
        self._pixels: dict[str, U8 | None] = {}
        self._glosses: dict[str, Gloss] = {}

    def make(self, name: str, mtl_material: MtlMaterial | None) -> tuple[Material, UvSlot]:
        """Make a material with a unique name, gray if it is None; also return the UV coordinates of its images."""
        material_name = unique_name(name or "material", self._names)
        label = f"material {quote(material_name)}"
        if mtl_material is None:
            return Material(material_name, gray_terms()), UvSlot()
        images = _Images(self, mtl_material, label)
        textures = {
            channel: Texture(np.ascontiguousarray(pixels[..., :3]), images.wrap(keyword), TextureEncoding("srgb"))
            for keyword, channel in TEXTURES
            if (pixels := images.get(keyword)) is not None
        }
        self._warn_unsupported(mtl_material, label)
        mtl_material = _without_black(mtl_material, textures)
        normal_map = self._normal_map(images, label)
        opacity = self._opacity(images, label)
        roughness = self._roughness(images, textures)
        if opacity is None and (glass := make_glass(mtl_material, roughness)) is not None:
            model = mtl_material.numbers["illum"][0]
            self._warnings.append(approximated(f"Illumination model {model:g} of {label} was read as solid glass."))
            terms = make_glass_terms(mtl_material, glass, textures)
            return Material(material_name, terms, textures, normal_map, glass=glass), images.slot
        terms, gloss = make_mtl_terms(mtl_material, textures, roughness, has_normal_map=normal_map is not None)
        if gloss is not None:
            self._glosses[material_name] = gloss
        return Material(material_name, terms, textures, normal_map, opacity=opacity), images.slot

    def decode(self, folder: str, name: str, label: str) -> U8 | None:
        """Decoded RGBA image, or None, with a warning. (height, width, 4)

        Args:
            folder: of the file that names it. name: as written there. label: names the image in warnings.
        """
        path = posixpath.join(folder, name)
        if path not in self._pixels:
            self._pixels[path] = None
            data = read_companion(self._companions, folder, name, label, self._warnings)
            try:
                self._pixels[path] = None if data is None else self._decoder.decode(data, label)
            except SceneError as error:
                self._warnings.append(unsupported(f"Skipped “{printable(name)}”: {error}."))
        return self._pixels[path]

    def _roughness(self, images: _Images, textures: dict[str, Texture]) -> float | None:
        """Roughness: Pr times the mean of map_Pr; None without both. A map that varies also becomes a texture."""
        factor = images.mtl_material.numbers.get("Pr", [None])[0]
        values = images.scalars("map_Pr")
        if values is None:
            return factor
        mean = float(values.mean()) / 255
        if mean > 0 and np.ptp(values) > NOISE:
            encoding = TextureEncoding("share", (1 / mean, 1 / mean, 1 / mean))
            textures["roughness"] = Texture(values[..., None], images.wrap("map_Pr"), encoding)
        return (factor or 1.0) * mean  # exporters write zero if there is an image

    def _opacity(self, images: _Images, label: str) -> Opacity | None:
        """Opacity: d, or 1 − Tr, times map_d."""
        numbers = images.mtl_material.numbers
        alpha_factor = min(1.0, numbers["d"][0] if "d" in numbers else 1 - min(1.0, numbers.get("Tr", [0.0])[0]))
        alpha = images.scalars("map_d")
        if alpha_factor == 0 and alpha is not None:
            alpha_factor = 1.0  # exporters write zero if there is an image
        return make_opacity(alpha, images.wrap("map_d"), alpha_factor, None, label, self._warnings)

    def _normal_map(self, images: _Images, label: str) -> Texture | None:
        """The normal map of `norm`, or of a bump map if its image is a normal map; warns about height maps."""
        for keyword in NORMAL_MAP_KEYWORDS:
            pixels = images.get(keyword)
            if pixels is None:
                continue
            mtl_map = images.mtl_material.maps[keyword]
            if keyword == "norm" or is_normal_map(pixels):
                strength = float(np.clip(mtl_map.strength, 0, MAX_STRENGTH))
                encoding = TextureEncoding("normal", (strength, strength, 1.0))
                return Texture(np.ascontiguousarray(pixels[..., :3]), images.wrap(keyword), encoding)
            name = printable(mtl_map.name)
            message = (
                f"“{name}” ({keyword} of {label}) is a height map, which isn't supported; use a normal map instead."
            )
            self._warnings.append(unsupported(message))
        return None

    def _warn_unsupported(self, mtl_material: MtlMaterial, label: str) -> None:
        for keyword in sorted(mtl_material.maps.keys() - set(USED_MAPS)):
            make_warning = ignored if keyword in HARMLESS_MAPS else unsupported
            name = printable(mtl_material.maps[keyword].name)
            self._warnings.append(make_warning(f"Ignored “{name}” ({keyword[:40]} of {label}): not supported."))
        options = {
            f"{option} of {keyword}"
            for keyword in USED_MAPS
            for option in mtl_material.maps.get(keyword, MtlMap("")).ignored_options
        }
        if options:
            message = f"Ignored options of images of {label}: {', '.join(sorted(options))}; they look different."
            self._warnings.append(unsupported(message))
        self._warnings.extend(
            approximated(f"Ignored {keyword} of {label}: not supported.")
            for keyword in ("Ps", "aniso")
            if mtl_material.numbers.get(keyword, [0.0])[0] > 0
        )

    def warn_gloss(self) -> None:
        """Warn once for all materials about each interpretation of Ks."""
        for gloss in Gloss:
            names = [name for name, material_gloss in self._glosses.items() if material_gloss is gloss]
            if names:
                suffix = f" and {len(names) - 1} more" if len(names) > 1 else ""
                self._warnings.append(approximated(f"Ks of material {quote(names[0])}{suffix} {gloss.value}"))


class _Images:
    """The images of one material, in common UV coordinates."""

    def __init__(self, maker: MaterialMaker, mtl_material: MtlMaterial, label: str) -> None:
        self.mtl_material = mtl_material
        named = {keyword: mtl_map for keyword in USED_MAPS if (mtl_map := mtl_material.maps.get(keyword)) is not None}
        decoded = {
            keyword: maker.decode(mtl_material.folder, mtl_map.name, f"{keyword} of {label}")
            for keyword, mtl_map in named.items()
            if mtl_map.name
        }
        self._pixels = {keyword: pixels for keyword, pixels in decoded.items() if pixels is not None}
        self._slots = {keyword: uv_slot(named[keyword]) for keyword in self._pixels}
        self._transforms = UvTransforms([*self._slots.values()], label, maker._warnings)
        self.slot = self._transforms.slot

    def wrap(self, keyword: str) -> tuple[str, str]:
        """Wrap mode of an image."""
        mtl_map = self.mtl_material.maps.get(keyword)
        return ("clamp", "clamp") if mtl_map is not None and mtl_map.clamp else ("repeat", "repeat")

    def get(self, keyword: str) -> U8 | None:
        """RGBA pixels for the common UV coordinates. (height, width, 4)"""
        if keyword not in self._pixels:
            return None
        return self._transforms.tile_image(self._slots[keyword], self._pixels[keyword], self.wrap(keyword))

    def scalars(self, keyword: str) -> Shaped[U8, "height width"] | None:
        """One channel of an image: that of -imfchan, for opacity an alpha channel that varies, otherwise red."""
        pixels = self.get(keyword)
        if pixels is None:
            return None
        channel = self.mtl_material.maps[keyword].channel
        if channel == "l":
            return np.asarray(np.round(luminance(pixels[..., :3].astype(np.float64))), np.uint8)
        if not channel:  # a gray image, or the image of map_Kd with opacity in its alpha channel
            channel = "m" if keyword == "map_d" and np.ptp(pixels[..., 3]) else "r"
        return np.ascontiguousarray(pixels[..., "rgbm".index(channel)])


def _without_black(mtl_material: MtlMaterial, textures: dict[str, Texture]) -> MtlMaterial:
    """The material without a black Kd if its image could not be read: exporters write zero if there is an image."""
    numbers = mtl_material.numbers
    if "map_Kd" not in mtl_material.maps or "diffuse" in textures or any(numbers.get("Kd", [1.0])):
        return mtl_material
    return replace(mtl_material, numbers={keyword: values for keyword, values in numbers.items() if keyword != "Kd"})


def uv_slot(mtl_map: MtlMap) -> UvSlot:
    """The options of an image for v from the top: v′ = s v + (1 − s − o)."""
    (u_scale, v_scale), (u_offset, v_offset) = mtl_map.scale, mtl_map.offset
    return UvSlot(transform=UvTransform((u_offset, 1 - v_scale - v_offset), scale=(u_scale, v_scale)))


def read_companion(
    companions: Companions, folder: str, name: str, label: str, warnings: list[ImporterWarning], kind: str = "image"
) -> bytes | None:
    """Read a file that another one names; None with a warning if there is none.

    It is relative to the file that names it, or to the scene. Of paths on other computers, the last part is tried.

    Args:
        companions: further files. folder: of the file that names it, relative to the scene. name: as written there.
        label: names the file in warnings. kind: "image" or "material file".
        warnings: gets a sentence if the file is missing, or found by the last part of its name.
    """
    plain = name.replace("\\", "/")
    last = posixpath.basename(plain)
    problem: SceneError | None = None
    for path in dict.fromkeys((posixpath.join(folder, plain), plain, posixpath.join(folder, last), last)):
        try:
            data = companions.read(path, label)
        except SceneError as error:
            problem = problem or error
            continue
        if data is not None:
            if path not in (posixpath.join(folder, plain), plain):
                message = f"“{printable(name)}” ({label}) was read from “{printable(last)}” next to the scene."
                warnings.append(approximated(message))
            return data
    missing = f"Missing {kind} “{printable(name)}”{f' ({label})' if kind == 'image' else ''}"
    reason = f"Skipped “{printable(name)}”: {problem}" if problem else f"{missing}: import it together with the scene"
    warnings.append(unsupported(f"{reason}."))
    return None


def is_normal_map(pixels: Shaped[U8, "height width channels"]) -> bool:
    """True if an image with 3 or 4 channels contains unit vectors about +z, unlike a height map."""
    step = 1 + max(pixels.shape[:2]) // 512  # a subset is enough
    vectors = pixels[::step, ::step, :3].reshape(-1, 3) / np.float32(127.5) - 1
    x, y, z = vectors.mean(axis=0)
    length = np.abs(np.linalg.norm(vectors, axis=1) - 1).mean()
    return bool(z > 0.5 and max(abs(x), abs(y)) < 0.25 and length < 0.15)


def printable(name: str) -> str:
    """Return the last 60 readable characters of a file name; its end is more informative than its start."""
    return ("…" if len(name) > 60 else "") + UNREADABLE.sub("", name[-60:])


def emission_factor(material: Material, mtl_material: MtlMaterial | None) -> Shaped[F64, " 3"]:
    """Ke, the emitted radiance; the caller multiplies it by the emission texture."""
    factor = np.array((mtl_material or MtlMaterial()).numbers.get("Ke", [0.0, 0.0, 0.0]))
    # exporters write zero if there is an image
    return np.ones(3) if "emission" in material.textures and not factor.any() else factor


def textured(material: Material, texture: Texture) -> Material:
    """The material, whose first term shows a texture."""
    terms = ({**material.terms[0], "texture": "diffuse"}, *material.terms[1:])
    return replace(material, terms=terms, textures={**material.textures, "diffuse": texture})
