"""Weights of a few bits in older stores: unpacking returns the packed values."""

import numpy as np
import pytest
from bit_packer import pack

from relume.assets.btf.bit_packing import max_code, packed_bytes, unpack


@pytest.mark.parametrize("bits", [[8], [3], [2, 3, 4, 5, 6, 7, 8], [5, 5, 4, 3, 3], [1, 6], []])
@pytest.mark.parametrize("num", [1, 37])
def test_unpacking_returns_the_packed_values(bits, num):
    widths = np.array(bits, np.uint8)
    rows = (
        np.random.default_rng(1).integers(-max_code(widths), max_code(widths) + 1, (num, len(widths))).astype(np.int8)
    )
    rows[0] = max_code(widths)
    rows[-1] = -max_code(widths)
    packed = pack(rows, widths)
    assert len(packed) == packed_bytes(num, widths) == int(np.ceil(num * sum(bits) / 8))
    np.testing.assert_array_equal(unpack(packed, widths, num), rows)
