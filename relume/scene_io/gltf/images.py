"""Decoded images of a file, and the wrap modes of textures.

glTF 2.0 specification, sections 3.8 and 3.9.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.image_io.decode import Decoder
from relume.scene_io.gltf.accessors import view_bytes
from relume.scene_io.gltf.container import GltfContainer

U8 = NDArray[np.uint8]
_CACHE_BYTES = 300_000_000  # of decoded images, which other materials may use
WRAPS = {33_071: "clamp", 33_648: "mirror", 10_497: "repeat"}


class TextureSource(Protocol):
    """Textures by index, see `ImageReader.texture`."""

    def texture(self, index: int, label: str) -> tuple[Shaped[U8, "height width 4"], tuple[str, str]]: ...


class ImageReader:
    """Decodes the images of one file, with a cache."""

    def __init__(self, container: GltfContainer) -> None:
        self._container = container
        self._decoded: dict[int, U8] = {}
        self._decoder = Decoder()

    def texture(self, index: int, label: str) -> tuple[Shaped[U8, "height width 4"], tuple[str, str]]:
        """Return the RGBA bytes of a texture and its wrap modes along u and v.

        Raises:
            SceneError: the texture or its file is missing, too large, damaged or in an unsupported format.
        """
        document = self._container.document
        if index >= len(document.textures):
            raise SceneError(f"{label} refers to texture {index} of {len(document.textures)}; export the scene again")
        texture = document.textures[index]
        source = texture.source
        webp = texture.extensions.get("EXT_texture_webp")
        if isinstance(webp, dict) and isinstance(webp.get("source"), int):
            source = webp["source"]
        if source is None:
            raise SceneError(f"{label} has an image relume cannot read; use PNG, JPEG or WebP (gltf-transform png)")
        return self._image(source, label), self._wrap(texture.sampler, label)

    def _wrap(self, index: int | None, label: str) -> tuple[str, str]:
        if index is None:
            return "repeat", "repeat"
        samplers = self._container.document.samplers
        if index >= len(samplers):
            raise SceneError(f"{label} refers to sampler {index} of {len(samplers)}; export the scene again")
        sampler = samplers[index]
        return WRAPS.get(sampler.wrapS, "repeat"), WRAPS.get(sampler.wrapT, "repeat")

    def _image(self, index: int, label: str) -> U8:
        images = self._container.document.images
        if not 0 <= index < len(images):
            raise SceneError(f"{label} refers to image {index} of {len(images)}; export the scene again")
        if index in self._decoded:
            self._decoded[index] = self._decoded.pop(index)  # most recently used last
        else:
            image = images[index]
            if image.bufferView is not None:
                data = bytes(view_bytes(self._container, image.bufferView, label))
            elif image.uri is not None:
                data = self._container.resolve(image.uri, label)
            else:
                raise SceneError(f"{label} has no data; export the scene again")
            self._decoded[index] = self._decoder.decode(data, label)
            while len(self._decoded) > 1 and sum(pixels.nbytes for pixels in self._decoded.values()) > _CACHE_BYTES:
                del self._decoded[next(iter(self._decoded))]
        return self._decoded[index]
