"""gather.full_rmse_SCENE and gather.full_bias_SCENE: reflected light against Mitsuba's whole path tracer.

The pictures of bench/relume_bench/gather_scenes.py, every surface on the way with its whole BSDF on Mitsuba's side:
highlights light other surfaces there by their own shape,
with us by few functions (docs/indirect-light.md#bounces).
"""

from __future__ import annotations

from relume_bench.figure import Figure, skipped
from relume_bench.gather_scenes import SIZES, render_pair
from relume_bench.indirect import PASSES
from relume_bench.mitsuba import missing
from relume_bench.standard_error import compare_with_passes

_SPP = {"still_life": 128}  # of each pass: errors of some per cent are told from the noise; its highlights have most
_OTHER_SPP = 16
_UNIT = "%"


def measure(tiny: bool) -> list[Figure]:
    """A bake and a render of each."""
    if (why := missing()) is not None:
        return skipped(tuple(f"gather.full_{kind}_{name}" for name in SIZES for kind in ("rmse", "bias")), _UNIT, why)
    return [figure for name in SIZES for figure in _figures(name, tiny)]


def _figures(name: str, tiny: bool) -> list[Figure]:
    spp = 2 if tiny else _SPP.get(name, _OTHER_SPP)
    pair = render_pair(name, spp, tiny, is_full=True)
    comparison = compare_with_passes(*pair)
    details = {
        "size": list(pair.rendered.shape[1::-1]),
        "spp": PASSES * spp,
        "noise": comparison.noise,
        "limit": comparison.limit,
    }
    return [
        Figure(f"gather.full_{kind}_{name}", 100 * estimate.value, _UNIT, details, 100 * estimate.standard_error)
        for kind, estimate in (("rmse", comparison.error), ("bias", comparison.bias))
    ]
