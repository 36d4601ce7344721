"""Targets that are painted over an image: strokes that ask for more or less light, a color, or a reference picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from relume.core.color import luminance
from relume.core.errors import ParameterError
from relume.inverse_lighting.solve import MAX_RADIANCE, Target

F32 = NDArray[np.float32]
Xy = tuple[float, float]
StrokeKind = Literal["brighter", "darker", "color", "reference"]
HOLD = 0.1
"""Weight of all pixels outside of strokes together, relative to all inside; they are to stay.

None beside a `reference` stroke: its picture has other light everywhere.
"""
_FLOOR = 1e-3
"""Smallest luminance that a stroke makes brighter, relative to the mean of the image: twice black is black."""
_SUBPIXELS = 4  # per side, of the mask of a brush


@dataclass(frozen=True)
class Stroke:
    """Pixels and their wanted light.

    Attributes:
        kind: `brighter` and `darker` by `stops`; in a `color` at equal luminance; as the `reference` picture.
        mask: coverage in [0, 1]. stops: at least 0. color: linear Rec. 709, not black.
    """

    kind: StrokeKind
    mask: Shaped[F32, "height width"]
    stops: float = 1.0
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)


def brush_mask(points: Sequence[Xy], radius: float, size: tuple[int, int]) -> Shaped[F32, "height width"]:
    """Draw the mask of a round brush along a line.

    Args:
        points: in pixels, from the left and from the top. radius: pixels. size: width and height of the mask.
    Returns:
        Coverage in [0, 1]; at least the pixel under each point inside the image, however small the brush.
    """
    width, height = size
    image = Image.new("L", (width * _SUBPIXELS, height * _SUBPIXELS))
    draw, r = ImageDraw.Draw(image), radius * _SUBPIXELS
    line = [(x * _SUBPIXELS, y * _SUBPIXELS) for x, y in points]
    if len(line) > 1:
        draw.line(line, fill=255, width=max(1, round(2 * r)))
    for x, y in line:
        draw.ellipse((x - r, y - r, x + r, y + r), fill=255)
    mask = np.asarray(image.resize(size, Image.Resampling.BOX), np.float32) / np.float32(255)
    for x, y in points:
        if 0 <= x < width and 0 <= y < height:
            mask[int(y), int(x)] = 1.0
    return mask


@dataclass(frozen=True)
class Region:
    """A region of a target: a stroke, or a whole reference picture. weights: of its pixels."""

    kind: StrokeKind
    weights: Shaped[F32, "height width"]


@dataclass(frozen=True)
class PaintedTarget:
    """A target, and its regions. target: its weights include the pixels that are to stay."""

    target: Target
    regions: tuple[Region, ...]

    @property
    def marked(self) -> Shaped[F32, "height width"]:
        """Weights of the pixels that are not only to stay."""
        return sum((region.weights for region in self.regions), np.zeros_like(self.target.weights))


def painted_target(
    strokes: Sequence[Stroke], image: Shaped[F32, "height width 3"], reference: Target | None = None, hold: float = HOLD
) -> PaintedTarget:
    """Return the target of strokes over an image; later strokes paint over earlier ones.

    Errors weigh less where the image is bright, about as a tone map shows them: w = L̄²/(L + L̄)².

    Args:
        strokes: the strokes; none: the whole picture is to look as the reference, if there is one.
        image: the current image. reference: the picture of `reference` strokes. hold: see `HOLD`.
    Raises:
        ParameterError: a stroke needs a reference picture, and there is none.
    """
    if not strokes and reference is not None:
        weights = reference.weights * _tone_weights(reference.radiance)
        return PaintedTarget(Target(reference.radiance, weights), (Region("reference", weights),))
    radiance, uncovered, masks = image, np.ones(image.shape[:2], np.float32), list[F32]()
    for stroke in strokes:
        if stroke.kind == "reference" and reference is None:
            raise ParameterError("strokes", stroke.kind, "a stroke of another kind, or give a reference picture")
        mask = stroke.mask * reference.weights if stroke.kind == "reference" and reference else stroke.mask
        radiance = np.where(mask[..., None] > 0.0, _wanted(stroke, radiance, reference), radiance)
        masks = [earlier * (1 - mask) for earlier in masks] + [mask]
        uncovered = uncovered * (1 - mask)
    if any(stroke.kind == "reference" for stroke in strokes):
        hold = 0.0
    tone_weights = _tone_weights(image)
    regions = tuple(Region(stroke.kind, mask * tone_weights) for stroke, mask in zip(strokes, masks, strict=True))
    weights = tone_weights * (1 - uncovered + _hold_weights(uncovered, hold))
    return PaintedTarget(Target(radiance, weights), regions)


def _wanted(stroke: Stroke, radiance: F32, reference: Target | None) -> F32:
    match stroke.kind:
        case "color":
            color = np.asarray(stroke.color, np.float32)
            return luminance(radiance)[..., None] * (color / max(float(luminance(color)), 1e-9))
        case "reference":
            assert reference is not None
            return reference.radiance
        case _:
            stops = stroke.stops if stroke.kind == "brighter" else -stroke.stops
            return np.asarray(np.float32(2.0**stops) * (_lifted(radiance) if stops > 0 else radiance))


def _lifted(radiance: F32) -> F32:
    """Add gray light to almost black pixels."""
    y = luminance(radiance)
    return np.asarray(radiance + np.maximum(_FLOOR * y.mean() - y, 0)[..., None])


def _tone_weights(image: F32) -> F32:
    y = np.clip(np.nan_to_num(luminance(image)), 0.0, MAX_RADIANCE)
    mean = y.mean()
    return np.asarray(np.square(mean / (y + mean))) if mean > 0.0 else np.ones_like(y)


def _hold_weights(uncovered: F32, hold: float) -> F32:
    num_uncovered = float(uncovered.sum())
    return uncovered * (hold * (uncovered.size - num_uncovered) / num_uncovered if num_uncovered > 0.0 else 0.0)
