"""How the still life looks before anybody edits it."""

from __future__ import annotations

from relume.scene.demo.wood import wood
from relume.scene.model import Material

BRASS_F0 = [0.91, 0.70, 0.34]


def materials() -> tuple[Material, ...]:
    """The demo's materials, in the order the meshes number them."""
    return (
        Material(
            "Teapot",
            (
                {"model": "lambert", "color": [0.240, 0.016, 0.012]},
                {
                    "model": "ashikhmin_shirley",
                    "color": [1.0, 1.0, 1.0],
                    "params": {"nu": 300.0, "nv": 1500.0, "f0": 0.07},
                },
            ),
        ),
        Material(
            "Tray",
            (
                {"model": "lambert", "color": [1.0, 1.0, 1.0], "texture": "diffuse"},
                {
                    "model": "cook_torrance",
                    "color": [0.8, 0.8, 0.8],
                    "params": {"sigma": 0.16, "ior": 1.5, "extinction": 0.0},
                },
            ),
            textures={"diffuse": wood()},
        ),
        Material(
            "Handles", ({"model": "ggx", "color": [1.0, 1.0, 1.0], "params": {"roughness": 0.36, "f0": BRASS_F0}},)
        ),
        Material(
            "Pearls",
            (
                {"model": "lambert", "color": [0.66, 0.585, 0.51]},
                {
                    "model": "cook_torrance",
                    "color": [1.0, 0.95, 0.92],
                    "params": {"sigma": 0.085, "ior": 1.68, "extinction": 0.0},
                },
            ),
        ),
        Material(
            "Bowl",
            (
                {"model": "lambert", "color": [0.21, 0.33, 0.29]},
                {"model": "ggx", "color": [1.0, 1.0, 1.0], "params": {"roughness": 0.26, "f0": 0.045}},
            ),
        ),
        Material(
            "Cloth",
            (
                {"model": "lambert", "color": [0.085, 0.130, 0.195]},
                {"model": "blinn_phong", "color": [0.030, 0.030, 0.032], "params": {"exponent": 6.0}},
            ),
        ),
        Material(
            "Table",
            (
                {"model": "lambert", "color": [0.066, 0.058, 0.051]},
                {"model": "blinn_phong", "color": [0.012, 0.012, 0.012], "params": {"exponent": 24.0}},
            ),
        ),
    )
