"""Seeds of view samples: the shifts of neighbors divide a lattice cell."""

import numpy as np

from relume.raytrace.gather_rays import cranley_patterson_offset, make_pattern
from relume.views.sample_seeds import interleaved_seeds


def test_shifts_of_neighboring_pixels_divide_a_cell():
    """The nine samples of any 3 × 3 pixels, and those of one pixel, lie in nine subcells; no two are equal."""
    width, height, pattern = 16, 12, make_pattern(8, 0, 0)
    pixel = np.arange(width * height, dtype=np.uint32)
    seed = interleaved_seeds(pixel, width, 1000)
    offsets = np.array([cranley_patterson_offset(pattern, s) for s in seed])
    subcell = ((3 * offsets).astype(int) @ [3, 1]).reshape(height, width)
    for y in range(height - 2):
        for x in range(width - 2):
            assert len(np.unique(subcell[y : y + 3, x : x + 3])) == 9
    assert len(np.unique(seed)) == len(seed)
    of_one_pixel = interleaved_seeds(np.full(9, 5, np.uint32), width, 0)
    offsets = np.array([cranley_patterson_offset(pattern, s) for s in of_one_pixel])
    assert len({tuple(subcell) for subcell in (3 * offsets).astype(int)}) == 9


def test_seeds_do_not_depend_on_where_a_task_begins():
    pixel = np.sort(np.random.default_rng(3).integers(0, 40, 200)).astype(np.uint32)
    begin = int(np.flatnonzero(np.diff(pixel))[20]) + 1
    np.testing.assert_array_equal(interleaved_seeds(pixel, 8, 0)[begin:], interleaved_seeds(pixel[begin:], 8, begin))
