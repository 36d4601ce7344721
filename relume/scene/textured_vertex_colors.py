"""Vertex colors of textured materials, as images that multiply the base color.

Where triangles do not share texels, colors are drawn at the texture coordinates that the mesh has. Where they do, as on
tiles that repeat, each triangle gets a block of texels of its own, into which all images of the material are copied.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba as nb
import numpy as np
import PIL.Image
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import srgb_encode
from relume.scene.model import WRAPS
from relume.scene.texture_encoding import ROWS_PER_BATCH, SRGB_TO_LINEAR, periodic

U8 = NDArray[np.uint8]
F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Wrap = tuple[str, str]

# Texels of an image up to which it is refined, until triangles have so many in the median: between the outermost texels
# of a triangle its colors are exact, and a gradient needs more of them than texels that only differ.
_REFINED = ((1024, 16), (4096, 2))
_MAX_DIFFERENCE = 0.1  # of two colors at one texel, linear
_MAX_CONFLICTS = 0.01  # share of texels at which triangles differ
_MAX_COVERS = 64.0  # bounding boxes of triangles, by the image
_MARGIN = 1.5  # texels around a triangle that lookups at its edges can reach
_MAX_BLOCK_TEXELS = 1 << 24  # of all blocks; of the image that holds them, twice as many
_MAX_REDUCTION = 4  # of images, so that blocks fit
_BLOCK_TEXELS_AT_ONCE = 1 << 20


@dataclass(frozen=True)
class TexturedColors:
    """Vertex colors of a material with images.

    Attributes:
        image: colors in sRGB, with alpha. (height, width, 4)
        wrap: wrap modes of the image.
        texel_uvs: texture coordinates at the centers of its texels, at which the material's images are copied; None if
            the image is drawn at the texture coordinates of the mesh.
        reduction: texels of the material's images along each side of a copied texel.
        corner_uvs: texture coordinates of the triangles in the image; None as before. (triangles, 3, 2)
    """

    image: Shaped[U8, "height width 4"]
    wrap: Wrap
    texel_uvs: Shaped[F32, "height width 2"] | None = None
    reduction: int = 1
    corner_uvs: Shaped[F32, "triangles 3 2"] | None = None

    def place(
        self, pixels: Shaped[U8, "rows columns channels"], wrap: Wrap
    ) -> tuple[Shaped[U8, "height width channels"], Wrap]:
        """Copy an image of the material into the blocks, with the wrap modes then; without blocks it stays."""
        if self.texel_uvs is None:
            return pixels, wrap
        height, width = (max(1, side // self.reduction) for side in pixels.shape[:2])
        reduced = _resized(pixels, (height, width), "BOX")
        placed = np.empty((*self.texel_uvs.shape[:2], pixels.shape[2]), np.uint8)
        for start in range(0, len(placed), ROWS_PER_BATCH):
            rows = slice(start, start + ROWS_PER_BATCH)
            placed[rows] = _bilinear(reduced, self.texel_uvs[rows].reshape(-1, 2), wrap).reshape(placed[rows].shape)
        return placed, self.wrap

    def multiply(self, pixels: Shaped[U8, "rows columns 4"]) -> Shaped[U8, "height width 4"]:
        """The base color's image, sRGB with alpha and placed, times the colors."""
        size = (self.image.shape[0], self.image.shape[1])
        pixels, product = _resized(pixels, size, "BILINEAR"), np.empty(self.image.shape, np.uint8)
        for start in range(0, size[0], ROWS_PER_BATCH):
            rows = slice(start, start + ROWS_PER_BATCH)
            color, alpha = self.image[rows, :, :3], self.image[rows, :, 3].astype(np.float32)
            light = SRGB_TO_LINEAR[pixels[rows, :, :3]] * SRGB_TO_LINEAR[color]
            product[rows, :, :3] = np.round(255 * srgb_encode(light.astype(np.float32)))
            product[rows, :, 3] = np.round(pixels[rows, :, 3] * (alpha / 255))
        return product


def draw_textured_colors(
    uvs: Shaped[F32, "triangles 3 2"], colors: Shaped[F32, "triangles 3 4"], size: tuple[int, int], wrap: Wrap
) -> TexturedColors | None:
    """Draw the vertex colors of triangles for a material with images.

    Args:
        uvs: texture coordinates of the corners, v from the top.
        colors: linear RGB and alpha in [0, 1], of the corners.
        size: height and width of the largest image. wrap: wrap modes of the images.
    Returns:
        None if blocks would have too many texels.
    """
    return _draw_in_place(uvs, colors, size, wrap) or _draw_blocks(uvs, colors, size)


def _draw_in_place(uvs: F32, colors: F32, size: tuple[int, int], wrap: Wrap) -> TexturedColors | None:
    """Colors at the texture coordinates of the mesh; None if triangles with different colors share texels."""
    extent = np.ptp(uvs.astype(np.float64), axis=1)
    height, width = size
    # a triangle beyond one repeat meets itself; many that cover each other are slow to draw, and share texels
    if extent.max() > 1 + 1e-6 or extent.prod(axis=1).sum() > _MAX_COVERS:
        return None
    for max_side, least in _REFINED:
        while max(height, width) <= max_side // 2 and np.median((extent * [width, height]).max(axis=1)) < least:
            height, width = 2 * height, 2 * width
    image = np.empty((height, width, 4), np.float32)
    image[:] = colors.mean(axis=(0, 1), dtype=np.float64)
    size_in_texels = (width, height)
    texels = uvs.astype(np.float64) * size_in_texels - 0.5
    wraps = np.array([WRAPS.index(name) for name in wrap])
    for axis in np.flatnonzero(wraps != WRAPS.index("clamp")):
        # coordinates near zero, so that texels are counted in integers
        period = 2 * size_in_texels[axis]
        texels[..., axis] -= np.floor(texels[:, :1, axis] / period) * period
    is_drawn = np.zeros((height, width), np.bool_)
    num_texels, num_conflicts = _draw_triangles(texels, colors, wraps, 0.0, image, is_drawn)
    if num_conflicts > _MAX_CONFLICTS * num_texels:
        return None
    _draw_triangles(texels, colors, wraps, _MARGIN, image, is_drawn)
    return TexturedColors(_to_bytes(image), wrap)


@nb.njit(nogil=True, cache=True, error_model="numpy")
def _wrap(index, size, mode):  # type: ignore[no-untyped-def]
    """Wrap a texel index into the image. mode: index into `WRAPS`."""
    if mode == 2:
        return min(max(index, 0), size - 1)
    if mode == 1:
        folded = index % (2 * size)
        return min(folded, 2 * size - 1 - folded)
    return index % size


@nb.njit(nogil=True, cache=True, error_model="numpy")
def _draw_triangles(texels, colors, wraps, margin, image, is_drawn):  # type: ignore[no-untyped-def]
    """Draw the colors of triangles at the centers of texels that are not drawn yet.

    Args:
        texels: corners; whole numbers are centers of texels. (triangles, 3, 2). colors: of corners. (triangles, 3, 4)
        wraps: indices into `WRAPS`. margin: texels around a triangle that belong to it.
        image: (height, width, 4), written. is_drawn: (height, width), written.
    Returns:
        Number of texels of all triangles, at least one each, and of those where another color was drawn.
    """
    height, width = is_drawn.shape
    num_texels = num_conflicts = 0
    weight = np.empty(3)
    for t in range(len(texels)):
        (ax, ay), (bx, by), (cx, cy) = texels[t, 0], texels[t, 1], texels[t, 2]
        twice_area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        sides = np.hypot(cx - bx, cy - by), np.hypot(ax - cx, ay - cy), np.hypot(bx - ax, by - ay)
        left, right = int(np.ceil(min(ax, bx, cx) - margin)), int(np.floor(max(ax, bx, cx) + margin))
        above, below = int(np.ceil(min(ay, by, cy) - margin)), int(np.floor(max(ay, by, cy) + margin))
        found = False
        for last in range(2):
            if last == 1:
                if found or margin > 0:
                    break
                # smaller than a texel: the one at its middle
                left = right = int(np.round((ax + bx + cx) / 3))
                above = below = int(np.round((ay + by + cy) / 3))
            elif twice_area == 0:
                continue
            for y in range(above, below + 1):
                for x in range(left, right + 1):
                    if last == 1:
                        weight[:] = 1 / 3
                    else:
                        weight[1] = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / twice_area
                        weight[2] = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / twice_area
                        weight[0] = 1 - weight[1] - weight[2]
                        is_near = True
                        for k in range(3):
                            # distance to the side opposite the corner: weight × height of the triangle
                            is_near &= weight[k] * abs(twice_area) >= -margin * sides[k]
                            weight[k] = max(weight[k], 0.0)
                        if not is_near:
                            continue
                        weight /= weight.sum()
                    found = True
                    row, column = _wrap(y, height, wraps[1]), _wrap(x, width, wraps[0])
                    num_texels += 1
                    difference = 0.0
                    for channel in range(4):
                        color = 0.0
                        for k in range(3):
                            color += weight[k] * colors[t, k, channel]
                        if is_drawn[row, column]:
                            difference = max(difference, abs(color - image[row, column, channel]))
                        else:
                            image[row, column, channel] = color
                    num_conflicts += difference > _MAX_DIFFERENCE
                    is_drawn[row, column] = True
    return num_texels, num_conflicts


def _draw_blocks(uvs: F32, colors: F32, size: tuple[int, int]) -> TexturedColors | None:
    """A block of texels for each triangle; None if there would be too many."""
    first, along, down = uvs[:, 0], uvs[:, 1] - uvs[:, 0], uvs[:, 2] - uvs[:, 0]
    color, color_along, color_down = colors[:, 0], colors[:, 1] - colors[:, 0], colors[:, 2] - colors[:, 0]
    # beyond the third side colors are clamped, which coarse blocks would show
    fourth = color + color_along + color_down
    smallest = 4 if np.abs(fourth - np.clip(fourth, 0, 1)).max() > 0.05 else 2
    reduction, sides = 1, _block_sides(along, down, size, smallest)
    while sides.prod(axis=1).sum() > _MAX_BLOCK_TEXELS:
        reduction *= 2
        if reduction > _MAX_REDUCTION:
            return None
        sides = _block_sides(along, down, (size[0] // reduction, size[1] // reduction), smallest)
    whole = np.asarray(sides, np.int64)
    num_texels = whole.prod(axis=1)
    corner, width, height = _pack(whole)
    if width * height > 2 * _MAX_BLOCK_TEXELS:
        return None
    image, texel_uvs = np.full((height, width, 4), 255, np.uint8), np.zeros((height, width, 2), np.float32)
    for batch in np.split(
        np.arange(len(uvs)), np.flatnonzero(np.diff(num_texels.cumsum() // _BLOCK_TEXELS_AT_ONCE)) + 1
    ):
        t = np.repeat(batch, num_texels[batch])
        within = np.arange(len(t)) - np.repeat(num_texels[batch].cumsum() - num_texels[batch], num_texels[batch])
        i, j = within % whole[t, 0], within // whole[t, 0]
        u, v = (i / (whole[t, 0] - 1))[:, None], (j / (whole[t, 1] - 1))[:, None]
        place = corner[t, 1] + j, corner[t, 0] + i
        texel_uvs[place] = first[t] + u * along[t] + v * down[t]
        image[place] = _to_bytes(np.clip(color[t] + u * color_along[t] + v * color_down[t], 0, 1))
    ends = np.array([[0, 0], [1, 0], [0, 1]]) * (whole[:, None] - 1)
    corner_uvs = (corner[:, None] + 0.5 + ends) / [width, height]
    return TexturedColors(image, ("clamp", "clamp"), texel_uvs, reduction, corner_uvs.astype(np.float32))


def _block_sides(along: F32, down: F32, size: tuple[int, int], smallest: int) -> Shaped[F64, "triangles 2"]:
    """Width and height of blocks that have as many texels as the image has on the triangles; whole numbers."""
    texels = np.stack([np.hypot(*(side * np.array([size[1], size[0]])).T) for side in (along, down)], axis=1)
    return np.asarray(np.maximum(np.ceil(texels) + 1, smallest), np.float64)


def _pack(sides: Shaped[I64, "blocks 2"]) -> tuple[Shaped[I64, "blocks 2"], int, int]:
    """Place blocks in rows of similar height: the left and upper texel of each, and the width and height of all."""
    order = np.argsort(-sides[:, 1], kind="stable")
    widths, heights = sides[order].T
    row_width = max(int(np.ceil(np.sqrt(sides.prod(axis=1).sum()))), int(widths.max()))
    start = widths.cumsum() - widths
    row = start // row_width
    row_starts = np.flatnonzero(np.diff(row, prepend=-1))
    row_index = np.cumsum(np.isin(np.arange(len(row)), row_starts)) - 1
    row_heights = heights[row_starts]
    corner = np.empty_like(sides)
    corner[order, 0] = start - start[row_starts][row_index]
    corner[order, 1] = (row_heights.cumsum() - row_heights)[row_index]
    return corner, int((corner[:, 0] + sides[:, 0]).max()), int(row_heights.sum())


def _to_bytes(colors: Shaped[NDArray[np.floating], "*batch 4"]) -> Shaped[U8, "*batch 4"]:
    """Linear RGB and alpha in [0, 1] as bytes in sRGB."""
    values = np.asarray(colors, np.float32)
    return np.round(255 * np.concatenate([srgb_encode(values[..., :3]), values[..., 3:]], axis=-1)).astype(np.uint8)


def _resized(pixels: U8, size: tuple[int, int], filter_name: str) -> U8:
    """Resize an image, channel by channel: Pillow would multiply colors by alpha. size: height and width."""
    if pixels.shape[:2] == size:
        return pixels
    resampling = PIL.Image.Resampling[filter_name]
    channels = [PIL.Image.fromarray(np.ascontiguousarray(pixels[..., k])) for k in range(pixels.shape[2])]
    return np.stack([np.asarray(channel.resize(size[::-1], resampling)) for channel in channels], axis=-1)


def _bilinear(pixels: U8, uvs: Shaped[F32, "n 2"], wrap: Wrap) -> Shaped[U8, "n channels"]:
    """Look up bytes, interpolated between texels."""
    position = uvs.astype(np.float64) * [pixels.shape[1], pixels.shape[0]] - 0.5
    low = np.floor(position)
    fraction = (position - low).astype(np.float32)
    columns = [periodic(low[:, 0] + k, pixels.shape[1], wrap[0]) for k in (0, 1)]
    rows = [periodic(low[:, 1] + k, pixels.shape[0], wrap[1]) for k in (0, 1)]
    value = np.zeros((len(uvs), pixels.shape[2]), np.float32)
    for down in (0, 1):
        for across in (0, 1):
            weight = np.abs(1 - across - fraction[:, 0]) * np.abs(1 - down - fraction[:, 1])
            value += weight[:, None] * pixels[rows[down], columns[across]]
    return np.round(value).astype(np.uint8)
