"""Footprints of pixels in textures: their axes, and means over them, against brute force."""

import numpy as np
import pytest

from relume.raytrace.barycentric import FacePoints
from relume.raytrace.texture import MipMap
from relume.scene.model import Texture

CORNERS = np.array([[0.2, -0.4, -3.0], [2.1, 0.3, -4.0], [-0.5, 1.9, -3.5]])
UVS = np.array([[0.1, 0.2], [0.9, 0.3], [0.25, 0.45]], np.float32)
PIXEL_ANGLE = 0.002


def hit(direction: np.ndarray) -> tuple[float, np.ndarray]:
    """Distance of the triangle's plane along a ray from the origin, and UV coordinates there."""
    edges = CORNERS[1:] - CORNERS[0]
    t, s_1, s_2 = np.linalg.solve(np.column_stack([direction, -edges[0], -edges[1]]), CORNERS[0])
    return t, UVS[0] + s_1 * (UVS[1] - UVS[0]) + s_2 * (UVS[2] - UVS[0])


def test_axes_are_how_texture_coordinates_change_over_a_pixel() -> None:
    direction = CORNERS.mean(axis=0) / np.linalg.norm(CORNERS.mean(axis=0))
    distance, uv = hit(direction)
    normal = np.cross(CORNERS[1] - CORNERS[0], CORNERS[2] - CORNERS[0])
    normal /= -np.linalg.norm(normal) * np.sign(normal @ direction)
    right = np.cross(direction, [0.0, 1, 0])
    right /= np.linalg.norm(right)
    changes = [hit(direction + 1e-4 * side)[1] - uv for side in (right, np.cross(right, direction))]
    differences = np.array(changes) / 1e-4 * PIXEL_ANGLE
    point = FacePoints(
        np.array([True]), CORNERS[None].astype(np.float32), UVS[None], np.zeros(1, np.float32),
        normal[None].astype(np.float32), np.zeros((1, 3)), np.zeros((1, 3)), np.zeros((1, 4)), uv[None],
    )  # fmt: skip
    sides = point.pixel_sides(np.float32([distance]), direction[None].astype(np.float32), PIXEL_ANGLE)
    axes = point.texture_sides(sides)[0]
    # conjugate diameters of the same ellipse have the same second moments
    np.testing.assert_allclose(axes.T @ axes, differences.T @ differences, rtol=1e-3)


def square(num: int = 48) -> np.ndarray:
    """Points of a square with side 1, as coordinates along two sides. (n, 2)"""
    x = (np.arange(num) + 0.5) / num - 0.5
    return np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)


@pytest.mark.parametrize(("length", "breadth", "angle"), [(6, 6, 0.0), (24, 3, 0.0), (24, 3, 0.7), (12, 4, 2.0)])
def test_means_are_those_over_footprints(length: float, breadth: float, angle: float) -> None:
    pixels = np.random.default_rng(5).random((256, 128, 3), np.float32)
    pyramid, num, size = MipMap(Texture(pixels)), 400, np.array([128, 256])
    uv = np.random.default_rng(6).random((num, 2)).astype(np.float32)
    c, s = np.cos(angle), np.sin(angle)
    sides = np.array([[length * c, length * s], [-breadth * s, breadth * c]]) / size
    means = pyramid.sample_pixels(uv, np.tile(sides.astype(np.float32), (num, 1, 1)))
    texel = np.zeros(1, np.float32)
    exact = [pyramid.sample((place + square() @ sides).astype(np.float32), texel.repeat(48**2)).mean(0) for place in uv]
    isotropic = pyramid.sample(uv, np.full(num, np.sqrt(length * breadth) / 256, np.float32))
    errors = [np.sqrt(np.mean((values - exact) ** 2)) for values in (means, isotropic)]
    assert errors[0] < 0.7 * errors[1]
    np.testing.assert_allclose(means.mean(axis=0), pixels.mean(axis=(0, 1)), atol=0.02)


def test_neighbors_in_an_atlas_are_left_out() -> None:
    """A part of the texture is black, the other white: a pixel's width from the border little of the other is seen."""
    pixels = np.zeros((256, 256, 3), np.float32)
    pixels[:, 123:] = 1
    border, side = 123 / 256, 10 / 256
    uv = np.array([[border - side, 0.5], [border + side, 0.5]], np.float32)
    axes = np.tile(np.diag([side, side]).astype(np.float32), (2, 1, 1))
    pyramid = MipMap(Texture(pixels, ("clamp", "clamp")))
    filters = pyramid.sample_pixels(uv, axes), pyramid.sample(uv, np.full(2, side, np.float32))
    several, single = (np.abs(values[:, 0] - [0, 1]).max() for values in filters)
    assert several < 0.02
    assert several < 0.25 * single


def test_one_texel_is_interpolated() -> None:
    pixels = np.random.default_rng(7).random((32, 32, 3), np.float32)
    pyramid, uv = MipMap(Texture(pixels)), np.random.default_rng(8).random((50, 2)).astype(np.float32)
    no_axes = np.zeros((50, 2, 2), np.float32)
    np.testing.assert_allclose(pyramid.sample_pixels(uv, no_axes), pyramid.sample(uv, np.zeros(50, np.float32)))
