"""measured_btf: a bidirectional texture function, each texel with a BRDF of its own (Müller 2004).

As a BRDF it is the mean of its texels: so it is where no texel can be told, in light that it sends to other surfaces.
Where a surface is seen, `relume.transport.btf_kernel` finds each texel's own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, NoReturn

import numpy as np

from relume.assets.btf.btf_store import STORE, load_btf
from relume.assets.btf.compress import MAX_COMPONENTS
from relume.assets.btf.local_pca_btf import F32, LocalPcaBtf
from relume.assets.btf.mean_brdf import mean_brdf
from relume.brdf.term import Parameter, Term
from relume.core.cache import asset_cached
from relume.core.errors import ParameterError


@dataclass(frozen=True, eq=False)
class BtfRef:
    """How a surface is covered with a BTF.

    Attributes:
        data: the name of the BTF. components: that are used. btf: with these alone.
        scale: how often it repeats along a unit of texture coordinates. rotation: counter-clockwise, radians.
    """

    data: str
    components: int
    btf: LocalPcaBtf
    scale: float
    rotation: float

    @property
    def tables(self) -> F32:
        """Of the BTF, see `LocalPcaBtf.tables`; made where they are asked for first, which takes a while."""
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
        Parameter("scale", "Repeats", 0.1, 200.0, 1.0, "", "log", "How often it repeats along the texture's side."),
        Parameter("rotation", "Rotation", -180.0, 180.0, 0.0, "°", "linear", "Turns the texture on the surface."),
        Parameter(
            "components",
            "Quality",
            0,
            MAX_COMPONENTS,
            MAX_COMPONENTS,
            "",
            "linear",
            "Components that are summed for each texel: fewer are quicker, and nearer to the mean.",
            step=1.0,
        ),
    ),
    curves=(),
    quotient=_without_data,
    source="Müller 2004: B_v ≈ M_v + Σ α_v E_v",
    texture="diffuse",
    help="A texture that looks different from every side and in every light: cloth, pebbles, leather.",
    fixed=("scale", "rotation", "components"),
    normalize=_normalize,
    num_channels=3,
    data=STORE,
)
