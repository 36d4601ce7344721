"""Packing of a texel's outgoing coefficients, and the lane layout of incident coefficients.

    p_kc = Σ_m C_cm a_mk

Channels of one material are correlated: along the first of three color axes, C, all functions are stored; along the
second those up to degree 2, along the third up to degree 1: 24 numbers instead of 45.

Incident coefficients are stored in lanes, so that a rotation handles eight at once: the cosine part of a function in
lane i, its sine part in lane i + 8.
"""

from __future__ import annotations

import numpy as np

from relume.math.zernike import num_functions

DEGREE = 4  # of the basis, like the harmonics in the paper: a BTF does not resolve much narrower light
NUM_FUNCTIONS = num_functions(DEGREE)
WIDTH = 16  # F: lanes of a channel
HALF = WIDTH // 2
PAIRS = 3 * HALF  # of lanes that rotate together, of all channels
HAS_ORDER = (np.tile([1, 2, 0, 0, 1, 3, 2, 4], 3) == np.arange(DEGREE + 1)[:, None]).astype(np.float32)
"""1 if m, up to 4, is the order of a pair of lanes. (5, 24) float32"""
FUNCTIONS = np.array([1, 4, 0, 3, 6, 8, 11, 13, 2, 5, 10, -1, 7, 9, 12, 14])
"""Basis function of each lane; the two of order 0 without rotation share a pair, one lane is empty. (F,)"""
EMPTY_LANE = int(np.flatnonzero(FUNCTIONS < 0)[0])

NUM_COEFFICIENTS = 24  # of a texel, per view direction
COEFFICIENT_LANE = np.array([*range(EMPTY_LANE), 2, *range(EMPTY_LANE + 1, WIDTH), 0, 1, 2, 3, 8, 9, 0, 8])
"""Lane of each coefficient. (24,)"""
COEFFICIENT_AXIS = np.array([*[0] * EMPTY_LANE, 2, *[0] * (WIDTH - EMPTY_LANE - 1), *[1] * 6, *[2] * 2])
"""Color axis of each coefficient. (24,)"""
