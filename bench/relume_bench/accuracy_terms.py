"""accuracy.TERM: as `relume_bench.accuracy`, for all other terms, at moderate sharpness; a tenth of the view samples.

Brute force over half a million texels takes minutes per term; the standard error tells the uncertainty of 200 samples.
"""

from __future__ import annotations

from typing import Any

from relume_bench.accuracy import Case, compare
from relume_bench.figure import Figure
from relume_bench.scenes import environments

_PARAMS: dict[str, tuple[dict[str, Any], str]] = {
    "oren_nayar": ({"sigma": 0.5}, "theta_i"),
    "phong": ({"exponent": 20.0}, "theta_r"),
    "blinn_phong": ({"exponent": 50.0}, "theta_h"),
    "lafortune": ({"exponent": 20.0, "c_x": -0.9, "c_y": -0.6}, "lobe"),
    "ward": ({"alpha": 0.2}, "theta_h"),
    "ward_duer": ({"alpha": 0.2}, "theta_h"),
    "ward_anisotropic": ({"alpha_x": 0.15, "alpha_y": 0.4}, "tilt_x"),
    "ashikhmin_shirley": ({"nu": 20.0, "nv": 100.0}, "alpha"),
    "cook_torrance": ({"sigma": 0.2}, "theta_h"),
    "schlick": ({"roughness": 0.05}, "theta_h"),
    "beard_maxwell": ({"sigma": 0.2}, "theta_h"),
    "ggx": ({"roughness": 0.45}, "theta_h"),
}
CASES: tuple[Case, ...] = tuple(
    (f"accuracy.{model}", {"model": model, "params": params}, curve) for model, (params, curve) in _PARAMS.items()
)


def measure(tiny: bool) -> list[Figure]:
    """Measure every term except `lambert`, which has a figure with a target."""
    return compare(CASES, 20 if tiny else 200, tiny, environments())
