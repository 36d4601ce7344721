"""Registry of BRDF terms. To add one, write its file in `terms` and add it here; tests/brdf then test it."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from relume.brdf.term import Curve, Term
from relume.brdf.terms.ashikhmin_shirley import ASHIKHMIN_SHIRLEY
from relume.brdf.terms.beard_maxwell import BEARD_MAXWELL
from relume.brdf.terms.blinn_phong import BLINN_PHONG
from relume.brdf.terms.btf import MEASURED_BTF
from relume.brdf.terms.cook_torrance import COOK_TORRANCE
from relume.brdf.terms.ggx import GGX
from relume.brdf.terms.ggx_multiple import GGX_MULTIPLE
from relume.brdf.terms.lafortune import LAFORTUNE
from relume.brdf.terms.lambert import LAMBERT
from relume.brdf.terms.measured import MEASURED_HD, MEASURED_HF, MEASURED_LV
from relume.brdf.terms.oren_nayar import OREN_NAYAR
from relume.brdf.terms.phong import PHONG
from relume.brdf.terms.schlick import SCHLICK
from relume.brdf.terms.sheen import SHEEN
from relume.brdf.terms.ward import WARD
from relume.brdf.terms.ward_anisotropic import WARD_ANISOTROPIC
from relume.brdf.terms.ward_duer import WARD_DUER

_ALL = (
    LAMBERT, OREN_NAYAR,
    PHONG, BLINN_PHONG, LAFORTUNE, WARD, WARD_DUER, WARD_ANISOTROPIC, ASHIKHMIN_SHIRLEY,
    COOK_TORRANCE, SCHLICK, BEARD_MAXWELL, GGX, GGX_MULTIPLE, SHEEN,
    MEASURED_LV, MEASURED_HD, MEASURED_HF, MEASURED_BTF,
)  # fmt: skip

TERMS: dict[str, Term] = {term.model: term for term in _ALL}


def _describe_curve(curve: Curve) -> dict[str, Any]:
    return {
        "name": curve.name,
        "label": curve.label,
        "angle": curve.angle.name.lower(),
        "parameters": list(curve.parameters),
        "bands": curve.num_bands,
        "view_dependent": curve.depends_on_view,
    }


def describe() -> list[dict[str, Any]]:
    """All terms as JSON for `GET /api/models`; the editor builds its sliders and curves from it."""
    return [
        {
            "model": term.model,
            "label": term.label,
            "help": term.help,
            "source": term.source,
            "texture": term.texture,
            "needs_data": term.needs_data,
            "width_parameter": None if term.width is None else term.width[0],
            "width_power": None if term.width is None else term.width[1],
            "data_prefix": None if term.data is None else term.data.prefix,
            "parameters": [
                asdict(parameter) | {"requires_new_operator": parameter.name in term.fixed}
                for parameter in term.parameters
            ],
            "curves": [_describe_curve(curve) for curve in term.curves],
        }
        for term in TERMS.values()
    ]
