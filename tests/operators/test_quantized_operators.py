"""Quantized and subsampled operators: columns in 16 bits, and columns of some samples, against float32."""

from __future__ import annotations

import numpy as np
import numpy_reference as ref
import pytest

from relume.operators.linear_operator import Interpolation, LinearOperator, operator_bytes, quantize, tile_layout
from relume.operators.update_kernel import BLOCK_SAMPLES, changed_columns, interpolate, stream, stream_quantized

RNG = np.random.default_rng(4)


def packed_of(transport):
    """Quantize columns in float32, (tiles, 3, J, samples), with blocks of any brightness."""
    tiles, _, num, samples = transport.shape
    blocks = -(-samples // BLOCK_SAMPLES)
    values, scale = np.zeros(transport.shape, np.int16), np.zeros((tiles, 3, num, blocks), np.float32)
    for tile in range(tiles):
        for block in range(blocks):
            here = slice(block * BLOCK_SAMPLES, (block + 1) * BLOCK_SAMPLES)
            rows, scale[tile, :, :, block] = quantize(
                np.ascontiguousarray(transport[tile, :, :, here].transpose(0, 2, 1))
            )
            values[tile, :, :, here] = rows.transpose(0, 2, 1)
    return LinearOperator(values, np.ones((3, num)), scale=scale)


def whole_numbers(packed):
    """Columns of the quantized operator. (tiles, 3, J, samples) float64"""
    scale = np.repeat(packed.scale, BLOCK_SAMPLES, axis=3)[..., : packed.transport.shape[3]]
    return packed.transport * scale.astype(float)


def lively(*shape):
    return (RNG.normal(size=shape) * np.exp(3 * RNG.normal(size=(*shape[:3], 1)))).astype(np.float32)


@pytest.mark.parametrize("counts", [(0, 0, 0), (1, 4, 5), (3, 0, 7), (8, 8, 8)])
@pytest.mark.parametrize("shape", [(1, 16), (2, 1040)])
def test_streamed_quantized_columns_are_the_product(counts, shape):
    tiles, samples = shape
    packed = packed_of(lively(tiles, 3, 8, samples))
    change, image = np.zeros((3, 8)), RNG.normal(size=(tiles, 3, samples)).astype(np.float32)
    for channel, count in enumerate(counts):
        change[channel, RNG.permutation(8)[:count]] = RNG.normal(size=count)
    expected = ref.stream(whole_numbers(packed), change, image)
    packed.add(change, image)
    np.testing.assert_allclose(image, expected, rtol=1e-5, atol=1e-5 * np.abs(expected).max())


def test_levels_of_quantized_columns_have_the_same_ends():
    packed, bounds = packed_of(lively(2, 3, 6, 1040)), np.array([0, 500, 500, 1300, 2080])
    change = RNG.normal(size=(4, 3, 6))
    images = np.zeros((2, 2, 3, 1040), np.float32)
    stream_quantized(packed.transport, packed.scale, changed_columns(change), images[0], bounds)
    stream(whole_numbers(packed).astype(np.float32), changed_columns(change), images[1], bounds)
    np.testing.assert_allclose(images[0], images[1], atol=1e-5 * np.abs(images[1]).max())


def test_16_bits_round_to_half_a_step_of_the_block_maximum():
    rows = (RNG.normal(size=(3, 100, 5)) * 10.0 ** RNG.integers(-20, 20, size=(3, 1, 5))).astype(np.float32)
    rows[0, :, 0], rows[1, :, 1] = 0, 1e-42  # zeros and subnormal numbers
    values, scale = quantize(rows)
    rest = np.abs(values * scale[:, None].astype(float) - rows)
    assert np.all(rest <= 0.5001 * np.abs(rows).max(axis=1, keepdims=True) / 32767 + 1e-41)
    assert np.abs(values).max() == 32767
    assert not values[0, :, 0].any()


def test_quantized_columns_take_half_the_memory():
    transport = lively(2, 3, 64, 1040)
    packed = packed_of(transport)
    assert packed.num_bytes == operator_bytes(2080, 64, bits=16) if tile_layout(2080) == (2, 1040) else True
    assert packed.num_bytes < 0.51 * transport.nbytes
    np.testing.assert_allclose(packed.columns_at(1040 + 700), whole_numbers(packed)[1, :, :, 700])


def test_subsampled_changes_are_interpolated_to_all_samples():
    """Against NumPy, with samples padded to whole tiles."""
    rows = RNG.normal(size=(7, 3)).astype(np.float32)
    near = RNG.integers(0, 7, size=(90, 3)).astype(np.int32)
    weight = RNG.random((90, 3)).astype(np.float32)
    image = RNG.normal(size=(2, 3, 48)).astype(np.float32)
    expected = image.astype(float)
    added = np.einsum("nk,nkc->nc", weight.astype(float), rows[near])
    for sample in range(90):
        expected[sample // 48, :, sample % 48] += added[sample]
    interpolate(rows, near, weight, image)
    np.testing.assert_allclose(image, expected, atol=1e-5)


def test_a_subsampled_operator_adds_the_change_of_its_samples():
    few = LinearOperator(lively(1, 3, 4, 16), RNG.random((3, 4)))
    near = RNG.integers(0, 10, size=(40, 3)).astype(np.int32)
    weight = RNG.dirichlet(np.ones(3), 40).astype(np.float32)
    subsampled = few.interpolated(Interpolation(10, near, weight))
    change, image = RNG.normal(size=(3, 4)), np.zeros((1, 3, 48), np.float32)
    subsampled.add(change, image)
    for sample in (0, 17, 39):
        expected = (subsampled.columns_at(sample) * change).sum(axis=1)
        np.testing.assert_allclose(image[0, :, sample], expected, rtol=1e-4, atol=1e-5 * np.abs(image).max())
    np.testing.assert_allclose(subsampled.importance, 2 * few.importance)  # each represents four
    assert operator_bytes(40, 4, 16, 10) == operator_bytes(10, 4, bits=16) + near.nbytes + weight.nbytes
    assert subsampled.num_bytes == few.num_bytes + near.nbytes + weight.nbytes
