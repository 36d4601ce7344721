"""gather.full_rmse_SCENE and gather.full_bias_SCENE: indirect light against Mitsuba's full path tracer.

The images of `relume_bench.gather_scenes`; with Mitsuba every surface on a path has its full BSDF: its highlights light
other surfaces with their own shape, with relume by few functions (docs/indirect-light.md#bounces).
"""

from __future__ import annotations

from relume_bench.figure import Figure, skipped
from relume_bench.gather_scenes import SIZES, render_pair
from relume_bench.indirect import PASSES
from relume_bench.mitsuba import missing
from relume_bench.standard_error import compare_with_passes

_SPP = {"still_life": 128}  # per pass: separates errors of some percent from the noise, most of which is in highlights
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
