"""The list of transfer methods, as far as they bake. To add one: write its module beside this one and add it here.

`relume.live.opened.openers` lists how their bakes open for pictures.
"""

from __future__ import annotations

from relume.methods.direct import DirectMethod
from relume.methods.gather import GatherMethod
from relume.methods.probes import ProbesMethod
from relume.store.bake_protocol import BakeMethod

METHODS: dict[str, BakeMethod] = {method.name: method for method in (DirectMethod(), GatherMethod(), ProbesMethod())}
