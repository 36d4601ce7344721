"""Pictures summed from subdivided triangles, for tests that compare update strategies to the last digits.

The product shades with prefiltered tables (`relume.transport.shading.shader`), which agree with operators to 0.1 %:
`tests/transport` and the contract check that. It would hide an omitted coefficient.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import relume.operators.shade
from relume.live.fixed_camera.strategies import incremental_light, shading
from relume.transport.projector import Projector


def shade_by_subdivision(term, contraction, lights, receivers, base_radiance=None):
    """Shade with a `Projector`, equally fine for any other light."""
    return Projector(term, contraction, lights, receivers)


@pytest.fixture(scope="module", autouse=True)
def shade_with_projector() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        for module in (relume.operators.shade, shading, incremental_light):
            patch.setattr(module, "Shader", shade_by_subdivision)
        yield
