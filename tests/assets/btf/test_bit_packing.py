"""Weights of a few bits: what is packed comes back, in no more bytes than it needs."""

import numpy as np
import pytest

from relume.assets.btf.bit_packing import max_code, pack, packed_bytes, unpack


@pytest.mark.parametrize("bits", [[8], [3], [2, 3, 4, 5, 6, 7, 8], [5, 5, 4, 3, 3], [1, 6], []])
@pytest.mark.parametrize("num", [1, 37])
def test_what_is_packed_comes_back(bits, num):
    of = np.array(bits, np.uint8)
    rows = np.random.default_rng(1).integers(-max_code(of), max_code(of) + 1, (num, len(of))).astype(np.int8)
    rows[0] = max_code(of)
    rows[-1] = -max_code(of)
    found = pack(rows, of)
    assert len(found) == packed_bytes(num, of) == int(np.ceil(num * sum(bits) / 8))
    np.testing.assert_array_equal(unpack(found, of, num), rows)
    for j, (begin, width) in enumerate(zip(np.cumsum([0, *bits]), bits, strict=False)):  # in plain NumPy
        plain = np.unpackbits(found)[: num * sum(bits)].reshape(num, -1)[:, begin : begin + width]
        np.testing.assert_array_equal(plain @ (1 << np.arange(width)[::-1]) - max_code(of)[j], rows[:, j])
