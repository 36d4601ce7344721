"""Kernels of `relume.raytrace.visibility_masks`: trace few samples, predict the others, flood from wrong ones.

A block is 64 successive view samples. For all lights at once, three levels process a region in the same way:

    the block       two samples as far apart as possible, against all lights
    a quarter of it two samples of its own, against the doubtful lights
    a quarter       all its samples, against the lights that are still doubtful

A light is doubtful in a region if the traced samples disagree, or if an adjacent light has another prediction. If a
traced sample contradicts the prediction of the level above, the adjacent lights are traced as well, and so on.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numba.cpython.unsafe.numbers import trailing_zeros
from numpy.typing import NDArray

from relume.core.bit_matrix import WORD_BITS, words_to_rows
from relume.core.numba_options import NO_REFCOUNT
from relume.raytrace.ray_packet import (
    FAR,
    LANES,
    enable_first_lanes,
    enable_stochastic_alpha,
    is_unoccluded,
    new_packet,
    set_direction,
    set_origin,
    trace_shadows,
)

U64 = NDArray[np.uint64]

BLOCK = WORD_BITS
_BLOCK_BITS = 6
_QUARTER = BLOCK // 4
_MIN_FULL_LANES = LANES * 3 // 4  # with this many rays to one light, a packet is traced without rays of the next
# predictions of the visibility of a light from the untraced samples of a region
_UNKNOWN, _LIT, _HIDDEN, _BELOW = 0, 1, 2, 3
# one in this many predicted bits is traced as a check; a power of two, at least the size of a quarter
_CHECK_EVERY = 128
# factors for eight bytes of one bit each: moves the bits into the highest byte, the first lowest; sums the bytes there
_GATHER_BITS, _SUM_BYTES = np.uint64(0x0102040810204080), np.uint64(0x0101010101010101)
_ZERO = np.int64(0)  # a NumPy integer: Numba compiles a kernel anew for each Python int literal
_HASH = 2_654_435_761  # Knuth's multiplicative hash: 2^32 divided by the golden ratio


class _Block(NamedTuple):
    """A block against all lights; bit k of a word is sample k.

    Attributes:
        facing_bits, traced_bits, visibility_bits: above the horizon; traced; unoccluded.
        alpha_sample: alpha samples for the rays of each sample at blended surfaces. Its size is `BLOCK`.
    """

    facing_bits: Shaped[U64, " lights"]
    traced_bits: Shaped[U64, " lights"]
    visibility_bits: Shaped[U64, " lights"]
    alpha_sample: Shaped[NDArray[np.float32], " samples"]


class _Level(NamedTuple):
    """State of a level in its region.

    Attributes:
        prediction: prediction for untraced samples.
        is_queued: the light was traced here. is_doubtful: the next level traces it.
        queue, samples: lights in the order of tracing, and masks of the samples to trace.
    """

    prediction: Shaped[NDArray[np.uint8], " lights"]
    is_queued: Shaped[NDArray[np.bool_], " lights"]
    is_doubtful: Shaped[NDArray[np.bool_], " lights"]
    queue: Shaped[NDArray[np.int64], " lights"]
    samples: Shaped[U64, " lights"]


@nb.njit(nogil=True, cache=True)
def _new_level(num_lights):  # type: ignore[no-untyped-def]
    """Allocate a level without predictions."""
    return _Level(
        np.zeros(num_lights, np.uint8),
        np.zeros(num_lights, np.bool_),
        np.zeros(num_lights, np.bool_),
        np.zeros(num_lights, np.int64),
        np.zeros(num_lights, np.uint64),
    )


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _flush(packet, block, num_waiting):  # type: ignore[no-untyped-def]
    """Trace the rays in the first lanes. A lane's owner: its light, then its sample in the lowest six bits."""
    if num_waiting == 0:
        return
    enable_first_lanes(packet, num_waiting)
    trace_shadows(packet)
    for lane in range(num_waiting):
        if is_unoccluded(packet, lane):
            owner = packet.owner[lane]
            block.visibility_bits[owner >> _BLOCK_BITS] |= np.uint64(1) << np.uint64(owner & (BLOCK - 1))


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _trace(packet, block, origins, directions, lights, samples):  # type: ignore[no-untyped-def]
    """Trace lights against masks of samples, only those above the horizon and not yet traced; counts the rays."""
    facing, traced = block.facing_bits, block.traced_bits
    num_rays, lane = 0, _ZERO
    for entry in range(lights.shape[0]):
        light = lights[entry]
        pending = samples[entry] & facing[light] & ~traced[light]
        traced[light] |= pending
        x, y, z = directions[light, 0], directions[light, 1], directions[light, 2]
        while pending:
            k = trailing_zeros(pending)  # type: ignore[call-arg, var-annotated]
            pending &= pending - np.uint64(1)
            packet.owner[lane] = light << _BLOCK_BITS | k
            set_origin(packet, lane, origins[k, 0], origins[k, 1], origins[k, 2])
            enable_stochastic_alpha(packet, lane, block.alpha_sample[k])
            set_direction(packet, lane, x, y, z, FAR)
            num_rays += 1
            lane += 1
            if lane == LANES:
                _flush(packet, block, lane)
                lane = _ZERO
        if lane >= _MIN_FULL_LANES:
            _flush(packet, block, lane)
            lane = _ZERO
    _flush(packet, block, lane)
    return num_rays


@nb.njit(nogil=True, cache=True)
def _find_facing(normals, directions, block):  # type: ignore[no-untyped-def]
    """Find the lights above each sample's horizon. Returns the number of pairs."""
    by_axis = np.zeros((3, BLOCK), np.float32)  # missing samples face no light
    for k in range(normals.shape[0]):
        by_axis[0, k], by_axis[1, k], by_axis[2, k] = normals[k, 0], normals[k, 1], normals[k, 2]
    nx, ny, nz = by_axis[0], by_axis[1], by_axis[2]
    is_above = np.empty(BLOCK, np.uint8)
    bytes_as_words = is_above.view(np.uint64)
    count = np.uint64(0)
    for light in range(directions.shape[0]):
        x, y, z = directions[light, 0], directions[light, 1], directions[light, 2]
        for k in range(BLOCK):
            is_above[k] = nx[k] * x + ny[k] * y + nz[k] * z > 0
        facing, in_bytes = np.uint64(0), np.uint64(0)
        for byte in range(BLOCK // 8):
            in_bytes += bytes_as_words[byte]
            facing |= (bytes_as_words[byte] * _GATHER_BITS >> np.uint64(56)) << np.uint64(8 * byte)
        count += in_bytes * _SUM_BYTES >> np.uint64(56)
        block.facing_bits[light] = facing
        block.traced_bits[light] = block.visibility_bits[light] = 0
    return np.int64(count)


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _farthest(origins, start, stop, x, y, z):  # type: ignore[no-untyped-def]
    """Find the sample of [start, stop) that is farthest from a point."""
    max_squared, farthest = np.float32(-1), start
    for k in range(start, stop):
        squared = (origins[k, 0] - x) ** 2 + (origins[k, 1] - y) ** 2 + (origins[k, 2] - z) ** 2
        if squared > max_squared:
            max_squared, farthest = squared, k
    return farthest


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _center(origins, start, stop):  # type: ignore[no-untyped-def]
    """Average the positions [start, stop)."""
    x, y, z = np.float32(0), np.float32(0), np.float32(0)
    for k in range(start, stop):
        x += origins[k, 0]
        y += origins[k, 1]
        z += origins[k, 2]
    inverse_count = np.float32(1) / np.float32(stop - start)
    return x * inverse_count, y * inverse_count, z * inverse_count


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _far_samples(origins, start, stop):  # type: ignore[no-untyped-def]
    """Choose two samples of [start, stop) far apart, as a mask."""
    x, y, z = _center(origins, start, stop)
    first = _farthest(origins, start, stop, x, y, z)
    second = _farthest(origins, start, stop, origins[first, 0], origins[first, 1], origins[first, 2])
    return np.uint64(1) << np.uint64(first) | np.uint64(1) << np.uint64(second)


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _mask(start, stop):  # type: ignore[no-untyped-def]
    """Set bits [start, stop) of a word."""
    mask = np.uint64(0)
    for k in range(start, stop):
        mask |= np.uint64(1) << np.uint64(k)
    return mask


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _predict(facing_bits, traced_bits, visible_bits):  # type: ignore[no-untyped-def]
    """Predict the visibility on which all traced samples of a region agree."""
    traced = facing_bits & traced_bits
    if not facing_bits:
        return _BELOW
    if not traced or (visible_bits & traced and ~visible_bits & traced):
        return _UNKNOWN
    return _LIT if visible_bits & traced else _HIDDEN


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _is_contradicted(traced_bits, visible_bits, prediction):  # type: ignore[no-untyped-def]
    """True if a traced sample contradicts the prediction."""
    return (prediction == _LIT and ~visible_bits & traced_bits != 0) or (
        prediction == _HIDDEN and visible_bits & traced_bits != 0
    )


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _init_level(block, region, previous_level, level):  # type: ignore[no-untyped-def]
    """Copy the predictions of the previous level, and queue its doubtful lights. Returns the length of the queue."""
    queue_length = 0
    for light in range(level.prediction.shape[0]):
        is_below = block.facing_bits[light] & region == 0
        level.prediction[light] = _BELOW if is_below else previous_level.prediction[light]
        level.is_queued[light] = previous_level.is_doubtful[light] and not is_below
        if level.is_queued[light]:
            level.queue[queue_length] = light
            queue_length += 1
    return queue_length


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _update_predictions(block, region, lights, previous_level, level, start, stop):  # type: ignore[no-untyped-def]
    """Update predictions of queue entries [start, stop); append the neighbors of wrong predictions to the queue."""
    first, index = lights
    queue_length = stop
    for entry in range(start, stop):
        light = level.queue[entry]
        facing_bits, traced_bits, visible_bits = (
            block.facing_bits[light] & region,
            block.traced_bits[light],
            block.visibility_bits[light],
        )
        level.prediction[light] = _predict(facing_bits, traced_bits, visible_bits)
        if _is_contradicted(facing_bits & traced_bits, visible_bits, previous_level.prediction[light]):
            for j in range(first[light], first[light + 1]):
                neighbor = index[j]
                if not level.is_queued[neighbor] and level.prediction[neighbor] != _BELOW:
                    level.is_queued[neighbor] = True
                    level.queue[queue_length] = neighbor
                    queue_length += 1
    return queue_length


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _flood(packet, block, positions, lights, region, samples, previous_level, level):  # type: ignore[no-untyped-def]
    """Trace `samples` against lights that `previous_level` doubts, then against neighbors of wrong predictions.

    Returns the number of rays; `level.prediction` then holds the predictions for the region.
    """
    origins, (directions, first, index, _) = positions, lights
    level.samples[:] = samples
    start, stop, num_rays = _ZERO, _init_level(block, region, previous_level, level), 0
    while start < stop:
        queued_lights, masks = level.queue[start:stop], level.samples[start:stop]
        num_rays += _trace(packet, block, origins, directions, queued_lights, masks)
        start, stop = stop, _update_predictions(block, region, (first, index), previous_level, level, start, stop)
    return num_rays


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _mark_doubtful(level, lights):  # type: ignore[no-untyped-def]
    """Mark traced lights that are unknown, strong, or predicted differently from an adjacent light."""
    _, first, index, strong = lights
    for light in range(level.prediction.shape[0]):
        prediction = level.prediction[light]
        level.is_doubtful[light] = False
        if level.is_queued[light] and prediction != _BELOW:
            is_doubtful = prediction == _UNKNOWN or strong[light]
            for j in range(first[light], first[light + 1]):
                neighbor_prediction = level.prediction[index[j]]
                is_doubtful |= neighbor_prediction != _BELOW and neighbor_prediction != prediction
            level.is_doubtful[light] = is_doubtful


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _check_predictions(packet, block, positions, lights, region, start, salt, level):  # type: ignore[no-untyped-def]
    """Trace a few predicted samples; lights with errors become doubtful. Returns the numbers of rays and errors."""
    origins, (directions, _, _, _) = positions, lights
    queue_length, num_wrong = 0, 0
    for light in range(directions.shape[0]):
        level.is_doubtful[light] = False
        sample_offset = ((light + salt) * _HASH & 0xFFFFFFFF) * _CHECK_EVERY >> 32
        if sample_offset < _QUARTER and level.prediction[light] in (_LIT, _HIDDEN):
            sample = (
                np.uint64(1) << np.uint64(start + sample_offset)
                & region
                & block.facing_bits[light]
                & ~block.traced_bits[light]
            )
            if sample:
                level.queue[queue_length], level.samples[queue_length] = light, sample
                queue_length += 1
    num_rays = _trace(packet, block, origins, directions, level.queue[:queue_length], level.samples[:queue_length])
    for entry in range(queue_length):
        light = level.queue[entry]
        level.is_doubtful[light] = _is_contradicted(
            level.samples[entry], block.visibility_bits[light], level.prediction[light]
        )
        num_wrong += level.is_doubtful[light]
    return num_rays, num_wrong


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _accept_predictions(block, region, level):  # type: ignore[no-untyped-def]
    """Set the visibility bits of untraced samples to the predictions."""
    for light in range(level.prediction.shape[0]):
        if level.prediction[light] == _LIT:
            block.visibility_bits[light] |= block.facing_bits[light] & ~block.traced_bits[light] & region


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _trace_quarter(packets, block, positions, lights, span, salt, levels, counts):  # type: ignore[no-untyped-def]
    """Trace samples `span` of a block: two of them, then all of them for doubtful lights; then check."""
    (packet, coherent_packet), (block_level, quarter_level, sample_level) = packets, levels
    start, stop = span
    region = _mask(start, stop)
    far_samples = _far_samples(positions, start, stop)
    counts[0] += _flood(packet, block, positions, lights, region, far_samples, block_level, quarter_level)
    _mark_doubtful(quarter_level, lights)
    counts[0] += _flood(coherent_packet, block, positions, lights, region, region, quarter_level, sample_level)
    num_checked, num_wrong = _check_predictions(packet, block, positions, lights, region, start, salt, sample_level)
    counts[0] += num_checked
    counts[2] += num_checked
    counts[3] += num_wrong
    if num_wrong:
        counts[0] += _flood(coherent_packet, block, positions, lights, region, region, sample_level, quarter_level)
        _accept_predictions(block, region, quarter_level)
    else:
        _accept_predictions(block, region, sample_level)


@nb.njit(nogil=True, cache=True)
def trace_blocks(tracers, origins, normals, alpha_sample, lights, start, stop, bits, counts):  # type: ignore[no-untyped-def]
    """Trace and predict samples [start, stop) block by block; `start` is a multiple of `BLOCK`.

    Args:
        tracers: `PacketTracer` for mixed rays, and for rays from all samples of a quarter to one light.
        origins: off the surface. normals: shading normals. (n, 3) float32
        alpha_sample: for the rays of each sample, or for all, at blended surfaces. (n,) or (1,) float32
        lights: directions, the two arrays of `relume.lights.neighbors`, and the strong lights, which are always traced.
        start, stop: the samples. bits: output, light m at bit m & 7 of byte m >> 3. (n, bytes) uint8
        counts: traced rays, rays of a full trace, checked predictions, wrong predictions: added to. (4,)
    """
    directions = lights[0]
    n = directions.shape[0]
    packet, coherent_packet = new_packet(tracers[0]), new_packet(tracers[1])
    facing_bits, traced_bits, visible_bits = np.zeros(n, np.uint64), np.zeros(n, np.uint64), np.zeros(n, np.uint64)
    block = _Block(facing_bits, traced_bits, visible_bits, np.full(BLOCK, alpha_sample[0]))
    initial_level, block_level = _new_level(n), _new_level(n)
    levels = (block_level, _new_level(n), _new_level(n))
    initial_level.is_doubtful[:] = True
    for block_start in range(start, stop, BLOCK):
        block_stop = min(block_start + BLOCK, stop)
        positions, width = origins[block_start:block_stop], block_stop - block_start
        if alpha_sample.shape[0] > 1:
            block.alpha_sample[:width] = alpha_sample[block_start:block_stop]
        counts[1] += _find_facing(normals[block_start:block_stop], directions, block)
        region, far_samples = _mask(_ZERO, width), _far_samples(positions, _ZERO, width)
        counts[0] += _flood(packet, block, positions, lights, region, far_samples, initial_level, block_level)
        _mark_doubtful(block_level, lights)
        for quarter_start in range(0, width, _QUARTER):
            span, salt = (quarter_start, min(quarter_start + _QUARTER, width)), block_start + quarter_start
            _trace_quarter((packet, coherent_packet), block, positions, lights, span, salt, levels, counts)
        words_to_rows(block.visibility_bits, bits[block_start:block_stop])
