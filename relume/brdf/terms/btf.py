"""measured_btf: a bidirectional texture function, with a BRDF for each texel, compressed by local PCA.

As a BRDF it is the mean of its texels, which is used for indirect light. At visible surfaces,
`relume.transport.btf_kernel` evaluates the BRDF of each texel.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, NoReturn

import numpy as np

from relume.assets.btf.btf_store import STORE, load_btf
from relume.assets.btf.local_pca_btf import F32, LocalPcaBtf
from relume.assets.btf.mean_brdf import mean_brdf
from relume.assets.btf.per_view_coder import MAX_COMPONENTS
from relume.brdf.term import Parameter, Term
from relume.core.cache import asset_cached
from relume.core.errors import ParameterError


@dataclass(frozen=True, eq=False)
class BtfRef:
    """Mapping of a BTF to a surface.

    Attributes:
        data: name of the BTF. components: number of components in use. btf: the BTF with these components only.
        scale: repeats per unit of texture coordinates. rotation: counterclockwise, radians.
    """

    data: str
    components: int
    btf: LocalPcaBtf
    scale: float
    rotation: float

    @property
    def tables(self) -> F32:
        """Tables of the BTF, see `LocalPcaBtf.tables`; computed on first use, which takes a while."""
        return _tables(self.data, self.components)


def _without_data(*directions: object) -> NoReturn:
    raise ParameterError("data", None, "the data of a BTF that was imported or made")


@asset_cached("BTF")
def _with_components(data: str, components: int) -> LocalPcaBtf:
    return load_btf(data).with_components(components)


@asset_cached("BTF tables")
def _tables(data: str, components: int) -> F32:
    return _with_components(data, components).tables()


def _normalize(fixed: Mapping[str, Any]) -> dict[str, Any]:
    data, components = fixed["data"], int(fixed["components"])
    btf, rotation = _with_components(data, components), float(np.radians(fixed["rotation"]))
    return {
        "quotient": partial(mean_brdf, btf.grid, btf.average, rotation),
        "texels": BtfRef(data, components, btf, float(fixed["scale"]), rotation),
    }


MEASURED_BTF = Term(
    model="measured_btf",
    label="Measured texture (BTF)",
    parameters=(
        Parameter("scale", "Repeats", 0.1, 200.0, 1.0, "", "log", "Repeats per unit of texture coordinates."),
        Parameter("rotation", "Rotation", -180.0, 180.0, 0.0, "°", "linear", "Rotates the texture on the surface."),
        Parameter(
            "components",
            "Quality",
            0,
            MAX_COMPONENTS,
            MAX_COMPONENTS,
            "",
            "linear",
            "Components per texel: fewer are faster, and closer to the mean.",
            step=1.0,
        ),
    ),
    curves=(),
    quotient=_without_data,
    source="local PCA, of whole BRDFs (Müller 2004) or per view: B ≈ M + Σ α E",
    texture="diffuse",
    help="A texture with its own reflection per texel, by view and light direction: cloth, pebbles, leather.",
    fixed=("scale", "rotation", "components"),
    normalize=_normalize,
    num_channels=3,
    data=STORE,
)
