"""Pictures summed from the leaves of operators: for tests that follow a picture through its routes to the last digits.

The product shades by boxes (`relume.transport.shading.shader`), which agree with operators to a thousandth:
`tests/transport` holds them to that, and so does the contract. That would hide a coefficient forgotten on the way.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import relume.operators.shade
from relume.transport.projector import Projector


def shade_by_subdivision(term, contraction, lights, receivers, base_radiance=None):
    """As fine beside any other light."""
    return Projector(term, contraction, lights, receivers)


@pytest.fixture(scope="module", autouse=True)
def shade_with_projector() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(relume.operators.shade, "Shader", shade_by_subdivision)
        yield
