"""The kernels of `relume.trace.coherent`: few samples are traced, the others predicted, errors flood.

A block is 64 view samples that follow each other. Over all lights at once, three levels do the same to a region:

    the block       two samples as far apart as they can be, against all lights
    a quarter of it two samples of its own, against the lights in doubt
    a quarter       all its samples, against the lights still in doubt

A light is in doubt in a region where the traced samples disagree, or where a light beside it is predicted otherwise.
Where a traced sample contradicts what the level above predicted, the lights beside it are traced as well, and so on.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
from numba.cpython.unsafe.numbers import trailing_zeros
from numpy.typing import NDArray

from relume.bits import WORD, into_rows
from relume.trace.packet import FAR, LANES, aim, ask_first, is_free, new_packet, set_origin, take_chance, trace_shadows
from relume.uncounted import UNCOUNTED

U64 = NDArray[np.uint64]

BLOCK = WORD
_BLOCK_BITS = 6
_QUARTER = BLOCK // 4
_ENOUGH = LANES * 3 // 4  # rays to one light from which on they do not wait for the next light's
# predictions: what a region's untraced samples are held to see of a light
_UNKNOWN, _LIT, _HIDDEN, _BELOW = 0, 1, 2, 3
# of the predicted bits, one in this many is traced all the same; a power of two from the size of a quarter up
_CHECK_EVERY = 128
# times eight bytes of one bit each: those bits in the highest byte, the first lowest; and the sum of eight bytes there
_GATHERED, _EACH_BYTE = np.uint64(0x0102040810204080), np.uint64(0x0101010101010101)
_BEGIN = np.int64(0)  # of NumPy: a kernel that is called with an int of Python is compiled anew for it
_HASH = 2_654_435_761  # Knuth's multiplicative hash: 2^32 divided by the golden ratio


class _Block(NamedTuple):
    """A block against all lights; bit k of a word is the k-th sample.

    Attributes:
        facing, known, seen: above the horizon; traced; unoccluded. (num_lights,) uint64
        chance: of the rays of each sample at surfaces that blend. (`BLOCK`,) float32
    """

    facing: U64
    known: U64
    seen: U64
    chance: NDArray[np.float32]


class _Level(NamedTuple):
    """What a level knows about its region.

    Attributes:
        prediction: of what was not traced. (num_lights,)
        queued: whether the light was traced here. doubted: whether the next level traces it. (num_lights,)
        queue, samples: lights in the order in which they are traced, and against which samples. (num_lights,)
    """

    prediction: NDArray[np.uint8]
    queued: NDArray[np.bool_]
    doubted: NDArray[np.bool_]
    queue: NDArray[np.int64]
    samples: U64


@nb.njit(nogil=True, cache=True)
def _new_level(num_lights):  # type: ignore[no-untyped-def]
    """Make room for a level that knows nothing."""
    return _Level(
        np.zeros(num_lights, np.uint8),
        np.zeros(num_lights, np.bool_),
        np.zeros(num_lights, np.bool_),
        np.zeros(num_lights, np.int64),
        np.zeros(num_lights, np.uint64),
    )


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _flush(occluded, packet, block, waiting):  # type: ignore[no-untyped-def]
    """Trace the rays of the first lanes. A lane's owner: its light, then its sample in the lowest six bits."""
    if waiting == 0:
        return
    ask_first(packet, waiting)
    trace_shadows(occluded, packet)
    for lane in range(waiting):
        if is_free(packet, lane):
            owner = packet.owner[lane]
            block.seen[owner >> _BLOCK_BITS] |= np.uint64(1) << np.uint64(owner & (BLOCK - 1))


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _trace(occluded, packet, block, origins, directions, lights, samples):  # type: ignore[no-untyped-def]
    """Trace lights against the samples of a mask each, those above the horizon and not yet traced; counts the rays."""
    facing, known = block.facing, block.known
    rays, lane = 0, _BEGIN
    for at in range(lights.shape[0]):
        light = lights[at]
        wanted = samples[at] & facing[light] & ~known[light]
        known[light] |= wanted
        x, y, z = directions[light, 0], directions[light, 1], directions[light, 2]
        while wanted:
            k = trailing_zeros(wanted)  # type: ignore[call-arg, var-annotated]
            wanted &= wanted - np.uint64(1)
            packet.owner[lane] = light << _BLOCK_BITS | k
            set_origin(packet, lane, origins[k, 0], origins[k, 1], origins[k, 2])
            take_chance(packet, lane, block.chance[k])
            aim(packet, lane, x, y, z, FAR)
            rays += 1
            lane += 1
            if lane == LANES:
                _flush(occluded, packet, block, lane)
                lane = _BEGIN
        if lane >= _ENOUGH:
            _flush(occluded, packet, block, lane)
            lane = _BEGIN
    _flush(occluded, packet, block, lane)
    return rays


@nb.njit(nogil=True, cache=True)
def _find_facing(normals, directions, block):  # type: ignore[no-untyped-def]
    """Find the lights above each sample's horizon. Returns the number of pairs."""
    by_axis = np.zeros((3, BLOCK), np.float32)  # samples that are not there face nothing
    by_axis[:, : normals.shape[0]] = normals.T
    nx, ny, nz = by_axis[0], by_axis[1], by_axis[2]
    is_above = np.empty(BLOCK, np.uint8)
    eights = is_above.view(np.uint64)
    count = np.uint64(0)
    for light in range(directions.shape[0]):
        x, y, z = directions[light, 0], directions[light, 1], directions[light, 2]
        for k in range(BLOCK):
            is_above[k] = nx[k] * x + ny[k] * y + nz[k] * z > 0
        facing, in_bytes = np.uint64(0), np.uint64(0)
        for eight in range(BLOCK // 8):
            in_bytes += eights[eight]
            facing |= (eights[eight] * _GATHERED >> np.uint64(56)) << np.uint64(8 * eight)
        count += in_bytes * _EACH_BYTE >> np.uint64(56)
        block.facing[light] = facing
        block.known[light] = block.seen[light] = 0
    return np.int64(count)


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _farthest(origins, start, stop, x, y, z):  # type: ignore[no-untyped-def]
    """Find the sample of [start, stop) that is farthest from a point."""
    best, at = np.float32(-1), start
    for k in range(start, stop):
        squared = (origins[k, 0] - x) ** 2 + (origins[k, 1] - y) ** 2 + (origins[k, 2] - z) ** 2
        if squared > best:
            best, at = squared, k
    return at


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _centre(origins, start, stop):  # type: ignore[no-untyped-def]
    """Average the positions [start, stop)."""
    x, y, z = np.float32(0), np.float32(0), np.float32(0)
    for k in range(start, stop):
        x += origins[k, 0]
        y += origins[k, 1]
        z += origins[k, 2]
    share = np.float32(1) / np.float32(stop - start)
    return x * share, y * share, z * share


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _ends(origins, start, stop):  # type: ignore[no-untyped-def]
    """Choose two samples of [start, stop) far apart, as a mask."""
    x, y, z = _centre(origins, start, stop)
    one = _farthest(origins, start, stop, x, y, z)
    other = _farthest(origins, start, stop, origins[one, 0], origins[one, 1], origins[one, 2])
    return np.uint64(1) << np.uint64(one) | np.uint64(1) << np.uint64(other)


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _mask(start, stop):  # type: ignore[no-untyped-def]
    """Set bits [start, stop) of a word."""
    mask = np.uint64(0)
    for k in range(start, stop):
        mask |= np.uint64(1) << np.uint64(k)
    return mask


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _predict(facing, known, seen):  # type: ignore[no-untyped-def]
    """Predict what the traced samples of a region agree on."""
    traced = facing & known
    if not facing:
        return _BELOW
    if not traced or (seen & traced and ~seen & traced):
        return _UNKNOWN
    return _LIT if seen & traced else _HIDDEN


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _contradicted(traced, seen, prediction):  # type: ignore[no-untyped-def]
    """Tell whether a traced sample sees what was not predicted."""
    return (prediction == _LIT and ~seen & traced != 0) or (prediction == _HIDDEN and seen & traced != 0)


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _begin(block, region, before, level):  # type: ignore[no-untyped-def]
    """Take over the predictions of the level before, and queue what it doubts. Returns the length of the queue."""
    end = 0
    for light in range(level.prediction.shape[0]):
        below = block.facing[light] & region == 0
        level.prediction[light] = _BELOW if below else before.prediction[light]
        level.queued[light] = before.doubted[light] and not below
        if level.queued[light]:
            level.queue[end] = light
            end += 1
    return end


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _judge(block, region, lights, before, level, start, stop):  # type: ignore[no-untyped-def]
    """Predict anew the lights of the queue in [start, stop); the neighbours of wrong predictions join its end."""
    first, index = lights
    end = stop
    for at in range(start, stop):
        light = level.queue[at]
        facing, known, seen = block.facing[light] & region, block.known[light], block.seen[light]
        level.prediction[light] = _predict(facing, known, seen)
        if _contradicted(facing & known, seen, before.prediction[light]):
            for j in range(first[light], first[light + 1]):
                beside = index[j]
                if not level.queued[beside] and level.prediction[beside] != _BELOW:
                    level.queued[beside] = True
                    level.queue[end] = beside
                    end += 1
    return end


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _flood(occluded, packet, block, points, lights, region, samples, before, level):  # type: ignore[no-untyped-def]
    """Trace `samples` against the lights that `before` doubts, then against the neighbours of wrong predictions.

    Returns the number of rays; `level.prediction` is what is held of the region now.
    """
    origins, (directions, first, index, _) = points, lights
    level.samples[:] = samples
    start, stop, rays = _BEGIN, _begin(block, region, before, level), 0
    while start < stop:
        lights_here, masks = level.queue[start:stop], level.samples[start:stop]
        rays += _trace(occluded, packet, block, origins, directions, lights_here, masks)
        start, stop = stop, _judge(block, region, (first, index), before, level, start, stop)
    return rays


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _doubt(level, lights):  # type: ignore[no-untyped-def]
    """Mark the lights that were traced, yet are unknown, strong, or predicted otherwise than a light beside them."""
    _, first, index, strong = lights
    for light in range(level.prediction.shape[0]):
        prediction = level.prediction[light]
        level.doubted[light] = False
        if level.queued[light] and prediction != _BELOW:
            doubted = prediction == _UNKNOWN or strong[light]
            for j in range(first[light], first[light + 1]):
                beside = level.prediction[index[j]]
                doubted |= beside != _BELOW and beside != prediction
            level.doubted[light] = doubted


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _check(occluded, packet, block, points, lights, region, start, salt, level):  # type: ignore[no-untyped-def]
    """Trace a few of the predicted samples; lights that are wrong come into doubt. Returns rays and wrong ones."""
    origins, (directions, _, _, _) = points, lights
    end, wrong = 0, 0
    for light in range(directions.shape[0]):
        level.doubted[light] = False
        number = ((light + salt) * _HASH & 0xFFFFFFFF) * _CHECK_EVERY >> 32
        if number < _QUARTER and level.prediction[light] in (_LIT, _HIDDEN):
            sample = np.uint64(1) << np.uint64(start + number) & region & block.facing[light] & ~block.known[light]
            if sample:
                level.queue[end], level.samples[end] = light, sample
                end += 1
    rays = _trace(occluded, packet, block, origins, directions, level.queue[:end], level.samples[:end])
    for at in range(end):
        light = level.queue[at]
        level.doubted[light] = _contradicted(level.samples[at], block.seen[light], level.prediction[light])
        wrong += level.doubted[light]
    return rays, wrong


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _keep(block, region, level):  # type: ignore[no-untyped-def]
    """Believe the predictions of what was not traced."""
    for light in range(level.prediction.shape[0]):
        if level.prediction[light] == _LIT:
            block.seen[light] |= block.facing[light] & ~block.known[light] & region


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _trace_quarter(occluded, packets, block, points, lights, span, salt, levels, counts):  # type: ignore[no-untyped-def]
    """Trace samples `span` of a block: two of them, then all of them where need be; then check."""
    (packet, alike), (whole, quarter, each) = packets, levels
    start, stop = span
    region = _mask(start, stop)
    anchors = _ends(points, start, stop)
    counts[0] += _flood(occluded, packet, block, points, lights, region, anchors, whole, quarter)
    _doubt(quarter, lights)
    counts[0] += _flood(occluded, alike, block, points, lights, region, region, quarter, each)
    checked, wrong = _check(occluded, packet, block, points, lights, region, start, salt, each)
    counts[0] += checked
    counts[2] += checked
    counts[3] += wrong
    if wrong:
        counts[0] += _flood(occluded, alike, block, points, lights, region, region, each, quarter)
        _keep(block, region, quarter)
    else:
        _keep(block, region, each)


@nb.njit(nogil=True, cache=True)
def trace_blocks(  # type: ignore[no-untyped-def]
    occluded, scene, arguments, of_alike, origins, normals, chance, lights, start, stop, bits, counts
):
    """Trace and predict samples [start, stop) block by block; `start` is a multiple of `BLOCK`.

    Args:
        occluded: `occluded`. scene: `EmbreeScene.handle`. arguments: address of `packet_arguments`.
        of_alike: address of those of rays that go to one light from all samples of a quarter.
        origins: off the surface. normals: shading normals. (n, 3) float32
        chance: of the rays of each sample, or of all, at surfaces that blend. (n,) or (1,) float32
        lights: directions, the two arrays of `relume.light.neighbours.Neighbours`, and which are always traced.
        start, stop: the samples. bits: written, light m in bit m & 7 of byte m >> 3. (n, bytes) uint8
        counts: rays traced, rays that a full trace would take, predicted bits checked, found wrong: added to. (4,)
    """
    directions = lights[0]
    n = directions.shape[0]
    packet, alike = new_packet(scene, arguments), new_packet(scene, of_alike)
    facing, known, seen = np.zeros(n, np.uint64), np.zeros(n, np.uint64), np.zeros(n, np.uint64)
    block = _Block(facing, known, seen, np.full(BLOCK, chance[0]))
    nothing, whole = _new_level(n), _new_level(n)
    levels = (whole, _new_level(n), _new_level(n))
    nothing.doubted[:] = True
    for here in range(start, stop, BLOCK):
        there = min(here + BLOCK, stop)
        points, width = origins[here:there], there - here
        if chance.shape[0] > 1:
            block.chance[:width] = chance[here:there]
        counts[1] += _find_facing(normals[here:there], directions, block)
        region, anchors = _mask(_BEGIN, width), _ends(points, _BEGIN, width)
        counts[0] += _flood(occluded, packet, block, points, lights, region, anchors, nothing, whole)
        _doubt(whole, lights)
        for begin in range(0, width, _QUARTER):
            span, salt = (begin, min(begin + _QUARTER, width)), here + begin
            _trace_quarter(occluded, (packet, alike), block, points, lights, span, salt, levels, counts)
        into_rows(block.seen, bits[here:there])
