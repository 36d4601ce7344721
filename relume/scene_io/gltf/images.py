"""Decoded images of a file, and the wrap modes of textures.

glTF 2.0 specification, sections 3.8 and 3.9.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, unsupported
from relume.image_io.decode import Decoder
from relume.scene_io.gltf.accessors import view_bytes
from relume.scene_io.gltf.container import GltfContainer

U8 = NDArray[np.uint8]
_CACHE_BYTES = 300_000_000  # of decoded images, which other materials may use
UNREADABLE_FORMATS = {"KHR_texture_basisu": "KTX2", "EXT_texture_avif": "AVIF", "MSFT_texture_dds": "DDS"}
UNPACK_KTX = " (npx @gltf-transform/cli ktxdecompress in.glb out.glb)"
WRAPS = {33_071: "clamp", 33_648: "mirror", 10_497: "repeat"}


class ImageReader:
    """Decodes the images of one file, with a cache."""

    def __init__(self, container: GltfContainer, warnings: list[ImporterWarning]) -> None:
        self._container = container
        self._warnings = warnings
        self._decoded: dict[int, U8] = {}
        self._unusable: set[int] = set()  # textures
        self._decoder = Decoder(applies_orientation=False)  # texture coordinates are of the pixels as stored

    def is_usable(self, index: int, label: str) -> bool:
        """True if a texture can be read; else a warning says why, once a texture."""
        if index in self._unusable:
            return False
        try:
            self.pixels(str(index), label)
            self.wrap(index, label)
        except SceneError as problem:
            self._warnings.append(unsupported(f"An image was left out: {problem}."))
            self._unusable.add(index)
            return False
        return True

    def pixels(self, file: str, label: str) -> Shaped[U8, "height width 4"]:
        """Return the RGBA bytes of a texture.

        Args:
            file: index of the texture. label: names it in messages.
        Raises:
            SceneError: the texture or its file is missing, too large, damaged or in an unsupported format.
        """
        texture = self._container.document.textures.get(int(file), label)
        webp = texture.extensions.get("EXT_texture_webp")
        sources = [webp.get("source") if isinstance(webp, dict) else None, texture.source]
        usable = [source for source in sources if isinstance(source, int)]
        if not usable:
            formats = [name for key, name in UNREADABLE_FORMATS.items() if key in texture.extensions]
            reason = f"is in the format {formats[0]}" if formats else "has no image"
            raise SceneError(f"{label} {reason}; save it as PNG, JPEG or WebP{UNPACK_KTX if 'KTX2' in formats else ''}")
        return self._image(usable[0], label)

    def wrap(self, index: int, label: str) -> tuple[str, str]:
        """Wrap modes of a texture along u and v. Raises SceneError if its sampler is invalid.

        Args:
            index: of the texture. label: names it in messages.
        """
        sampler_index = self._container.document.textures.get(index, label).sampler
        if sampler_index is None:
            return "repeat", "repeat"
        sampler = self._container.document.samplers.get(sampler_index, label)
        return WRAPS.get(sampler.wrapS, "repeat"), WRAPS.get(sampler.wrapT, "repeat")

    def _image(self, index: int, label: str) -> U8:
        if index in self._decoded:
            self._decoded[index] = self._decoded.pop(index)  # most recently used last
        else:
            image = self._container.document.images.get(index, label)
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
