"""Store of images that users uploaded for materials, in `relume.assets.asset_store`.

As a roughness map, an image's green channel is the roughness, as in glTF: linear, without the sRGB curve. As a normal
map, its RGB are x, y and z in [−1, 1].

    <folder>/<id>/texels.npy       sRGB bytes, or reflectances. (height, width, 3) uint8 or float16
                  thumbnail.png
                  image.json       name and warnings; for images from `relume.images.metalness` also their recipe, scale
                                   and wrap modes

Looks refer to one as "image:<id>".
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from relume.brdf.texture_slots import IMAGES, EmissionImage, NormalMap, is_user_image
from relume.core.cache import asset_cached
from relume.core.color import srgb_encode
from relume.core.import_warnings import ImporterWarning, warning_of
from relume.image_io.write_image import png_bytes, to_bytes
from relume.images.own_textures import is_own_texture, load_own_texture
from relume.images.read_image import MAX_SIDE, read_image
from relume.scene.model import WRAPS, Texture, TextureEncoding

THUMBNAIL_SIDE = 96
_TEXELS, _THUMBNAIL = "texels.npy", "thumbnail.png"
_MIN_MEAN_ROUGHNESS = 1 / 255  # divisor for black images
_MIN_MEAN_EMISSION = 1e-6  # of a channel; below, it emits nothing


class ImageRecipe(NamedTuple):
    """The inputs of a derived image, see `relume.images.metalness`.

    Attributes:
        channel: texture channel that it replaces.
        metalness: the metalness image. base: the base color image; or "diffuse" or "scene" for the scene's own
            textures; None for a uniform color.
        scene, material: origin of these textures, or empty.
        factor: factor of the base color. dielectric: reflectance at normal incidence. Three numbers each.
    """

    channel: str
    metalness: str
    base: str | None
    scene: str
    material: str
    factor: tuple[float, float, float]
    dielectric: tuple[float, float, float]

    @property
    def images(self) -> tuple[str, ...]:
        """Uploaded images among the inputs."""
        return tuple(name for name in (self.metalness, self.base) if is_user_image(name))


@dataclass(frozen=True)
class ImageRecord:
    """An image in lists.

    Attributes:
        created: seconds since 1970. size: width and height. warnings: warnings about the import, one sentence each.
        roughness: mean roughness, if used as a roughness map.
        recipe: inputs of a derived image; None for an uploaded one.
    """

    id: str
    name: str
    created: float
    size: tuple[int, int]
    warnings: tuple[ImporterWarning, ...]
    roughness: float
    recipe: ImageRecipe | None = None

    @property
    def texture(self) -> str:
        """Name of the image in terms of looks."""
        return IMAGES.prefix + self.id


def store(folder: Path, source: Path, name: str) -> ImageRecord:
    """Import an image file; an existing one with this content gets the new name.

    Args:
        folder: folder of the asset store. source: a .png, .jpg, .webp or .exr file. name: shown to users.
    Raises:
        SceneError: the file is unusable, or the store is full.
    """
    texture, warnings = read_image(source, name)

    def fill(staged_folder: Path) -> dict[str, Any]:
        return _write(staged_folder, texture) | {"warnings": [warning.document() for warning in warnings]}

    return get_record(folder, IMAGES.store(folder, source, name, fill))


def store_derived(folder: Path, name: str, recipe: ImageRecipe, compute: Callable[[], Texture]) -> ImageRecord:
    """Store a derived image under the hash of its recipe; an existing one is not computed again.

    Args:
        folder: folder of the asset store. name: shown to users. recipe: its inputs.
        compute: returns its texels, as bytes.
    Raises:
        SceneError: the store is full. Errors of `compute` propagate.
    """

    def fill(staged_folder: Path) -> dict[str, Any]:
        texture = compute()
        scale = (texture.encoding or TextureEncoding("srgb")).scale
        return _write(staged_folder, texture) | {
            "warnings": [],
            "made_of": recipe._asdict(),
            "scale": scale,
            "wrap": texture.wrap,
        }

    with tempfile.TemporaryDirectory() as unfinished:
        source = Path(unfinished) / "made_of.json"
        source.write_text(json.dumps(recipe._asdict(), sort_keys=True))
        return get_record(folder, IMAGES.store(folder, source, name, fill))


def store_texture(folder: Path, name: str, texture: Texture) -> ImageRecord:
    """Store a texture of an imported material under the hash of its texels.

    Args:
        folder: folder of the asset store. name: shown to users. texture: bytes with three channels.
    Raises:
        SceneError: the store is full.
    """
    encoding = texture.encoding or TextureEncoding("srgb")
    scale = encoding.scale if encoding.kind == "srgb" else (1.0, 1.0, 1.0)  # of other kinds it is in the look

    def fill(staged_folder: Path) -> dict[str, Any]:
        return _write(staged_folder, texture) | {"warnings": [], "scale": scale, "wrap": texture.wrap}

    with tempfile.TemporaryDirectory() as unfinished:
        source = Path(unfinished) / "texels"
        header = json.dumps([texture.pixels.shape, scale, texture.wrap]).encode()
        source.write_bytes(header + np.ascontiguousarray(texture.pixels).tobytes())
        return get_record(folder, IMAGES.store(folder, source, name, fill))


def _write(folder: Path, texture: Texture) -> dict[str, Any]:
    """Write an image's files; return their fields of the record."""
    height, width = texture.pixels.shape[:2]
    np.save(folder / _TEXELS, texture.pixels)
    (folder / _THUMBNAIL).write_bytes(_thumbnail(texture))
    return {"size": [width, height], "roughness": _mean_fraction(_roughness_bytes(texture))}


def records(folder: Path) -> list[ImageRecord]:
    """Return all images of a folder, newest first."""
    return IMAGES.records(folder, get_record)


def get_record(folder: Path, identity: str) -> ImageRecord:
    """Return one image. Raises NotFoundError; SceneError if its files are damaged."""
    path = IMAGES.path(folder, identity)
    document = IMAGES.load_record(path)
    size, warnings = document.get("size"), document.get("warnings")
    if not isinstance(warnings, list) or not isinstance(size, list) or [*map(type, size)] != [int, int]:
        raise IMAGES.damaged_error(path)
    parsed_warnings, roughness = tuple(map(warning_of, warnings)), document.get("roughness")
    if not isinstance(roughness, float):  # records of older versions lack it
        roughness = mean_roughness(IMAGES.prefix + identity)
    recipe = _parse_recipe(document, path)
    return ImageRecord(
        identity, document["name"], document["created"], (size[0], size[1]), parsed_warnings, roughness, recipe
    )


def get_recipe(name: str) -> ImageRecipe | None:
    """Return the recipe of a look's image; None for an uploaded one. Raises what `load_texture` raises."""
    path = IMAGES.resolve(name)
    return _parse_recipe(IMAGES.load_record(path), path)


def _parse_recipe(document: dict[str, Any], path: Path) -> ImageRecipe | None:
    """Parse the recipe that `store_derived` wrote; raises the error for a damaged asset if a field is missing."""
    fields = document.get("made_of")
    try:
        if fields is None:
            return None
        recipe = ImageRecipe(**fields)
        (red, green, blue), (r, g, b) = recipe.factor, recipe.dielectric
        return recipe._replace(factor=(red, green, blue), dielectric=(r, g, b))
    except (TypeError, ValueError) as error:
        raise IMAGES.damaged_error(path) from error


def thumbnail_path(folder: Path, identity: str) -> Path:
    """Return the path of its thumbnail. Raises NotFoundError."""
    return IMAGES.path(folder, identity) / _THUMBNAIL


def load_texture(name: str) -> Texture:
    """Load the image of a term's `texture`; its texels are memory-mapped.

    Raises:
        NotFoundError: it does not exist. SceneError: its files are damaged.
    """
    return load_own_texture(name) if is_own_texture(name) else _load(IMAGES.resolve(name))


def load_roughness_map(name: str) -> Texture:
    """Load the image of a term's `roughness_map`: roughness over its mean. Raises what `load_texture` raises."""
    return load_own_texture(name) if is_own_texture(name) else _load_roughness(IMAGES.resolve(name))


def load_normal_map(map_: NormalMap) -> Texture:
    """Load the image of a material's `normal_map`: tangent-space normals. Raises what `load_texture` raises."""
    if is_own_texture(map_.image):
        return load_own_texture(map_.image)
    return _load_normals(IMAGES.resolve(map_.image), map_.scale)


def load_emission_image(emission: EmissionImage) -> Texture:
    """Load an image that surfaces emit, divided by its mean. Raises what `load_texture` raises."""
    return _load_emission(IMAGES.resolve(emission.image), emission.mean)


def load_gobo(name: str) -> Texture:
    """Load the image of a spot's `gobo`; its edges do not repeat. Raises what `load_texture` raises."""
    return _load_gobo(IMAGES.resolve(name))


def mean_roughness(name: str) -> float:
    """Mean of a roughness map. Raises what `load_texture` raises."""
    return _load_mean(IMAGES.resolve(name))


@asset_cached("normal map image")
def _load_normals(path: Path, scale: float) -> Texture:
    texture = _load(path)
    return Texture(_raw_bytes(texture), texture.wrap, TextureEncoding("normal", (scale, scale, 1.0)))


@asset_cached("emission image")
def _load_emission(path: Path, mean: tuple[float, float, float]) -> Texture:
    texture, inverse_mean = _load(path), 1 / np.maximum(mean, _MIN_MEAN_EMISSION)
    if texture.encoding is None:
        return Texture((texture.pixels * inverse_mean).astype(np.float32), texture.wrap)
    red, green, blue = (inverse_mean * texture.encoding.scale).tolist()
    return Texture(texture.pixels, texture.wrap, TextureEncoding("srgb", (red, green, blue)))


@asset_cached("gobo image")
def _load_gobo(path: Path) -> Texture:
    return replace(_load(path), wrap=("clamp", "clamp"))


@asset_cached("roughness map image")
def _load_roughness(path: Path) -> Texture:
    inverse_mean = 1 / max(_load_mean(path), _MIN_MEAN_ROUGHNESS)
    return Texture(
        _roughness_bytes(_load(path)), encoding=TextureEncoding("share", (inverse_mean, inverse_mean, inverse_mean))
    )


@lru_cache(maxsize=1_000)
def _load_mean(path: Path) -> float:
    return _mean_fraction(_roughness_bytes(_load(path)))


def _roughness_bytes(texture: Texture) -> NDArray[np.uint8]:
    """Roughness as bytes. (height, width, 1)"""
    return np.ascontiguousarray(_raw_bytes(texture, slice(1, 2)))


def _raw_bytes(texture: Texture, channels: slice = slice(None)) -> NDArray[np.uint8]:
    """Bytes of the file without the sRGB curve. (height, width, channels)"""
    values = texture.pixels[..., channels]
    return values if texture.encoding else np.rint(255 * values.astype(np.float32)).astype(np.uint8)


def _mean_fraction(roughness_bytes: NDArray[np.uint8]) -> float:
    return float(roughness_bytes.mean() / 255)


@asset_cached("image file")
def _load(path: Path) -> Texture:
    texels = IMAGES.open_array(path, _TEXELS)
    is_image = texels.ndim == 3 and texels.shape[2] == 3 and min(texels.shape[:2]) >= 1
    if not is_image or max(texels.shape[:2]) > MAX_SIDE or texels.dtype not in (np.uint8, np.float16):
        raise IMAGES.damaged_error(path)
    if texels.dtype == np.float16:
        return Texture(texels)
    document = IMAGES.load_record(path)
    scale, wrap = document.get("scale", [1.0, 1.0, 1.0]), document.get("wrap", ["repeat", "repeat"])
    if [*map(type, scale)] != 3 * [float] or len(wrap) != 2 or not set(wrap) <= set(WRAPS):
        raise IMAGES.damaged_error(path)
    return Texture(texels, (wrap[0], wrap[1]), TextureEncoding("srgb", (scale[0], scale[1], scale[2])))


def _thumbnail(texture: Texture) -> bytes:
    """Thumbnail for lists, a square PNG."""
    pixels = texture.pixels
    display = pixels if texture.encoding else to_bytes(srgb_encode(pixels.astype(np.float32)))
    size = THUMBNAIL_SIDE, THUMBNAIL_SIDE
    return png_bytes(np.asarray(Image.fromarray(display).resize(size, Image.Resampling.BOX)))
