"""Pixels of a fixed view that show one material alone."""

from __future__ import annotations

import numpy as np


def shown(transfer, name):
    """Pixels whose samples are all of one material. (height, width)"""
    view = transfer.views["front"]
    pixels = np.unique(view.pixel[view.rows(transfer.material_names.index(name))])
    others = [view.pixel[view.rows(k)] for k, other in enumerate(transfer.material_names) if other != name]
    background = view.pixel[view.num_surface_samples :]
    mask = np.zeros(view.height * view.width, np.bool_)
    mask[np.setdiff1d(pixels, np.concatenate([*others, background]))] = True
    return mask.reshape(view.height, view.width)
