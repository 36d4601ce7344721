"""Pearls resting on the surfaces below: a graduated string, a heap in the bowl, and a few on the cloth."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.scene.examples.still_life.grids import GridSurface, merge_surfaces, normalize, revolve, sphere

F64 = NDArray[np.float64]
Height = Callable[[F64, F64], F64]

GAP = 2e-5  # between touching objects, so that no ray starts inside a neighbor


def contact_height(height: Height, x: float, z: float, radius: float) -> float:
    """Height of a sphere's center after it is lowered at (x, z) until it touches the ground, meters.

    Args:
        height: height of the ground at any (x, z), meters.
        x, z: coordinates of the center, meters.
        radius: radius of the sphere, meters.
    """
    r = radius * np.sqrt(np.linspace(0, 1, 24))[:, None]
    phi = np.linspace(0, 2 * np.pi, 33)[None, :-1]
    ground = height(x + r * np.cos(phi), z + r * np.sin(phi))
    return float((ground + np.sqrt(np.maximum(radius**2 - r**2, 0))).max()) + GAP


def place_along_path(
    height: Height, path: Shaped[F64, "points 2"], radii: Shaped[F64, " pearls"]
) -> Shaped[F64, "placed 3"]:
    """Centers of touching pearls on a string along a path, each resting on the ground.

    Args:
        height: height of the ground at any (x, z), meters.
        path: points in (x, z), meters.
        radii: radii of the pearls in order, meters.
    Returns:
        In meters, only for the pearls that fit on the path.
    """
    steps = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    centers: list[F64] = []
    s, step = 0.0, 2e-4
    for i, radius in enumerate(radii):
        while s <= steps[-1]:
            x, z = (float(np.interp(s, steps, path[:, k])) for k in (0, 1))
            center = np.array([x, contact_height(height, x, z, radius), z])
            s += step
            if not centers or np.linalg.norm(center - centers[-1]) >= radius + radii[i - 1] + GAP:
                centers.append(center)
                break
    return np.array(centers)


def pour_heap(
    height: Height, center: tuple[float, float], spread: float, radii: Shaped[F64, " pearls"], seed: int
) -> Shaped[F64, "pearls 3"]:
    """Centers of pearls poured into a heap: each takes the lowest free position among random candidates.

    Args:
        height: height of the ground at any (x, z), meters.
        center: center of the heap in (x, z), meters.
        spread: largest distance of candidates from the center, meters.
        radii: radii of the pearls in the order in which they fall, meters.
        seed: seed of the candidates.
    Returns:
        In meters.
    """
    rng = np.random.default_rng(seed)
    centers = np.zeros((0, 3))
    for i, radius in enumerate(radii):
        reach = spread * np.sqrt(rng.random(160))
        phi = 2 * np.pi * rng.random(160)
        spots = np.column_stack([center[0] + reach * np.cos(phi), center[1] + reach * np.sin(phi)])
        y = np.array([contact_height(height, x, z, radius) for x, z in spots])
        for neighbor, neighbor_radius in zip(centers, radii[:i], strict=True):
            touch = radius + neighbor_radius + GAP
            flat = ((spots - neighbor[[0, 2]]) ** 2).sum(1)
            y = np.maximum(y, np.where(flat < touch**2, neighbor[1] + np.sqrt(np.maximum(touch**2 - flat, 0)), -1.0))
        best = int(y.argmin())
        centers = np.concatenate([centers, [[spots[best, 0], y[best], spots[best, 1]]]])
    return centers


def pearls(centers: Shaped[F64, "pearls 3"], radii: Shaped[F64, " pearls"]) -> GridSurface:
    """Return spheres with random rotations, so that no two show the same facets."""
    rng = np.random.default_rng(7)
    spheres = []
    for center, radius in zip(centers, radii, strict=True):
        axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        spheres.append(
            sphere(radius, 11 if radius < 0.010 else 18).transform(axes * np.sign(np.linalg.det(axes)), center)
        )
    return merge_surfaces(spheres)


def bowl_profile() -> Shaped[F64, "rows 2"]:
    """(radius, height) along the bowl's section, from the inner center over the lip to the foot."""
    inside = np.array(
        [[0.0, 0.0075], [0.012, 0.0078], [0.024, 0.0115], [0.034, 0.020], [0.0405, 0.032], [0.0440, 0.0445]]
    )
    lip = np.array([[0.0447, 0.0470], [0.0460, 0.0478], [0.0472, 0.0470]])
    outside = np.array([[0.0468, 0.0440], [0.0440, 0.0310], [0.0375, 0.0170], [0.0275, 0.0080], [0.0205, 0.0058]])
    foot = np.array([[0.0188, 0.0045], [0.0186, 0.0020], [0.0178, 0.0003], [0.0165, 0.0], [0.0, 0.0]])
    corners = np.concatenate([inside, lip, outside, foot])
    return _chaikin(corners, 2)


def bowl() -> GridSurface:
    """Return a small bowl with its foot at y = 0."""
    profile = bowl_profile()
    slope = np.gradient(profile, axis=0)
    normals = normalize(np.column_stack([-slope[:, 1], slope[:, 0]]))
    return revolve(np.column_stack([profile, normals]), 56)


def bowl_height(x: Shaped[F64, "*points"], z: Shaped[F64, "*points"]) -> Shaped[F64, "*points"]:
    """Height of the bowl's upper side above its foot; -1 outside the bowl."""
    profile = bowl_profile()
    upper = profile[: int(profile[:, 0].argmax()) + 1]
    return np.interp(np.hypot(x, z), upper[:, 0], upper[:, 1], right=-1.0)


def _chaikin(points: F64, rounds: int) -> F64:
    """Chaikin's corner cutting with fixed ends."""
    for _ in range(rounds):
        cut = np.stack([0.75 * points[:-1] + 0.25 * points[1:], 0.25 * points[:-1] + 0.75 * points[1:]], 1)
        points = np.concatenate([points[:1], cut.reshape(-1, 2)[1:-1], points[-1:]])
    return points
