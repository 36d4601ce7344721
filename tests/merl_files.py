"""Measured materials made by code: our own terms at the nodes of the MERL grid."""

import numpy as np

from relume.assets.measured.merl import CHANNEL_SCALE, NOT_MEASURED, grid_directions
from relume.brdf.evaluate import eval_brdf

PLASTIC = (
    {"model": "lambert", "color": [0.5, 0.2, 0.05]},
    {"model": "cook_torrance", "color": [1.0, 0.8, 0.6], "params": {"sigma": 0.2, "ior": 1.5}},
)


def make_planes(documents=PLASTIC):
    """A sum of terms as the planes of a MERL file, -1 where a direction lies below the horizon."""
    wi, wo = grid_directions()
    above_horizon = (wi[..., 2] > 0) & (wo[..., 2] > 0)
    value = sum(eval_brdf(document, wi, wo) for document in documents)
    return np.where(above_horizon, np.moveaxis(value / CHANNEL_SCALE, -1, 0), NOT_MEASURED)
