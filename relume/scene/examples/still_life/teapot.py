"""Martin Newell's teapot (1975): 32 bicubic Bézier patches from his control points.

Rim, body, lid and bottom are quarter turns of a profile: the four control points of a ring with radius r are
r·(1, 0), r·(1, 0.56), r·(0.56, 1), r·(0, 1). Handle and spout are two patches each and their mirror images.
Newell's axes: +Z up, spout toward +X, unit roughly two inches.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.scene.examples.still_life.grids import GridSurface, grid_faces, merge_surfaces

F64 = NDArray[np.float64]

RING = np.array([[1.0, 0.0], [1.0, 0.56], [0.56, 1.0], [0.0, 1.0]])
LID_FIT = 1.077  # the original lid is narrower than the rim by this factor and would float

# (radius, height) of the control rings, four per patch, top to bottom.
PROFILES: dict[str, tuple[tuple[tuple[float, float], ...], ...]] = {
    "rim": (((1.4, 2.4), (1.3375, 2.53125), (1.4375, 2.53125), (1.5, 2.4)),),
    "body": (
        ((1.5, 2.4), (1.75, 1.875), (2.0, 1.35), (2.0, 0.9)),
        ((2.0, 0.9), (2.0, 0.45), (1.5, 0.225), (1.5, 0.15)),
    ),
    "lid": (
        ((0.0, 3.15), (0.8, 3.15), (0.0, 2.85), (0.2, 2.7)),
        ((0.2, 2.7), (0.4, 2.55), (1.3, 2.55), (1.3, 2.4)),
    ),
    "bottom": (((1.5, 0.15), (1.5, 0.075), (1.425, 0.0), (0.0, 0.0)),),
}

# Half sections at y <= 0: rows are (y = 0, -w, -w, 0), one section per row of the tables below.
HANDLE = (
    (((-1.6, 0, 2.025), (-1.6, -0.3, 2.025), (-1.5, -0.3, 2.25), (-1.5, 0, 2.25)),
     ((-2.3, 0, 2.025), (-2.3, -0.3, 2.025), (-2.5, -0.3, 2.25), (-2.5, 0, 2.25)),
     ((-2.7, 0, 2.025), (-2.7, -0.3, 2.025), (-3.0, -0.3, 2.25), (-3.0, 0, 2.25)),
     ((-2.7, 0, 1.8), (-2.7, -0.3, 1.8), (-3.0, -0.3, 1.8), (-3.0, 0, 1.8))),
    (((-2.7, 0, 1.8), (-2.7, -0.3, 1.8), (-3.0, -0.3, 1.8), (-3.0, 0, 1.8)),
     ((-2.7, 0, 1.575), (-2.7, -0.3, 1.575), (-3.0, -0.3, 1.35), (-3.0, 0, 1.35)),
     ((-2.5, 0, 1.125), (-2.5, -0.3, 1.125), (-2.65, -0.3, 0.9375), (-2.65, 0, 0.9375)),
     ((-2.0, 0, 0.9), (-2.0, -0.3, 0.9), (-1.9, -0.3, 0.6), (-1.9, 0, 0.6))),
)  # fmt: skip
SPOUT = (
    (((1.7, 0, 1.425), (1.7, -0.66, 1.425), (1.7, -0.66, 0.6), (1.7, 0, 0.6)),
     ((2.6, 0, 1.425), (2.6, -0.66, 1.425), (3.1, -0.66, 0.825), (3.1, 0, 0.825)),
     ((2.3, 0, 2.1), (2.3, -0.25, 2.1), (2.4, -0.25, 2.025), (2.4, 0, 2.025)),
     ((2.7, 0, 2.4), (2.7, -0.25, 2.4), (3.3, -0.25, 2.4), (3.3, 0, 2.4))),
    (((2.7, 0, 2.4), (2.7, -0.25, 2.4), (3.3, -0.25, 2.4), (3.3, 0, 2.4)),
     ((2.8, 0, 2.475), (2.8, -0.25, 2.475), (3.525, -0.25, 2.49375), (3.525, 0, 2.49375)),
     ((2.9, 0, 2.475), (2.9, -0.15, 2.475), (3.45, -0.15, 2.5125), (3.45, 0, 2.5125)),
     ((2.8, 0, 2.4), (2.8, -0.15, 2.4), (3.2, -0.15, 2.4), (3.2, 0, 2.4))),
)  # fmt: skip


def patches() -> Iterator[tuple[str, Shaped[F64, "4 4 3"]]]:
    """Yield the 32 patches: name of the object part and control points, first axis downward, second around."""
    for name, profiles in PROFILES.items():
        for profile in profiles:
            control = np.array([[(r * x, r * y, z) for x, y in RING] for r, z in profile])
            if profile[1] == (0.8, 3.15):  # the knob: Newell's table has 0.45 for 0.8 × 0.56
                control[1, 1, 1] = control[1, 2, 0] = 0.45
            for quarter in range(4):
                c, s = round(np.cos(quarter * np.pi / 2)), round(np.sin(quarter * np.pi / 2))
                yield name, control @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    for name, halves in (("handle", HANDLE), ("spout", SPOUT)):
        for half in halves:
            half_patch = np.array(half, float)
            yield name, half_patch[:, ::-1]
            yield name, half_patch * (1.0, -1.0, 1.0)


def bernstein(t: Shaped[F64, " n"]) -> tuple[Shaped[F64, "n 4"], Shaped[F64, "n 4"]]:
    """Return the four cubic Bernstein polynomials and their derivatives."""
    s = 1 - t
    value = np.stack([s**3, 3 * t * s**2, 3 * t**2 * s, t**3], -1)
    slope = np.stack([-3 * s**2, 3 * s * (s - 2 * t), 3 * t * (2 * s - t), 3 * t**2], -1)
    return value, slope


def tessellate(control: Shaped[F64, "4 4 3"], num_segments: int) -> GridSurface:
    """Tessellate a patch into num_segments² cells with analytic normals and tangents along the second axis.

    Derivatives vanish where a patch degenerates to a point, so frames are evaluated slightly inside the edge.
    """
    t = np.linspace(0, 1, num_segments + 1)
    value, _ = bernstein(t)
    inner_value, inner_slope = bernstein(np.clip(t, 1e-4, 1 - 1e-4))
    positions = np.einsum("ia,jb,abk->ijk", value, value, control)
    down = np.einsum("ia,jb,abk->ijk", inner_slope, inner_value, control)
    along = np.einsum("ia,jb,abk->ijk", inner_value, inner_slope, control)
    uvs = np.stack(np.meshgrid(t, t), -1).reshape(-1, 2)
    normals = np.cross(down, along).reshape(-1, 3)
    faces = grid_faces(num_segments + 1, num_segments + 1)[:, ::-1]
    return GridSurface(positions.reshape(-1, 3), normals, along.reshape(-1, 3), uvs, faces)


def teapot(num_segments: int, height: float) -> GridSurface:
    """Return the complete teapot, +Y up, spout toward +X, standing at the origin; `height` in meters."""
    scale = height / 3.15
    surfaces = []
    for name, control in patches():
        scaled_control = control * (LID_FIT, LID_FIT, 1.0) if name == "lid" else control
        surfaces.append(tessellate(scaled_control * scale, num_segments))
    to_y_up = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    return merge_surfaces(surfaces).transform(to_y_up, (0.0, 0.0, 0.0))
