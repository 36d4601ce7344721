"""Make docs/images/factorization.png: a Phong ball with K terms of its in-out factorization, and the exact one.

Above, the optimal factors with 1, 4, 12, 36, 75 terms; below, Zernike functions, 1, 3, 10, 36, 78; exact at the right.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from relume.assets.environments.environment_names import load_environment
from relume.assets.environments.equirect import halve_to_width
from relume_bench.factorization_pictures import ball_normals, pictures

_ENVIRONMENT, _SIZE, _PIXELS, _SCALE, _EXPOSURE = "studio", 48, 64, 2, 1.0
_PATH = Path(__file__).resolve().parents[1] / "docs" / "images" / "factorization.png"


def main() -> None:
    """Render and write."""
    radiance = halve_to_width(load_environment(_ENVIRONMENT).radiance, 64)
    exact, svd, zernike = pictures(radiance, _SIZE, _PIXELS)
    white = _EXPOSURE * np.quantile(exact, 0.98)
    rows = [np.concatenate([_ball(each / white) for each in (*images, exact)], axis=1) for images in (svd, zernike)]
    Image.fromarray(np.concatenate(rows)).save(_PATH, optimize=True)


def _ball(values: np.ndarray) -> np.ndarray:
    """Return the sRGB picture of a ball."""
    x = (2 * np.arange(_PIXELS) + 1 - _PIXELS) / _PIXELS
    inside = x**2 + x[:, None] ** 2 < 0.99
    assert inside.sum() == len(ball_normals(_PIXELS)[0])
    out = np.full((_PIXELS, _PIXELS, 3), 0.05)
    out[inside] = np.clip(values, 0, 1)
    encoded = np.where(out <= 0.0031308, 12.92 * out, 1.055 * out ** (1 / 2.4) - 0.055)
    return np.kron((255 * encoded + 0.5).astype(np.uint8), np.ones((_SCALE, _SCALE, 1), np.uint8))


if __name__ == "__main__":
    main()
