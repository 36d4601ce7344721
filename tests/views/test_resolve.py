"""Resolve samples to pixels and encode pixels, against NumPy and the packer of `rgb9e5`."""

from __future__ import annotations

import numpy as np
import numpy_reference as ref
import pytest
from rgb9e5 import rgb9e5_pack, rgb9e5_unpack

from relume.core.errors import ParameterError
from relume.math.rgb9e5 import pack_rgb9e5, unpack_rgb9e5
from relume.scene.model import Camera
from relume.views.resolve import encode, resolve
from relume.views.view import View


def make_view(width=100, height=70, seed=0):
    """A view with one to four samples per pixel, unordered, without a store."""
    rng = np.random.default_rng(seed)
    count = rng.integers(1, 5, width * height)
    pixel = np.repeat(np.arange(width * height), count).astype(np.uint32)
    weight = rng.random(len(pixel))
    weight /= np.repeat(np.bincount(pixel, weight), count)
    shuffled = rng.permutation(len(pixel))
    pixel, weight = pixel[shuffled], weight[shuffled]
    order = np.argsort(pixel, kind="stable").astype(np.int32)
    return View(
        camera=Camera("v", np.eye(4), 0.8), index=0, width=width, height=height, store=None, cache=None, key="",
        bounds=np.int64([0, len(pixel)]), pixel=pixel, first=np.concatenate([[0], np.cumsum(count)]).astype(np.int64),
        order=order, throughput=weight[order, None].astype(np.float32), origin=np.zeros((1, 3), np.float32),
        mirrored=None, is_mirrored=np.zeros(len(pixel), np.bool_), textures={},
        level=np.zeros(len(pixel), np.uint8), level_pairs=((),),
    )  # fmt: skip


@pytest.fixture(scope="module")
def view():
    return make_view()


@pytest.fixture(scope="module")
def radiance(view):
    return np.exp(np.random.default_rng(1).normal(size=(3, view.num_view_samples))).astype(np.float32)


@pytest.mark.parametrize("gain", [0.0, 1.0, 2.5, (2.0, 0.0, 0.5)])
def test_the_whole_image_is_the_weighted_sum(view, radiance, gain):
    pixels = resolve(view, radiance, [(0, 0, view.width, view.height)], gain, view.throughput).reshape(
        view.height, view.width, 3
    )
    np.testing.assert_allclose(pixels, np.array(gain) * ref.resolve(view, radiance.T.astype(float)), rtol=2e-6)


@pytest.mark.parametrize("count", [1, 3, 4])
def test_tiles_are_consecutive_row_major_and_clipped(view, radiance, count):
    tiles = view.all_tiles[::-1][:count]
    whole = ref.resolve(view, radiance.T.astype(float))
    expected = np.concatenate([whole[y : y + h, x : x + w].reshape(-1, 3) for x, y, w, h in tiles])
    np.testing.assert_allclose(resolve(view, radiance, tiles, 1.0, view.throughput), expected, rtol=2e-6)
    payload = np.frombuffer(encode(view, radiance, tiles, "f32", 1.0, view.throughput), "<f4").reshape(-1, 3)
    np.testing.assert_allclose(payload, expected, rtol=2e-6)


def test_tiles_cover_the_image_once():
    for width, height in [(64, 64), (65, 63), (16, 200), (130, 128)]:
        view = make_view(width, height)
        coverage = np.zeros((height, width), int)
        for x, y, w, h in view.all_tiles:
            assert 0 < w <= 64
            assert 0 < h <= 64
            coverage[y : y + h, x : x + w] += 1
        np.testing.assert_array_equal(coverage, 1)


def test_no_tiles_are_no_bytes(view, radiance):
    assert resolve(view, radiance, [], 1.0, view.throughput).shape == (0, 3)
    assert encode(view, radiance, [], "f32", 1.0, view.throughput) == b""
    assert encode(view, radiance, [], "rgb9e5", 1.0, view.throughput) == b""


def test_the_packed_payload_is_the_packed_image(view, radiance):
    tiles = view.all_tiles
    pixels = resolve(view, radiance, tiles, 1.0, view.throughput)
    words = np.frombuffer(encode(view, radiance, tiles, "rgb9e5", 1.0, view.throughput), "<u4")
    np.testing.assert_array_equal(words, rgb9e5_pack(pixels))
    error = np.abs(rgb9e5_unpack(words) - pixels)
    assert (error <= pixels.max(axis=1, keepdims=True) * 2**-9).all()


@pytest.mark.parametrize("form", ["jpeg", "", "F32", "../x"])
def test_other_formats_are_rejected(view, radiance, form):
    with pytest.raises(ParameterError, match="'rgb9e5' or 'f32'"):
        encode(view, radiance, view.all_tiles, form, 1.0, view.throughput)


def packed(rgb):
    rgb = np.asarray(rgb, np.float32)
    return np.array([pack_rgb9e5(*pixel) for pixel in rgb], np.uint32)


def test_the_packing_kernel_equals_numpy_bit_for_bit():
    rng = np.random.default_rng(2)
    random = np.exp(rng.uniform(-25, 14, (20_000, 1)) + rng.normal(size=(20_000, 3)))
    # rounding to even or up
    halfway = np.ldexp(rng.integers(0, 1024, (5000, 3)) + 0.5, rng.integers(-30, 8, (5000, 1)))
    powers = np.ldexp(1.0, np.arange(-40, 20))[:, None] * [1.0, 0.5, 0.25]
    below = np.nextafter(powers.astype(np.float32), np.float32(0))
    for rgb in (random, halfway, powers, below, np.eye(3) * 0.9999, rng.integers(0, 70_000, (2000, 3))):
        rgb = np.asarray(rgb, np.float32)
        np.testing.assert_array_equal(packed(rgb), rgb9e5_pack(rgb))


def test_the_unpacking_kernel_equals_numpy():
    words = np.random.default_rng(3).integers(0, 1 << 32, 5000).astype(np.uint32)
    np.testing.assert_array_equal([unpack_rgb9e5(word) for word in words], rgb9e5_unpack(words))


HOSTILE = [
    0.0,
    -0.0,
    -1.0,
    -np.inf,
    np.inf,
    np.nan,
    1e38,
    -1e38,
    1e-45,
    65408.0,
    65409.0,
    65535.0,
    2.0**-24,
    2.0**-25,
    1.0,
]


def test_invalid_values_are_packed_like_numpy():
    rgb = np.array(np.meshgrid(HOSTILE, HOSTILE, HOSTILE), np.float32).reshape(3, -1).T
    words = packed(rgb)
    np.testing.assert_array_equal(words, rgb9e5_pack(rgb))
    back = rgb9e5_unpack(words)
    assert np.isfinite(back).all()
    assert back.max() <= 65408


def test_invalid_radiance_of_a_sample_stays_in_its_pixel(view, radiance):
    hurt = radiance.copy()
    hurt[0, 17], hurt[1, 17], hurt[2, 17] = np.nan, np.inf, -1e30
    whole = [(0, 0, view.width, view.height)]
    words, clean = (
        np.frombuffer(encode(view, r, whole, "rgb9e5", 1.0, view.throughput), "<u4") for r in (hurt, radiance)
    )
    others = np.arange(len(words)) != view.pixel[17]
    np.testing.assert_array_equal(words[others], clean[others])
    assert np.isfinite(rgb9e5_unpack(words)).all()
