"""Looks after a match, and how far an image is from another."""

from __future__ import annotations

import jsonpatch
import numpy as np

from relume.look import Look


def matched(look, result):
    """The look after the operations of a match."""
    return Look.model_validate(jsonpatch.apply_patch(look.model_dump(mode="json"), result.operations))


def relative_error(image, reference):
    return np.linalg.norm(image - reference) / np.linalg.norm(reference)
