"""How the out-factors of a texel are kept in few numbers, and how light vectors lie beside them.

    p_kc = Σ_m C_cm a_mk

Channels of one material go nearly together: along the first of three axes of colours, C, all functions count; along the
second those up to degree 2, along the third up to degree 1. That is 24 numbers in place of 45.

Light vectors lie in lanes, so that turning them is the same for eight at once: a function's cosine part in lane i, its
sine part in lane i + 8.
"""

from __future__ import annotations

import numpy as np

from relume.math.zernike import num_functions

DEGREE = 4  # of the in-basis, as of harmonics in the paper: a BTF tells no light apart that is much narrower
NUM_FUNCTIONS = num_functions(DEGREE)
WIDTH = 16  # F: lanes of a channel
HALF = WIDTH // 2
PAIRS = 3 * HALF  # of lanes that turn together, of all channels
HAS_ORDER = (np.tile([1, 2, 0, 0, 1, 3, 2, 4], 3) == np.arange(DEGREE + 1)[:, None]).astype(np.float32)
"""Whether m, up to 4, is the order of pairs of lanes. (5, 24) float32"""
FUNCTIONS = np.array([1, 4, 0, 3, 6, 8, 11, 13, 2, 5, 10, -1, 7, 9, 12, 14])
"""Which function of the in-basis each lane has; the two that no order turns share a pair, one lane has none. (F,)"""
EMPTY_LANE = int(np.flatnonzero(FUNCTIONS < 0)[0])

NUM_COEFFICIENTS = 24  # of a texel, from each side
COEFFICIENT_LANE = np.array([*range(EMPTY_LANE), 2, *range(EMPTY_LANE + 1, WIDTH), 0, 1, 2, 3, 8, 9, 0, 8])
"""Lane that each number counts for. (24,)"""
COEFFICIENT_AXIS = np.array([*[0] * EMPTY_LANE, 2, *[0] * (WIDTH - EMPTY_LANE - 1), *[1] * 6, *[2] * 2])
"""Axis of colours that it counts along. (24,)"""
