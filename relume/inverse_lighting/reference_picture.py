"""Reference pictures as targets: decoded, resized, without what the display clipped."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from PIL import Image

from relume.core.color import luminance
from relume.core.errors import SceneError
from relume.image_io.contrast import apply_contrast
from relume.image_io.decode import MAX_SIDE, Decoder
from relume.image_io.inverse_tone_mapping import inverse_tone_map
from relume.image_io.read_linear import EXR_MAGIC, read_pixels
from relume.image_io.white_balance import balance_matrix
from relume.inverse_lighting.solve import MAX_RADIANCE, Target
from relume.look.model import DisplayLook

F32 = NDArray[np.float32]
_HDR_MAGIC = b"#?"
_WHITE = 255  # the display value that may have been clipped
_LABEL = "the reference picture"


def read_reference(data: bytes, display: DisplayLook, size: tuple[int, int]) -> Target:
    """Decode a reference picture as a target.

    HDR and OpenEXR files have linear radiance. Other files have display values, from which tone map, contrast, exposure
    and white balance of the look are removed; an OpenColorIO view counts as sRGB, and a display LUT stays. Clipped,
    transparent and invalid pixels have no weight.

    Args:
        data: contents of the file. display: of the look. size: width and height of the target; a picture of another
            aspect ratio is cropped about its center.
    Raises:
        SceneError: the file is damaged, too large, or of an unknown format.
    """
    suffix = ".exr" if data.startswith(EXR_MAGIC) else ".hdr" if data.startswith(_HDR_MAGIC) else ""
    if suffix:
        radiance = read_pixels(data, suffix, _LABEL, _check_size)[0]
        return _resize(radiance, np.asarray(np.isfinite(radiance).all(axis=-1), np.float32), size)
    pixels = Decoder().decode(data, _LABEL)
    tone_map = display.tone_map if isinstance(display.tone_map, str) else "none"
    values = np.asarray(pixels[..., :3] / 255, np.float32)
    graded = inverse_tone_map(values, display.contrast * display.exposure, tone_map)
    balanced = apply_contrast(graded, 1 / display.contrast)
    unbalance = np.linalg.inv(balance_matrix(display.temperature, display.tint)).astype(np.float32)
    radiance = np.maximum(balanced @ unbalance.T, 0)
    is_clipped = (pixels[..., :3] == _WHITE).any(axis=-1)
    return _resize(radiance, np.asarray(np.where(is_clipped, 0, pixels[..., 3] / 255), np.float32), size)


def match_exposure(
    reference: Target, image: Shaped[F32, "height width 3"], weights: Shaped[F32, "height width"]
) -> Target:
    """Scale a reference picture to the mean luminance of an image, for pictures of unknown exposure.

    Args:
        reference: the picture. image: the current image. weights: of the pixels to compare.
    """
    used = weights * reference.weights
    wanted, current = (float(np.sum(used * luminance(each), dtype=np.float64)) for each in (reference.radiance, image))
    return replace(reference, radiance=reference.radiance * np.float32(current / wanted)) if wanted > 0.0 else reference


def _check_size(width: int, height: int) -> None:
    if max(width, height) > MAX_SIDE:
        raise SceneError(f"{_LABEL} is {width}×{height}; at most {MAX_SIDE}×{MAX_SIDE} is read, scale it down")


def _resize(radiance: F32, weights: F32, size: tuple[int, int]) -> Target:
    """Average the pixels with weight over each pixel of the target."""
    valid = np.clip(np.where(weights[..., None] > 0.0, radiance, 0.0), 0.0, MAX_RADIANCE)
    box = _centered_box((radiance.shape[1], radiance.shape[0]), size)
    coverage = _average(weights, size, box)
    channels = [_average(valid[..., c] * weights, size, box) for c in range(3)]
    mean = np.stack(channels, axis=-1) / np.maximum(coverage, 1e-6)[..., None]
    return Target(mean.astype(np.float32), coverage)


def _average(values: F32, size: tuple[int, int], box: tuple[float, float, float, float]) -> F32:
    image = Image.fromarray(np.ascontiguousarray(values, np.float32))
    return np.asarray(image.resize(size, Image.Resampling.BOX, box), np.float32)


def _centered_box(picture: tuple[int, int], size: tuple[int, int]) -> tuple[float, float, float, float]:
    """Return the largest box of a picture with the aspect ratio of a size."""
    scale = min(picture[0] / size[0], picture[1] / size[1])
    left, top = ((whole - scale * side) / 2 for whole, side in zip(picture, size, strict=True))
    return left, top, picture[0] - left, picture[1] - top
