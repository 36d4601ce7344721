"""The table of strategies: the scheduler takes the first one that is ready."""

from __future__ import annotations

from relume.live.fixed_camera.strategies.cached_image import CACHED_IMAGE
from relume.live.fixed_camera.strategies.earlier_reflectances import EARLIER_REFLECTANCES
from relume.live.fixed_camera.strategies.incremental_light import INCREMENTAL_LIGHT
from relume.live.fixed_camera.strategies.linear_mix import LINEAR_MIX
from relume.live.fixed_camera.strategies.operator import OPERATOR
from relume.live.fixed_camera.strategies.shade import SHADE
from relume.live.fixed_camera.strategies.sparse_preview import SPARSE_PREVIEW
from relume.live.fixed_camera.strategies.strategy import Strategy
from relume.live.fixed_camera.strategies.texel_sum import TEXEL_SUM

STRATEGIES: tuple[Strategy, ...] = (
    CACHED_IMAGE,
    LINEAR_MIX,
    TEXEL_SUM,
    OPERATOR,
    INCREMENTAL_LIGHT,
    EARLIER_REFLECTANCES,
    SPARSE_PREVIEW,
    SHADE,
)
"""Updates of the displayed image by fidelity, highest first, then by the cost of a frame; shading last.

Of jobs with equal urgency, that of the earlier row runs first.
"""
