"""What an eye sees through the pixels of its picture: which are edges, and the rays that samples are made of."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from relume.eye.layers import Layer, layers_of
from relume.eye.merged import Chosen, alone, joined, merged
from relume.eye.mirrors import MOST_MIRRORS
from relume.eye.pixel_edges import bright_edges_of, brightness_of, edges_of, is_partly_there, is_turning
from relume.eye.windows import AT_ONCE, Window, windows_of
from relume.parallel import each_in_order
from relume.scene.model import Camera, Scene
from relume.trace.cutout_filter import EVERYWHERE
from relume.trace.geometry import Geometry
from relume.trace.primary import camera_directions

F32 = NDArray[np.float32]

_GOLDEN = (5**0.5 - 1) / 2
_MIDDLE = np.full((1, 2), 0.5)


@dataclass(frozen=True)
class Edges:
    """Of a picture.

    Attributes:
        is_edge: whether a pixel wants more rays than the one through its middle. (pixels,)
        num_alone: what the others show together. num_rays: that found it.
    """

    is_edge: NDArray[np.bool_]
    num_alone: int
    num_rays: int


@dataclass(frozen=True)
class Eye:
    """A camera before a scene.

    Attributes:
        scene: what is seen. geometry: its triangles. camera: the eye. size: width and height of its picture, pixels.
        follows_mirrors: whether there are rays of what is seen in mirrors.
    """

    scene: Scene
    geometry: Geometry
    camera: Camera
    size: tuple[int, int]
    follows_mirrors: bool = True

    @property
    def pixel_angle(self) -> float:
        """That a pixel spans, radians."""
        return self.camera.yfov / self.size[1]

    @cached_property
    def _origin(self) -> F32:
        return self.camera.to_world[:3, 3].astype(np.float32)

    @cached_property
    def _bright(self) -> float:
        return brightness_of(self.scene.environment.radiance)

    def _directions(self, pixel: NDArray[np.int64], positions: NDArray[np.float64] = _MIDDLE) -> F32:
        """Of rays through some positions (n, 2) of pixels (p,), those of a pixel in a row. (p · n, 3)"""
        y, x = np.divmod(pixel, self.size[0])
        at_x, at_y = ((a[:, None] + positions[:, k]).astype(np.float32).ravel() for k, a in enumerate((x, y)))
        return camera_directions(self.camera, self.size, at_x, at_y)

    def _layers(self, directions: F32, chance: F32 | np.float32 = EVERYWHERE) -> list[Layer]:
        return layers_of(
            self.geometry, self.scene.materials, self._origin, directions, chance, self.pixel_angle,
            follows_mirrors=self.follows_mirrors,
        )  # fmt: skip

    def edges(self, *, smooths: bool) -> Edges:
        """Look at all pixels. smooths: else none is an edge."""
        num_pixels = self.size[0] * self.size[1]
        is_edge, shown = np.zeros(num_pixels, np.bool_), np.zeros(num_pixels, np.uint8)
        cosine = np.ones(num_pixels, np.float32)

        def looked_at(window: Window) -> int:
            wider, pixel = window.widened(self.size), window.pixels(self.size)
            directions = self._directions(wider.pixels(self.size))
            layers = self._layers(directions)
            of_layers = sum(np.bincount(layer.ray[layer.is_shown], minlength=len(directions)) for layer in layers)
            shown[pixel] = window.cut_from(wider, np.asarray(of_layers))
            if smooths:
                found, turn = self._edges_in(wider, layers, directions)
                is_edge[pixel], cosine[pixel] = window.cut_from(wider, found), window.cut_from(wider, turn)
            return sum(len(layer.ray) for layer in layers)

        num_rays = sum(each_in_order(looked_at, windows_of(self.size), AT_ONCE))
        is_edge |= is_turning(cosine)
        return Edges(is_edge, int(shown[~is_edge].sum(dtype=np.int64)), num_rays)

    def _edges_in(self, window: Window, layers: list[Layer], directions: F32) -> tuple[NDArray[np.bool_], F32]:
        """Find edges but for those that turn, and the cosines of these, by rays through the middles of pixels."""
        size = window.width, window.height
        is_edge, cosine = np.zeros(len(directions), np.bool_), np.ones(len(directions), np.float32)
        for layer in layers:
            differs, turn = edges_of(self.geometry, layer, size)
            is_edge |= differs
            cosine = np.minimum(cosine, turn)
            if layer.chain is not None:
                is_edge |= bright_edges_of(layer, self.scene.environment.radiance, self._bright, size)
        holes = self.geometry.embree.holes
        if holes is not None and holes.blends:
            is_edge |= is_partly_there(self.geometry, self._origin, directions)
        return is_edge, cosine

    def chosen(
        self, window: Window, is_edge: NDArray[np.bool_], positions: NDArray[np.float64]
    ) -> tuple[Chosen, int, int]:
        """What samples are made of in a window.

        Args:
            window: of the picture. is_edge: of all its pixels. positions: of the rays of one that is an edge. (n, 2)
        Returns:
            Rays; how many of them are of edges; how many were traced.
        """
        pixel = window.pixels(self.size)
        plain, edges = pixel[~is_edge[pixel]], pixel[is_edge[pixel]]
        coarse = self._layers(self._directions(plain))
        fine = self._layers(self._directions(edges, positions), _shared_chances(edges, len(positions)))
        parts = [merged(self.geometry, layer, edges, positions) for layer in fine]
        num_fine, num_rays = sum(len(part.pixel) for part in parts), sum(len(layer.ray) for layer in coarse + fine)
        return joined([*(alone(layer, plain) for layer in coarse), *parts], MOST_MIRRORS), num_fine, num_rays


def _shared_chances(pixel: NDArray[np.int64], num: int) -> F32:
    """Chances of as many rays of each of p pixels, evenly apart: a surface that blends has its share. (p · num,)"""
    places = np.array([0, 5, 2, 7, 4, 1, 6, 3])  # not in the order of the rows that the positions lie in
    offset = (pixel[:, None] * _GOLDEN) % 1  # eighths alone would be seen as steps
    return np.asarray((places[places < num] + offset) / num + 1e-6, np.float32).ravel()
