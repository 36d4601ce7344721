"""Images in linear values; nothing is decoded before its header has said that it is small enough.

glTF 2.0 specification, sections 3.8 and 3.9.
"""

from __future__ import annotations

import io

import numpy as np
import PIL.Image
from numpy.typing import NDArray

from relume.errors import SceneError
from relume.scene.gltf.accessors import view_bytes
from relume.scene.gltf.container import Container

U8 = NDArray[np.uint8]
MAX_SIDE = 8_192
MAX_TEXELS = 1_000_000_000  # of all images of a scene together, as often as they are decoded
_KEPT_BYTES = 300_000_000  # of decoded images, for the next material that names them
MAX_JPEG_SCANS = 200  # each scan of a progressive JPEG costs a pass over all texels
FORMATS = ("PNG", "JPEG", "WEBP")
WRAPS = {33_071: "clamp", 33_648: "mirror", 10_497: "repeat"}


class Decoder:
    """Decodes images within one budget for all of them."""

    def __init__(self) -> None:
        self._texels_left = MAX_TEXELS

    def decode(self, data: bytes, what: str) -> U8:
        """The texels as bytes, RGBA. (height, width, 4)

        Raises:
            SceneError: the image is too large, damaged, or of another format than PNG, JPEG and WebP.
        """
        if data.startswith(b"\xff\xd8") and data.count(b"\xff\xda") > MAX_JPEG_SCANS:
            raise SceneError(f"{what} is a JPEG of more than {MAX_JPEG_SCANS} scans; save it again")
        try:
            with PIL.Image.open(io.BytesIO(data), formats=FORMATS) as image:
                self._check_size(*image.size, what)
                return _rgba(image)
        except SceneError:
            raise
        except (PIL.Image.DecompressionBombError, PIL.Image.DecompressionBombWarning):
            raise SceneError(f"{what} is too large; at most {MAX_SIDE}×{MAX_SIDE} is read, scale it down") from None
        except Exception:  # decoders raise many kinds for damaged data (OSError, SyntaxError, struct.error …)
            raise SceneError(f"{what} is damaged or neither PNG, JPEG nor WebP; export the scene again") from None

    def _check_size(self, width: int, height: int, what: str) -> None:
        if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
            raise SceneError(f"{what} is {width}×{height}; at most {MAX_SIDE}×{MAX_SIDE} is read, scale it down")
        self._texels_left -= width * height
        if self._texels_left < 0:
            raise SceneError(f"the scene's images have more than {MAX_TEXELS:,} texels together; scale them down")


class ImageReader:
    """Decodes the images of one file, and keeps the last of them."""

    def __init__(self, container: Container) -> None:
        self._container = container
        self._decoded: dict[int, U8] = {}
        self._decoder = Decoder()

    def texture(self, index: int, what: str) -> tuple[U8, tuple[str, str]]:
        """The bytes (height, width, 4), RGBA, of a texture and how it wraps along u and v.

        Raises:
            SceneError: the texture does not exist, lies outside the file, is too large, damaged or of another format.
        """
        document = self._container.document
        if index >= len(document.textures):
            raise SceneError(f"{what} refers to texture {index} of {len(document.textures)}; export the scene again")
        texture = document.textures[index]
        source = texture.source
        webp = texture.extensions.get("EXT_texture_webp")
        if isinstance(webp, dict) and isinstance(webp.get("source"), int):
            source = webp["source"]
        if source is None:
            raise SceneError(f"{what} has an image relume cannot read; use PNG, JPEG or WebP (gltf-transform png)")
        return self._image(source, what), self._wrap(texture.sampler, what)

    def _wrap(self, sampler: int | None, what: str) -> tuple[str, str]:
        if sampler is None:
            return "repeat", "repeat"
        samplers = self._container.document.samplers
        if sampler >= len(samplers):
            raise SceneError(f"{what} refers to sampler {sampler} of {len(samplers)}; export the scene again")
        chosen = samplers[sampler]
        return WRAPS.get(chosen.wrapS, "repeat"), WRAPS.get(chosen.wrapT, "repeat")

    def _image(self, index: int, what: str) -> U8:
        images = self._container.document.images
        if not 0 <= index < len(images):
            raise SceneError(f"{what} refers to image {index} of {len(images)}; export the scene again")
        if index in self._decoded:
            self._decoded[index] = self._decoded.pop(index)  # the newest comes last
        else:
            image = images[index]
            if image.bufferView is not None:
                data = bytes(view_bytes(self._container, image.bufferView, what))
            elif image.uri is not None:
                data = self._container.resolve(image.uri, what)
            else:
                raise SceneError(f"{what} has no data; export the scene again")
            self._decoded[index] = self._decoder.decode(data, what)
            while len(self._decoded) > 1 and sum(kept.nbytes for kept in self._decoded.values()) > _KEPT_BYTES:
                del self._decoded[next(iter(self._decoded))]
        return self._decoded[index]


def _rgba(image: PIL.Image.Image) -> U8:
    """8-bit RGBA, colours not multiplied by alpha; 16-bit grey is scaled."""
    if image.mode.startswith("I"):
        grey = np.clip(np.asarray(image, np.int64) // 257, 0, 255).astype(np.uint8)
        return np.stack([grey, grey, grey, np.full_like(grey, 255)], axis=-1)
    return np.asarray(image.convert("RGBA"), np.uint8)
