"""Images that were sent for materials; `relume.asset_store` keeps them.

    <folder>/<id>/texels.npy       bytes of display values, or reflectances. (height, width, 3) uint8 or float16
                  thumbnail.png
                  image.json       name, and what had to be changed

Look documents name one as "image:<id>".
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from relume.brdf.channels import IMAGES
from relume.color import srgb_encode
from relume.imageio.files import png_bytes, to_bytes
from relume.images.reading import MAX_SIDE, read_image
from relume.remarks import Remark, remark_of
from relume.scene.model import Coding, Texture

THUMBNAIL_SIDE = 96
_TEXELS, _THUMBNAIL = "texels.npy", "thumbnail.png"


@dataclass(frozen=True)
class ImageRecord:
    """What lists show of an image.

    Attributes:
        created: seconds since 1970. size: width and height. warnings: what was changed, one sentence each.
    """

    id: str
    name: str
    created: float
    size: tuple[int, int]
    warnings: tuple[Remark, ...]

    @property
    def texture(self) -> str:
        """The name by which terms of looks mean this image."""
        return IMAGES.prefix + self.id


def keep(folder: Path, source: Path, name: str) -> ImageRecord:
    """Keep an image under the hash of its file; the same content twice is the same, its newest name wins.

    Args:
        folder: of the asset store. source: a .png, .jpg, .webp or .exr file. name: what people call it.
    Raises:
        SceneError: the file cannot be used, or the store is full.
    """
    texture, said = read_image(source, name)
    height, width = texture.pixels.shape[:2]

    def fill(made: Path) -> dict[str, Any]:
        np.save(made / _TEXELS, texture.pixels)
        (made / _THUMBNAIL).write_bytes(_thumbnail(texture))
        return {"size": [width, height], "warnings": [remark.document() for remark in said]}

    return get_record(folder, IMAGES.keep(folder, source, name, fill))


def records(folder: Path) -> list[ImageRecord]:
    """All images of a folder, newest first."""
    return IMAGES.records(folder, get_record)


def get_record(folder: Path, identity: str) -> ImageRecord:
    """One image. Raises NotFoundError; SceneError where its files are damaged."""
    path = IMAGES.path(folder, identity)
    document = IMAGES.read(path)
    size, warnings = document.get("size"), document.get("warnings")
    if not isinstance(warnings, list) or not isinstance(size, list) or [*map(type, size)] != [int, int]:
        raise IMAGES.damaged(path)
    said = tuple(map(remark_of, warnings))
    return ImageRecord(identity, document["name"], document["created"], (size[0], size[1]), said)


def thumbnail_path(folder: Path, identity: str) -> Path:
    """A small picture of one. Raises NotFoundError."""
    return IMAGES.path(folder, identity) / _THUMBNAIL


def texture_of(name: str) -> Texture:
    """What a term's `texture` names; its texels stay on the disk and are read where they are needed.

    Raises:
        NotFoundError: it is not here. SceneError: its files are damaged.
    """
    return _load(IMAGES.found(name))


@lru_cache(maxsize=16)
def _load(path: Path) -> Texture:
    texels = IMAGES.array(path, _TEXELS)
    is_image = texels.ndim == 3 and texels.shape[2] == 3 and min(texels.shape[:2]) >= 1
    if not is_image or max(texels.shape[:2]) > MAX_SIDE or texels.dtype not in (np.uint8, np.float16):
        raise IMAGES.damaged(path)
    return Texture(texels, coding=Coding("srgb") if texels.dtype == np.uint8 else None)


def _thumbnail(texture: Texture) -> bytes:
    """A square of what it shows, as a list has room for. PNG"""
    pixels = texture.pixels
    shown = pixels if texture.coding else to_bytes(srgb_encode(pixels.astype(np.float32)))
    size = THUMBNAIL_SIDE, THUMBNAIL_SIDE
    return png_bytes(np.asarray(Image.fromarray(shown).resize(size, Image.Resampling.BOX)))
