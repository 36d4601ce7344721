"""IES files made by code."""

from __future__ import annotations

import numpy as np


def ies_text(candela, polar, azimuth=(0,), *, head="IESNA:LM-63-2002", tilt="NONE", factors=(1, 1, 1), kind=1):
    """A file with the candela of each azimuth, as rows; factors: multiplier, ballast and photometric factor."""
    candela = np.atleast_2d(candela)
    lines = [head, "[TEST] made by code", f"TILT={tilt}"]
    multiplier, ballast, photometric = factors
    lines += [f"1 1000 {multiplier} {len(polar)} {len(azimuth)} {kind} 2 0 0 0", f"{ballast} {photometric} 50"]
    lines += [" ".join(f"{value:.6g}" for value in row) for row in (polar, azimuth, *candela)]
    return "\r\n".join(lines) + "\r\n"


def cosine_web(power, polar, azimuth=(0,), scale=1000.0):
    """Candela of cos^n θ below the horizon, times 1 + cos(C) / 2."""
    cosine = np.clip(np.cos(np.radians(polar)), 0, 1) ** power
    factor = 1 if len(azimuth) == 1 else 1 + np.cos(np.radians(azimuth))[:, None] / 2
    return scale * np.atleast_2d(factor * cosine)
