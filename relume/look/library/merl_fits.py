"""Convert published fits of MERL materials to terms: `python -m relume.look.library.merl_fits FITS.json`.

FITS.json has the tables of Ngan 2005 and Low 2012, {table: {material: {"Lambertian": {...}, model: {...}}}}. The output
file holds the numbers that `relume.look.library.materials` turns into terms. Diffuse is albedo/π in both papers. Ngan's
colors need MERL's channel scale. Normalization of each highlight, with the same D, F, G as ours:
    NganCookTorrance      albedo · D F G/(π² cos θi cos θo), F by Schlick from f0: 4/π times ours
    LowCookTorrance       albedo · D F G/(π cos θi cos θo), F exact: 4 times ours
    NganAshikhminShirley  nu = nv = sharpness: ours
    NganBlinnPhong        sharpness is that of the half vector: ours
    NganLafortune         Cx = Cy = Cxy, divided by the larger of |Cxy|, |Cz|: ours
    NganWard, NganWardDuer  ours
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from relume.brdf.evaluate import eval_brdf
from relume.brdf.fresnel import fresnel, schlick
from relume.brdf.registry import TERMS
from relume.core.color import srgb_encode
from relume.look.library.materials import DATA, make_preset_terms
from relume.math.polar import polar

Fit = Mapping[str, Any]
Params = dict[str, float]

MERL_CHANNEL_SCALE = (1.0, 1.15, 1.66)
_MAX_INDEX = 10.0  # allowed η and k of `cook_torrance`
_MAX_F0 = 0.96  # F at normal incidence for η = 1 and k slightly below the limit
_DIGITS = 5

GROUPS = {
    "paint": ("paint",),
    "fabric": ("fabric", "felt"),
    "rubber": ("rubber", "latex", "bball", "foam"),
    "plastic": ("acrylic", "plastic", "phenolic", "delrin", "nylon", "polyethylene", "pvc", "teflon"),
    "wood": ("cherry", "maple", "fruitwood", "pine", "natural-209", "oak", "walnut"),
    "stone": ("alumina", "aventurnine", "obsidian", "hematite", "jasper", "silicon", "marble"),
}


def fit_conductor(f0: float) -> tuple[float, float, float]:
    """Fit a conductor to a Schlick curve: gain · F(η, k) is f0 at normal incidence and close to Schlick's F up to 80°.

    The exact curve of a strong dielectric dips before it rises and Schlick's does not, so a conductor fits better. The
    gain makes up for an f0 that no conductor with k ≤ 10 has.

    Returns:
        η, k, gain
    """
    clamped_f0 = min(f0, _MAX_F0)
    root = math.sqrt(clamped_f0)
    dielectric = (1.0 + root) / (1.0 - root)
    cosine = np.cos(np.radians(np.arange(0.0, 81.0, 4.0)))
    best = (math.inf, 1.0, 0.0)
    for ior in np.linspace(1.0, min(dielectric, _MAX_INDEX), 200):
        extinction = math.sqrt(max(clamped_f0 * (ior + 1.0) ** 2 - (ior - 1.0) ** 2, 0.0) / (1.0 - clamped_f0))
        if extinction <= _MAX_INDEX:
            error = float(np.abs(fresnel(cosine, ior, extinction) - schlick(cosine, clamped_f0)).max())
            best = min(best, (error, float(ior), extinction))
    return best[1], best[2], f0 / clamped_f0


def _ngan_cook_torrance(fit: Fit) -> tuple[float, Params]:
    ior, extinction, gain = fit_conductor(fit["eta"])
    return 4.0 / math.pi * gain, {"sigma": fit["roughness"], "ior": ior, "extinction": extinction}


def _low_cook_torrance(fit: Fit) -> tuple[float, Params]:
    return 4.0, {"sigma": fit["roughness"], "ior": fit["eta"], "extinction": 0.0}


def _ashikhmin_shirley(fit: Fit) -> tuple[float, Params]:
    return 1.0, {"nu": fit["sharpness"], "nv": fit["sharpness"], "f0": fit["fresnelReflectance"]}


def _blinn_phong(fit: Fit) -> tuple[float, Params]:
    return 1.0, {"exponent": fit["sharpness"]}


def _lafortune(fit: Fit) -> tuple[float, Params]:
    return 1.0, {"exponent": fit["sharpness"], "c_x": fit["Cxy"], "c_y": fit["Cxy"], "c_z": fit["Cz"]}


def _ward(fit: Fit) -> tuple[float, Params]:
    return 1.0, {"alpha": fit["roughness"]}


# table -> our model, and the conversion of a fit to a color factor and parameters
CONVERSIONS: dict[str, tuple[str, Callable[[Fit], tuple[float, Params]]]] = {
    "low_cooktorrance_E2": ("cook_torrance", _low_cook_torrance),
    "ngan_cooktorrance": ("cook_torrance", _ngan_cook_torrance),
    "ngan_ashikhminshirley": ("ashikhmin_shirley", _ashikhmin_shirley),
    "ngan_blinnphong": ("blinn_phong", _blinn_phong),
    "ngan_lafortune": ("lafortune", _lafortune),
    "ngan_ward": ("ward", _ward),
    "ngan_wardduer": ("ward_duer", _ward),
}


def convert_row(table: str, fit: Mapping[str, Fit]) -> list[float] | None:
    """Convert one material to numbers: diffuse RGB, highlight RGB, parameters in the order of the term's declaration.

    Returns:
        None if a parameter is outside the term's range.
    """
    model, convert = CONVERSIONS[table]
    diffuse, highlight = (np.array(lobe["albedo"]) for lobe in fit.values())
    scale = np.array(MERL_CHANNEL_SCALE if table.startswith("ngan") else (1.0, 1.0, 1.0))
    factor, params = convert(list(fit.values())[1])
    parameters = TERMS[model].parameters
    rounded_params = [float(f"{params[p.name]:.{_DIGITS}g}") for p in parameters]
    if any(not p.minimum <= value <= p.maximum for p, value in zip(parameters, rounded_params, strict=True)):
        return None
    colors = [*(diffuse * scale), *(highlight * scale * factor)]
    return [float(f"{value:.{_DIGITS}g}") for value in colors] + rounded_params


def material_group(material: str) -> str:
    """Group of a material by its name: a key of `GROUPS`, or metal."""
    return next(
        (group for group, keywords in GROUPS.items() if any(keyword in material for keyword in keywords)), "metal"
    )


def compute_swatch(terms: list[dict[str, Any]]) -> str:
    """Color under uniform light, viewed at 45 degrees, as "#rrggbb"."""
    edges = np.concatenate([[0.0], np.geomspace(1e-3, np.pi / 2, 120)])
    theta, phi = np.meshgrid(0.5 * (edges[1:] + edges[:-1]), (np.arange(48) + 0.5) * (np.pi / 24), indexing="ij")
    half = polar(theta, phi)
    wo = np.array([math.sqrt(0.5), 0.0, math.sqrt(0.5)])
    cosine = half @ wo
    wi = 2.0 * cosine[..., None] * half - wo
    # dωi = 4 (wo·h) dωh: uniform steps of the half vector follow the highlight
    weight = 4.0 * np.maximum(cosine, 0.0) * np.maximum(wi[..., 2], 0.0) * np.sin(theta) * np.diff(edges)[:, None]
    weight *= np.pi / 24
    albedo = sum(np.einsum("tp,tpc->c", weight, eval_brdf(term, wi, wo)) for term in terms)
    display = srgb_encode(np.clip(albedo, 0.0, 1.0).astype(np.float32))
    return "#" + "".join(f"{round(255 * float(value)):02x}" for value in display)


def convert_all(fits: Mapping[str, Mapping[str, Mapping[str, Fit]]]) -> dict[str, Any]:
    """Return the content of the data file."""
    tables: dict[str, Any] = {}
    materials: dict[str, Any] = {}
    for table, (model, _) in CONVERSIONS.items():
        rows = {name: numbers for name, fit in fits[table].items() if (numbers := convert_row(table, fit)) is not None}
        tables[table] = {"model": model, "materials": dict(sorted(rows.items()))}
        for name, numbers in rows.items():
            if name not in materials:
                materials[name] = {
                    "group": material_group(name),
                    "swatch": compute_swatch(make_preset_terms(model, numbers)),
                }
    return {"materials": dict(sorted(materials.items())), "tables": tables}


def main() -> int:
    """Convert the tables named on the command line."""
    data = convert_all(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")))
    # one line per material, for readable diffs
    text = json.dumps(data, separators=(",", ":")).replace('],"', '],\n"').replace('},"', '},\n"')
    DATA.write_text(text + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
